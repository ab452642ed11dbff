"""Adaptive integrator: Dormand-Prince 5(4) with located events, for any law that gives a ``rate``.

Dormand and Prince 1980; dense output of Hairer, Norsett and Wanner (Solving ODEs I, II.6). Every switch of the
hybrid loop (`stickslip.simulate._loop`) is located on real steps from the same start, and the step ends on it.
The check on the exact integrator, and the way for laws that it cannot run.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import kernel
from stickslip.simulate._case import (
    COLUMNS,
    DIVERGED,
    DONE,
    DURATION,
    INERTIA,
    KI,
    KP,
    MAX_STEP,
    METERED,
    NO_STEP,
    NOT_FINITE,
    POSITION_0,
    POSITION_LIMIT,
    SAMPLE_TIME,
    STIFFNESS,
    STORM,
    STORM_EVENTS,
    STORM_TIME,
    TOLERANCE,
    TOO_STIFF,
    VELOCITY_0,
    VELOCITY_LIMIT,
    Case,
    Outcome,
)
from stickslip.simulate._loop import (
    COMPENSATION_TORQUE,
    EXTRA,
    FRICTION_TORQUE,
    LAWS,
    MOTOR_TORQUE,
    OMEGA_D,
    POSITION,
    THETA_D,
    VELOCITY,
    arrays_of,
    begin_side,
    calm_step,
    events,
    rates,
    small_enough,
    switch,
)
from stickslip.simulate._meter import MAX_WINDOW, SIGNALS, close_standstill, meter, new_meter

__all__ = ["can_run", "run"]

EVENT_ROWS = 20_000
SHORTEST = 1e-14
LOCAL = 1e-3
"""Error allowed in one step over the tolerance of a run: thousands of steps add up, and events carry them on."""
CREEP, STEEPEST = 1e-9, 1e6
"""Velocity (rad/s) at which a law's slope is taken, and the relaxation rate (1/s) that explicit steps can follow."""
MOST_STEPS = 50_000_000
RINGING, DECAYING = 1.6, 2.8
"""Step times the largest eigenvalue that explicit stages damp: imaginary ones to about 1.6, real ones to 3.3."""
# Stages of the pair; the scratch row after them serves events and output.
STAGES, SCRATCH = 7, 7


def can_run(case: Case) -> str:
    """Why this integrator cannot run the case, or the empty string."""
    for side in (case.plant, case.compensator):
        if side.model is not None and side.model.law.rate is None:
            return f"law {side.model.law.name!r} gives no `rate`; use the fixed integrator"
    if case.numbers[SAMPLE_TIME] > 0.0:
        return "the controller is sampled; use the fixed integrator"
    friction = case.axis.friction
    if friction.law.steady is not None and friction.law.holding is None:
        slope = abs(friction.law.steady(CREEP, friction.parameters)) / CREEP
        if not friction.law.state_fields and slope / case.axis.inertia > STEEPEST:
            return (
                f"the friction's slope at rest, {slope:.3g} N·m·s/rad, slows the axis down at "
                f"{slope / case.axis.inertia:.1g} /s; use the fixed integrator"
            )
    return ""


def run(case: Case) -> Outcome:
    """Integrate the case; see `Outcome`."""
    numbers = case.numbers
    y = np.concatenate(
        [[numbers[POSITION_0], numbers[VELOCITY_0], 0.0, 0.0, 0.0], case.plant.state, case.compensator.state]
    )
    rows = np.empty((case.grid.size + EVENT_ROWS, len(COLUMNS)))
    acc = new_meter(numbers[DURATION], settle_band(case))
    turns = np.empty((4096, 2))
    counts = np.zeros(4, dtype=np.int64)
    code, time = integrate(
        *arrays_of(case), y, tolerances(case), case.breaks, case.grid, rows, acc, turns, counts
    )
    names = ("steps", "rejected", "events")
    return Outcome(
        rows[: counts[3]], int(code), float(time), acc, turns[: int(acc_turns(acc))],
        {name: int(counts[i]) for i, name in enumerate(names)},
    )  # fmt: skip


def acc_turns(acc: Any) -> int:
    """Number of turning points in the accumulator."""
    from stickslip.simulate._meter import TURN_COUNT

    return int(acc[TURN_COUNT])


def settle_band(case: Case) -> float:
    """2 % of the reference's final position where it comes to rest, rad; 0 where it does not."""
    from stickslip.simulate._meter import settle_band_of

    return settle_band_of(case.reference, float(case.numbers[DURATION]))


def tolerances(case: Case) -> Any:
    """Absolute tolerance of every state in one step: the position's, carried over by the contact's stiffness.

    A torque error of tolerance x stiffness moves a stuck contact by the tolerance; the velocity's share is a
    quarter of the ringing frequency times it.
    """
    numbers = case.numbers
    position, stiffness = LOCAL * numbers[TOLERANCE], numbers[STIFFNESS]
    ringing = math.sqrt(max(stiffness, numbers[KP]) / numbers[INERTIA])
    integral = position * numbers[KP] / numbers[KI] if numbers[KI] > 0.0 else 1.0
    out = [
        position,
        0.25 * position * ringing,
        integral,
        0.25 * position * ringing,
        0.25 * position * ringing**2,
    ]
    for side in (case.plant, case.compensator):
        if side.model is None:
            continue
        law, n = side.model.law, side.model.law.elements_in(side.model.parameters)
        fields = sorted(law.state_fields, key=lambda f: f.per_element)
        for f in fields:
            share = {"rad": position, "N·m": 0.4 * position * stiffness}.get(f.par.unit, position * stiffness)
            out += [share] * (n if f.per_element else 1)
    return np.array(out)


# Dormand and Prince's coefficients: row s leads to stage s, at the fraction NODES[s] of the step; the last row is
# the fifth-order solution (stage 6 is its rate), ERROR the difference to the fourth-order one.
TABLEAU = np.array(
    [
        [0, 0, 0, 0, 0, 0],
        [1 / 5, 0, 0, 0, 0, 0],
        [3 / 40, 9 / 40, 0, 0, 0, 0],
        [44 / 45, -56 / 15, 32 / 9, 0, 0, 0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
NODES = np.array([0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1])
ERROR = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


@kernel()
def stages(a: Any, w: Any, t: float, h: float, y: Any, k: Any, end: Any, error: Any, u: Any) -> None:
    """One Dormand-Prince step from y; row 0 of k holds the rates at its start, row 6 receives those at its end.

    ``u`` is left with the state of stage 5.
    """
    n = y.shape[0]
    for s in range(1, 7):
        for j in range(n):
            rise = 0.0
            for m in range(s):
                rise += TABLEAU[s, m] * k[m, j]
            if s < 6:
                u[j] = y[j] + h * rise
            else:
                end[j] = y[j] + h * rise
        if s < 6:
            rates(a, w, t + NODES[s] * h, u, k, s)
        else:
            rates(a, w, t + h, end, k, s)
    for j in range(n):
        off = 0.0
        for m in range(STAGES):
            off += ERROR[m] * k[m, j]
        error[j] = h * off


@kernel()
def dense(h: float, y: Any, k: Any, end: Any, x: float, out: Any) -> None:
    """State at the fraction x of a step, fourth order."""
    z = 1.0 - x
    for j in range(y.shape[0]):
        rise = end[j] - y[j]
        bend = h * k[0, j] - rise
        skew = rise - h * k[6, j] - bend
        fine = h * (
            -12715105075.0 / 11282082432.0 * k[0, j]
            + 87487479700.0 / 32700410799.0 * k[2, j]
            - 10690763975.0 / 1880347072.0 * k[3, j]
            + 701980252875.0 / 199316789632.0 * k[4, j]
            - 1453857185.0 / 822651844.0 * k[5, j]
            + 69997945.0 / 29380423.0 * k[6, j]
        )
        out[j] = y[j] + x * (rise + z * (bend + x * (skew + z * fine)))


@kernel()
def locate(
    a: Any, w: Any, t: float, h: float, y: Any, k: Any, end: Any, error: Any, u: Any, g: Any,
    before: float, after: float, precision: float,
) -> float:  # fmt: skip
    """Shorten a step of length h to the first moment at which an event is due; returns its length.

    Illinois' method on real steps; the step is left on the far side of the event.
    """
    low, high = 0.0, h
    g_low = before if before < 0.0 else -1e-16
    g_high = after
    side = 0
    for i in range(80):
        if high - low <= precision or g_high == 0.0:
            break
        x = (low * g_high - high * g_low) / (g_high - g_low)
        if not low < x < high or i > 12:
            x = 0.5 * (low + high)
        stages(a, w, t, x, y, k, end, error, u)
        now = events(a, w, t + x, end, k, SCRATCH, g)
        if now >= 0.0:
            high, g_high = x, now
            if side == 1:
                g_low *= 0.5
            side = 1
        else:
            low, g_low = x, now
            if side == -1:
                g_high *= 0.5
            side = -1
    stages(a, w, t, high, y, k, end, error, u)
    return high


@kernel()
def emit(a: Any, w: Any, t: float, y: Any, k: Any, rows: Any, n: int, event: float) -> int:
    """Write a row at t; returns the number of rows."""
    if n >= rows.shape[0]:
        return n
    rates(a, w, t, y, k, SCRATCH)
    rows[n, 0] = t
    rows[n, 1] = w[THETA_D]
    rows[n, 2] = w[OMEGA_D]
    rows[n, 3] = y[POSITION]
    rows[n, 4] = y[VELOCITY]
    rows[n, 5] = w[MOTOR_TORQUE]
    rows[n, 6] = w[FRICTION_TORQUE]
    rows[n, 7] = w[COMPENSATION_TORQUE]
    rows[n, 8] = event
    return n + 1


@kernel()
def note(w: Any, y: Any, nodes: Any, i: int) -> None:
    """Write the signals of the state whose rates were taken last into column i of the meter's nodes."""
    nodes[0, i] = w[THETA_D] - y[POSITION]
    nodes[1, i] = w[OMEGA_D] - y[VELOCITY]
    nodes[2, i] = y[POSITION]
    nodes[3, i] = y[VELOCITY]
    nodes[4, i] = w[OMEGA_D]
    nodes[5, i] = w[MOTOR_TORQUE]
    nodes[6, i] = w[FRICTION_TORQUE]
    nodes[7, i] = w[COMPENSATION_TORQUE]


@kernel()
def measure(
    a: Any, w: Any, t: float, h: float, y: Any, k: Any, end: Any, u: Any, nodes: Any, acc: Any, turns: Any,
    smooth: bool,
) -> None:  # fmt: skip
    """Hand an accepted step to the meter: its ends are noted, the nodes between come from the dense output.

    A smooth step, limited by stability alone, is short against every motion that it holds: parabolas do.
    """
    for i in range(1, 4):
        if i == 2 or not smooth:
            dense(h, y, k, end, 0.25 * i, u)
            rates(a, w, t + 0.25 * i * h, u, k, SCRATCH)
            note(w, u, nodes, i)
    if smooth:
        for j in range(SIGNALS):
            nodes[j, 1] = 0.125 * (3.0 * nodes[j, 0] + 6.0 * nodes[j, 2] - nodes[j, 4])
            nodes[j, 3] = 0.125 * (3.0 * nodes[j, 4] + 6.0 * nodes[j, 2] - nodes[j, 0])
    meter(acc, turns, t, h, nodes)
    for j in range(SIGNALS):
        nodes[j, 0] = nodes[j, 4]


@kernel()
def settle(a: Any, w: Any, t: float, y: Any, k: Any, g: Any) -> int:
    """Switch until no event is due at this moment; returns how many rounds it took (9 where it never ends)."""
    for i in range(9):
        if events(a, w, t, y, k, SCRATCH, g) < 0.0:
            return i
        switch(a, w, t, y, k, SCRATCH, g)
    return 9


@kernel()
def inside(a: Any, w: Any, t: float, h: float, y: Any, k: Any, end: Any, u: Any, g: Any) -> float:
    """Fraction of a step at which an event is due though none is at its end, or 0.

    Looked for half way, and where the velocity has an extreme: a grazing reversal dips through zero and back.
    """
    start, stop = k[0, VELOCITY], k[6, VELOCITY]
    for i in range(2):
        if i == 1 and start * stop >= 0.0:
            break
        x = 0.5 if i == 0 else start / (start - stop)
        dense(h, y, k, end, x, u)
        if events(a, w, t + x * h, u, k, SCRATCH, g) >= 0.0:
            return x
    return 0.0


@kernel()
def broken(a: Any, w: Any, y: Any) -> int:
    """Whether the state is beyond every reasonable bound or no number; DONE where it is fine."""
    for j in range(y.shape[0]):
        if not np.isfinite(y[j]):
            return NOT_FINITE
    if abs(y[POSITION]) > w[POSITION_LIMIT] or abs(y[VELOCITY]) > w[VELOCITY_LIMIT]:
        return DIVERGED
    return DONE


@kernel()
def ratio(error: Any, tolerance: Any) -> float:
    """The largest error in units of its tolerance; infinite where it is no number."""
    largest = 0.0
    for j in range(error.shape[0]):
        r = abs(error[j]) / tolerance[j]
        if not r <= 1e300:
            return np.inf
        largest = max(largest, r)
    return largest


@kernel()
def stiffness_limit(k: Any, end: Any, u: Any, tolerance: Any) -> float:
    """Longest next step that follows the fastest motion present instead of ringing at the border of stability.

    The last two stages belong to the same time: the difference of their rates against that of their states tells
    the largest eigenvalue and whether it decays or rings (Hairer and Wanner, Solving ODEs II, IV.2). ``u`` holds
    the state of stage 5.
    """
    above, below, along = 0.0, 0.0, 0.0
    for j in range(u.shape[0]):
        rate = (k[6, j] - k[5, j]) / tolerance[j]
        state = (end[j] - u[j]) / tolerance[j]
        above += rate * rate
        below += state * state
        along += rate * state
    if above <= 0.0 or below <= 0.0:
        return math.inf
    size = math.sqrt(above / below)
    decays = along < -0.95 * math.sqrt(above * below)
    return (DECAYING if decays else RINGING) / size


# ---- one step, and all of them ------------------------------------------------------------------------------
# What a trial step leaves behind: its length, whether it ends the stretch, whether an event is due at its end, the
# value of the event function there, the length of the next step, whether it may be taken, and whether its error is so
# far below the tolerance that stability alone limits it.
STEP, FINAL, EVENT, VALUE, NEXT, TAKEN, SMOOTH, TRIAL = range(8)


@kernel()
def attempt(
    a: Any, w: Any, t: float, stop: float, y: Any, k: Any, end: Any, error: Any, u: Any, g: Any, tolerance: Any,
    nodes: Any, trial: Any,
) -> int:  # fmt: skip
    """Try one step of length ``trial[NEXT]`` from t; where it is accepted it ends at the first event."""
    h = min(trial[NEXT], calm_step(w, y, k[0, VELOCITY]))
    trial[FINAL] = t + h * (1.0 + 1e-9) >= stop
    step = stop - t if trial[FINAL] else h
    stages(a, w, t, step, y, k, end, error, u)
    worst = ratio(error, tolerance)
    shrink = small_enough(w, y, end)
    trial[TAKEN] = 0.0
    if not worst < np.inf and step <= SHORTEST:
        return NOT_FINITE
    if worst > 1.0 and step <= SHORTEST:
        return NO_STEP
    if (worst > 1.0 or shrink < 1.0) and step > SHORTEST:
        trial[NEXT] = step * min(shrink, max(0.2, 0.9 * worst**-0.2) if worst > 1.0 else 1.0)
        return DONE
    trial[TAKEN] = 1.0
    trial[SMOOTH] = worst < 1e-3
    grow = min(5.0, 0.9 * worst**-0.2) if worst > 1e-4 else 5.0
    resolved = stiffness_limit(k, end, u, tolerance)
    note(w, end, nodes, 4)
    before, now = trial[VALUE], events(a, w, t + step, end, k, SCRATCH, g)
    # Far from any event at both ends, none lies between; an extreme of the velocity is looked at all the same.
    near = now > -4.0 * abs(now - before) or k[0, VELOCITY] * k[6, VELOCITY] < 0.0
    if now < 0.0 and near:
        early = inside(a, w, t, step, y, k, end, u, g)
        if early > 0.0 and step > SHORTEST:
            step *= early
            trial[FINAL] = 0.0
            stages(a, w, t, step, y, k, end, error, u)
            note(w, end, nodes, 4)
            now = events(a, w, t + step, end, k, SCRATCH, g)
    trial[EVENT] = now >= 0.0
    if now >= 0.0:
        trial[FINAL] = 0.0
        before = events(a, w, t, y, k, SCRATCH, g)
        precision = min(max(LOCAL * w[TOLERANCE], 4e-16 * t), 1e-10)
        step = locate(a, w, t, step, y, k, end, error, u, g, before, now, precision)
        note(w, end, nodes, 4)
        trial[NEXT] = max(min(h, step * grow, 1e-4, resolved), 1e-8)
    elif not trial[FINAL] or step >= h:
        trial[NEXT] = min(step * grow, resolved)
    trial[STEP] = step
    trial[VALUE] = now
    return DONE


@kernel()
def cross(
    a: Any, w: Any, t: float, stop: float, y: Any, k: Any, g: Any, rows: Any, written: int, room: int
) -> tuple[int, int]:
    """Switch at an event, with a row before and after it; returns the number of rows and of switching rounds."""
    if rows.shape[0] - written > room + 2:
        written = emit(a, w, t, y, k, rows, written, 1.0)
    events(a, w, t, y, k, SCRATCH, g)
    switch(a, w, t, y, k, SCRATCH, g)
    rounds = settle(a, w, t, y, k, g)
    begin_side(a, w, t, 0.5 * (t + stop), y, k, SCRATCH)
    if rows.shape[0] - written > room + 2:
        written = emit(a, w, t, y, k, rows, written, 1.0)
    return written, rounds


@kernel()
def integrate(
    a: Any,
    w: Any,
    y: Any,
    tolerance: Any,
    breaks: Any,
    grid: Any,
    rows: Any,
    acc: Any,
    turns: Any,
    counts: Any,
) -> tuple[int, float]:
    """Run the loop from rest to the last break. Returns how it ended and when.

    ``counts`` receives steps, rejected steps, events and rows.
    """
    n = y.shape[0]
    k, nodes, trial = np.zeros((STAGES + 1, n)), np.zeros((SIGNALS, 5)), np.zeros(TRIAL)
    end, error, u = np.zeros(n), np.zeros(n), np.zeros(n)
    g = np.zeros(n - LAWS + EXTRA)
    longest = min(w[MAX_STEP], MAX_WINDOW)
    t, written, out, code = 0.0, 0, 0, DONE
    storm_start, storm_events = 0.0, 0
    trial[NEXT] = 1e-6
    for b in range(breaks.shape[0]):
        stop = breaks[b]
        begin_side(a, w, t, 0.5 * (t + stop), y, k, SCRATCH)
        settle(a, w, t, y, k, g)
        if out < grid.shape[0] and grid[out] <= t:
            written = emit(a, w, t, y, k, rows, written, 0.0)
            out += 1
        fresh = True
        trial[NEXT] = min(trial[NEXT], 1e-4)
        while t < stop and code == DONE:
            if fresh:
                rates(a, w, t, y, k, 0)
                note(w, y, nodes, 0)
                trial[VALUE] = -np.inf
                fresh = False
            trial[NEXT] = min(trial[NEXT], longest)
            code = attempt(a, w, t, stop, y, k, end, error, u, g, tolerance, nodes, trial)
            if code != DONE or trial[TAKEN] == 0.0:
                counts[1] += 1
                continue
            step = trial[STEP]
            counts[0] += 1
            while out < grid.shape[0] and grid[out] <= t + step:
                dense(step, y, k, end, min(1.0, (grid[out] - t) / step), u)
                written = emit(a, w, grid[out], u, k, rows, written, 0.0)
                out += 1
            if w[METERED] != 0.0:
                measure(a, w, t, step, y, k, end, u, nodes, acc, turns, trial[SMOOTH] != 0.0)
            t = stop if trial[FINAL] else t + step
            # Element by element: assigning slices would compile numpy's checks of shapes, seconds of it.
            for j in range(n):
                y[j] = end[j]
                k[0, j] = k[6, j]
            code = broken(a, w, y)
            if code == DONE and trial[EVENT]:
                counts[2] += 1
                storm_events += 1
                written, rounds = cross(a, w, t, stop, y, k, g, rows, written, grid.shape[0] - out)
                fresh = True
                if t - storm_start > STORM_TIME:
                    storm_start, storm_events = t, 0
                if storm_events > STORM_EVENTS or rounds == 9:
                    code = STORM
            if code == DONE and counts[0] + counts[1] > MOST_STEPS:
                code = TOO_STIFF
        if code != DONE:
            break
    close_standstill(acc, t)
    counts[3] = written
    return code, t
