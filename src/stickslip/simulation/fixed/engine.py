"""Fixed-step integrator: for any law, through its ``step`` alone, under a controller in continuous time.

Second order and A-stable (`stickslip.simulation.fixed.step`): the implicit trapezoid, with steps cut at
reversals, break-away and every kink of the reference, and short near rest, where s(v) varies. Where a step
does not resolve the contact at rest, that is where ``dt`` times the slope of its torque against the velocity
exceeds `RESOLVED` inertias (a spring k: omega dt > 2 with omega = sqrt(k / J)), the whole run uses an
L-stable method of the same order instead, since the trapezoid would let a stuck contact ring without damping.
What that method does not resolve, it damps; where it would so lose a motion near rest that the contact's bristles
remember (a load applied at once, a reversal), it takes shorter steps until that motion has decayed.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.errors import ParameterError
from stickslip.jit import kernel
from stickslip.simulation._meter import TURN_COUNT, close_standstill, new_meter
from stickslip.simulation.case_arrays import (
    COLUMNS,
    COMPENSATOR_SCALE,
    DIVERGED,
    DONE,
    DURATION,
    FROM_MEASUREMENT,
    GAIN,
    INERTIA,
    METERED,
    NO_STEP,
    NOT_FINITE,
    PLANT_BAND,
    PLANT_SCALE,
    POSITION_0,
    POSITION_LIMIT,
    SAMPLE_TIME,
    SOURCE,
    STIFFNESS,
    STORM,
    STORM_EVENTS,
    STORM_TIME,
    TOO_STIFF,
    VELOCITY_0,
    VELOCITY_LIMIT,
    Array,
    Case,
    Outcome,
    Side,
    surroundings,
)
from stickslip.simulation.fixed.loop import (
    FRICTION,
    GATHERED,
    HEAD,
    POSITION,
    SIDE,
    VELOCITY,
    Loop,
    copy,
    restart,
    step_plant,
)
from stickslip.simulation.fixed.output import (
    EVENTS,
    OUTPUTS,
    ROWS,
    STEPS,
    measure,
    record,
    record_jump,
    write,
)
from stickslip.simulation.fixed.step import GROWTH, LANDING, advance
from stickslip.simulation.metrics import settle_band_of
from stickslip.simulation.root import ROOT
from stickslip.simulation.root import compiled as root
from stickslip.spec import Surroundings
from stickslip.waiting import Reached, watched

__all__ = ["can_run", "run"]

RESOLVED = 2.0
"""dt * slope / J up to which the trapezoid runs; omega dt = 2 after `contact_slope` of a spring."""
ROUNDING = 1e-14
"""To which a velocity is solved (relative above 1 rad/s), and an event met (N·m, rad/s)."""
RINGING = 0.25
"""omega dt of the steps that resolve a motion near rest which a longer, damped one would lose."""
NOW, CAP, ASKED = range(3)
"""Of the clock: the time reached and the longest next step, s, and whether the run is to end."""


def can_run(case: Case) -> str:
    """Say why this integrator cannot run `case`, in one sentence; "" if it can."""
    return "the controller is sampled; use the sampled integrator" if case.numbers[SAMPLE_TIME] > 0.0 else ""


def run(case: Case, dt: float) -> Outcome:
    """Integrate the case with steps of at most `dt`.

    Parameters
    ----------
    case : Case
    dt : float
        Step, s. Output times and kinks of the reference are met whatever it is.

    Returns
    -------
    Outcome
        One row per entry of ``case.grid`` (torques interpolated inside steps), and rows per reversal, standstill,
        break-away and jump of the torque. A run that ends early says so in ``code`` and keeps its rows.

    Raises
    ------
    ParameterError
        If `dt` is not a positive number.
    """
    if not (dt > 0.0 and math.isfinite(dt)):
        raise ParameterError(f"fixed integrator: dt = {dt:g} s must be greater than 0")
    n = case.numbers
    loop = loop_of(case, dt)
    start = np.zeros(HEAD + case.plant.state.size + case.compensator.state.size)
    start[HEAD:] = np.concatenate([case.plant.state, case.compensator.state])
    start[POSITION], start[VELOCITY] = n[POSITION_0], n[VELOCITY_0]
    start[SIDE] = np.sign(start[VELOCITY])
    if abs(start[VELOCITY]) < n[PLANT_BAND]:
        start[VELOCITY], start[GATHERED] = 0.0, start[VELOCITY]
    accumulator = new_meter(float(n[DURATION]), settle_band_of(case.reference, float(n[DURATION])))
    turns = np.zeros((4096, 2))
    counts = np.zeros(4, dtype=np.int64)
    grid = np.ascontiguousarray(case.grid, dtype=np.float64)
    stops = np.ascontiguousarray(case.breaks, dtype=np.float64)
    clock = np.array([0.0, dt, 0.0])

    def stop() -> None:
        clock[ASKED] = 1.0

    rows, code = watched(
        lambda: integrate(loop, start, stops, grid, dt, clock, accumulator, turns, counts),
        lambda: Reached(float(clock[NOW]), float(n[DURATION]), float(counts[STEPS])), stop,
    )  # fmt: skip
    return Outcome(
        rows, int(code), float(clock[NOW]), accumulator, turns[: int(accumulator[TURN_COUNT])],
        {"steps": int(counts[STEPS]), "rejected": 0, "events": int(counts[EVENTS])},
    )  # fmt: skip


def loop_of(case: Case, dt: float) -> Loop:
    """Lay out what a step reads, and decide how the run is damped (see the module's docstring)."""
    size = HEAD + case.plant.state.size + case.compensator.state.size
    n = case.numbers
    measured = n[SOURCE] == FROM_MEASUREMENT
    help_slope = n[GAIN] * contact_slope(case.compensator, dt) if measured else 0.0
    steep = bool(dt * help_slope > RESOLVED * n[INERTIA])
    jumps = measured and case.compensator.pointers.holding != 0
    # A feedback that jumps with the velocity chatters at rest: that would be resolved without end.
    travel = math.inf if steep or jumps else travel_of(case)
    return Loop(
        n,
        case.plant.addresses,
        case.plant.parameters,
        case.compensator.addresses,
        case.compensator.parameters,
        case.profile,
        case.reference_parameters,
        case.plant.state.size,
        bool(dt * contact_slope(case.plant, dt) > RESOLVED * n[INERTIA]),
        steep,
        RINGING * math.sqrt(n[INERTIA] / n[STIFFNESS]) if travel < math.inf else 0.0,
        travel,
        velocity_scale(case),
        surroundings(case.numbers),
        np.zeros(3),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros((8, 5)),
        searches(n[INERTIA]),
    )


def searches(inertia: float) -> Array:
    """What the root finder keeps for a stage's velocity, and for the time of an event in a step."""
    out = np.zeros((2, len(ROOT.scalars)))
    root.ready(out[0], inertia, ROUNDING, 1.0, 1.0)
    root.ready(out[1], 1.0, ROUNDING, 1.0, 0.0)
    return out


def contact_slope(side: Side, dt: float) -> float:
    """Slope of a law's torque against the end velocity of a step from rest, N·m·s/rad (k dt / 2 of a spring).

    0 for a law that holds at rest: there the engine itself finds the jump.
    """
    model = side.model
    if model is None or model.law.holding is not None:
        return 0.0
    tiny = 1e-12
    z = model.law.state(model.parameters)
    return abs(model.law.step(0.0, tiny, dt, z, model.parameters, Surroundings())) / tiny


def travel_of(case: Case) -> float:
    """Displacement of the plant's contact up to break-away, rad; infinite where it has no spring."""
    model = case.plant.model
    if model is None or model.law.steady is None or not model.law.state_fields:
        return math.inf
    return abs(model.law.steady(1e-9, model.parameters)) / case.numbers[STIFFNESS] or math.inf


def velocity_scale(case: Case) -> float:
    """The smallest velocity scale of the laws that see the axis's velocity, rad/s; infinite without."""
    n = case.numbers
    scales = [n[PLANT_SCALE]]
    if n[SOURCE] == FROM_MEASUREMENT:
        scales.append(n[COMPENSATOR_SCALE])
    return float(min((x for x in scales if x > 0.0), default=math.inf))


# ---- the loop over time -----------------------------------------------------------------------------------


@kernel()
def integrate(
    loop: Loop,
    a: Any,
    stops: Any,
    grid: Any,
    dt: float,
    clock: Any,
    accumulator: Any,
    turns: Any,
    counts: Any,
) -> tuple[Any, int]:
    """Run from 0 to the last stop; returns rows and code."""
    b = a.copy()
    rows = np.zeros((grid.size + 256, len(COLUMNS)))
    storm = np.full(STORM_EVENTS, -1.0)
    a[FRICTION] = step_plant(loop, a, a[VELOCITY], a[VELOCITY], 0.0)
    code = DONE
    for segment in range(stops.shape[0]):
        begin, stop = clock[NOW], stops[segment]
        copy(a, b)
        restart(loop, a, begin)
        if segment > 0:
            rows = record_jump(loop, b, a, begin, rows, counts)
        pieces = max(1, math.ceil((stop - begin) / dt * (1.0 - 1e-12)))
        for piece in range(pieces):
            goal = stop if piece == pieces - 1 else begin + (stop - begin) * (piece + 1) / pieces
            rows, code = reach(loop, a, b, goal, dt, clock, grid, rows, storm, accumulator, turns, counts)
            if code != DONE:
                break
        if code != DONE:
            break
    if code == DONE and counts[OUTPUTS] < grid.size:
        rows = write(loop, a, a, clock[NOW], 1.0, 0.0, clock[NOW], 0.0, rows, counts)
    if loop.numbers[METERED] != 0.0:
        close_standstill(accumulator, clock[NOW])
    return rows[: counts[ROWS]].copy(), code


@kernel()
def reach(
    loop: Loop,
    a: Any,
    b: Any,
    goal: float,
    dt: float,
    clock: Any,
    grid: Any,
    rows: Any,
    storm: Any,
    accumulator: Any,
    turns: Any,
    counts: Any,
) -> tuple[Any, int]:
    """Step from the clock's time to `goal`, once or, where events cut the step, more often; rows and code.

    ``storm`` holds the times of the last events.
    """
    while goal - clock[NOW] > 1e-12 * dt:
        if clock[ASKED] != 0.0:
            return rows, TOO_STIFF
        t = clock[NOW]
        if loop.steep:
            clock[CAP] = LANDING * dt if a[VELOCITY] == 0.0 else min(GROWTH * clock[CAP], dt)
        before = a.copy() if a[VELOCITY] == 0.0 else a
        taken, event = advance(loop, a, b, t, goal - t, clock[CAP])
        code = verdict(loop.numbers, b, taken)
        if code != DONE:
            return rows, code
        if goal - t - taken < 1e-12 * dt:
            taken = goal - t
        rows = record_jump(loop, before, a, t, rows, counts)
        rows = record(loop, a, b, t, taken, event, grid, rows, counts)
        if loop.numbers[METERED] != 0.0:
            measure(loop, a, b, t, taken, accumulator, turns)
        copy(b, a)
        clock[NOW] = t + taken
        counts[STEPS] += 1
        if event:
            counts[EVENTS] += 1
            last = counts[EVENTS] % STORM_EVENTS
            if storm[last] >= 0.0 and clock[NOW] - storm[last] < STORM_TIME:
                return rows, STORM
            storm[last] = clock[NOW]
    clock[NOW] = goal
    return rows, DONE


@kernel()
def verdict(n: Any, b: Any, taken: float) -> int:
    """DONE if a step may be kept, else why the run ends."""
    for i in range(b.size):
        if not math.isfinite(b[i]):
            return NOT_FINITE
    if abs(b[POSITION]) > n[POSITION_LIMIT] or abs(b[VELOCITY]) > n[VELOCITY_LIMIT]:
        return DIVERGED
    return NO_STEP if taken < 0.0 else DONE
