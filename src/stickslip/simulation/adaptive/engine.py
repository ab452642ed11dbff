"""Adaptive integrator: Dormand-Prince 5(4) with located events, for any law that gives a ``rate``.

Every switch of the hybrid loop (`stickslip.simulation.adaptive.hybrid`) is located on real steps from the same start,
and the step ends on it (`stickslip.simulation.adaptive.step`). The check on the exact integrator, and the way for laws
that it cannot run.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.core.progress import Reached, watched
from stickslip.jit import kernel, pointer
from stickslip.simulation._meter import MAX_WINDOW, close_standstill, meter, new_meter, turning_points
from stickslip.simulation._nodes import SIGNALS
from stickslip.simulation.adaptive.hybrid import rates
from stickslip.simulation.adaptive.layout import Laid, Loop, laid_out, loop_of, named
from stickslip.simulation.adaptive.step import LOCAL, attempt, dense, note
from stickslip.simulation.adaptive.switching import begin_side, events, switch, torques
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

EVENT_ROWS = 20_000
CREEP, STEEPEST = 1e-9, 1e6
"""Velocity (rad/s) at which a law's slope is taken, and the relaxation rate (1/s) that explicit steps can follow."""
STEPS = StepBudget(1_000_000, 1_000_000, 2_000, 50_000_000)


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
    duration = float(numbers[DURATION])
    laid = laid_out(case, tolerances(case), (float(numbers[POSITION_0]), float(numbers[VELOCITY_0])))
    reached = laid.reached
    reached["first_steps"], reached["step_rate"] = STEPS.pace(case)
    rows = np.empty((case.grid.size + EVENT_ROWS, len(COLUMNS)))
    acc = new_meter(numbers[DURATION], settle_band_of(case.reference, duration))
    turns = np.empty((4096, 2))

    def stop() -> None:
        reached["first_steps"] = -math.inf

    code = watched(
        lambda: integrate(laid, case.breaks, case.grid, rows, acc, turns),
        lambda: Reached(float(reached["time"]), duration, float(reached["steps"] + reached["rejected"])), stop,
    )  # fmt: skip
    return Outcome(
        rows[: reached["rows"]], int(code), float(reached["time"]), acc, turning_points(acc, turns),
        {name: int(reached[name]) for name in ("steps", "rejected", "events")},
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
def emit(loop: Loop, t: float, y: Any, rows: Any, event: float) -> None:
    """Write a row at t, if there is room for it."""
    now, n = loop.now, loop.progress.rows
    if n >= rows.shape[0]:
        return
    torques(loop, t, y)
    rows[n, 0] = t
    rows[n, 1] = now.reference.position
    rows[n, 2] = now.reference.velocity
    rows[n, 3] = named(y).position
    rows[n, 4] = now.seen_velocity
    rows[n, 5] = now.motor_torque
    rows[n, 6] = now.friction_torque
    rows[n, 7] = now.compensation_torque
    rows[n, 8] = event
    loop.progress.rows = n + 1


@kernel()
def measure(loop: Loop, t: float, h: float, nodes: Any, acc: Any, turns: Any) -> None:
    """Hand an accepted step to the meter: its ends are noted, the nodes between come from the dense output.

    A smooth step, limited by stability alone, is short against every motion that it holds: parabolas do.
    """
    smooth = loop.step.smooth != 0
    for i in range(1, 4):
        if i == 2 or not smooth:
            dense(loop, h, 0.25 * i, loop.middle)
            torques(loop, t + 0.25 * i * h, loop.middle)
            note(loop, loop.middle, nodes, i)
    if smooth:
        for j in range(SIGNALS):
            nodes[j, 1] = 0.125 * (3.0 * nodes[j, 0] + 6.0 * nodes[j, 2] - nodes[j, 4])
            nodes[j, 3] = 0.125 * (3.0 * nodes[j, 4] + 6.0 * nodes[j, 2] - nodes[j, 0])
    meter(acc, turns, t, h, nodes)
    for j in range(SIGNALS):
        nodes[j, 0] = nodes[j, 4]


@kernel()
def settle(loop: Loop, t: float) -> int:
    """Switch until no event is due at this moment; returns how many rounds it took (9 where it never ends)."""
    for i in range(9):
        if events(loop, t, loop.y) < 0.0:
            return i
        switch(loop, t, loop.y)
    return 9


@kernel()
def broken(loop: Loop) -> int:
    """Whether the state is beyond every reasonable bound or no number; DONE where it is fine."""
    n, state = loop.numbers, named(loop.y)
    for j in range(loop.case.states):
        if not np.isfinite(loop.y[j]):
            return NOT_FINITE
    if abs(state.position) > n[POSITION_LIMIT] or abs(state.velocity) > n[VELOCITY_LIMIT]:
        return DIVERGED
    return DONE


@kernel()
def cross(loop: Loop, t: float, stop: float, rows: Any, room: int) -> int:
    """Switch at an event, with a row before and after it that leave `room`; returns the rounds that it took."""
    if rows.shape[0] - loop.progress.rows > room + 2:
        emit(loop, t, loop.y, rows, 1.0)
    events(loop, t, loop.y)
    switch(loop, t, loop.y)
    rounds = settle(loop, t)
    begin_side(loop, t, 0.5 * (t + stop), loop.y)
    if rows.shape[0] - loop.progress.rows > room + 2:
        emit(loop, t, loop.y, rows, 1.0)
    return rounds


@kernel()
def accept(loop: Loop, t: float, grid: Any, rows: Any, nodes: Any, acc: Any, turns: Any) -> None:
    """Hand out the step that was tried, and make its end the state."""
    n, reached, step = loop.case.states, loop.progress, loop.step.length
    reached.steps += 1
    while reached.outputs < grid.shape[0] and grid[reached.outputs] <= t + step:
        time = grid[reached.outputs]
        dense(loop, step, min(1.0, (time - t) / step), loop.middle)
        emit(loop, time, loop.middle, rows, 0.0)
        reached.outputs += 1
    if loop.numbers[METERED] != 0.0:
        measure(loop, t, step, nodes, acc, turns)
    last = pointer(loop.rates, 6 * n)
    # Element by element: assigning slices would compile numpy's checks of shapes, seconds of it.
    for j in range(n):
        loop.y[j] = loop.end[j]
        loop.rates[j] = last[j]


@kernel()
def integrate(laid: Laid, breaks: Any, grid: Any, rows: Any, acc: Any, turns: Any) -> int:
    """Run the loop from rest to the last break. Returns how it ended; when is in the progress."""
    loop = loop_of(laid)
    y, reached, tried = loop.y, loop.progress, loop.step
    nodes, longest = np.zeros((SIGNALS, 5)), min(loop.numbers[MAX_STEP], MAX_WINDOW)
    t, code = 0.0, DONE
    storm_start, storm_events = 0.0, 0
    tried.next = 1e-6
    for b in range(breaks.shape[0]):
        stop = breaks[b]
        begin_side(loop, t, 0.5 * (t + stop), y)
        settle(loop, t)
        if reached.outputs < grid.shape[0] and grid[reached.outputs] <= t:
            emit(loop, t, y, rows, 0.0)
            reached.outputs += 1
        fresh = True
        tried.next = min(tried.next, 1e-4)
        while t < stop and code == DONE:
            if fresh:
                rates(loop, t, y, loop.rates)
                note(loop, y, nodes, 0)
                tried.value = -np.inf
                fresh = False
            tried.next = min(tried.next, longest)
            code = attempt(loop, t, stop, nodes)
            if code != DONE or tried.taken == 0:
                reached.rejected += 1
                continue
            accept(loop, t, grid, rows, nodes, acc, turns)
            t = stop if tried.final != 0 else t + tried.length
            reached.time = t
            code = broken(loop)
            if code == DONE and tried.event != 0:
                reached.events += 1
                storm_events += 1
                rounds = cross(loop, t, stop, rows, grid.shape[0] - reached.outputs)
                fresh = True
                if t - storm_start > STORM_TIME:
                    storm_start, storm_events = t, 0
                if storm_events > STORM_EVENTS or rounds == 9:
                    code = STORM
            if (
                code == DONE
                and reached.steps + reached.rejected > reached.first_steps + reached.step_rate * t
            ):
                code = TOO_STIFF
        if code != DONE:
            break
    close_standstill(acc, t)
    return code
