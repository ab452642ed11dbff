"""Torque and motion together: J dv/dt = T - T_f must be possible, and friction must dissipate.

A line in acceleration, direction and velocity, T = J a + T_c sign(v) + b v + T_0 (+ gravity), is fitted to the filtered
record (inverse dynamics; Gautier and Khalil's regression for one axis): enough to detect a wrong sign, a delay and a
load that depends on the position, whatever the law of friction.
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
"""Most rows of a regression: more add no information."""
FEWEST = 50
"""Fewest rows in motion, away from the ends of the record, for a regression."""
QUARTER = 90.0
"""Least swing of a pendulum, degrees, to distinguish it from a spring."""
IN_DEGREES, CLOSER, APART = 360.0 / math.tau, 0.5, 1.1
"""Turns of 2 pi in 360; residual relative to these below which another number of turns explains the torque; and least
ratio of that number to them."""
EXTRAPOLATED = 5.0
"""Greatest ratio of a torque over the turn to what the record shows of it: a pendulum that swings by 12 degrees to
either side shows a fifth."""
BOTH = 0.05
"""Least share of the moving rows in either direction for friction and a constant torque to be distinguished."""
STRETCHES, SURE = 12, 3.0
"""Segments of the jackknife of friction's work; standard deviations below zero that make an error."""
LATE, STROKE, EARLY = 0.12, 0.25, 0.03
"""Longest delay searched, s: more only within a part `STROKE` of the usual stroke, `EARLY` in any case."""
BETTER = 2.0
"""Least ratio of the residual with any shorter delay."""
SHOWS = 2.0
"""Least ratio of the residual without an inertia, for a delay longer than `EARLY`."""
ROUGHLY = 0.15
"""Relative uncertainty of a delay longer than `EARLY`: wind-up and play shift reversals, too."""
MANY, CLEARLY, HARM = 9, 10.0, 1e-3
"""For a delay shown by reversals alone: fewest rows, least ratio of the residual without it, and least part of that
residual in the torque's variance. Play, wind-up, tuning steps and flexible trains stay below this ratio."""
WEIGHT, TOLD = 0.3, 0.25
"""Least constant torque that is reported, part of Coulomb friction; greatest half-width of its interval, part of its
value."""
TENTH, HELD, STRANGE, STRANGE_TIME = 0.1, 0.5, 1.5, 1.5e-3
"""Offset of the torque from its row, rows: least that is reported; greatest of any hold, and precision required to be
one; and least that no hold explains, rows and s."""
PULLS = 0.5
"""Least part of the torque due to a positive inertia for its sign to be right."""
RANK = 1e-10
"""Part of the largest singular value below which a direction is undetermined."""


@dataclass(frozen=True, slots=True)
class Fit:
    """A fitted line: inertia, Coulomb, viscous, constant and further coefficients; explained share; residual."""

    values: Array
    explained: float
    rest: float


def sign(view: View) -> Iterator[Finding]:
    """Yield a finding if the work of friction over the record is negative."""
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
        return  # With an inverted torque sign the inertia would be negative: this torque is delayed.
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
    """Return whether the axis moves in both directions, which distinguishes friction from a constant torque."""
    return BOTH < float(np.mean(smooth.velocity[smooth.moving] > 0.0)) < 1.0 - BOTH


def _one_way(smooth: Smooth, view: View, turned: str) -> Iterator[Finding]:
    """Yield a warning, at most, for one-way motion: friction and a load that drives the axis are then one constant."""
    power = smooth.torque * smooth.velocity
    stops = abs(smooth.velocity[-1]) < 0.5 * abs(smooth.velocity[0])
    if float(np.mean(power)) < -0.5 * float(np.mean(np.abs(power))) and not stops:
        only = "one way only" if min(smooth.travel) < NEVER * max(smooth.travel) else "nearly one way only"
        message = f"the axis moves {only}, and the torque brakes it: a load drives it, or the sign is wrong"
        yield Finding(
            "warning", "torque-sign", message, remedy=f"say {turned}, if positive torque drives backwards"
        )


def _braking(smooth: Smooth, *, measured: bool) -> tuple[float, float]:
    """Return friction's mean power over the moving rows and its standard deviation, by a jackknife over segments."""
    rows = _rows(smooth)
    v = smooth.velocity[rows]
    matrix = _matrix(smooth, rows, measured=measured)
    weights = np.zeros(matrix.shape[1])
    weights[1:3] = np.mean(np.abs(v)), np.mean(v * v)
    torque = smooth.torque[rows]

    def power(without: int) -> float:
        """Return the power without one of the segments; with all if `without` is negative."""
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
    # A delay of many rows looks like none in sliding, but is unmistakable at reversals.
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
    """Return delay, half-width and row, s; whether acceleration determines the delay; and whether that is certain."""
    if (found := view.sliding) is None:
        return 0.0, math.inf, view.period, False, False
    number, inertia = found.numbers["skew"], found.numbers["inertia"]
    shows = inertia.lower > 0.0
    return number.value, number.half, found.period, shows, shows and inertia.upper <= RATIO * inertia.lower


def _skew_at_reversals(smooth: Smooth) -> float | None:
    """Return the delay of many rows at which reversals of torque and motion fit, s; None if others fit almost as well.

    Play, wind-up, ringing and a feedforward shift reversals too, but none improves the fit tenfold over no delay.
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
    # At standstill the torque reverses unseen: a shift within that time is determined by acceleration only.
    unseen = abs(shift) < smooth.standstill and not _accelerates(smooth, shift, rest, reach)
    late = shift * smooth.period
    return None if unseen or (abs(late) > EARLY and not _is_far(smooth, shift, rest, reach)) else late


def _is_far(smooth: Smooth, shift: int, rest: float, reach: int) -> bool:
    """Return whether a shift beyond `EARLY` is genuine: neither a shorter one nor dwelling explains it."""
    near = int(EARLY / smooth.period) + 1
    shorter = shifts_looked_at(lambda these: _rests(smooth, these, reach), near, 30)
    # A vibration fits itself some periods later.
    if BETTER * rest > least_between(*shorter):
        return False
    return _accelerates(smooth, shift, rest, reach)


def _accelerates(smooth: Smooth, shift: int, rest: float, reach: int) -> bool:
    """Return whether a shift with residual `rest` shows an inertia.

    If the axis dwells at every reversal, its torque reverses late, too, but acceleration is unaffected.
    """
    return bool(_rests(smooth, [shift], reach, accelerates=False)[0] >= SHOWS * rest)


def _reach(smooth: Smooth) -> int:
    """Return the longest delay searched, samples: a part of a stroke, since more would fit the stroke before."""
    sides = np.sign(smooth.velocity[smooth.moving])
    strokes = 1 + np.count_nonzero(np.diff(sides))
    stroke = np.count_nonzero(smooth.moving) / strokes
    most = max(min(LATE / smooth.period, STROKE * stroke), min(EARLY / smooth.period, 60.0), MANY + 1.0)
    return int(min(most, smooth.velocity.size // 8))


def gravity(view: View) -> Iterator[Finding]:
    """Yield a finding on a mean torque that repeats every turn (gravity), or on a constant torque."""
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
    """Return the amplitude of a torque with a period of `turns` of the position, and the residual.

    The amplitude is 0 if there is no such torque or the record shows little of it.
    """
    size = float(np.std(smooth.torque))
    if not np.ptp(smooth.position) > 0.5 * turns or size == 0.0:
        return 0.0, plain.rest
    full = _fit(smooth, 0, periodic=True, turn=turns * math.tau)
    rows = _rows(smooth)
    shows = full.explained > 0.5 and _shows_turn(smooth, rows, plain, full, turns)
    # Friction that builds up after a reversal makes the mean of both directions rise over a short distance, too: a
    # weight still acts where that is over.
    beyond = rows[smooth.gone_on[rows]]
    if shows and beyond.size >= FEWEST and np.ptp(smooth.position) < turns * math.tau:
        line, wave = (_fit(smooth, 0, periodic=p, turn=turns * math.tau, rows=beyond) for p in (False, True))
        shows = _shows_turn(smooth, beyond, line, wave, turns)
    return (math.hypot(full.values[4], full.values[5]) if shows else 0.0), full.rest


def _shows_turn(smooth: Smooth, rows: Any, plain: Fit, full: Fit, turns: float) -> bool:
    """Return whether a torque with this period explains a line's residual in some rows, and these show much of it."""
    size, amplitude = float(np.std(smooth.torque)), math.hypot(full.values[4], full.values[5])
    angle = smooth.position[rows] / turns
    # Over a short part of a turn, any bend of the torque fits a wave that the constant torque opposes.
    seen = 0.5 * float(np.ptp(full.values[4] * np.sin(angle) + full.values[5] * np.cos(angle)))
    shows = full.rest < 0.7 * plain.rest and 0.1 * size < amplitude < 20.0 * size
    return shows and seen > max(0.1 * size, amplitude / EXTRAPOLATED)


def _offset(view: View, smooth: Smooth, plain: Fit) -> Iterator[Finding]:
    """Yield a note on a constant torque that is large against Coulomb friction from sliding or the whole torque."""
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
    """Return the filtered record if it has torque and moves away from its ends; else None."""
    smooth = view.smooth
    if smooth is None or not smooth.torque.size or smooth.fast <= 0.0:
        return None
    enough = _inside(smooth).size >= FEWEST and float(np.std(smooth.torque)) > 0.0
    return smooth if enough else None


def line_of(smooth: Smooth) -> Fit:
    """Fit inertia, Coulomb, viscous and constant part of the torque in motion."""
    return _fit(smooth, 0)


def _hangs_in_degrees(smooth: Smooth, rest: float) -> bool:
    """Return whether the torque is that of a pendulum with its angle in degrees, in both directions of motion."""
    forth = float(np.mean(smooth.velocity[smooth.moving] > 0.0))
    if np.ptp(smooth.position) < QUARTER or not 0.2 < forth < 0.8:
        return False
    fit = _fit(smooth, 0, periodic=True, turn=360.0)
    amplitude, size = math.hypot(fit.values[4], fit.values[5]), float(np.std(smooth.torque))
    return fit.rest < 0.2 * rest and fit.explained > 0.9 and 0.1 * size < amplitude < 20.0 * size


def _degrees_or_gear(view: View, smooth: Smooth) -> Finding:
    """Return whether a gear or degrees explain a torque with a period of 360.

    Behind a gear the motor's angle is the load's times its ratio.
    """
    far = float(np.ptp(smooth.position)) / (QUARTER / 360.0 * math.tau)
    # The step is the ratio at which a pendulum over a turn has a residual of a hundredth of its torque.
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
    """Fit a line by least squares over the moving rows, or some, with the torque taken `shift` samples later.

    `turn` is one turn of the position in its unit.
    """
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
    """Return `Fit.rest` with the torque taken so many samples later, at most `reach`, shape (shifts,).

    `accelerates` includes an inertia.
    """
    rows = _rows(smooth, reach)
    matrix = _matrix(smooth, rows, measured=False)[:, 0 if accelerates else 1 :]
    basis, sizes, _ = np.linalg.svd(matrix / _sizes(matrix), full_matrices=False)
    basis = basis[:, sizes > RANK * sizes[0]]
    torques = np.stack([smooth.torque[rows + k] for k in shifts])
    left = torques - (torques @ basis) @ basis.T
    return np.asarray(np.mean(left**2, axis=1))


def _sizes(matrix: Array) -> Array:
    """Return the root mean squares of the columns, 1 for those that are 0."""
    size: Array = np.sqrt(np.mean(matrix**2, axis=0))
    return np.where(size == 0.0, 1.0, size)


def _rows(smooth: Smooth, reach: int = 60) -> Any:
    """Return `_inside`, thinned out to `ROWS`."""
    rows = _inside(smooth, reach)
    return rows[:: max(1, rows.size // ROWS)]


def _inside(smooth: Smooth, reach: int = 60) -> Any:
    """Return the moving rows, at least `reach` rows away from the ends."""
    count = smooth.velocity.size
    edge = min(max(reach, 60), count // 8)
    return np.flatnonzero(smooth.moving[edge : count - edge]) + edge


def _matrix(smooth: Smooth, rows: Any, *, measured: bool) -> Array:
    """Return the columns acceleration, direction, velocity and one."""
    v = smooth.velocity[rows]
    inertia = np.zeros_like(v) if measured else smooth.acceleration[rows]
    return np.stack([inertia, np.sign(v), v, np.ones_like(v)], axis=1)
