"""Adaptive integrator: Dormand-Prince 5(4) with located events, for any law that gives a ``rate``.

Every switch of the hybrid loop (`stickslip.simulation.adaptive.hybrid`) is located on real steps from the same start,
and the step ends on it (`stickslip.simulation.adaptive.step`). The check on the exact integrator, and the way for laws
that it cannot run.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import kernel
from stickslip.simulation._meter import (
    MAX_WINDOW,
    SIGNALS,
    TURN_COUNT,
    close_standstill,
    meter,
    new_meter,
)
from stickslip.simulation.adaptive.hybrid import (
    COMPENSATION_TORQUE,
    EXTRA,
    FRICTION_TORQUE,
    LAWS,
    MOTOR_TORQUE,
    OMEGA_D,
    POSITION,
    SEEN_VELOCITY,
    THETA_D,
    VELOCITY,
    arrays_of,
    begin_side,
    events,
    rates,
    switch,
)
from stickslip.simulation.adaptive.step import (
    EVENT,
    FINAL,
    FOURTH,
    LOCAL,
    NEXT,
    SCRATCH,
    SMOOTH,
    STAGES,
    STEP,
    TAKEN,
    TRIAL,
    VALUE,
    attempt,
    dense,
    note,
)
from stickslip.simulation.case_arrays import (
    COLUMNS,
    DIVERGED,
    DONE,
    DURATION,
    INERTIA,
    KI,
    KP,
    MAX_STEP,
    METERED,
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
    StepBudget,
)
from stickslip.simulation.metrics import settle_band_of
from stickslip.waiting import Reached, watched

__all__ = ["can_run", "run"]

EVENT_ROWS = 20_000
CREEP, STEEPEST = 1e-9, 1e6
"""Velocity (rad/s) at which a law's slope is taken, and the relaxation rate (1/s) that explicit steps can follow."""
STEPS = StepBudget(1_000_000, 1_000_000, 2_000, 50_000_000)
FIRST_STEPS, STEP_RATE, NOW = range(3)
"""Of the pace: how many steps there may be, how many more for each second of the motion, and the time reached, s."""


def can_run(case: Case) -> str:
    """Why this integrator cannot run the case, or the empty string."""
    for side in (case.plant, case.compensator):
        if side.model is not None and side.model.law.rate is None:
            return f"law {side.model.law.name!r} gives no `rate`; use the fixed integrator"
    if case.numbers[SAMPLE_TIME] > 0.0:
        return "the controller is sampled; use the sampled integrator"
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
    acc = new_meter(numbers[DURATION], settle_band_of(case.reference, float(numbers[DURATION])))
    turns = np.empty((4096, 2))
    counts, pace = np.zeros(4, dtype=np.int64), np.array([*STEPS.pace(case), 0.0])
    arrays = (*arrays_of(case), y, tolerances(case), case.breaks, case.grid, rows, acc, turns, counts, pace)

    def stop() -> None:
        pace[FIRST_STEPS] = -math.inf

    code = watched(
        lambda: integrate(*arrays),
        lambda: Reached(float(pace[NOW]), float(numbers[DURATION]), float(counts[0] + counts[1])), stop,
    )  # fmt: skip
    time = pace[NOW]
    names = ("steps", "rejected", "events")
    return Outcome(
        rows[: counts[3]], int(code), float(time), acc, turns[: int(acc[TURN_COUNT])],
        {name: int(counts[i]) for i, name in enumerate(names)},
    )  # fmt: skip


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
    rows[n, 4] = w[SEEN_VELOCITY]
    rows[n, 5] = w[MOTOR_TORQUE]
    rows[n, 6] = w[FRICTION_TORQUE]
    rows[n, 7] = w[COMPENSATION_TORQUE]
    rows[n, 8] = event
    return n + 1


@kernel()
def measure(
    a: Any, w: Any, t: float, h: float, y: Any, k: Any, end: Any, u: Any, nodes: Any, acc: Any, turns: Any,
    smooth: bool, fourth: float,
) -> None:  # fmt: skip
    """Hand an accepted step to the meter: its ends are noted, the nodes between come from the dense output.

    A smooth step, limited by stability alone, is short against every motion that it holds: parabolas do.
    """
    for i in range(1, 4):
        if i == 2 or not smooth:
            dense(h, y, k, end, 0.25 * i, fourth, u)
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
def broken(a: Any, w: Any, y: Any) -> int:
    """Whether the state is beyond every reasonable bound or no number; DONE where it is fine."""
    for j in range(y.shape[0]):
        if not np.isfinite(y[j]):
            return NOT_FINITE
    if abs(y[POSITION]) > w[POSITION_LIMIT] or abs(y[VELOCITY]) > w[VELOCITY_LIMIT]:
        return DIVERGED
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
    pace: Any,
) -> int:
    """Run the loop from rest to the last break. Returns how it ended; when is in the ``pace`` (see `NOW`).

    ``counts`` receives steps, rejected steps, events and rows.
    """
    n = y.shape[0]
    k, nodes, trial = np.zeros((STAGES + 1, n)), np.zeros((SIGNALS, 5)), np.zeros(TRIAL)
    end, error, u, fast = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
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
            code = attempt(a, w, t, stop, y, k, end, error, u, g, tolerance, nodes, trial, fast)
            if code != DONE or trial[TAKEN] == 0.0:
                counts[1] += 1
                continue
            step = trial[STEP]
            counts[0] += 1
            while out < grid.shape[0] and grid[out] <= t + step:
                dense(step, y, k, end, min(1.0, (grid[out] - t) / step), trial[FOURTH], u)
                written = emit(a, w, grid[out], u, k, rows, written, 0.0)
                out += 1
            if w[METERED] != 0.0:
                measure(a, w, t, step, y, k, end, u, nodes, acc, turns, trial[SMOOTH] != 0.0, trial[FOURTH])
            t = stop if trial[FINAL] else t + step
            pace[NOW] = t
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
            if code == DONE and counts[0] + counts[1] > pace[FIRST_STEPS] + pace[STEP_RATE] * t:
                code = TOO_STIFF
        if code != DONE:
            break
    close_standstill(acc, t)
    counts[3] = written
    return code
