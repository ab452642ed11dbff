"""The workbench: forms from the descriptions, and exports that give the numbers that were shown."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from stickslip.core.errors import InputError
from stickslip.web.cases import descriptions, python_of, tables_of, toml_of
from support.serving import Served

FRICTION = {"law": "coulomb", "fc": 0.285, "sigma2": 0.018}
CASE: dict[str, Any] = {
    "axis": {"inertia": 4e-4}, "friction": FRICTION, "duration": 0.5,
    "reference": {"kind": "sine", "amplitude": 0.01, "frequency": 2.0},
    "controller": {"linear": "PD", "bandwidth_hz": 20.0, "damping": 1.0, "compensator": "feedforward", "gain": 0.8,
                   "sample_time": 1e-3, "encoder_counts": 65536.0},
    "believed": {"law": "coulomb", "fc": 0.25, "sigma2": 0.018},
}  # fmt: skip


def without(path: str, value: Any) -> dict[str, Any]:
    """The case with another value at a place."""
    case: dict[str, Any] = json.loads(json.dumps(CASE))
    table, _, key = path.rpartition(".")
    (case[table] if table else case)[key] = value
    return case


@pytest.mark.slow
def test_both_exports_give_the_numbers_that_were_shown(served: Served, tmp_path: Path) -> None:
    """The file of `stickslip simulate` and the Python program, to the last digit."""
    client = served.client()
    client.timeout = 420.0
    shown = client.post("/api/simulations", json=CASE).json()["metrics"]
    assert shown["position_rms_rad"] > 0.0
    for kind, name in (("toml", "case.toml"), ("python", "case.py")):
        answer = client.get(f"/api/simulations/{kind}", params={"case": json.dumps(CASE)})
        assert answer.status_code == 200
        (tmp_path / name).write_bytes(answer.content)
    command = [sys.executable, "-m", "stickslip", "simulate", "case.toml", "--json"]
    simulated = json.loads(subprocess.run(command, cwd=tmp_path, capture_output=True, check=True).stdout)
    assert {k: simulated["metrics"][k] for k in shown if shown[k] is not None} == {
        k: v for k, v in shown.items() if v is not None
    }
    printed = subprocess.run(
        [sys.executable, "case.py"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    found = {k: float(v) for k, v in (line.split() for line in printed.stdout.splitlines())}
    assert found["position_rms_rad"] == shown["position_rms_rad"]


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("friction.law", "../evil.py", "law must be one of"),
        ("friction.law", {"model": "x.toml"}, "law must be one of"),
        ("reference.kind", "x", "kind must be one of"), ("controller.linear", "x", "linear must be one of"),
        ("controller.compensator", "evil", "compensator must be one of"), ("duration", 1e9, "duration must be"),
        ("duration", "x", "must be a finite number"), ("axis", [], "axis must be a table"),
        ("friction.fc", "0.1", "must be a finite number"), ("friction.a b", 1.0, "is not the name"),
    ],
)  # fmt: skip
def test_a_case_that_is_none_is_told_so(path: str, value: Any, said: str) -> None:
    """Before it is a file; nothing in it is ever a path."""
    with pytest.raises(InputError, match=re.escape(said)):
        toml_of(without(path, value))


def test_a_parameter_out_of_bounds_is_named(served: Served) -> None:
    """By the reader of the file, and without the path of the server's own."""
    answer = served.client().post("/api/simulations", json=without("friction.fc", -1.0))
    assert answer.status_code == 422
    assert "fc" in answer.json()["error"]
    assert "/tmp" not in answer.json()["error"]


def test_every_law_and_reference_is_described() -> None:
    """With units and bounds; the example of each law is a case."""
    forms = descriptions()
    assert {"lugre", "gms", "coulomb"} <= {law["name"] for law in forms["laws"]}
    for law in forms["laws"]:
        assert all(f["unit"] and f["meaning"] for f in law["fields"])
        example = {k: list(v) if isinstance(v, tuple) else v for k, v in law["example"].items()}
        case = {**CASE, "friction": {"law": law["name"], **example}, "believed": None}
        assert tables_of(case)["friction"]["law"] == law["name"]
        compile(python_of(case), "case.py", "exec")
    json.dumps(forms, allow_nan=False)


@pytest.mark.slow
def test_a_slider_simulates_at_once(page: Any) -> None:
    """And what was kept stays beside it."""
    page.get_by_label("New project name").fill("bench")
    page.get_by_role("button", name="Create").click()
    page.get_by_role("link", name="Workbench").click()
    page.wait_for_selector("[data-ms]")
    page.get_by_role("button", name="Pin run").click()
    before = page.locator("tr", has_text="position rms (rad)").locator("td").all_inner_texts()
    assert before[0] == before[1]
    page.get_by_label("bandwidth, slider").focus()
    for _ in range(40):
        page.keyboard.press("ArrowRight")
    changed = page.locator("tr", has_text="position rms (rad)").locator("td").nth(1)
    changed.filter(has_not_text=before[1]).wait_for()
    page.get_by_role("link", name="Export as TOML").wait_for()
