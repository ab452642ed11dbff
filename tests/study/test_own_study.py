"""Studies of a user's own: a law from a file, laws like others, single runs, and runs that depend on their start."""

from __future__ import annotations

from pathlib import Path

import pytest

from stickslip.cli import _output
from stickslip.core.code_approval import allow_code
from stickslip.core.errors import CodeRefused
from stickslip.models.model import Model
from stickslip.report._view import StudyView
from stickslip.report.html import notes
from stickslip.studies import study as studies
from stickslip.studies.plan import load, load_run
from stickslip.studies.rerun import rerun

DATA = Path(__file__).parents[1] / "data"
LAW = '''
"""Viscous friction with a level of its own."""
from typing import Annotated, NamedTuple
from stickslip.core.spec import Law, Par

class Params(NamedTuple):
    """Its parameters."""
    level: Annotated[float, Par("N·m", "F_0", "level", lower=0.0)]
    slope: Annotated[float, Par("N·m·s/rad", "b", "slope", lower=0.0, default=0.01)]

def steady(v, p):
    if v > 0.0:
        return p.level + p.slope * v
    if v < 0.0:
        return p.slope * v - p.level
    return 0.0

def step(v0, v1, dt, z, p, u):
    return steady(v1, p)

def rate(v, z, p, u, dz):
    return steady(v, p)

LAW = Law(
    "mine", Params, step, title="Mine", equation="F = F_0", source=("none",), example={"level": 0.2}, rate=rate,
    steady=steady,
)
'''


def test_a_law_from_a_file_serves_as_plant_and_compensator(small: studies.Study, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(LAW)
    text = small.source.read_text()
    text = text.replace("[axis]", 'plugins = ["mine.py"]\n\n[axis]', 1)
    text += '\n[laws.mine]\nlaw = "mine"\nlevel = 0.2\n\n[controllers.FF-mine]\nlinear = "PD"\n'
    text += 'compensator = "feedforward"\nlaw = "mine"\n\n[friction.own]\nlaw = "mine.py"\nlevel = 0.1\n'
    small.source.write_text(text)
    with pytest.raises(CodeRefused, match=r"plugins.*mine\.py"):
        load(small.source)
    with allow_code():
        study = load(small.source)
    result = studies.run(study, tmp_path / "out", ["FF-mine", "sine", "own", "nominal"])
    assert [run.failure for run in result] == ["", ""]
    (tmp_path / "mine.py").unlink()  # Its copy serves.
    assert rerun(tmp_path / "out").differences == []


def test_like_takes_values_over(small: studies.Study) -> None:
    text = small.source.read_text() + '\n[friction.softer]\nlike = "plus10"\nk = [5.0e3, 2.5e3]\n'
    small.source.write_text(text)
    friction = {run.friction: run.axis.friction for run in load(small.source).runs}
    assert friction["softer"].parameters.k == (5e3, 2.5e3)
    assert friction["softer"].parameters.fs == friction["plus10"].parameters.fs
    assert isinstance(friction["plus10"], Model)


def test_one_run_from_a_file() -> None:
    run = load_run(DATA / "one_run.toml")
    run.check()
    executed = studies.execute(run)
    assert executed.failure == ""
    assert executed.metrics["position_rms_rad"] > 0.0


def test_a_study_names_the_runs_that_depend_on_their_start(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Coulomb feedback pushes away from rest, and 1e-9 rad decide which way: its metrics are those of one branch."""
    only = ["literal", "low", "nominal", "FB-coulomb", "PD"]
    for _ in range(2):  # run, and found finished
        result = studies.run(studies.load("thesis"), tmp_path, only)
        assert {r.controller: r.depends_on_start for r in result.runs} == {"PD": False, "FB-coulomb": True}
    found = next(n for n in notes(StudyView(result)) if n.title == "Runs that depend on their start")
    assert found.text.endswith(": literal/low/nominal/FB-coulomb.")
    _output.print_study(result, None, 2)
    said = capsys.readouterr().out
    assert "these depend on their initial position (shifted by 1e-9 rad" in said
    assert "branch): literal/low/nominal/FB-coulomb\n" in said
