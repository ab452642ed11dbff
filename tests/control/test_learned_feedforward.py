"""Feedforward learned over the angle: the law does what its definition says, and its table gives what was learned."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import ParameterError
from stickslip.core.spec import Surroundings

BINS, PERIOD, RATE = 16, 500, 0.8
LOWER, UPPER = 0.0, 0.2
TIME = 1e-3
ZERO = [0.0] * BINS


def learner(**more):
    values = {"lower": LOWER, "upper": UPPER, "samples": float(PERIOD), "rate": RATE, "largest": 10.0, **more}
    return ss.ControlBlock("learned_feedforward", **{"forward": ZERO, "backward": ZERO, **values})


def loop_with(*feedforward):
    loop = ss.ControlBlock("pid", kp=6.0, kd=0.1, ki=100.0)
    return ss.Controller(loop=loop, sample_time=TIME, feedforward=feedforward, torque_limit=2.0)


def samples():
    """Measured position, reference position and velocity over five periods of 0.1 (1 - cos), the error made up."""
    t = TIME * np.arange(5 * PERIOD)
    w = 2.0 * np.pi / (PERIOD * TIME)
    reference, velocity = 0.1 * (1.0 - np.cos(w * t)), 0.1 * w * np.sin(w * t)
    position = reference - 0.02 * np.sign(velocity) - 0.01 * np.sin(70.0 * reference)
    return np.column_stack([position, reference, velocity, 0.0 * t])


def ran(controller, rows, learned=None):
    """Torque and feedforward of every sample, and what was learned."""
    n, m, p = controller.settings, controller.memory(), controller.parameters
    z, u = controller.state(learned), SimpleNamespace(**Surroundings()._asdict())
    out = []
    for row in rows:
        torque = controller.functions["sample"](*map(float, row), n, m, z, p, u)
        out.append((torque, m.feedforward))
    return np.array(out), controller.learned(z)


def between_centres(table, place):
    """Linear between the middles of the bins, ends held."""
    return np.interp(place, np.arange(BINS) + 0.5, table)


def test_the_map_is_that_of_its_definition():
    rows = samples()
    given, _ = ran(loop_with(learner()), rows)
    up, down = np.zeros(BINS), np.zeros(BINS)
    for repetition in range(5):
        part = slice(repetition * PERIOD, (repetition + 1) * PERIOD)
        place = BINS * (rows[part, 1] - LOWER) / (UPPER - LOWER)
        forward = rows[part, 2] >= 0.0
        expected = np.where(forward, between_centres(up, place), between_centres(down, place))
        assert given[part, 1] == pytest.approx(expected, abs=1e-12)
        rest = given[part, 0] - given[part, 1]
        bins = np.clip(np.floor(place), 0, BINS - 1)
        for table, side in ((up, rows[part, 2] > 0.0), (down, rows[part, 2] < 0.0)):
            for i in range(BINS):
                taught = rest[side & (bins == i)]
                table[i] += RATE * (taught.mean() if taught.size else 0.0)
            wide = np.pad(table, 1, mode="edge")
            table[:] = 0.25 * wide[:-2] + 0.5 * wide[1:-1] + 0.25 * wide[2:]
    assert max(np.abs(up).max(), np.abs(down).max()) > 0.1


def test_what_was_learned_comes_back_and_is_given_by_a_table():
    rows = samples()
    _, learned = ran(loop_with(learner()), rows)
    up, down = learned["feedforward_up"], learned["feedforward_down"]
    assert len(up) == len(down) == BINS
    assert max(map(abs, up)) > 0.1
    limits = {"lower": LOWER, "upper": UPPER, "forward": up, "backward": down}
    first = rows[: PERIOD - 1]
    again, _ = ran(loop_with(learner()), first, learned)
    started, _ = ran(loop_with(learner(forward=up, backward=down)), first)
    table, _ = ran(loop_with(ss.ControlBlock("table_feedforward", **limits)), first)
    assert np.array_equal(again, started)
    assert table == pytest.approx(again, abs=1e-12)
    half, _ = ran(loop_with(ss.ControlBlock("table_feedforward", gain=0.5, **limits)), first)
    assert half[:, 1] == pytest.approx(0.5 * again[:, 1], abs=1e-12)


def test_an_hour_at_rest_leaves_the_map():
    rows = samples()
    _, learned = ran(loop_with(learner()), rows)
    still = np.tile([0.05, 0.1, 0.0, 0.0], (3 * PERIOD, 1))  # an error that the integral pushes against
    _, after = ran(loop_with(learner()), np.concatenate([rows, still]))
    _, end = ran(loop_with(learner()), np.concatenate([rows, still, still]))
    assert after == end
    apart = np.abs(np.subtract(after["feedforward_up"], learned["feedforward_up"]))
    assert apart.max() <= RATE * 0.5  # at most the repetition that the rest began in


def given_over_time(over, count, missing=()):
    table = [0.0, 0.2, 0.3, -0.1]
    block = ss.ControlBlock("table_feedforward", None, {"over": over}, step=2e-3, table=table)
    rows = np.zeros((count, 4))
    rows[list(missing), 0] = np.nan
    return ran(ss.Controller(loop=None, sample_time=TIME, feedforward=block), rows)[0][:, 1]


def test_a_table_over_time_begins_at_the_first_sample_and_is_held_or_repeated():
    whole = [0.0, 0.1, 0.2, 0.25, 0.3, 0.1, -0.1]
    assert given_over_time("time", 10) == pytest.approx([*whole, -0.1, -0.1, -0.1])
    assert given_over_time("repeated_time", 17) == pytest.approx([*whole, -0.05, *whole, -0.05, 0.0])


def test_samples_that_are_missing_count():
    late = given_over_time("time", 7, missing=(2, 3))
    assert late[4:] == pytest.approx([0.3, 0.1, -0.1])


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"rate": 2.0}, "rate = 2 must be below 2"),
        ({"upper": 0.0}, "upper = 0 rad must be greater than lower = 0 rad"),
        ({"samples": 10.5}, r"samples = 10\.5 must be a whole number"),
        ({"backward": [0.0]}, "every element needs a value of each"),
    ],
)
def test_what_cannot_learn_is_refused(wrong, said):
    with pytest.raises(ParameterError, match=said):
        learner(**wrong)
