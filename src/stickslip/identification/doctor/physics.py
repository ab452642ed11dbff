"""Torque and motion together: J dv/dt = T - T_f must be able to hold, and friction must brake.

A straight line in acceleration, direction and velocity, T = J a + T_c sign(v) + b v + T_0 (+ gravity), is fitted to
the filtered record (inverse dynamics; Gautier and Khalil's regression for one axis): enough to see a sign, a delay
and a load that depends on the position, whatever the law of friction.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from stickslip.core.finding import Finding
from stickslip.core.messages import name_option, name_options
from stickslip.identification.doctor.view import NEVER, Array, Smooth, View
from stickslip.identification.fit.shifts import least_between, shifts_looked_at
from stickslip.identification.fit.uncertainty import RATIO
from stickslip.readers.convert import pendulum_before_gear

ROWS = 20_000
"""Rows of a regression: more tell no more."""
FEWEST = 50
"""Rows in motion, away from the ends of the record, that a regression needs."""
QUARTER = 90.0
"""Of a turn, in degrees, that a pendulum must swing over to be told from a spring."""
IN_DEGREES, CLOSER, APART = 360.0 / math.tau, 0.5, 1.1
"""Turns of 2 pi in 360; part of what these leave of the torque below which another number of turns explains it; and by
how much that is another one."""
EXTRAPOLATED = 5.0
"""Times what the record shows of it that a torque over the turn may be: a pendulum that swings by 12 degrees to either
side shows a fifth."""
BOTH = 0.05
"""Share of the moving rows in either direction below which friction is not told from a constant torque."""
STRETCHES, SURE = 12, 3.0
"""Stretches of the jackknife of friction's work, and its standard deviations below zero that make an error."""
LATE, STROKE, EARLY = 0.12, 0.25, 0.03
"""s over which such a delay is looked for: farther only within a part of the usual stroke, so far in any case."""
BETTER = 2.0
"""Times as much that any shorter one must leave."""
SHOWS = 2.0
"""Times as much that is left without an inertia, where such a delay is told that is longer than `EARLY`."""
ROUGHLY = 0.15
"""Of one longer than `EARLY`, by which it may be wrong: wind-up and play shift reversals, too."""
MANY, CLEARLY, HARM = 9, 10.0, 1e-3
"""Rows from which on a delay that reversals alone show is told, how many times as much none must leave, and part of the
torque's variance that this must be. Play, wind-up, tuning steps and flexible trains left 3 times as much at most where
that was worth a word; at 1.25 times they made 9 false delays of 187 logs."""
WEIGHT, TOLD = 0.3, 0.25
"""Of Coulomb friction, from which on a constant torque is worth a word; and half the interval within which it is told,
of its value."""
TENTH, HELD, STRANGE, STRANGE_TIME = 0.1, 0.5, 1.5, 1.5e-3
"""Rows by which a torque acts beside its row that are worth a word; that any hold makes, and to which it must be known
if it may be one; rows and s from which on no hold explains it."""
PULLS = 0.5
"""Of the torque, that a positive inertia takes at least for its sign to be right."""
RANK = 1e-10
"""Part of the largest singular value below which a direction is not told."""


@dataclass(frozen=True, slots=True)
class Fit:
    """A fitted line: inertia, Coulomb, viscous, constant, and what follows; the share of the variance explained."""

    values: Array
    explained: float
    rest: float


def sign(view: View) -> Iterator[Finding]:
    """The work of friction over the record: it cannot be negative."""
    smooth = usable(view)
    if smooth is None:
        return
    measured = view.torque_channel == "friction_torque"
    turned = view.mapped(view.torque_channel, "-")
    if not _both_ways(smooth) and not measured:
        yield from _one_way(smooth, view, turned)
        return
    fit = _fit(smooth, 0, measured=measured)
    braked, doubt = _braking(smooth, measured=measured)
    exchanged = float(np.mean(np.abs(smooth.torque * smooth.velocity)))
    if not exchanged > 0.0 or fit.explained < 0.2 or not braked + SURE * doubt < -0.1 * exchanged:
        return
    pull = fit.values[0] * float(np.sqrt(np.mean(smooth.acceleration**2)))
    if not measured and pull > PULLS * float(np.sqrt(np.mean(smooth.torque**2))):
        return  # Of a turned torque the inertia would be negative: this one acts late.
    if measured:
        message = "friction is negative where the velocity is positive: it is the force on the moving body"
        remedy = f"say {turned}: here friction opposes positive velocity"
        yield Finding("warning", "torque-sign", message, remedy=remedy)
        return
    also = " and the inertia would be negative" if fit.values[0] < 0.0 else ""
    message = f"friction would drive the axis: its work over the record is negative{also}"
    remedy = (
        f"say {turned}, if positive torque drives backwards, or {name_option('accept', 'torque-sign')} if you "
        "know it is right"
    )
    yield Finding("error", "torque-sign", message, remedy=remedy)


def _both_ways(smooth: Smooth) -> bool:
    """Whether friction is told from a constant torque: the axis moves in both directions."""
    return BOTH < float(np.mean(smooth.velocity[smooth.moving] > 0.0)) < 1.0 - BOTH


def _one_way(smooth: Smooth, view: View, turned: str) -> Iterator[Finding]:
    """Where the axis moves one way only, friction and a load that drives it are one constant: no more than doubts."""
    power = smooth.torque * smooth.velocity
    stops = abs(smooth.velocity[-1]) < 0.5 * abs(smooth.velocity[0])
    if float(np.mean(power)) < -0.5 * float(np.mean(np.abs(power))) and not stops:
        only = "one way only" if min(smooth.travel) < NEVER * max(smooth.travel) else "nearly one way only"
        message = f"the axis moves {only}, and the torque brakes it: a load drives it, or the sign is wrong"
        yield Finding(
            "warning", "torque-sign", message, remedy=f"say {turned}, if positive torque drives backwards"
        )


def _braking(smooth: Smooth, *, measured: bool) -> tuple[float, float]:
    """Mean power that friction takes over the moving rows, and its standard deviation: a jackknife over stretches."""
    rows = _rows(smooth)
    v = smooth.velocity[rows]
    matrix = _matrix(smooth, rows, measured=measured)
    weights = np.zeros(matrix.shape[1])
    weights[1:3] = np.mean(np.abs(v)), np.mean(v * v)
    torque = smooth.torque[rows]

    def power(without: int) -> float:
        """Without one of the stretches; with all where that is negative."""
        kept = stretch != without
        x: Array = matrix[kept]
        values: Array = np.linalg.pinv(x.T @ x) @ (x.T @ torque[kept])
        return float(weights @ values)

    stretch = np.arange(v.size) * STRETCHES // v.size
    spread = math.sqrt((STRETCHES - 1) * float(np.var([power(k) for k in range(STRETCHES)])))
    return power(-1), spread


def skew(view: View) -> Iterator[Finding]:
    """Compare the torque's delay in gross sliding with that of drives: a note, and a warning if no drive has it."""
    smooth = usable(view)
    if smooth is None:
        return
    late, half, row, shows, sure = _skew_in_sliding(view)
    # Many rows at once look like no delay to sliding, and like nothing else to reversals.
    if (at_reversals := _skew_at_reversals(smooth)) is not None:
        late, sure = at_reversals, True
        half = ROUGHLY * abs(late) if abs(late) > EARLY else smooth.period
    if not (shows or sure):
        return
    told, beyond = f"{abs(late) * 1e3:.3g} ms (±{half * 1e3:.2g})", abs(late) - half
    if sure and beyond > max(STRANGE * row, STRANGE_TIME):
        words = (
            "torque comes after the motion it causes" if late > 0.0
            else "motion comes later than the torque that causes it"
        )  # fmt: skip
        message = f"torque and motion fit best when shifted by {told}: {words}"
        remedy = "log both from one clock; identify allows for it where sliding shows it to half a row"
        yield Finding("warning", "time-skew", message, remedy=remedy)
    elif (half <= HELD * row and beyond > 0.0 and abs(late) >= TENTH * row) or (sure and beyond > HELD * row):
        where = "after" if late < 0.0 else "before"
        message = f"the torque acted {told} {where} its row on average, {abs(late) / row:.2g} of a row"
        remedy = "identify allows for it" if half <= HELD * row else "log both from one clock"
        yield Finding("note", "torque-timing", message, remedy=remedy)


def _skew_in_sliding(view: View) -> tuple[float, float, float, bool, bool]:
    """Delay, its half-width and the row, s; whether something accelerates, which alone tells it, and surely."""
    if (found := view.sliding) is None:
        return 0.0, math.inf, view.period, False, False
    number, inertia = found.numbers["skew"], found.numbers["inertia"]
    shows = inertia.lower > 0.0
    return number.value, number.half, found.period, shows, shows and inertia.upper <= RATIO * inertia.lower


def _skew_at_reversals(smooth: Smooth) -> float | None:
    """The delay of many rows at which reversals of torque and motion fit, s, where nothing else fits by far; else None.

    Play, wind-up, ringing and a feedforward shift reversals too, but none fits them ten times as well as no delay.
    """
    reach = _reach(smooth)
    if _inside(smooth, reach).size < FEWEST:
        return None
    shifts, rests = shifts_looked_at(lambda these: _rests(smooth, these, reach), reach, 30)
    best = int(np.argmin(rests))
    least = max(CLEARLY * float(rests[best]), HARM * float(np.var(smooth.torque)))
    if abs(shifts[best]) < MANY or best in (0, shifts.size - 1) or rests[shifts == 0][0] < least:
        return None
    shift, rest = int(shifts[best]), float(rests[best])
    # While it stands its torque turns unseen: of a shift within that, only what accelerates the axis tells.
    unseen = abs(shift) < smooth.standstill and not _accelerates(smooth, shift, rest, reach)
    late = shift * smooth.period
    return None if unseen or (abs(late) > EARLY and not _is_far(smooth, shift, rest, reach)) else late


def _is_far(smooth: Smooth, shift: int, rest: float, reach: int) -> bool:
    """Whether a shift beyond `EARLY`, which leaves `rest`, is one: neither a shorter one nor dwelling explains it."""
    near = int(EARLY / smooth.period) + 1
    shorter = shifts_looked_at(lambda these: _rests(smooth, these, reach), near, 30)
    # A shake fits itself some periods later.
    if BETTER * rest > least_between(*shorter):
        return False
    return _accelerates(smooth, shift, rest, reach)


def _accelerates(smooth: Smooth, shift: int, rest: float, reach: int) -> bool:
    """Whether a shift that leaves `rest` shows an inertia: where the axis dwells at every reversal its torque turns
    late, too; what accelerates it does not."""
    return bool(_rests(smooth, [shift], reach, accelerates=False)[0] >= SHOWS * rest)


def _reach(smooth: Smooth) -> int:
    """Samples over which a delay is looked for: no more than a part of a stroke, which would fit the one before."""
    sides = np.sign(smooth.velocity[smooth.moving])
    strokes = 1 + np.count_nonzero(np.diff(sides))
    stroke = np.count_nonzero(smooth.moving) / strokes
    most = max(min(LATE / smooth.period, STROKE * stroke), min(EARLY / smooth.period, 60.0), MANY + 1.0)
    return int(min(most, smooth.velocity.size // 8))


def gravity(view: View) -> Iterator[Finding]:
    """A mean torque that comes back with every turn: gravity; or a constant one."""
    smooth = usable(view)
    if smooth is None or view.torque_channel != "motor_torque":
        return
    plain = _fit(smooth, 0)
    if view.record.units.get("position") == "rad":
        drive: dict[str, Any] = view.record.meta.get("reading", {}).get("drive", {})
        unit = view.record.units["motor_torque"]
        own, rest = _once_a_turn(smooth, plain, 1.0)
        behind, left = _once_a_turn(smooth, plain, float(drive.get("gear_ratio", 1.0)))
        told = f"the mean torque depends on the load's angle: {behind:.3g} {unit} once a turn of the load"
        if behind and left < rest and (geared := pendulum_before_gear(view.record, told)):
            yield from geared
            return
        if own:
            message = f"the mean torque depends on the angle: {own:.3g} {unit} once a turn, as gravity does"
            yield Finding(
                "warning",
                "gravity",
                message,
                remedy=f"identify with {name_option('pendulum', True)}, or turn the axis upright",
            )
            return
        if _hangs_in_degrees(smooth, min(plain.rest, rest)):
            yield _degrees_or_gear(view, smooth)
            return
    yield from _offset(view, smooth, plain)


def _once_a_turn(smooth: Smooth, plain: Fit, turns: float) -> tuple[float, float]:
    """Amplitude of a torque that comes back after so many turns of the position, 0 where it does not or where the
    record shows little of it; and what that leaves."""
    size = float(np.std(smooth.torque))
    if not np.ptp(smooth.position) > 0.5 * turns or size == 0.0:
        return 0.0, plain.rest
    full = _fit(smooth, 0, periodic=True, turn=turns * math.tau)
    rows = _rows(smooth)
    shows = full.explained > 0.5 and _shows_turn(smooth, rows, plain, full, turns)
    # Friction that builds up behind a reversal makes the mean of both directions rise over a short way, too: a weight
    # acts where that is over.
    beyond = rows[smooth.gone_on[rows]]
    if shows and beyond.size >= FEWEST and np.ptp(smooth.position) < turns * math.tau:
        line, wave = (_fit(smooth, 0, periodic=p, turn=turns * math.tau, rows=beyond) for p in (False, True))
        shows = _shows_turn(smooth, beyond, line, wave, turns)
    return (math.hypot(full.values[4], full.values[5]) if shows else 0.0), full.rest


def _shows_turn(smooth: Smooth, rows: Any, plain: Fit, full: Fit, turns: float) -> bool:
    """Whether a torque once in so many turns explains what a line leaves in some rows, and these show much of it."""
    size, amplitude = float(np.std(smooth.torque)), math.hypot(full.values[4], full.values[5])
    angle = smooth.position[rows] / turns
    # Of a short part of a turn any bend of the torque makes a wave, with the constant torque against it.
    seen = 0.5 * float(np.ptp(full.values[4] * np.sin(angle) + full.values[5] * np.cos(angle)))
    shows = full.rest < 0.7 * plain.rest and 0.1 * size < amplitude < 20.0 * size
    return shows and seen > max(0.1 * size, amplitude / EXTRAPOLATED)


def _offset(view: View, smooth: Smooth, plain: Fit) -> Iterator[Finding]:
    """Compare a constant torque with Coulomb friction from gross sliding, or else with the whole torque."""
    offset, part, found = plain.values[3], "", view.sliding
    weighs = abs(offset) > WEIGHT * float(np.std(smooth.torque)) and plain.explained > 0.5
    large = weighs and _both_ways(smooth)
    if found is not None:
        level = found.numbers["fc"]
        coulomb = level.value
        if level.half < TOLD * coulomb:
            offset = found.numbers["offset"].value
            large = abs(offset) > WEIGHT * coulomb
            part = f", {100 * abs(offset) / coulomb:.0f} % of Coulomb friction"
    if large:
        message = f"the torque has a constant part of {offset:.3g} {view.record.units['motor_torque']}{part}"
        remedy = (
            "a weight, a spring, an offset of the sensor, which is identified along, or friction that differs by "
            f"direction (identify {name_option('per_direction', True)})"
        )
        yield Finding("note", "offset", message, remedy=remedy)


def usable(view: View) -> Smooth | None:
    """The filtered record, where it has torque and moves, away from its ends."""
    smooth = view.smooth
    if smooth is None or not smooth.torque.size or smooth.fast <= 0.0:
        return None
    enough = _inside(smooth).size >= FEWEST and float(np.std(smooth.torque)) > 0.0
    return smooth if enough else None


def line_of(smooth: Smooth) -> Fit:
    """Inertia, Coulomb, viscous and constant part of the torque while it moves."""
    return _fit(smooth, 0)


def _hangs_in_degrees(smooth: Smooth, rest: float) -> bool:
    """Whether the torque is that of a pendulum whose angle is in degrees: on the way forth and on the way back."""
    forth = float(np.mean(smooth.velocity[smooth.moving] > 0.0))
    if np.ptp(smooth.position) < QUARTER or not 0.2 < forth < 0.8:
        return False
    fit = _fit(smooth, 0, periodic=True, turn=360.0)
    amplitude, size = math.hypot(fit.values[4], fit.values[5]), float(np.std(smooth.torque))
    return fit.rest < 0.2 * rest and fit.explained > 0.9 and 0.1 * size < amplitude < 20.0 * size


def _degrees_or_gear(view: View, smooth: Smooth) -> Finding:
    """Of a torque that comes back as a pendulum's whose angle is in degrees may: whether a gear explains it better, or
    as well, since the motor's angle is the load's times its ratio."""
    far = float(np.ptp(smooth.position)) / (QUARTER / 360.0 * math.tau)
    # A step is the ratio by which a pendulum over a turn leaves a hundredth of its torque.
    ratios: Array = np.geomspace(1.5, max(far, 2.0 * IN_DEGREES), 150)
    rests = [_fit(smooth, 0, periodic=True, turn=n * math.tau).rest for n in ratios]
    best = float(ratios[int(np.argmin(rests))])
    fine: Array = np.linspace(best / 1.04, 1.04 * best, 41)
    rests = [_fit(smooth, 0, periodic=True, turn=n * math.tau).rest for n in fine]
    best, least = float(fine[int(np.argmin(rests))]), min(rests)
    seen = name_options(gear_ratio=f"{best:.3g}", side="load", pendulum=True)
    other = not 1.0 / APART < best / IN_DEGREES < APART
    if other and least < CLOSER * _fit(smooth, 0, periodic=True, turn=360.0).rest:
        turns = f"{best * math.tau:.4g} rad, {best:.3g} turns"
        message = f"the mean torque comes back with {turns}: a pendulum behind a gear?"
        return Finding("warning", "gravity", message, remedy=f"identify with {seen}, if such a gear is there")
    message = (
        f"the mean torque comes back with 360, as gravity does with a turn: degrees rather than rad, or the motor's "
        f"angle before a gear of about {best:.2g}"
    )
    remedy = f"say {view.mapped('position', 'deg')} if it is in degrees, or identify with {seen}"
    return Finding("warning", "position-unit", message, remedy=remedy)


def _fit(
    smooth: Smooth, shift: int, *, periodic: bool = False, measured: bool = False, turn: float = 2.0 * math.pi,
    rows: Any = None,
) -> Fit:  # fmt: skip
    """Least squares over the rows that move, or some of them, with the torque taken `shift` samples later; `turn` is
    one of the position in its unit."""
    rows = _rows(smooth) if rows is None else rows
    matrix = _matrix(smooth, rows, measured=measured)
    if periodic:
        angle = 2.0 * math.pi / turn * smooth.position[rows]
        matrix = np.column_stack([matrix, np.sin(angle), np.cos(angle)])
    size = _sizes(matrix)
    torque = smooth.torque[rows + shift]
    solved = cast("tuple[Array, ...]", np.linalg.lstsq(matrix / size, torque, rcond=RANK))
    values = solved[0]
    rest = float(np.mean((torque - matrix @ (values / size)) ** 2))
    spread = float(np.var(torque))
    return Fit(values / size, 1.0 - rest / spread if spread > 0.0 else 0.0, rest)


def _rests(smooth: Smooth, shifts: Iterable[int], reach: int = 60, *, accelerates: bool = True) -> Array:
    """`Fit.rest` with the torque taken so many samples later, at most `reach`, shape (shifts,); with an inertia or
    without."""
    rows = _rows(smooth, reach)
    matrix = _matrix(smooth, rows, measured=False)[:, 0 if accelerates else 1 :]
    basis, sizes, _ = np.linalg.svd(matrix / _sizes(matrix), full_matrices=False)
    basis = basis[:, sizes > RANK * sizes[0]]
    torques = np.stack([smooth.torque[rows + k] for k in shifts])
    left = torques - (torques @ basis) @ basis.T
    return np.asarray(np.mean(left**2, axis=1))


def _sizes(matrix: Array) -> Array:
    """Root mean squares of the columns, 1 for those that are 0."""
    size: Array = np.sqrt(np.mean(matrix**2, axis=0))
    return np.where(size == 0.0, 1.0, size)


def _rows(smooth: Smooth, reach: int = 60) -> Any:
    """No more of `_inside` than are needed."""
    rows = _inside(smooth, reach)
    return rows[:: max(1, rows.size // ROWS)]


def _inside(smooth: Smooth, reach: int = 60) -> Any:
    """Rows that move, so many away from the ends."""
    count = smooth.velocity.size
    edge = min(max(reach, 60), count // 8)
    return np.flatnonzero(smooth.moving[edge : count - edge]) + edge


def _matrix(smooth: Smooth, rows: Any, *, measured: bool) -> Array:
    """Acceleration, direction, velocity, one."""
    v = smooth.velocity[rows]
    inertia = np.zeros_like(v) if measured else smooth.acceleration[rows]
    return np.stack([inertia, np.sign(v), v, np.ones_like(v)], axis=1)
