"""One source of the slip rule: each law's own choice holds, unless the run gives one for all."""

from __future__ import annotations

import json

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.control.compensator import Feedback
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core.errors import InputError, UnknownName
from stickslip.machines.angle import AngleMap
from stickslip.machines.motor import Harmonics
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate
from stickslip.simulation.prescribed.open_loop import respond
from stickslip.studies.plan import load, load_run
from support.thesis_loops import INERTIA, PARAMETERS, PLANT

SOFT = {**PLANT, "k": [300.0, 200.0, 100.0, 50.0], "fs": 0.5, "fc": 0.1}
"""Springs so soft that elements are still loaded against the motion long after a reversal: where the rules differ."""
GAINS = place("PD", INERTIA, 20.0, 0.8)
MOTION = Reference("sine", amplitude=0.02, frequency=5.0)


def gms(rule: str) -> Model:
    return Model("gms", {"slip_rule": rule}, **SOFT) if rule else Model("coulomb", **PARAMETERS["coulomb"])


def run(plant: str, compensator: str = "", integrator: str = "exact", **more):
    helper = Feedback(gms(compensator), gain=0.5) if compensator else None
    axis = RigidAxis(INERTIA, gms(plant))
    return simulate(
        axis, Controller(GAINS, helper), MOTION, 0.4, integrator=integrator, metered=False, **more
    )


def apart(one, other) -> float:
    """Largest difference in position, rad, between two runs with the same grid."""
    times = np.arange(0.0, 0.4, 1e-3)
    there, here = (np.interp(times, r.time, r["position"]) for r in (one, other))
    return float(np.abs(there - here).max())


@pytest.mark.parametrize("integrator", ["exact", "adaptive", "fixed"])
def test_the_laws_own_choice_holds(integrator):
    own, signed = (run(rule, rule, integrator) for rule in ("literal", "signed"))
    assert apart(own, signed) > 1e-4
    assert apart(own, run("signed", "signed", integrator, slip_rule="literal")) == 0.0
    assert apart(signed, run("literal", "literal", integrator, slip_rule="signed")) == 0.0


@pytest.mark.parametrize(("plant", "compensator"), [("literal", "signed"), ("signed", "literal")])
def test_each_law_keeps_its_own_beside_another(plant, compensator):
    """The exact integrator, which knows the rules by itself, against the one that runs the laws' own functions."""
    exact, adaptive = run(plant, compensator), run(plant, compensator, "adaptive")
    assert apart(exact, adaptive) < 1e-9
    assert apart(exact, run(plant, plant)) > 1e-5


def test_the_record_says_which_rule_each_law_ran_with():
    meta = run("literal", "signed").meta
    assert meta["slip_rules"] == {"friction": "literal", "compensator": "signed"}
    assert meta["slip_rule"] is None
    ruled = run("literal", "signed", slip_rule="signed").meta
    assert ruled["slip_rules"] == {"friction": "signed", "compensator": "signed"}
    assert ruled["slip_rule"] == "signed"
    assert "slip_rule" not in ruled["friction"]  # what is usual is left out of a law as data
    assert run("signed", "signed", slip_rule="literal").meta["friction"]["slip_rule"] == "literal"
    assert run("", "literal").meta["slip_rules"] == {"compensator": "literal"}
    with pytest.raises(UnknownName, match="slip rule"):
        run("signed", slip_rule="absolute")


def test_in_open_loop_too():
    times = np.linspace(0.0, 0.4, 401)
    own = respond(gms("literal"), MOTION, times)
    assert own.meta["slip_rules"] == {"model": "literal"}
    given = respond(gms("signed"), MOTION, times, slip_rule="literal")
    np.testing.assert_array_equal(own["friction_torque"], given["friction_torque"])
    other = respond(gms("signed"), MOTION, times)["friction_torque"]
    assert np.abs(own["friction_torque"] - other).max() > 0.01


LITERAL = """law = "gms"
choices = {slip_rule = "literal"}

[parameters]
k = [300.0, 200.0, 100.0, 50.0]
alpha = [0.25, 0.25, 0.25, 0.25]
c = 24.0
fs = 0.5
fc = 0.1
vs = 0.01
sigma2 = 0.018
"""
ONE_RUN = """
[axis]
inertia = 3.8623e-4

[friction]
law = {model = "model.toml"}

[reference]
kind = "sine"
amplitude = 0.02
frequency = 5.0
duration = 0.1

[controller]
linear = "PD"
placement = {bandwidth_hz = 20.0, damping = 0.8}
"""
STUDY = """
[axis]
inertia = 3.8623e-4
[friction.soft]
law = {model = "model.toml"}
[references.sine]
kind = "sine"
amplitude = 0.02
frequency = 5.0
duration = 0.1
[controllers.PD]
linear = "PD"
placement = {bandwidth_hz = 20.0, damping = 0.8}
"""


@pytest.fixture
def files(tmp_path):
    (tmp_path / "model.toml").write_text(LITERAL)
    return tmp_path


def test_a_model_from_a_file_keeps_its_own_rule_in_a_run(files, capsys):
    """`stickslip simulate` gave it the default of the run without a word."""
    for given, runs_by in (("", "literal"), ('slip_rule = "signed"\n', "signed")):
        file = files / "run.toml"
        file.write_text(given + ONE_RUN)
        assert main(["simulate", str(file), "--out", str(files / "run.npz"), "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["slip_rules"] == {"friction": runs_by}
    file.write_text(ONE_RUN)
    assert load_run(file).key.startswith("own/")


def test_and_in_a_study(files):
    for given, named in (("", "own"), ('slip_rules = ["signed", "literal"]\n', "signed")):
        file = files / "study.toml"
        file.write_text(given + STUDY)
        first = load(file).runs[0]
        assert first.key == f"{named}/sine/soft/PD"
        assert first.rule == (None if named == "own" else named)
    assert load("thesis").runs[0].rule == "signed"


def test_a_ripple_does_not_stand_twice():
    """In the law, and in the table [angle] of its file."""
    angle = AngleMap(ripple=Harmonics((1.0,), (0.1,), (0.0,)))
    once = angle.on(Model("coulomb", fc=0.285, sigma2=0.0))
    with pytest.raises(InputError, match="position_dependence"):
        angle.on(once)
