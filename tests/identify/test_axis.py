"""Identification of a whole axis from simulated closed-loop records with counted position and coloured noise."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from stickslip.identification.axis import identify_axis
from stickslip.identify.axis.output import output_error
from stickslip.identify.regression.inverse import inverse_dynamics
from stickslip.machines.servo import ServoAxis
from stickslip.plugins import law
from support import axis_cases as cases

AXIS = ServoAxis(drive_side="load")


def test_a_law_of_ones_own_is_identified(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "CONTRIBUTING.md").read_text(encoding="utf-8")
    block = next(b for b in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if "LAW = Law(" in b)
    (tmp_path / "own.py").write_text(block, encoding="utf-8")
    experiment = cases.experiment("coulomb", noise=2e-3)
    found = output_error(
        [experiment], AXIS, law(str(tmp_path / "own.py")), inverse_dynamics([experiment], AXIS)
    )
    # Without viscous friction of its own the law takes the mean torque.
    assert 0.28 < found.model.parameters.fc < 0.34


def test_without_its_loop_a_record_still_tells_the_law() -> None:
    """The output error of an open loop that drifts told no law from another, and the simplest was taken."""
    experiment = replace(cases.experiment("stribeck", noise=5e-3, seconds=8.0), reference=None, loop=None)
    found = identify_axis([experiment], AXIS, ["coulomb", "stribeck"])
    coulomb, stribeck = (float(np.mean(c.score)) for c in found.details["candidates"])
    assert stribeck < 0.8 * coulomb
    assert found.model is not None
    assert found.model.law.name == "stribeck"
    assert_recovered(found, {"fc": cases.FC})
    # Where friction falls to its level is not told, so that what acts at rest is: only by reversals, in time.
    assert "extrapolated to rest" in found["fs"].verdict
    assert found["fs"].lower < 0.335 < found["fs"].upper
    held = identify_axis([experiment], AXIS, ["coulomb", "stribeck"], skew=-0.5 * experiment.period)
    assert_recovered(held, {"fs": 0.335, "fc": cases.FC})


def test_gains_that_do_not_make_the_recorded_signal_are_doubted() -> None:
    experiment = cases.experiment("coulomb", seconds=3.0)
    right = identify_axis([experiment], AXIS, ["coulomb"], intervals="covariance")
    assert not any("loop given" in note or "loop simulated" in note for note in right.notes)
    wrong = replace(experiment, loop=replace(cases.LOOP, kp=100.0 * cases.LOOP.kp))
    found = identify_axis([wrong], AXIS, ["coulomb"])
    assert any("kp 800 given, 8 " in note for note in found.notes)
