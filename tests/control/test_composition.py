"""A controller made of control laws: against the sampled controller that it replaces, and what it refuses."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from golden_rows import GMS, INERTIA, LUGRE, pd, pid

from stickslip.control import sampled
from stickslip.control.block import ControlBlock
from stickslip.control.compensators.feedback import Feedback
from stickslip.control.compensators.feedforward import Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import Cascade, place
from stickslip.control.sampled_controller import SampledController
from stickslip.errors import LawError, ParameterError, UnknownName
from stickslip.model import Model
from stickslip.spec import Surroundings

TIME = 1e-3


def motion(count=400, seed=3):
    """Measured position, reference position, velocity, acceleration: sliding, reversals, a stop, lost samples."""
    draw = np.random.default_rng(seed)
    velocity = np.repeat(draw.normal(0.0, 0.3, count // 40), 40)
    velocity[80:160] = 0.0
    reference = np.cumsum(velocity) * TIME
    position = reference - 2e-3 * np.sin(np.arange(count) * 0.05)
    position[200:203] = math.nan
    reference[300] = math.inf
    return np.column_stack([position, reference, velocity, np.gradient(velocity, TIME)])


def torques_of(controller, inputs, first=None):
    n, m, z, p = controller.settings, controller.memory(), controller.state(), controller.parameters
    u, functions = SimpleNamespace(**Surroundings()._asdict()), controller.functions
    out = []
    for i, row in enumerate(inputs.tolist()):
        if first is not None and i < first:
            functions["follow"](*row, 0.2, n, m, z, p, u)
        else:
            out.append(functions["sample"](*row, n, m, z, p, u))
    return np.array(out)


def old_torques_of(controller, inputs, first=None):
    helper = controller.compensator
    law = helper.model.law if helper else None
    n, p = sampled.settings(controller), helper.model.parameters if helper else None
    m = SimpleNamespace(**dict.fromkeys(sampled.Memory._fields, 0.0))
    z, u = law.state(p) if law else None, SimpleNamespace(**Surroundings()._asdict())
    functions = sampled.functions_by(law)
    out = []
    for i, row in enumerate(inputs.tolist()):
        if first is not None and i < first:
            functions["follow"](*row, 0.2, n, m, z, p, u)
        else:
            out.append(functions["sample"](*row, n, m, z, p, u))
    return np.array(out)


def ff(model, **more):
    return ControlBlock("friction_feedforward", model, **more)


PAIRS = {
    "PD": (
        SampledController(pd(), TIME, torque_limit=1.0),
        Controller(place("PD", INERTIA, 20.0, 1.0), None, 1.0, TIME),
    ),
    "PID": (
        SampledController(pid(), TIME),
        Controller(place("PID", INERTIA, 20.0, 1.0), None, sample_time=TIME),
    ),
    "PR": (
        SampledController(ControlBlock("pr", kp=pd().parameters.kp, kd=pd().parameters.kd), TIME),
        Controller(place("PR", INERTIA, 20.0, 1.0), None, sample_time=TIME),
    ),
    "cascade at its limit": (
        SampledController(
            ControlBlock("cascade", kv=60.0, kvp=0.1, kvi=6.0, feed=0.7), TIME, ff(LUGRE), torque_limit=0.3
        ),
        Controller(Cascade(60.0, 0.1, 6.0, 0.7), Feedforward(LUGRE), 0.3, TIME),
    ),
    "feedforward": (
        SampledController(pd(), TIME, ff(GMS, gain=0.9, lead=1e-3, deadband=0.02), torque_limit=0.6),
        Controller(
            place("PD", INERTIA, 20.0, 1.0), Feedforward(GMS, 0.9, lead=1e-3, deadband=0.02), 0.6, TIME
        ),
    ),
    "feedforward of friction and inertia": (
        SampledController(
            pid(), TIME, [ff(LUGRE), ControlBlock("inertia_feedforward", inertia=INERTIA, offset=0.03)]
        ),
        Controller(
            place("PID", INERTIA, 20.0, 1.0),
            Feedforward(LUGRE, offset=0.03, inertia_feedforward=INERTIA),
            sample_time=TIME,
        ),
    ),
    "feedback": (
        SampledController(pd(), TIME, observer=ControlBlock("friction_feedback", LUGRE, gain=0.7)),
        Controller(place("PD", INERTIA, 20.0, 1.0), Feedback(LUGRE, 0.7), sample_time=TIME),
    ),
    "filtered velocity": (
        SampledController(
            pd(), TIME, estimator=ControlBlock("filtered_difference", corner=2.0 * math.pi * 80.0)
        ),
        Controller(place("PD", INERTIA, 20.0, 1.0), sample_time=TIME, velocity_filter=80.0),
    ),
}


@pytest.mark.parametrize("name", PAIRS)
def test_as_the_sampled_controller_that_it_replaces(name):
    new, old = PAIRS[name]
    inputs = motion()
    if "filter" in name:  # over lost samples the new one filters for as long as they took
        inputs = inputs[:200]
    mine, theirs = torques_of(new, inputs), old_torques_of(old, inputs)
    assert np.isfinite(mine).all()
    assert np.abs(theirs).max() > 0.05
    assert np.abs(mine - theirs).max() <= 1e-13


@pytest.mark.parametrize("name", PAIRS)
def test_taken_over_as_by_the_sampled_controller_that_it_replaces(name):
    new, old = PAIRS[name]
    inputs = motion()[: 200 if "filter" in name else None]
    mine, theirs = torques_of(new, inputs, 30), old_torques_of(old, inputs, 30)
    assert mine[0] == pytest.approx(0.2, rel=1e-12)
    if (
        "limit" not in name
    ):  # at the limit the two judge the growth of the first sample before and after the take-over
        assert np.abs(mine - theirs).max() <= 1e-13


def test_an_integral_takes_over_and_goes_on_from_there():
    controller = PAIRS["PID"][0]
    still = np.tile([0.0, 0.02, 0.0, 0.0], (40, 1))
    growth = controller.parameters.loop.ki * 0.02 * TIME
    assert torques_of(controller, still, 30)[:3] == pytest.approx(0.2 + growth * np.arange(3), rel=1e-12)


def test_two_laws_of_one_file_keep_their_own_choices():
    curve = {"curve": "double_exponential"}
    example = LUGRE.law.having(**curve).example
    other = Model("lugre", curve, **{**example, "sigma0": 3.5e4, "sigma1": 0.0})
    controller = SampledController(pd(), TIME, ff(LUGRE), ControlBlock("friction_feedback", other, gain=0.5))
    alone = SampledController(pd(), TIME, observer=ControlBlock("friction_feedback", other, gain=0.5))
    base, inputs = SampledController(pd(), TIME, ff(LUGRE)), motion()
    none = SampledController(pd(), TIME)
    whole, parts = torques_of(controller, inputs), torques_of(alone, inputs) + torques_of(base, inputs)
    assert whole == pytest.approx(parts - torques_of(none, inputs), abs=1e-13)


def test_a_law_belongs_in_its_place():
    with pytest.raises(ParameterError, match="observer = 'pd' is no observer; give it as loop"):
        SampledController(pd(), TIME, observer=pd())
    with pytest.raises(ParameterError, match="sample_time = 0 s must be greater than 0"):
        SampledController(pd(), 0.0)
    with pytest.raises(ParameterError, match="it has no law"):
        SampledController(None, TIME)


def test_a_block_says_what_is_wrong_with_it():
    with pytest.raises(ParameterError, match="kp = -1"):
        ControlBlock("pd", kp=-1.0, kd=0.1)
    with pytest.raises(ParameterError, match="needs a friction law"):
        ControlBlock("friction_feedforward", gain=1.0)
    with pytest.raises(ParameterError, match="takes no friction law"):
        ControlBlock("pd", LUGRE, kp=1.0, kd=0.1)
    with pytest.raises(ParameterError, match=r"delay = 0\.5 must be a whole number"):
        ControlBlock("disturbance_observer", inertia=INERTIA, corner=300.0, delay=0.5)
    with pytest.raises(UnknownName, match="choice of control law 'pid'"):
        ControlBlock("pid", None, {"windup": "none"}, **{"kp": 1.0, "ki": 1.0, "kd": 0.1})
    with pytest.raises(UnknownName, match="unknown control law 'pdi'; did you mean"):
        ControlBlock("pdi")


def test_a_control_law_in_a_file_of_ones_own(tmp_path):
    own = tmp_path / "spring.py"
    own.write_text(
        "from typing import Annotated, NamedTuple\n"
        "from stickslip.control_spec import ControlLaw\n"
        "from stickslip.spec import Par\n"
        "class Params(NamedTuple):\n"
        "    k: Annotated[float, Par('N·m/rad', 'k', 'stiffness', positive=True)]\n"
        "def sample(y, z, p, u):\n"
        "    return p.k * y.error\n"
        "CONTROL_LAW = ControlLaw('spring', Params, sample, 'loop', title='Spring', equation='k e',\n"
        "                         source=('own',), example={'k': 1.0}, linear=True)\n"
    )
    controller = SampledController(ControlBlock(str(own), k=3.0), TIME)
    assert torques_of(controller, motion()[:100]) == pytest.approx(6e-3 * np.sin(np.arange(100) * 0.05))
    empty = tmp_path / "empty.py"
    empty.write_text("")
    with pytest.raises(LawError, match="defines no control law"):
        ControlBlock(str(empty))


def test_a_friction_observers_correction_is_a_velocity_besides():
    law = Model("viscous", sigma2=0.5)
    late, corrected = (
        SampledController(pd(), TIME, observer=ControlBlock("friction_observer", law, gain=0.8, correction=k))
        for k in (0.0, 3.0)
    )
    inputs = motion()[:200]
    error = inputs[:, 1] - inputs[:, 0]
    apart = torques_of(corrected, inputs) - torques_of(late, inputs)
    assert apart == pytest.approx(0.8 * 0.5 * 3.0 * error, abs=1e-14)
