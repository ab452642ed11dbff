"""Intervals of a torque over the angle hold at their rate: coloured noise, other in each stroke, drift, delay."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.core.record import Record
from stickslip.identification.cogging import identify_cogging
from stickslip.identification.cogging.noise import Noise, density_of, excess, widened
from stickslip.identification.cogging.rows import Places

TURN = 2.0 * np.pi
UNITS = {"position": "rad", "motor_torque": "N·m"}
AMPLITUDE, RIPPLE, FRICTION = 0.03, 0.004, 0.05


def record(rng, *, late=0.0, drift=0.0, noise=0.004):
    """Two speeds forth and back; what a loop leaves: noise without its slow part, larger where it is faster."""
    parts, t0 = [], 0.0
    for speed in (0.5, 0.25):
        for side in (1.0, -1.0):
            t = t0 + np.arange(0.0, 1.1 * TURN / speed, 2e-3)
            q = side * (speed * (t - t0) - 0.55 * TURN)
            acted = q - late * side * speed
            friction = (FRICTION + drift * t) * (1.0 + RIPPLE / FRICTION * np.cos(2.0 * acted - 0.4))
            blue = np.diff(rng.standard_normal(t.size + 1)) + 0.2 * rng.standard_normal(t.size)
            wave = AMPLITUDE * np.cos(24.0 * acted + 1.0)
            parts.append((t, q, wave + side * friction + noise * speed / 0.5 * blue))
            t0 = t[-1] + 0.5
    t, q, y = (np.concatenate(x) for x in zip(*parts, strict=True))
    return Record(t, {"position": q, "motor_torque": y}, UNITS)


def test_intervals_are_as_wide_as_the_scatter():
    errors, said = [], []
    for seed in range(25):
        found = identify_cogging([record(np.random.default_rng(seed))])
        for name, true in (("even[24]", AMPLITUDE), ("odd[2]", RIPPLE)):
            errors.append((found[name].value - true) / found[name].std)
            said.append(found[name].std)
    assert 0.75 < np.std(errors) < 1.3
    assert np.mean(np.abs(errors) < 1.96) > 0.87
    # Counted as white, the same noise would say seven times as much.
    assert np.median(said) < 0.25 * 0.004 * np.sqrt(2.0 / 12_000.0)


def test_a_delay_is_told_from_friction_over_the_angle():
    found = identify_cogging([record(np.random.default_rng(1), late=2e-3)])
    assert found["delay"].value == pytest.approx(2e-3, abs=4.0 * found["delay"].std)
    assert found["delay"].std < 1e-4
    assert found["even[24]"].value == pytest.approx(AMPLITUDE, abs=4.0 * found["even[24]"].std)


def test_friction_that_drifts_leaves_its_ripple_right():
    found = identify_cogging([record(np.random.default_rng(2), drift=2e-5)])
    assert found["drift"].value == pytest.approx(2e-5, abs=4.0 * found["drift"].std)
    mean = RIPPLE / FRICTION * (FRICTION + 2e-5 * 41.0)
    assert found["odd[2]"].value == pytest.approx(mean, rel=0.01)
    assert abs(found["odd[2]"].value - RIPPLE) > 0.5 * (mean - RIPPLE)


def test_density_is_that_of_the_noise():
    rng = np.random.default_rng(3)
    blue = np.diff(rng.standard_normal(8193))
    density = density_of(blue, np.array([0.0, 0.01]))
    way = TURN * np.linspace(0.0, 0.5, density.size)
    assert density[200:] == pytest.approx((2.0 - 2.0 * np.cos(way))[200:], rel=0.5)


def test_whitened_noise_is_white():
    rng, n = np.random.default_rng(4), 4096
    zeros = np.zeros(n)
    blue = np.diff(rng.standard_normal(n + 1))
    angle = np.linspace(0.0, TURN, n)
    places = Places(
        angle, blue, zeros + 1.0, zeros, zeros, np.zeros(n, dtype=np.intp), zeros, zeros, np.zeros((n, 2))
    )
    (seen,) = Noise.of(places, blue, [5.0]).whitened(blue[:, None])
    assert float(np.sum(seen**2)) == pytest.approx(n, rel=0.1)


def test_what_strokes_differ_by_makes_intervals_wider():
    orders = np.array([0.0, 0.0, 5.0, 5.0])
    assert excess(np.array([1.0, 1.0, 3.0, 3.0]), orders, 4).tolist() == [1.0, 1.0, 1.0, 1.0]
    assert excess(np.array([1.0, 1.0, 30.0, 30.0]), orders, 4)[2] == pytest.approx(10.0)


def test_few_strokes_tell_only_roughly_what_they_differ_by():
    """4 strokes leave 6 differences to two waves: Student's quantile of 6 is 2.447, not 1.96."""
    orders = np.array([0.0, 0.0, 5.0, 5.0])
    assert widened(np.array([1.0, 1.0, 3.0, 3.0]), orders, 4).tolist() == [1.0, 1.0, 1.0, 1.0]
    wide = widened(np.array([1.0, 1.0, 30.0, 30.0]), orders, 4)
    assert wide[2] == pytest.approx(math.sqrt(10.0) * 2.447 / 1.96, rel=1e-3)


def test_the_motion_is_that_of_when_the_torque_acted():
    n = 2000
    angle, zeros = np.linspace(0.0, TURN, n), np.zeros(n)
    swing = np.column_stack([0.1 * np.cos(5.0 * angle), -0.2 * np.sin(5.0 * angle)])
    places = Places(
        angle, zeros, zeros + 1.0, zeros + 0.5, zeros, np.zeros(n, dtype=np.intp), zeros, zeros, swing
    )
    velocity, acceleration = places.motion([5.0], late=0.01).T
    before = 5.0 * (angle - 0.5 * 0.01)
    assert velocity == pytest.approx(0.5 + 0.1 * np.cos(before), abs=1e-9)
    assert acceleration == pytest.approx(-0.2 * np.sin(before), abs=1e-9)
