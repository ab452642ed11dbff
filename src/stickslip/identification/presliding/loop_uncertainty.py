"""Systematic errors of elements fitted to one loop: cycles that differ, time stamps, encoder counts, torque scale.

A fit to one cycle of many rows with little noise has a covariance far smaller than its true errors: the torque acted up
to half a row earlier, a count represents all positions within it, the next cycle differs, and the law's residual is
correlated from row to row. Each effect is evaluated by fitting again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.core.messages import axis_unit
from stickslip.core.record import encoder_step
from stickslip.identification.estimate import Estimate
from stickslip.identification.fit.noise import quantile
from stickslip.identification.fit.profile import inverse_information
from stickslip.identification.fit.student import student_quantile
from stickslip.identification.fit.uncertainty import RATIO, SHARE, Fit
from stickslip.identification.presliding.hysteresis import Loop, Rows, correlation_lags, fit_loop

Array = np.ndarray[Any, np.dtype[np.float64]]

LINEARITY = 1e-4
"""Least relative uncertainty of a torque."""
DRAWS = 2
"""Number of random changes of positions and torques within their counts."""
FEWEST = 2
"""Least degrees of freedom of the spread of the cycles: with two cycles, Student's quantile for one would exaggerate
the difference."""
ENDS = 1e-9
"""Relative decrease of the sum of squares at which a fit from the minimum stops."""


def add_systematic_errors(
    loop: Loop, found: Fit, cycles: Sequence[Rows], frozen: Sequence[str], options: Mapping[str, Any]
) -> tuple[Estimate, ...]:
    """Widen the intervals of a fit to the first of several cycles by its systematic errors.

    Parameters
    ----------
    loop : Loop
    found : Fit
        Fit to ``cycles[0]``.
    cycles : sequence of array
        Rows of every full cycle.
    frozen : sequence of str
        Parameters that are held.
    options : mapping
        Options of that fit: those of `stickslip.identification.presliding.hysteresis.fit_loop`.
    """
    if not found.noise.known:
        return found.estimates
    here = np.array([found.values[n] for n in found.vector.names])
    torques = np.array(["N" in p.par.unit for p in found.vector.free])
    parts = [
        correlated_half_widths(found),
        LINEARITY * np.abs(here) * math.sqrt(quantile(found.noise)) * torques,
    ]
    others = [refit(loop, found, rows, frozen, options) for rows in cycles[1:]]
    off = np.array([x - here for x in others if x is not None])
    if off.size:
        spread = np.sqrt(np.mean(np.vstack([off, 0.0 * here]) ** 2, axis=0))
        parts.append(student_quantile(max(len(off), FEWEST)) * spread)
    moved = [refit(x, found, cycles[0], frozen, options) for x in shift_torque(loop)]
    parts.append(np.max([np.abs(x - here) for x in moved if x is not None] or [0.0 * here], axis=0))
    dithered = [refit(x, found, cycles[0], frozen, options) for x in dither_counts(loop)]
    parts.append(1.96 * np.max([np.abs(x - here) for x in dithered if x is not None] or [0.0 * here], axis=0))
    extra = np.sqrt(np.sum(np.square(parts), axis=0))
    level = float(np.sqrt(np.mean(loop.torque[cycles[0]] ** 2)))
    return tuple(
        widen_interval(e, float(extra[i]), p.nonnegative, level)
        for i, (e, p) in enumerate(zip(found.estimates, found.vector.free, strict=True))
    )


def correlated_half_widths(found: Fit) -> Array:
    """Return the half-widths of 95 % intervals for residuals correlated from row to row, shape (parameters,).

    The number of residuals that count is that of correlation times in the rows. The sum of their correlation to the end
    of the data, which the covariance uses, vanishes for residuals that repeat with the cycle.
    """
    inverse, _ = inverse_information(found.optimum.jacobian)
    change = found.vector.jacobian(found.u)
    variance = np.maximum(np.einsum("ij,jk,ik->i", change, inverse, change), 0.0) * found.noise.std**2
    fewer = 1.0 + 0.5 * correlation_lags(found.optimum.residuals)
    return np.sqrt(quantile(found.noise) * fewer * variance)


def refit(
    loop: Loop, found: Fit, rows: Rows, frozen: Sequence[str], options: Mapping[str, Any]
) -> Array | None:
    """Return the values of the same fit to other rows or a changed loop; None if other parameters are then free."""
    assert found.vector.base is not None
    again, _ = fit_loop(
        loop, found.vector.base, rows, frozen=frozen, starts=found, profiles=False, tolerance=ENDS,
        **options,
    )  # fmt: skip
    if again.vector.names != found.vector.names:
        return None
    values = np.array([again.values[n] for n in found.vector.names])
    return values if np.all(np.isfinite(values)) else None


def shift_torque(loop: Loop) -> list[Loop]:
    """Return the loop with its torque half a row earlier and later: when it acted within a row is unknown."""
    half = 0.5 * float(np.median(np.diff(loop.time)))
    return [
        replace(loop, torque=np.interp(loop.time + s * half, loop.time, loop.torque)) for s in (-1.0, 1.0)
    ]


def dither_counts(loop: Loop) -> list[Loop]:
    """Return the loop with positions and torques changed within their counts; none if both are exact."""
    x, y = encoder_step(loop.position), encoder_step(loop.torque)
    if x == 0.0 and y == 0.0:
        return []
    rng, n = np.random.default_rng(0), loop.time.size
    return [
        replace(
            loop,
            position=loop.position + x * (rng.random(n) - 0.5),
            torque=loop.torque + y * (rng.random(n) - 0.5),
        )
        for _ in range(DRAWS)
    ]


def widen_interval(e: Estimate, extra: float, positive: bool, level: float) -> Estimate:
    """Return the estimate with another half-width added to its interval: in the logarithm for a positive number."""
    if not (math.isfinite(e.lower) and math.isfinite(e.upper) and math.isfinite(extra)) or extra == 0.0:
        return e
    std = math.hypot(e.std, extra / 1.96)
    if not positive:
        low, high = (
            e.value - math.hypot(e.value - e.lower, extra),
            e.value + math.hypot(e.upper - e.value, extra),
        )
        wide = 0.5 * (high - low) > SHARE * level
    elif e.lower > 0.0 and e.value > 0.0:
        part = extra / e.value
        low = e.value * math.exp(-math.hypot(math.log(e.value / e.lower), part))
        high = e.value * math.exp(min(math.hypot(math.log(e.upper / e.value), part), 700.0))
        wide = high > RATIO * low
    else:
        low, high, wide = 0.0, e.value + math.hypot(e.upper - e.value, extra), True
    if e.name.startswith("alpha["):
        high = min(high, 1.0)
    why = e.verdict
    if e.identified and wide:
        why = (
            f"cycles that differ, half a row of lag, or counts leave it between {low:.3g} and {high:.3g} "
            f"{axis_unit(e.unit)}"
        )
    return replace(e, std=std, lower=low, upper=high, identified=e.identified and not wide, verdict=why)
