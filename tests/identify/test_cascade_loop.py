"""The closed loop of a cascade, position P around velocity PI, as a record's controller."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.control.linear import Cascade
from stickslip.core.errors import InputError
from stickslip.identification.axis import identify_axis
from stickslip.identification.experiment import Experiment
from stickslip.identification.methods._experiments import loop_of
from stickslip.identification.output_error.loop_check import doubted_loops, shown_gains
from stickslip.machines.servo import ServoAxis
from stickslip.simulation.recorded_input.simulation import Drive, Loop, Mechanics, control_signal, drive_axis
from stickslip.verbs.identify import loops_of
from stickslip.verbs.recommend import loop_of as loop_to_recommend
from support import axis_cases as cases

TEXT = "kv=40,kvp=0.08,kvi=0.6,feed=0.8,filter=200,limit=3"
OWN: dict[str, float] = {"kv": 40.0, "kvp": 0.08, "kvi": 0.6}
T = 1e-3


def recorded(loop: Loop) -> Experiment:
    time = T * np.arange(6000)
    reference = cases.wanted(time, 0)
    push = 0.01 * np.repeat(np.random.default_rng(0).standard_normal(time.size // 10), 10)
    drive = Drive(time, reference, "feedback", loop, disturbance=push, max_step=2e-4)
    out = drive_axis(Mechanics(cases.INERTIA), cases.model("coulomb"), drive)
    count = 2.0 * math.pi / 65536
    return Experiment(
        "log.csv", time, count * np.round(out[:, 0] / count), out[:, 2], "torque", reference, loop
    )


def test_identify_and_recommend_read_the_same_description() -> None:
    gains, beside, _ = loop_to_recommend(TEXT)
    loop = loop_of(TEXT)
    assert gains == Cascade(loop.kv, loop.kvp, loop.kvi, loop.feed)
    assert beside == {"filter": loop.filter, "limit": loop.limit}
    assert loop_of("kv=40,kvp=0.08").feed == 1.0
    (text,) = loops_of({"kv": np.float64(40.0), "kvp": 0.08}, 1)
    assert loop_of(text) == loop_of("kv=40,kvp=0.08")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("kv=40,kvp=0.08,kp=1", "unknown number of loop of a cascade 'kp'"),
        ("kp=8,kx=1", "unknown number of loop of a PID 'kx'"),
        ("kvp=0.08", "give kv, greater than 0"),
        ("kv=40", "give kvp, greater than 0"),
        ("kv=40,kvp=-1", "give kvp, greater than 0"),
        ("kv=40,kvp=1,feed=-1", "feed = -1 must be a finite number of 0 or more"),
    ],
)
def test_what_is_no_loop_is_refused(given: str, said: str) -> None:
    for read in (loop_of, loop_to_recommend):
        with pytest.raises(InputError, match=said if "feed" not in said else "feed = -1 must be"):
            read(given)


@pytest.mark.parametrize("given", [{}, {"feed": 0.7}, {"filter": 150.0}, {"limit": 0.2}, {"kvi": 0.0}])
def test_its_output_is_that_of_the_control_law(given: dict[str, Any]) -> None:
    """Along a recorded motion of which reference and position are known at every sample."""
    loop = Loop(**{**OWN, **given})
    time = T * np.arange(2000)
    reference = 0.3 * (1.0 - np.cos(2.0 * math.pi * time))
    position = 0.98 * reference + 0.02 * np.sin(9.0 * time) * time
    block = ss.ControlBlock("cascade", kv=loop.kv, kvp=loop.kvp, kvi=loop.kvi, feed=loop.feed)
    p, z = block.law.parameters(block.parameters._asdict()), block.law.state(block.parameters)
    expected, seen = [], 0.0
    for k in range(time.size):
        before = max(k - 1, 0)
        v, rate = (position[k] - position[before]) / T, (reference[k] - reference[before]) / T
        if loop.filter:
            v += math.exp(-2.0 * math.pi * loop.filter * T) * (seen - v)
            seen = v
        y = _Seen(reference[k] - position[k], rate, v, T, loop.limit)
        torque = block.law.sample(y, z, p, None)
        expected.append(min(max(torque, -loop.limit), loop.limit))
    made = control_signal(loop, time, reference, position)
    assert np.allclose(made, expected, rtol=1e-9, atol=1e-12)
    assert not given.get("limit") or np.mean(np.abs(made) == loop.limit) > 0.05


class _Seen:
    """What the law sees of a sample."""

    others = 0.0

    def __init__(
        self, error: float, reference_velocity: float, velocity: float, elapsed: float, limit: float
    ) -> None:
        self.error, self.reference_velocity, self.velocity = error, reference_velocity, velocity
        self.elapsed, self.torque_limit = elapsed, limit


def test_an_axis_is_identified_through_its_cascade() -> None:
    """Disturbed by a third of the torque that accelerates, to which the loop answers."""
    made = recorded(Loop(**OWN, filter=300.0, limit=3.0))
    assert made.closed_loop
    assert not made.can_begin_later
    found = identify_axis([made], ServoAxis(), ["coulomb"])
    assert found["inertia"].lower < cases.INERTIA < found["inertia"].upper
    assert found["inertia"].cause == "disturbance"
    assert "record stronger accelerations" in found["inertia"].verdict
    assert found["fc"].value == pytest.approx(cases.model("coulomb").parameters.fc, rel=0.05)
    assert found["fc"].identified
    assert not [n for n in found.notes if "another controller" in n]


def test_a_wrong_gain_of_a_cascade_is_told_and_a_right_one_is_not() -> None:
    made = recorded(Loop(**OWN, limit=3.0))
    assert doubted_loops([made]) == []
    (said,) = doubted_loops([replace(made, loop=Loop(**{**OWN, "kvp": 0.16}, limit=3.0))])
    assert "log.csv shows another controller than the loop given (as a PID): kp 7 given, 3.8" in said
    # With a part of the feedforward it is no PID: nothing is said.
    assert shown_gains(replace(made, loop=Loop(**OWN, feed=0.5, limit=3.0))) is None
