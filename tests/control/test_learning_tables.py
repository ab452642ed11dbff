"""Tables that learn from repetition to repetition: over the angle as the control law does, within their bound."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from stickslip.control.learning import AngleTable, TimeTable, low_pass
from stickslip.control.registry import control_law

BINS, SAMPLES, RATE = 12, 997, 0.8
PHASE = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
ANGLE, VELOCITY = 0.3 - 0.5 * np.cos(PHASE), np.sin(PHASE)


def table(largest=10.0):
    return AngleTable.over(ANGLE, VELOCITY, BINS, RATE, largest)


def by_the_law(repetitions):
    """What `learned_feedforward` makes of the loop's torques, one repetition after the other, shape (2, bins)."""
    law = control_law("learned_feedforward")
    zero = [0.0] * BINS
    p = SimpleNamespace(
        lower=float(ANGLE.min()), upper=float(ANGLE.max()), samples=float(SAMPLES), rate=RATE, largest=10.0,
        forward=zero, backward=zero,
    )  # fmt: skip
    z = SimpleNamespace(
        **{n: [0.0] * BINS for n in ("up", "down", "up_sum", "down_sum", "up_count", "down_count")},
        known=0.0, bin=0.0, side=0.0, passed=0.0,
    )  # fmt: skip
    last = 0.0
    for torque in [*np.concatenate(repetitions), 0.0]:
        k = int(z.passed) % SAMPLES
        y = SimpleNamespace(
            residual=last,
            rest=0.0,
            turns=0.0,
            position=ANGLE[k] - 0.01,
            error=0.01,
            reference_velocity=VELOCITY[k],
        )
        law.sample(y, z, p, None)
        last = torque
    return np.array([z.up, z.down])


def test_a_repetition_teaches_the_table_over_the_angle_what_it_teaches_the_law():
    draw = np.random.default_rng(5)
    torques = [draw.normal(size=SAMPLES), np.sin(3.0 * ANGLE) + 0.2 * np.sign(VELOCITY)]
    found = table()
    for torque in torques:
        found = found.after(torque)
    np.testing.assert_allclose(found.torque, by_the_law(torques), atol=1e-12)
    assert np.abs(found.torque).max() > 0.3


def test_its_block_gives_what_it_learned_by_angle_and_direction():
    found = table()
    for _ in range(60):  # smoothing holds back what is finer than bins
        held = found.block().parameters
        middle = (
            np.linspace(held.lower, held.upper, BINS, endpoint=False) + 0.5 * (held.upper - held.lower) / BINS
        )
        ahead = np.where(
            VELOCITY < 0.0, np.interp(ANGLE, middle, held.backward), np.interp(ANGLE, middle, held.forward)
        )
        found = found.after(0.1 * ANGLE + 0.3 * np.sign(VELOCITY) - ahead)
    np.testing.assert_allclose(found.torque[0][2:-2], 0.1 * middle[2:-2] + 0.3, atol=3e-3)
    np.testing.assert_allclose(found.torque[1][2:-2], 0.1 * middle[2:-2] - 0.3, atol=3e-3)


@pytest.mark.parametrize(
    "made",
    [table, lambda largest: TimeTable(np.zeros(SAMPLES), 1e-3, RATE, 0, low_pass(10.0, 1e-3), largest)],
)
def test_no_table_leaves_its_bound(made):
    found = made(0.05)
    for _ in range(5):
        found = found.after(np.full(SAMPLES, 3.0))
    assert np.all(found.torque == 0.05)
