"""Dependence on the angle: friction's ripple, and the torque besides friction (cogging, an offset).

At a constant speed the motor's torque is T+(theta) in one direction and T-(theta) in the other. Half their difference
is friction; half their sum does not change sign with the velocity. Both repeat every revolution (thesis 2.1.6,
4.3.1.1.2): each run is fitted by harmonics, and those that agree over the speeds are kept.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.identification.estimate import Estimate, Identification, Picture, Trace
from stickslip.identification.steady_friction.segments import Segment, constant_velocity_segments
from stickslip.machines.angle import AngleMap, harmonic_sum
from stickslip.machines.motor import Harmonics

Array = np.ndarray[Any, np.dtype[np.float64]]

HIGHEST = 30
"""Greatest order searched."""
FASTEST = 1.0
"""Fastest run that is used, rad/s: above it the loop and the axis's inertia distort the motor's torque."""
LEAST = 0.003
"""Least amplitude of a harmonic, part of the mean friction."""
SURE = 3.0
"""Standard errors over the speeds by which a harmonic must exceed zero."""
CIRCLE = np.linspace(0.0, 2.0 * math.pi, 361)


def identify_angle(
    record: Record, segments: Sequence[Segment] = (), *, torque: str = "motor_torque", fastest: float = FASTEST,
    highest: int = HIGHEST,
) -> Identification:  # fmt: skip
    """Identify the ripple and the torque besides friction from runs at constant velocities in both directions.

    Parameters
    ----------
    record : Record
        Channels ``position`` (absolute, rad), the torque's, and ``velocity_reference`` if known.
    segments : sequence of Segment
        Segments to use; those of `constant_velocity_segments` if empty.
    torque : str
        Channel of the torque.
    fastest : float
        Fastest speed used, rad/s; the slowest one if all are faster.
    highest : int
        Greatest order searched.

    Returns
    -------
    Identification
        ``ripple[n]`` and ``torque[n]``, amplitudes by order; ``details["angle"]`` is the
        `stickslip.machines.angle.AngleMap`.

    Raises
    ------
    InputError
        If no speed was run over a whole revolution in both directions.
    """
    found = list(segments) or list(constant_velocity_segments(record, torque=torque))
    pairs = paired([s for s in found if s.revolutions > 0])
    if not pairs:
        raise InputError(
            "no speed was run over a whole revolution in both directions; run 380 degrees forth and back"
        )
    slow = [v for v in pairs if v <= fastest] or [min(pairs)]
    halves = [_halves(record, pairs[v], torque, highest) for v in slow]
    level = np.array([h[0, 0] for h in halves])
    friction = np.array([h[0] / h[0, 0] for h in halves])
    beside = np.array([h[1] for h in halves])
    mean = float(np.mean(level))
    ripple = _kept(friction, LEAST, highest)
    rest = _kept(beside, LEAST * mean, highest)
    angle = AngleMap(ripple, rest, float(np.mean(beside[:, 0])))
    estimates = (
        *_estimates("ripple", "-", "a", ripple, friction, highest),
        *_estimates("torque", "N·m", "T", rest, beside, highest),
    )
    left = _misfit(record, [s for v in slow for s in pairs[v]], torque, angle)
    notes = [
        f"{len(slow)} speeds up to {max(slow):g} rad/s, both directions; friction varies by "
        f"{100.0 * ripple.peak_to_peak():.3g} % peak to peak over a revolution, the torque offset by "
        f"{rest.peak_to_peak():.3g} N·m about {angle.offset:.3g} N·m.",
    ]
    return Identification(
        "angle", None, estimates, np.eye(len(estimates)), {"rms_Nm": left}, tuple(notes), (),
        (_picture(record, pairs[slow[-1]], torque, angle, float(level[-1])),), {"angle": angle},
    )  # fmt: skip


def paired(segments: Sequence[Segment]) -> dict[float, tuple[Segment, Segment]]:
    """Return the positive and negative run of each speed (to 2 digits), the fastest first."""
    by: dict[float, dict[bool, Segment]] = {}
    for s in segments:
        by.setdefault(float(f"{abs(s.velocity):.2g}"), {})[s.velocity > 0.0] = s
    whole = {v: (d[True], d[False]) for v, d in by.items() if len(d) == 2}
    return dict(sorted(whole.items(), reverse=True))


def _rows(record: Record, s: Segment, torque: str) -> tuple[Array, Array]:
    inside = (record.time >= s.start) & (record.time <= s.end)
    return record["position"][inside], record[torque][inside]


def _halves(record: Record, pair: tuple[Segment, Segment], torque: str, highest: int) -> Array:
    """Return the coefficients of half the difference and half the sum, shape (2, 1 + 2 highest)."""
    one, other = (_coefficients(*_rows(record, s, torque), highest) for s in pair)
    return np.array([0.5 * (one - other), 0.5 * (one + other)])


def _coefficients(angle: Array, torque: Array, highest: int) -> Array:
    """Return the mean, then cosine and sine of every order, shape (1 + 2 highest,)."""
    if angle.size < 4 * highest:
        raise InputError(
            f"a revolution of {angle.size} samples does not show order {highest}; record more, or lower `highest`"
        )
    waves = [f(n * angle) for n in range(1, highest + 1) for f in (np.cos, np.sin)]
    matrix = np.column_stack([np.ones_like(angle), *waves])
    # Over whole revolutions the columns are nearly orthogonal, so the normal equations are accurate.
    return np.asarray(np.linalg.solve(matrix.T @ matrix, matrix.T @ torque), dtype=np.float64)


def _kept(values: Array, least: float, highest: int) -> Harmonics:
    """Return the harmonics, averaged over the runs, that are large enough and agree."""
    mean = values.mean(axis=0)
    error = values.std(axis=0, ddof=1) / math.sqrt(len(values)) if len(values) > 1 else np.zeros_like(mean)
    kept: list[tuple[float, float, float]] = []
    for n in range(1, highest + 1):
        c, s = mean[2 * n - 1], mean[2 * n]
        amplitude, spread = math.hypot(c, s), math.hypot(error[2 * n - 1], error[2 * n])
        if amplitude > max(least, SURE * spread):
            kept.append((float(n), amplitude, math.atan2(-s, c)))
    orders, amplitudes, phases = zip(*kept, strict=True) if kept else ((), (), ())
    return Harmonics(orders, amplitudes, phases)


def _estimates(
    name: str, unit: str, symbol: str, found: Harmonics, values: Array, highest: int
) -> list[Estimate]:
    out: list[Estimate] = []
    for n, a in zip(found.order, found.amplitude, strict=True):
        k = 2 * int(n) - 1
        std = (
            float(np.hypot(*values[:, k : k + 2].std(axis=0, ddof=1))) / math.sqrt(len(values))
            if len(values) > 1
            else math.nan
        )
        low, high = (a - 1.96 * std, a + 1.96 * std) if math.isfinite(std) else (0.0, math.inf)
        why = "" if math.isfinite(std) else "one speed has no spread"
        out.append(Estimate(f"{name}[{n:g}]", unit, f"{symbol}_{n:g}", a, std, low, high, not why, why))
    return out


def _misfit(record: Record, segments: Sequence[Segment], torque: str, angle: AngleMap) -> float:
    """Return the RMS over all runs of the torque's variation over the revolution without the map, N·m."""
    left: list[Array] = []
    for s in segments:
        x, y = _rows(record, s, torque)
        side = math.copysign(1.0, s.velocity)
        rest = y - angle.torque(x)
        shape = side * (1.0 + harmonic_sum(angle.ripple, x))
        left.append(rest - shape * float(np.mean(rest * shape) / np.mean(shape**2)))
    return float(np.sqrt(np.mean(np.concatenate(left) ** 2)))


def _picture(
    record: Record, pair: tuple[Segment, Segment], torque: str, angle: AngleMap, level: float
) -> Picture:
    """Draw the torque over the angle at the slowest speed, both directions (thesis figures 4.6, 4.7, 4.29, 4.30)."""
    traces: list[Trace] = []
    for s, word, kind in zip(pair, ("positive", "negative"), ("points", "open points"), strict=True):
        x, y = _rows(record, s, torque)
        place = np.degrees(np.mod(x, 2.0 * math.pi))
        thin = max(1, x.size // 180)
        side = math.copysign(1.0, s.velocity)
        model = side * level * (1.0 + harmonic_sum(angle.ripple, CIRCLE)) + angle.torque(CIRCLE)
        traces.append(Trace(f"{word} velocity", place[::thin], side * y[::thin], kind))
        traces.append(Trace(f"map, {word}", np.degrees(CIRCLE), side * model))
    return Picture(
        "angle", f"Torque over the angle at {abs(pair[0].velocity):.2g} rad/s",
        f"Friction varies by {level * angle.ripple.peak_to_peak():.2g} N·m over a revolution, the torque offset by "
        f"{angle.beside.peak_to_peak():.2g} N·m",
        "angle (degrees)", "size of the torque (N·m)", tuple(traces),
    )  # fmt: skip
