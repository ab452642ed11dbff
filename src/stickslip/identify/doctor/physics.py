"""Torque and motion together: J dv/dt = T - T_f must be able to hold, and friction must brake.

A straight line in acceleration, direction and velocity, T = J a + T_c sign(v) + b v + T_0 (+ gravity), is fitted to
the filtered record (inverse dynamics; Gautier and Khalil's regression for one axis): enough to see a sign, a delay
and a load that depends on the position, whatever the law of friction.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np

from stickslip.finding import Finding
from stickslip.identify.doctor._view import Array, Smooth, View

__all__ = ["gravity", "sign", "skew"]

ROWS = 20_000
"""Rows of a regression: more tell no more."""
QUARTER = 90.0
"""Of a turn, in degrees, that a pendulum must swing over to be told from a spring."""
HARM = 5e-6
"""Of the torque's variance, that a delay must leave unexplained to be told: less spoils nothing."""


@dataclass(frozen=True, slots=True)
class Fit:
    """A fitted line: inertia, Coulomb, viscous, constant, and what follows; the share of the variance explained."""

    values: Array
    explained: float
    rest: float


def sign(view: View) -> Iterator[Finding]:
    """The work of friction over the record: it cannot be negative."""
    smooth = _usable(view)
    if smooth is None:
        return
    measured = view.torque_channel == "friction_torque"
    fit = _fit(smooth, 0, measured=measured)
    inertia, coulomb, viscous = (float(value) for value in fit.values[:3])
    moving: Array = np.abs(smooth.velocity[smooth.moving])
    braked = float(np.mean(coulomb * moving + viscous * moving**2))
    exchanged = float(np.mean(np.abs(smooth.torque * smooth.velocity)))
    if exchanged <= 0.0 or fit.explained < 0.2:
        return
    if braked < -0.1 * exchanged:
        also = " and the inertia would be negative" if inertia < 0.0 and not measured else ""
        message = f"friction would drive the axis: its work over the record is negative{also}"
        channel = view.torque_channel
        turned = view.mapped(channel, "-")
        if measured:
            message = (
                "friction is negative where the velocity is positive: it is the force on the moving body"
            )
            yield Finding(
                "warning",
                "torque-sign",
                message,
                remedy=f"say {turned}: here friction opposes positive velocity",
            )
        else:
            yield Finding(
                "error", "torque-sign", message, remedy=f"say {turned}, if positive torque drives backwards"
            )


def skew(view: View) -> Iterator[Finding]:
    """The delay between torque and motion at which they fit best."""
    smooth = _usable(view)
    if smooth is None or view.torque_channel != "motor_torque":
        return
    reach = int(min(max(0.03 / smooth.period, 10), 60, smooth.velocity.size // 8))
    shifts = range(-reach, reach + 1)
    rests = np.array([_fit(smooth, k).rest for k in shifts])
    best = int(np.argmin(rests))
    shift = best - reach
    fit = _fit(smooth, shift)
    known = abs(shift) >= 2 and abs(shift) * smooth.period >= _edge(smooth, view.step)
    spoils = rests[reach] >= 1.25 * rests[best] and rests[reach] - rests[best] >= HARM * float(
        np.var(smooth.torque)
    )
    if not (known and spoils) or best in (0, 2 * reach) or fit.explained < 0.8:
        return
    late = (
        "torque comes after the motion it causes"
        if shift > 0
        else "motion comes later than the torque that causes it"
    )
    message = f"torque and motion fit best when shifted by {abs(shift) * smooth.period * 1e3:.3g} ms: {late}"
    yield Finding("warning", "time-skew", message, remedy="shift the torque, or log both from one clock")


def gravity(view: View) -> Iterator[Finding]:
    """A mean torque that comes back with every turn: gravity; or a constant one."""
    smooth = _usable(view)
    if smooth is None or view.torque_channel != "motor_torque":
        return
    plain = _fit(smooth, 0)
    size = float(np.std(smooth.torque))
    if view.record.units.get("position") == "rad" and np.ptp(smooth.position) > 0.5 and size > 0.0:
        full = _fit(smooth, 0, periodic=True)
        amplitude = math.hypot(full.values[4], full.values[5])
        if full.rest < 0.7 * plain.rest and 0.1 * size < amplitude < 20.0 * size and full.explained > 0.5:
            unit = view.record.units["motor_torque"]
            message = (
                f"the mean torque depends on the angle: {amplitude:.3g} {unit} once a turn, as gravity does"
            )
            yield Finding(
                "warning", "gravity", message, remedy="identify with gravity, or turn the axis upright"
            )
            return
        if _hangs_in_degrees(smooth, min(plain.rest, full.rest)):
            message = (
                "the mean torque comes back with 360, as gravity does with a turn: degrees rather than rad"
            )
            yield Finding("warning", "position-unit", message, remedy=f"say {view.mapped('position', 'deg')}")
            return
    offset, coulomb = plain.values[3], abs(plain.values[1])
    if coulomb > 0.0 and abs(offset) > 0.3 * coulomb and plain.explained > 0.5:
        unit = view.record.units["motor_torque"]
        message = (
            f"the torque has a constant part of {offset:.3g} {unit}, {100 * abs(offset) / coulomb:.0f} % of"
            " Coulomb friction"
        )
        yield Finding(
            "note",
            "offset",
            message,
            remedy="a weight, a spring or an offset of the sensor; identify it along",
        )


def _usable(view: View) -> Smooth | None:
    """The filtered record, where it has torque and moves."""
    smooth = view.smooth
    if smooth is None or not smooth.torque.size or smooth.fast <= 0.0:
        return None
    enough = np.count_nonzero(smooth.moving) >= 50 and float(np.std(smooth.torque)) > 0.0
    return smooth if enough else None


def _hangs_in_degrees(smooth: Smooth, rest: float) -> bool:
    """Whether the torque is that of a pendulum whose angle is in degrees: on the way forth and on the way back."""
    forth = float(np.mean(smooth.velocity[smooth.moving] > 0.0))
    if np.ptp(smooth.position) < QUARTER or not 0.2 < forth < 0.8:
        return False
    fit = _fit(smooth, 0, periodic=True, turn=360.0)
    amplitude, size = math.hypot(fit.values[4], fit.values[5]), float(np.std(smooth.torque))
    return fit.rest < 0.2 * rest and fit.explained > 0.9 and 0.1 * size < amplitude < 20.0 * size


def _edge(smooth: Smooth, step: float) -> float:
    """The time within which the axis turns round inside one step of its encoder, s: no edge is known better."""
    slow = smooth.moving & (np.abs(smooth.velocity) < 0.5 * smooth.fast)
    turning = float(np.sqrt(np.mean(smooth.acceleration[slow] ** 2))) if np.any(slow) else 0.0
    return math.sqrt(step / turning) if turning > 0.0 else 0.0


def _fit(
    smooth: Smooth, shift: int, *, periodic: bool = False, measured: bool = False, turn: float = 2.0 * math.pi
) -> Fit:
    """Least squares over the rows that move, with the torque taken `shift` samples later; `turn` is one of the position
    in its unit."""
    count = smooth.velocity.size
    edge = min(60, count // 8)
    rows = np.flatnonzero(smooth.moving[edge : count - edge]) + edge
    rows = rows[:: max(1, rows.size // ROWS)]
    v = smooth.velocity[rows]
    inertia = np.zeros_like(v) if measured else smooth.acceleration[rows]
    parts = [inertia, np.sign(v), v, np.ones_like(v)]
    if periodic:
        angle = 2.0 * math.pi / turn * smooth.position[rows]
        parts += [np.sin(angle), np.cos(angle)]
    matrix: Array = np.stack(parts, axis=1)
    size: Array = np.sqrt(np.mean(matrix**2, axis=0))
    size[size == 0.0] = 1.0
    torque = smooth.torque[rows + shift]
    solved = cast("tuple[Array, ...]", np.linalg.lstsq(matrix / size, torque, rcond=1e-10))
    values = solved[0]
    rest = float(np.mean((torque - matrix @ (values / size)) ** 2))
    spread = float(np.var(torque))
    return Fit(values / size, 1.0 - rest / spread if spread > 0.0 else 0.0, rest)
