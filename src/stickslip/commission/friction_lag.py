"""The attraction parameter C of GMS from the lag of friction behind a velocity that swings without reversing.

The thesis describes it so (3.1.3.2.4.2), had no use of its record, since friction varied too much with the angle, and
took C by a rule (4.3.1.1.5). Here what depends on the angle is known and taken out. An error of the inertia is fitted
along. A lag of the measured torque by two samples (hold, converters, bearings that do not lag) is not told from that of
friction: what is said of C holds with it and without.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.identification.estimate import Estimate, Identification, Picture, Trace
from stickslip.identification.presliding.hysteresis import Loop, correlation_lags
from stickslip.machines.angle import AngleMap, harmonic_sum
from stickslip.models.model import Model
from stickslip.simulation.prescribed.motion import Along

Array = np.ndarray[Any, np.dtype[np.float64]]

LAGS = np.geomspace(0.5, 1e-4, 81)
"""Lags of friction that are looked at, s: C is the torque over the lag."""
SKIPPED = 0.2
"""Of the record, at its start: the transient."""
ALIVE = 0.25
"""Of the mean velocity, below which the axis may have stuck between two samples of the record."""
SKEW = 2.0
"""Samples by which torque and motion may be apart. On thesis-grease (C = 35 N·m/s) commissioning's own curve has its
least misfit at 47 N·m/s: 1.5 ms less lag."""
CHI = 3.84
"""95 % quantile of chi-square with one degree of freedom."""
RATIO = 2.0
"""Upper over lower bound up to which C is identified."""


def friction_of(record: Record, inertia: float, angle: AngleMap) -> tuple[Loop, Array]:
    """The mean friction of a revolution along a motion: without inertia, ripple, and what acts beside; acceleration."""
    place, velocity = record["position"], record["velocity"]
    acceleration = np.gradient(velocity, record.time)
    torque = record["motor_torque"] - inertia * acceleration - angle.torque(place)
    friction = torque / (1.0 + harmonic_sum(angle.ripple, place))
    return Loop(record.time, place, friction, velocity=velocity), acceleration


def lag_of(
    record: Record, inertia: float, angle: AngleMap, model: Model, sample_time: float
) -> Identification:
    """Which C the record allows.

    Parameters
    ----------
    record : Record
        Of `stickslip rig run attraction`, with its velocity.
    inertia : float
        kg·m²
    angle : AngleMap
    model : Model
        GMS with its springs and sliding curve; its C is not looked at.
    sample_time : float
        Of the rig, s; `SKEW` of them its torque may be too early or too late.

    Returns
    -------
    Identification
        ``c`` with its range of 95 %, from 0 or to infinity where the record sets no limit.

    Raises
    ------
    InputError
        If the velocity nearly reverses.
    """
    loop, acceleration = friction_of(record, inertia, angle)
    assert loop.velocity is not None
    rows = np.arange(round(SKIPPED * loop.time.size), loop.time.size)
    least, mean = float(np.min(loop.velocity[rows])), float(np.mean(loop.velocity[rows]))
    if least < ALIVE * mean:
        raise InputError(
            f"the velocity falls to {least:.2g} rad/s of {mean:.2g}; C needs a motion in one direction "
            "(thesis eq. 3.22)"
        )
    beside = np.column_stack([np.ones(rows.size), loop.velocity[rows], acceleration[rows]])
    plain, _ = np.linalg.qr(beside / np.linalg.norm(beside, axis=0))
    level = float(np.mean(loop.torque[rows]))
    tried = level / LAGS
    left: list[Array] = []
    for c in tried.tolist():
        own = Model(model.law, {}, **{**as_lists(model), "c": c})
        rest = (loop.torque - Along(model.law, loop.time, loop.position, loop.velocity).of(own))[rows]
        left.append(rest - plain @ (plain.T @ rest))
    squares = np.array([float(r @ r) for r in left])
    best = int(np.argmin(squares))
    independent = rows.size / max(1, correlation_lags(left[best]))
    allowed = squares <= squares[best] * (1.0 + CHI / max(independent - 4.0, 1.0))
    skew = SKEW * sample_time
    low, high = level / (float(LAGS[allowed][0]) + skew), level / max(float(LAGS[allowed][-1]) - skew, 1e-9)
    low, high = 0.0 if allowed[0] else low, math.inf if high > tried[-1] else high
    why = "" if high <= RATIO * low else f"the record allows {told(low, high)}"
    found = Estimate("c", "N·m/s", "C", float(tried[best]), math.nan, low, high, not why, why)
    rms = np.sqrt(squares / rows.size)
    allows = told(low, high)
    note = (
        f"The lag of friction behind the velocity allows for C: {allows}; least misfit at {found.value:.3g}."
    )
    return Identification(
        "attraction", None, (found,), np.eye(1), {"rms_Nm": float(rms[best])}, (note,), (),
        (_picture(tried, rms, allowed, f"The record allows {allows}"),),
    )  # fmt: skip


def told(low: float, high: float) -> str:
    """A range of C for people."""
    if low == 0.0 and math.isinf(high):
        return "any value"
    if math.isinf(high):
        return f"{low:.3g} N·m/s and more"
    return f"{low:.3g} to {high:.3g} N·m/s" if low > 0.0 else f"{high:.3g} N·m/s and less"


def as_lists(model: Model) -> dict[str, Any]:
    """Parameters as `Model` takes them."""
    values: dict[str, Any] = model.parameters._asdict()
    return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}  # type: ignore[reportUnknownArgumentType]


def _picture(tried: Array, rms: Array, allowed: Any, message: str) -> Picture:
    """Misfit over C."""
    traces = (
        Trace("misfit", tried, 1e3 * rms),
        Trace("within 95 %", tried[allowed], 1e3 * rms[allowed], "points"),
    )
    return Picture(
        "attraction", "Lag of friction in sliding", message, "C (N·m/s)",
        "misfit (mN·m RMS)", traces, "log",
    )  # fmt: skip
