"""Sliding curves from staircases as drives log them: plain code makes the logs, nothing of the package's engines."""

import math

import numpy as np
import pytest

from stickslip import Model, Record
from stickslip.identification.estimate import Identification
from stickslip.identification.fit.multistart import bounded_solution
from stickslip.identification.steady_friction.curve import identify_sliding
from stickslip.identification.steady_friction.points import SlidingPoints
from stickslip.identification.steady_friction.segments import segments_of, sliding_points

DEGREES = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
TRUTH = {"fs": 1.2, "fc": 1.0, "vs": 0.1, "delta_s": 2.0, "sigma2": 0.35}
UNITS = {"position": "rad", "motor_torque": "N·m"}
LUGRE = Model("lugre", sigma0=1e4, fs=1.5, fc=0.8, vs=0.05, delta_s=1.5, sigma2=0.1)


def staircase(
    degrees: tuple[float, ...], seconds: float = 4.0, cogging: float = 0.0, counts: int = 2**18, seed: int = 0
) -> Record:
    """Forth and back at each speed (degrees/s) with rests between, at 500 Hz: PI speed loop, LuGre, an encoder.

    Semi-implicit steps of 0.25 ms; current noise and 0.005 N·m of resolution with a seed other than 0.
    """
    j, s0, s1, kv, ki, dt, sub = 0.02, 3000.0, 8.0, 3.0, 40.0, 1e-3, 4
    x = v = z = integral = 0.0
    h = dt / sub
    rows: list[tuple[float, float]] = []
    for level in [sign * math.radians(d) for d in degrees for sign in (1.0, -1.0)]:
        size, reference = abs(level), 0.0
        for k in range(round((seconds + 0.3) / dt)):
            change = size * dt / 0.2
            reference = min(reference + change, size) if k * dt < seconds else max(reference - change, 0.0)
            error = math.copysign(reference, level) - v
            integral += ki * error * dt
            drive = kv * error + integral
            rows.append((x, drive))
            for _ in range(sub):
                g = TRUTH["fc"] + (TRUTH["fs"] - TRUTH["fc"]) * math.exp(-((v / TRUTH["vs"]) ** 2))
                bristle = v - s0 * abs(v) * z / g
                z = (z + h * v) / (1.0 + h * s0 * abs(v) / g)
                friction = s0 * z + s1 * bristle * math.exp(-((v / 0.05) ** 2)) + TRUTH["sigma2"] * v
                v += h * (drive - friction - cogging * math.sin(7.0 * x)) / j
                x += h * v
    position, torque = np.array(rows)[::2].T
    count = 2.0 * math.pi / counts
    if seed:
        torque = torque + np.random.default_rng(seed).normal(0.0, 0.02, torque.size)
        torque = 0.005 * np.round(torque / 0.005)
    channels = {"position": count * np.round(position / count), "motor_torque": torque}
    return Record(2.0 * dt * np.arange(torque.size), channels, UNITS)


@pytest.fixture(scope="module")
def fine() -> Record:
    return staircase(DEGREES)


@pytest.fixture(scope="module")
def coarse() -> Record:
    """4096 counts, of which the slowest level turns 11 a second; noise; one fast level."""
    return staircase((2.0, 5.0, 10.0, 20.0, 50.0, 200.0), counts=4096, seed=1)


def held(result: Identification) -> list[str]:
    return [e.name for e in result.estimates if e.lower <= TRUTH[e.name] <= e.upper]


def test_no_slow_level_of_a_staircase_is_lost(fine: Record) -> None:
    """Each of 4 s: the slowest travels 4 degrees, where 20 were dropped."""
    found, dropped = segments_of(fine)
    speeds = sorted(round(math.degrees(s.velocity), 1) for s in found)
    assert set(speeds) >= {s * d for d in DEGREES[1:] for s in (1.0, -1.0)} | {1.0}
    assert all(abs(d.velocity) < math.radians(1.1) for d in dropped)
    _, notes = sliding_points(fine)
    assert "20 degrees or a fifth" in notes[0]
    left = next(note for note in notes if note.startswith("Left out"))
    assert "-0.017" in left
    assert "lasts less than 0.2 s" in left or "swings" in left


def test_its_curve_holds_the_truth_with_intervals_that_a_torque_can_have(fine: Record) -> None:
    points, _ = sliding_points(fine)
    result = identify_sliding(points, LUGRE, starts=6)
    assert held(result) == list(TRUTH)
    assert result.not_identified == ()
    assert result["fc"].value == pytest.approx(1.0, rel=1e-3)
    # The loop averages to 1e-5 of the torque; no torque is known that well.
    assert result["fc"].std > 5e-5


def test_a_coarse_encoder_shows_slow_levels_over_seconds(coarse: Record) -> None:
    points, _ = sliding_points(coarse)
    assert np.min(np.abs(points.velocity)) < math.radians(2.2)
    result = identify_sliding(points, LUGRE, starts=6)
    assert held(result) == list(TRUTH)
    assert result["fc"].identified
    assert result["sigma2"].identified
    assert "spread within each segment" in result.details["noise_source"]


def test_what_depends_on_the_angle_counts_as_the_doubt_of_less_than_a_revolution() -> None:
    """Cogging of a tenth of the friction: a level of 8 degrees sees one side of a tooth."""
    record = staircase((2.0, 5.0, 20.0, 100.0, 200.0), cogging=0.1, seed=1)
    points, notes = sliding_points(record)
    assert points.std is not None
    truth = np.sign(points.velocity) * (
        TRUTH["fc"] + 0.2 * np.exp(-((points.velocity / 0.1) ** 2)) + 0.35 * np.abs(points.velocity)
    )
    off = np.abs(points.torque - truth) / points.std
    assert float(np.max(np.abs(points.torque - truth))) > 0.05
    assert float(np.sqrt(np.mean(off**2))) < 1.6
    assert any("adds to their uncertainty" in note for note in notes)


def test_a_static_torque_without_evidence_is_not_identified(fine: Record) -> None:
    """Levels above the Stribeck velocity only: F_S was 6.9e15 N·m and more."""
    points, _ = sliding_points(fine)
    fast = points.only(np.abs(points.velocity) > 0.8)
    start = Model("lugre", sigma0=1e4, fs=1.5, fc=0.8, vs=0.4, delta_s=0.8, sigma2=0.1)
    result = identify_sliding(fast, start, starts=10)
    assert set(result.not_identified) >= {"fs", "vs", "delta_s"}
    assert result["fs"].value <= 10.0 * np.max(np.abs(fast.torque))


def test_what_acts_below_the_slowest_speed_is_extrapolated() -> None:
    """A curve that noise of 1e-9 tells in its tail: it holds only if friction goes on as the law does."""
    law = Model("stribeck_plain", fs=1.2, fc=1.0, vs=0.02, delta_s=1.0, sigma2=0.35)
    v = np.geomspace(0.1, 3.0, 16)
    torque = np.array([law.law.steady(x, law.parameters) for x in v])
    result = identify_sliding(SlidingPoints(v, torque), law, noise=1e-9, starts=4)
    for name in ("fs", "vs"):
        assert result[name].verdict.startswith("extrapolated: it acts below 0.1 rad/s")
        assert not result[name].identified
    assert result["fc"].identified
    assert result["sigma2"].identified
    # With the break-away torque the static level is measured; nothing tells the shape between.
    whole = SlidingPoints(np.append(0.0, v), np.append(1.2, torque))
    result = identify_sliding(whole, law, noise=1e-9, starts=4)
    assert result["fs"].identified
    assert result["vs"].verdict.startswith("extrapolated")


def test_the_linear_part_of_a_start_ends_whatever_the_columns() -> None:
    """A Stribeck part that has died at every speed is a column of zeros: SciPy's reflective method never came back."""
    v = np.array([0.806294, 1.073287, 1.284723, 1.455768, 2.471851, 2.859059])
    side = np.repeat([1.0, -1.0], 6)
    columns = np.column_stack([0.0 * side, side, side * np.tile(v, 2)])
    target = np.array(
        [24.46, -69.37, -250.6, -214.6, -653.4, -732.8, -613.8, -722.4, -766.1, -854.9, -1170.0, -1404.0]
    )
    lower, upper = np.array([1.4e-6, 1.4e-6, -np.inf]), np.full(3, np.inf)
    found = bounded_solution(columns, target, lower, upper)
    assert np.all(found >= lower)
    # What the zero column leaves is a straight line through the rest, where its level is at the bound.
    slope = float(columns[:, 2] @ target / (columns[:, 2] @ columns[:, 2]))
    free = np.linalg.lstsq(columns[:, 1:], target, rcond=None)[0]
    assert found[1:] == pytest.approx(free if free[0] > 0.0 else [1.4e-6, slope], rel=1e-4)


def test_a_stribeck_velocity_below_the_slowest_speed_is_extrapolated_however_flat_its_curve() -> None:
    """A shape factor of 0.4 leaves a slope at all speeds, which another curve explains as well."""
    law = Model("stribeck_plain", fs=0.32, fc=0.34, vs=0.008, delta_s=0.42, sigma2=0.0257)
    v = np.append(0.0, np.geomspace(0.02, 5.0, 16))
    torque = np.array([0.32, *(law.law.steady(x, law.parameters) for x in v[1:])])
    result = identify_sliding(SlidingPoints(v, torque), law, noise=1e-8, starts=2)
    assert {e.name for e in result.estimates if e.verdict.startswith("extrapolated")} == {"vs", "delta_s"}
    assert result["fs"].identified


def test_coulomb_and_viscous_friction_are_told_where_the_stribeck_curve_is_not() -> None:
    """Slow levels in doubt: a shape factor near 0 took the place of both; fc [0, 1.0], sigma2 [0, inf]."""
    v = np.geomspace(0.03, 4.0, 9)
    v = np.concatenate([v, -v])
    friction = np.sign(v) * (1.0 + 0.2 * np.exp(-((v / 0.04) ** 2))) + 0.35 * v
    std = np.where(np.abs(v) < 0.2, 0.05, 0.004)
    torque = friction + std * np.random.default_rng(5).standard_normal(v.size)
    result = identify_sliding(SlidingPoints(v, torque, std, absolute=True), LUGRE, starts=8)
    assert {"vs", "delta_s"} <= set(result.not_identified)
    for name in ("fc", "sigma2"):
        assert result[name].identified
        assert result[name].lower <= TRUTH[name] <= result[name].upper
