"""A controller made of control laws: against the sampled controller that it replaces, and what it refuses."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from stickslip.control.block import ControlBlock
from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import Cascade, Gains, place
from stickslip.control.registry import control_law, control_law_names
from stickslip.core.errors import LawError, ParameterError, UnknownName
from stickslip.core.spec import Surroundings
from stickslip.models.model import Model
from support import sampled_text as sampled
from support.golden_rows import GMS, INERTIA, LUGRE, pd, pid

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
        Controller(loop=pd(), sample_time=TIME, torque_limit=1.0),
        Controller(place("PD", INERTIA, 20.0, 1.0), None, 1.0, TIME),
    ),
    "PID": (
        Controller(loop=pid(), sample_time=TIME),
        Controller(place("PID", INERTIA, 20.0, 1.0), None, sample_time=TIME),
    ),
    "PR": (
        Controller(loop=ControlBlock("pr", kp=pd().parameters.kp, kd=pd().parameters.kd), sample_time=TIME),
        Controller(place("PR", INERTIA, 20.0, 1.0), None, sample_time=TIME),
    ),
    "cascade at its limit": (
        Controller(
            loop=ControlBlock("cascade", kv=60.0, kvp=0.1, kvi=6.0, feed=0.7),
            sample_time=TIME,
            feedforward=ff(LUGRE),
            torque_limit=0.3,
        ),
        Controller(Cascade(60.0, 0.1, 6.0, 0.7), Feedforward(LUGRE), 0.3, TIME),
    ),
    "feedforward": (
        Controller(
            loop=pd(),
            sample_time=TIME,
            feedforward=ff(GMS, gain=0.9, lead=1e-3, deadband=0.02),
            torque_limit=0.6,
        ),
        Controller(
            place("PD", INERTIA, 20.0, 1.0), Feedforward(GMS, 0.9, lead=1e-3, deadband=0.02), 0.6, TIME
        ),
    ),
    "feedforward of friction and inertia": (
        Controller(
            loop=pid(),
            sample_time=TIME,
            feedforward=[ff(LUGRE), ControlBlock("inertia_feedforward", inertia=INERTIA, offset=0.03)],
        ),
        Controller(
            place("PID", INERTIA, 20.0, 1.0),
            Feedforward(LUGRE, offset=0.03, inertia_feedforward=INERTIA),
            sample_time=TIME,
        ),
    ),
    "feedback": (
        Controller(loop=pd(), sample_time=TIME, observer=ControlBlock("friction_feedback", LUGRE, gain=0.7)),
        Controller(place("PD", INERTIA, 20.0, 1.0), Feedback(LUGRE, 0.7), sample_time=TIME),
    ),
    "filtered velocity": (
        Controller(
            loop=pd(),
            sample_time=TIME,
            estimator=ControlBlock("filtered_difference", corner=2.0 * math.pi * 80.0),
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


PLACED = place("PD", INERTIA, 20.0, 1.0)
REPLACED = {
    **{name: old for name, (_, old) in PAIRS.items()},
    "gains of its own": Controller(Gains(6.0, 300.0, 0.1, 0.05), None, 0.3, TIME),
    "cascade without integral": Controller(Cascade(60.0, 0.1, 0.0, 0.7), None, 0.3, TIME),
    "feedforward through a low-pass, in steps": Controller(
        PLACED, Feedforward(LUGRE, 0.9, 40.0, 2e-3, 0.01, 0.03, INERTIA, 5), 0.6, TIME
    ),
    "feedback through a low-pass": Controller(PLACED, Feedback(GMS, 0.7, 60.0), 0.6, TIME),
    "feedback beside a filtered velocity": Controller(
        PLACED, Feedback(GMS, 0.7, None, 0.0, 0.01, 0.02, INERTIA, 3), 0.6, TIME, velocity_filter=80.0
    ),
}


@pytest.mark.parametrize("name", REPLACED)
def test_gains_and_a_compensator_are_control_laws_bit_for_bit(name):
    old = REPLACED[name]
    inputs = motion()[: 200 if "filter" in name or "low-pass" in name else None]
    mine, theirs = torques_of(old, inputs), old_torques_of(old, inputs)
    assert np.abs(theirs).max() > 0.01
    assert np.array_equal(mine, theirs)


def test_an_integral_takes_over_and_goes_on_from_there():
    controller = PAIRS["PID"][0]
    still = np.tile([0.0, 0.02, 0.0, 0.0], (40, 1))
    growth = controller.parameters.loop.ki * 0.02 * TIME
    assert torques_of(controller, still, 30)[:3] == pytest.approx(0.2 + growth * np.arange(3), rel=1e-12)


def test_two_laws_of_one_file_keep_their_own_choices():
    curve = {"curve": "double_exponential"}
    example = LUGRE.law.having(**curve).example
    other = Model("lugre", curve, **{**example, "sigma0": 3.5e4, "sigma1": 0.0})
    controller = Controller(
        loop=pd(),
        sample_time=TIME,
        feedforward=ff(LUGRE),
        observer=ControlBlock("friction_feedback", other, gain=0.5),
    )
    alone = Controller(
        loop=pd(), sample_time=TIME, observer=ControlBlock("friction_feedback", other, gain=0.5)
    )
    base, inputs = Controller(loop=pd(), sample_time=TIME, feedforward=ff(LUGRE)), motion()
    none = Controller(loop=pd(), sample_time=TIME)
    whole, parts = torques_of(controller, inputs), torques_of(alone, inputs) + torques_of(base, inputs)
    assert whole == pytest.approx(parts - torques_of(none, inputs), abs=1e-13)


def test_a_law_belongs_in_its_place():
    with pytest.raises(ParameterError, match="observer = 'pd' cannot be used as observer; give it as loop"):
        Controller(loop=pd(), sample_time=TIME, observer=pd())
    with pytest.raises(ParameterError, match=r"sample_time = -0\.001 s must be at least 0"):
        Controller(loop=pd(), sample_time=-TIME)
    with pytest.raises(ParameterError, match="no control law"):
        Controller(loop=None, sample_time=TIME)


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


ADAPTING = [name for name in control_law_names() if control_law(name).adapts]


@pytest.mark.parametrize("name", ADAPTING)
def test_what_adapts_stands_over_an_integral_or_an_observer(name):
    law = control_law(name)
    block = ControlBlock(law, LUGRE if law.holds_friction else None, **law.example)
    places = {"loop": pd(), law.place: block}
    with pytest.raises(ParameterError, match=f"{name} cannot adapt while the axis sticks") as refused:
        Controller(sample_time=TIME, **places)
    assert "\n" not in str(refused.value)
    Controller(sample_time=TIME, alone=True, **places)
    helper = ControlBlock("disturbance_observer", inertia=INERTIA, corner=200.0)
    observers = [block, helper] if law.place == "observer" else helper
    Controller(sample_time=TIME, **{**places, "observer": observers})
    if law.place != "loop":
        Controller(sample_time=TIME, **{**places, "loop": pid()})


def test_eight_laws_adapt():
    assert len(ADAPTING) == 8


def test_a_scale_needs_a_friction_law_with_a_torque_at_constant_velocity():
    law = LUGRE.law
    without = replace(law, name="unsteady", steady=None, **{"variants": {}})
    with pytest.raises(ParameterError, match="friction law 'unsteady' has no torque at constant velocity"):
        ControlBlock(
            "scaled_feedforward",
            Model(without, **law.example),
            **control_law("scaled_feedforward").example,
        )


def test_a_learnt_scale_stays_inside_its_bounds_and_where_it_is_at_rest():
    controller = Controller(
        loop=pid(),
        sample_time=TIME,
        feedforward=ControlBlock("scaled_feedforward", LUGRE, **control_law("scaled_feedforward").example),
    )
    n, m, z, p = controller.settings, controller.memory(), controller.state(), controller.parameters
    u, sample = SimpleNamespace(**Surroundings()._asdict()), controller.functions["sample"]
    position = velocity = 0.0
    for k in range(3000):  # an axis with half the friction that the law expects
        torque = sample(position, 0.3 * TIME * k, 0.3, 0.0, n, m, z, p, u)
        velocity += TIME / INERTIA * (torque - 0.5 * (0.285 + 0.018 * 0.3) * (velocity > 0.0))
        position += TIME * velocity
    learnt = z.feedforward.scale
    assert learnt == pytest.approx((0.5 * (0.285 + 0.018 * 0.3) - 0.018 * 0.3) / 0.285, abs=0.01)
    for _ in range(2000):
        sample(position, position, 0.0, 0.0, n, m, z, p, u)
    assert z.feedforward.scale == learnt
    for k in range(3000):  # something drives it ahead of its reference
        sample(position + 0.3 * TIME * k + 2e-3, position + 0.3 * TIME * k, 0.3, 0.0, n, m, z, p, u)
    assert z.feedforward.scale == p.feedforward.lowest


def test_a_control_law_in_a_file_of_ones_own(tmp_path):
    own = tmp_path / "spring.py"
    own.write_text(
        "from typing import Annotated, NamedTuple\n"
        "from stickslip.core.control_spec import ControlLaw\n"
        "from stickslip.core.spec import Par\n"
        "class Params(NamedTuple):\n"
        "    k: Annotated[float, Par('N·m/rad', 'k', 'stiffness', positive=True)]\n"
        "def sample(y, z, p, u):\n"
        "    return p.k * y.error\n"
        "CONTROL_LAW = ControlLaw('spring', Params, sample, 'loop', title='Spring', equation='k e',\n"
        "                         source=('own',), example={'k': 1.0}, linear=True)\n"
    )
    controller = Controller(loop=ControlBlock(str(own), k=3.0), sample_time=TIME)
    assert torques_of(controller, motion()[:100]) == pytest.approx(6e-3 * np.sin(np.arange(100) * 0.05))
    empty = tmp_path / "empty.py"
    empty.write_text("")
    with pytest.raises(LawError, match="defines no control law"):
        ControlBlock(str(empty))


def test_a_friction_observers_correction_is_a_velocity_besides():
    law = Model("viscous", sigma2=0.5)
    late, corrected = (
        Controller(
            loop=pd(),
            sample_time=TIME,
            observer=ControlBlock("friction_observer", law, gain=0.8, correction=k),
        )
        for k in (0.0, 3.0)
    )
    inputs = motion()[:200]
    error = inputs[:, 1] - inputs[:, 0]
    apart = torques_of(corrected, inputs) - torques_of(late, inputs)
    assert apart == pytest.approx(0.8 * 0.5 * 3.0 * error, abs=1e-14)


def test_what_accelerates_the_inertia_is_no_compensation_to_an_observer():
    """A sinusoid without friction: with the inertia fed forward nothing is left, under an observer as without one."""
    inertia, w, time = 4e-4, 40.0, 1e-3
    inputs = np.arange(2000) * time
    errors = {}
    for observed in (False, True):
        for fed in (0.0, inertia):
            made = Controller(
                loop=ControlBlock("pd", kp=6.0, kd=0.1), sample_time=time,
                feedforward=ControlBlock("inertia_feedforward", inertia=fed, offset=0.05),
                observer=ControlBlock("disturbance_observer", inertia=inertia, corner=200.0) if observed else None,
            )  # fmt: skip
            n, m, z, p = made.settings, made.memory(), made.state(), made.parameters
            u, sample = SimpleNamespace(**Surroundings()._asdict()), made.functions["sample"]
            x, v, worst = 0.0, 0.2 * w, 0.0
            for t in inputs:
                wanted = (0.2 * np.sin(w * t), 0.2 * w * np.cos(w * t), -0.2 * w**2 * np.sin(w * t))
                torque = sample(float(x), *map(float, wanted), n, m, z, p, u) - 0.05
                worst = max(worst, abs(wanted[0] - x)) if t > 1.0 else worst
                x += time * (v + 0.5 * time * torque / inertia)
                v += time * torque / inertia
            errors[observed, fed > 0.0] = worst
    # The offset is a disturbance that is fed forward: the observer leaves it to the feedforward.
    assert errors[True, True] < 0.2 * errors[True, False]
    assert errors[True, True] == pytest.approx(errors[False, True], rel=0.1)


@pytest.mark.parametrize(("law", "torque"), [("gains", 0.44), ("pid", 0.4)])
def test_an_integral_held_back_at_the_limit_stays_and_its_torque_follows_the_rule_of_its_law(law, torque):
    """As docs/reference/controllers.md has it: the torque of one holds the growth that is not kept, the other's not."""
    p = SimpleNamespace(kp=1.0, ki=100.0, kd=0.0, kr=0.0)
    y = SimpleNamespace(
        started=1.0, elapsed=TIME, error=0.4, reference_velocity=0.0, velocity=0.0, others=0.5, torque_limit=0.9,
    )  # fmt: skip
    z = SimpleNamespace(integral=0.0, error=0.4)
    assert control_law(law).sample(y, z, p, None) == pytest.approx(torque)
    assert z.integral == 0.0
    y.torque_limit = 1.0
    assert control_law(law).sample(y, z, p, None) == pytest.approx(0.44)
    assert z.integral == pytest.approx(0.4 * TIME)
