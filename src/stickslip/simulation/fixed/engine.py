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

from stickslip.core.errors import ParameterError
from stickslip.core.progress import Reached, watched
from stickslip.core.spec import Surroundings
from stickslip.jit import kernel, pointer
from stickslip.models.friction_levels import static_level
from stickslip.simulation._meter import close_standstill, new_meter, turning_points
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
from stickslip.simulation.fixed.layout import CASE, HEAD, NOW, PROGRESS, STATE, STATES, Laid, Loop, loop_of
from stickslip.simulation.fixed.loop import copy, restart, step_plant
from stickslip.simulation.fixed.output import measure, record, record_jump, write
from stickslip.simulation.fixed.step import GROWTH, LANDING, advance
from stickslip.simulation.metrics import settle_band_of
from stickslip.simulation.root import ROOT
from stickslip.simulation.root import compiled as root

RESOLVED = 2.0
"""dt * slope / J up to which the trapezoid runs; omega dt = 2 after `contact_slope` of a spring."""
ROUNDING = 1e-14
"""To which a velocity is solved (relative above 1 rad/s), and an event met (N·m, rad/s)."""
RINGING = 0.25
"""omega dt of the steps that resolve a motion near rest which a longer, damped one would lose."""


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
        raise ParameterError(f"fixed integrator: dt = {dt:g} s must be greater than 0 and finite")
    n = case.numbers
    laid, duration = laid_out(case, dt), float(n[DURATION])
    reached = laid.reached
    accumulator = new_meter(duration, settle_band_of(case.reference, duration))
    turns = np.zeros((4096, 2))
    grid = np.ascontiguousarray(case.grid, dtype=np.float64)
    stops = np.ascontiguousarray(case.breaks, dtype=np.float64)

    def stop() -> None:
        reached["asked"] = 1

    rows, code = watched(
        lambda: integrate(laid, stops, grid, accumulator, turns),
        lambda: Reached(float(reached["time"]), duration, float(reached["steps"])), stop,
    )  # fmt: skip
    return Outcome(
        rows, int(code), float(reached["time"]), accumulator, turning_points(accumulator, turns),
        {"steps": int(reached["steps"]), "rejected": 0, "events": int(reached["events"])},
    )  # fmt: skip


def laid_out(case: Case, dt: float) -> Laid:
    """Lay out what a step reads, and decide how the run is damped (see the module's docstring)."""
    n, plant, compensator = case.numbers, case.plant, case.compensator
    measured = n[SOURCE] == FROM_MEASUREMENT
    slope = n[GAIN] * contact_slope(compensator, dt) if measured else 0.0
    steep = bool(dt * slope > RESOLVED * n[INERTIA])
    jumps = measured and compensator.pointers.holding != 0
    # A feedback that jumps with the velocity chatters at rest: that would be resolved without end.
    travel = math.inf if steep or jumps else travel_of(case)
    start = started(case)
    fixed, now, progress = np.zeros(1, CASE), np.zeros(1, NOW), np.zeros(1, PROGRESS)
    fixed["plant"], fixed["compensator"] = plant.pointers, compensator.pointers
    fixed["profile"], fixed["plant_states"], fixed["size"] = case.profile, plant.state.size, start.size
    fixed["damped"], fixed["steep"] = dt * contact_slope(plant, dt) > RESOLVED * n[INERTIA], steep
    fixed["resolved"] = RINGING * math.sqrt(n[INERTIA] / n[STIFFNESS]) if travel < math.inf else 0.0
    fixed["travel"], fixed["fine"], fixed["time_step"] = travel, velocity_scale(case), dt
    now["around"], progress["cap"] = tuple(surroundings(n)), dt
    states = np.zeros((STATES, start.size))
    states[0] = start
    return Laid(
        fixed.view(np.float64), now.view(np.float64), progress.view(np.float64), n, plant.parameters,
        compensator.parameters, case.reference_parameters, states, searches(n[INERTIA]),
    )  # fmt: skip


def started(case: Case) -> Array:
    """The state at the start, at rest in the contacts."""
    n = case.numbers
    out = np.concatenate([np.zeros(HEAD), case.plant.state, case.compensator.state])
    start = out[:HEAD].view(STATE)[0]
    start["position"], start["velocity"] = n[POSITION_0], n[VELOCITY_0]
    start["side"] = np.sign(n[VELOCITY_0])
    if abs(n[VELOCITY_0]) < n[PLANT_BAND]:
        start["velocity"], start["gathered"] = 0.0, n[VELOCITY_0]
    return out


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
    return static_level(model) / case.numbers[STIFFNESS] or math.inf


def velocity_scale(case: Case) -> float:
    """The smallest velocity scale of the laws that see the axis's velocity, rad/s; infinite without."""
    n = case.numbers
    scales = [n[PLANT_SCALE]]
    if n[SOURCE] == FROM_MEASUREMENT:
        scales.append(n[COMPENSATOR_SCALE])
    return float(min((x for x in scales if x > 0.0), default=math.inf))


# ---- the loop over time -----------------------------------------------------------------------------------


@kernel()
def integrate(laid: Laid, stops: Any, grid: Any, accumulator: Any, turns: Any) -> tuple[Any, int]:
    """Run from 0 to the last stop; returns rows and code."""
    loop = loop_of(laid)
    a, b, reached, dt = loop.here, loop.end, loop.progress, loop.case.time_step
    rows, nodes = np.zeros((grid.size + 256, len(COLUMNS))), np.zeros((8, 5))
    storm = np.full(STORM_EVENTS, -1.0)
    a.friction = step_plant(loop, a, a.velocity, a.velocity, 0.0)
    code = DONE
    for segment in range(stops.shape[0]):
        begin, stop = reached.time, stops[segment]
        copy(loop, a, b)
        restart(loop, a, begin)
        if segment > 0:
            rows = record_jump(loop, b, a, begin, rows)
        pieces = max(1, math.ceil((stop - begin) / dt * (1.0 - 1e-12)))
        for piece in range(pieces):
            goal = stop if piece == pieces - 1 else begin + (stop - begin) * (piece + 1) / pieces
            rows, code = reach(loop, goal, grid, rows, storm, nodes, accumulator, turns)
            if code != DONE:
                break
        if code != DONE:
            break
    if code == DONE and reached.outputs < grid.size:
        rows = write(loop, a, a, 1.0, 0.0, reached.time, 0.0, rows)
    if loop.numbers[METERED] != 0.0:
        close_standstill(accumulator, reached.time)
    return rows[: reached.rows].copy(), code


@kernel()
def reach(
    loop: Loop, goal: float, grid: Any, rows: Any, storm: Any, nodes: Any, accumulator: Any, turns: Any
) -> tuple[Any, int]:
    """Step from the time reached to `goal`, once or, where events cut the step, more often; rows and code.

    ``storm`` holds the times of the last events.
    """
    a, b, case, reached = loop.here, loop.end, loop.case, loop.progress
    while goal - reached.time > 1e-12 * case.time_step:
        if reached.asked != 0:
            return rows, TOO_STIFF
        t = reached.time
        if case.steep != 0:
            longest = case.time_step
            reached.cap = LANDING * longest if a.velocity == 0.0 else min(GROWTH * reached.cap, longest)
        rests = a.velocity == 0.0
        if rests:
            # A step from rest changes the torques there, too.
            copy(loop, a, loop.before)
        taken, event = advance(loop, a, b, t, goal - t, reached.cap)
        code = verdict(loop, taken)
        if code != DONE:
            return rows, code
        if goal - t - taken < 1e-12 * case.time_step:
            taken = goal - t
        if rests:
            rows = record_jump(loop, loop.before, a, t, rows)
        rows = record(loop, t, taken, event, grid, rows)
        if loop.numbers[METERED] != 0.0:
            measure(loop, t, taken, nodes, accumulator, turns)
        copy(loop, b, a)
        reached.time = t + taken
        reached.steps += 1
        if event:
            reached.events += 1
            last = reached.events % STORM_EVENTS
            if storm[last] >= 0.0 and reached.time - storm[last] < STORM_TIME:
                return rows, STORM
            storm[last] = reached.time
    reached.time = goal
    return rows, DONE


@kernel()
def verdict(loop: Loop, taken: float) -> int:
    """DONE if a step may be kept, else why the run ends."""
    n, end, all_of = loop.numbers, loop.end, pointer(loop.end, 0)
    for i in range(loop.case.size):
        if not math.isfinite(all_of[i]):
            return NOT_FINITE
    if abs(end.position) > n[POSITION_LIMIT] or abs(end.velocity) > n[VELOCITY_LIMIT]:
        return DIVERGED
    return NO_STEP if taken < 0.0 else DONE
