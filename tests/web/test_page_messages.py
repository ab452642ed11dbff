"""Messages of a job name the fields of the page's forms, and files by the names that the user knows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from stickslip.core.messages import Surface, name_option, render, shown_on
from stickslip.web.worker import outcome

FORM = "under “Columns and units”"


def done(request: dict[str, Any], project: Path) -> dict[str, Any]:
    return outcome({"project": str(project), **request}, lambda _line: None)


def test_a_log_that_cannot_be_read_names_the_form(tmp_path: Path) -> None:
    (tmp_path / "upload.csv").write_text("a--b,q rad,torque [Nm]\n" + "1,2,3\n" * 30)
    log = {"folder": str(tmp_path), "file": "upload.csv", "name": "axis--from-plc.csv", "reading": {}}
    problem = done({"task": "read", **log}, tmp_path)["done"]["problem"]
    assert "no column of times among a--b, q rad, torque [Nm]" in problem
    assert f"“time” = its column with its unit {FORM}, or give the time between rows {FORM}" in problem


def test_a_model_is_called_by_its_name(tmp_path: Path) -> None:
    model = tmp_path / "models" / "model-1" / "model.toml"
    model.parent.mkdir(parents=True)
    model.write_text('law = "coulomb"\n[parameters]\nfc = 0.3\n[axis]\ninertia = 1e-3\n')
    request = {"task": "recommend", "folder": str(model.parent), "model": str(model), "options": {}}
    said = done(request, tmp_path)["error"]
    assert said.startswith("model.toml ")
    assert str(tmp_path) not in said


def test_what_the_page_has_no_field_for_is_named_as_a_command() -> None:
    with shown_on(Surface.PAGE):
        assert (
            render(f"give {name_option('resistance', 'OHM')}")
            == "give `--resistance OHM` on the command line"
        )
