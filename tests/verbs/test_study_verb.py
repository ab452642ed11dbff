"""`ss.study` and `ss.stability`: what their commands do, from Python."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.studies.plan import load

ONE = ("low", "signed", "nominal", "PD")


def test_a_study_is_that_of_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    printed = ["study", "thesis", "--only", ",".join(ONE), "--no-report", "--json"]
    assert main([*printed, "--out", str(tmp_path / "command")]) == 0
    data = json.loads(capsys.readouterr().out)
    seen: list[tuple[int, int]] = []

    def progress(finished: int, all_of_them: int) -> None:
        seen.append((finished, all_of_them))

    found = ss.study("thesis", tmp_path / "library", only=ONE, report=False, progress=progress)
    assert seen == [(1, 1)]
    (run,) = found.runs
    assert run.key == "signed/low/nominal/PD"
    # What is no number is null in JSON.
    assert {k: None if v != v else v for k, v in run.metrics.items()} == data["runs"][0]["metrics"]
    assert f"{run.metrics['position_rms_rad']:.4g}" in repr(found)
    notebook: Any = found
    assert run.key in notebook._repr_html_()
    table = found.to_pandas()
    assert table.loc[0, "position_rms_rad"] == run.metrics["position_rms_rad"]
    assert list(table.loc[0, ["reference", "controller"]]) == ["low", "PD"]
    again = ss.study(load("thesis"), tmp_path / "library", only=("step", "signed", "nominal", "PD"))
    assert [r.key for r in again.runs] == ["signed/step/nominal/PD"]  # the folder holds both
    assert (tmp_path / "library" / "report.html").exists()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"file": "compensators"}, "run `stickslip study compensators`"),
        ({"file": "nothing"}, "unknown study 'nothing'; give the path of a TOML file, or one of thesis"),
        ({"file": "thesis", "seeds": -1}, "must be 0 or more"),
        ({"file": "thesis", "seeds": 2}, "leave out seeds"),
        ({"file": load("thesis"), "ablation": False}, "ablation cannot be given beside a study that is loaded"),
        ({"file": "thesis", "only": ("low", " ")}, "has an empty part"),
        ({"file": "thesis", "only": ("nobody",)}, "nobody"),
        ({"file": "thesis", "jobs": 0}, "jobs"),
    ],
)  # fmt: skip
def test_a_study_that_cannot_be_is_refused_in_a_line(
    given: dict[str, object], said: str, tmp_path: Path
) -> None:
    with pytest.raises(ss.InputError) as refused:
        ss.study(folder=tmp_path, **given)  # type: ignore[arg-type]
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


CONTROLLER = """
[controller]
sample_time = 0.001
[controller.loop]
law = "pd"
kp = 3.0
kd = 0.04
"""


def test_stability_is_that_of_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "pd.toml"
    file.write_text(CONTROLLER)
    assert main(["analyse", "stability", "--rig", "thesis-dry", "--controller", str(file)]) == 0
    printed = capsys.readouterr().out.strip().splitlines()
    for machine in ("thesis-dry", ss.load_machine("thesis-dry")):
        found = ss.stability(machine, file)
        assert list(found.lines()) == printed
        assert all(line in repr(found) for line in printed)
    late = ss.stability("thesis-dry", file, delay=ss.load_machine("thesis-dry").delay + 3.0)
    assert found.loops[1].delay - late.loops[1].delay == pytest.approx(3.0)


def test_a_contact_without_springs_is_said_to_be_one() -> None:
    axis = ss.RigidAxis(4e-4, ss.Model("coulomb", fc=0.2, sigma2=0.01))
    controller = ss.Controller(ss.place("PD", 4e-4, 10.0, 1.0), sample_time=1e-3)
    said = repr(ss.stability(axis, controller))
    assert "a contact without springs, which holds the axis where it sticks" in said
    assert "loss of contact stiffness" not in said
    for given, wrong in (({"amplitude": 0.0}, "amplitude = 0 rad"), ({"delay": -1.0}, "delay = -1")):
        with pytest.raises(ss.StickslipError, match=wrong):
            ss.stability(axis, controller, **given)
    with pytest.raises(ss.InputError, match="continuous time"):
        ss.stability(axis, ss.Controller(ss.place("PD", 4e-4, 10.0, 1.0)))


OBSERVER = """
[controller.observer]
law = "disturbance_observer"
inertia = 4.2757e-4
corner = 100.0
"""


def test_stability_samples_a_controller_as_its_machine_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "observed.toml"
    file.write_text(CONTROLLER + OBSERVER)
    told = ss.stability("thesis-dry", file)
    file.write_text((CONTROLLER + OBSERVER).replace("sample_time = 0.001", ""))
    assert list(ss.stability("thesis-dry", file).lines()) == list(told.lines())
    assert main(["analyse", "stability", "--rig", "thesis-dry", "--controller", str(file)]) == 0
    assert "sample time 1 ms" in capsys.readouterr().out
    placed = ss.Controller(ss.place("PD", 4.2757e-4, 10.0, 1.0))
    assert ss.stability("thesis-dry", placed).sample_time == 1e-3
