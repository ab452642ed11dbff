"""The sampled engine: an axis between two samples of its controller, under a torque that is held.

Between two samples the torque does not change, so that the motion is that of the contact alone: exact while every
element sticks (`sampled.stick`), of order 8 under error control while something slips (`sampled.slip`), and cut where
an element breaks away or the axis turns (`sampled.modes`). That is for laws that give `modes`
(`stickslip.core.spec.Elements`, `Bristle`); every other law takes implicit steps under error control
(`sampled.general`). The tolerance is, as that of the other integrators, the error in position that a well-conditioned
run may gather; general steps, of second order, gather more where a contact's spring rings at rest.

The controller is one compiled function a sample (`compiled_controller`), whatever it is made of.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.core.progress import Reached, watched
from stickslip.jit import call_profile, call_sample, kernel, pointer
from stickslip.simulation._meter import close_standstill, new_meter, turning_points
from stickslip.simulation.case_arrays import (
    COLUMNS,
    DIVERGED,
    DONE,
    DURATION,
    ENCODER,
    NO_STEP,
    NO_TORQUE,
    NOT_FINITE,
    SAMPLE_TIME,
    STORM,
    STORM_EVENTS,
    STORM_TIME,
    TOO_STIFF,
    Array,
    Case,
    Outcome,
    surroundings,
)
from stickslip.simulation.compiled_controller import Sampled, compiled, measured_position
from stickslip.simulation.metrics import settle_band_of
from stickslip.simulation.recorded_input.contact import Plant
from stickslip.simulation.sampled.axis import axis_of, general_axis, not_located
from stickslip.simulation.sampled.general import (
    Contact,
    Held,
    act_on,
    contact_of,
    held_of,
    hold,
    plant_of,
    step_on,
)
from stickslip.simulation.sampled.modes import creep, friction, rest, sign
from stickslip.simulation.sampled.output import PROGRESS, Grid, Output, measure, put_out, with_room, write
from stickslip.simulation.sampled.rates import HOLDS, RESTS, SLIPS, STEPS, STUCK, never_sticks
from stickslip.simulation.sampled.rush import RUNAWAY, rush
from stickslip.simulation.sampled.slip import slip
from stickslip.simulation.sampled.stick import stick

MOST_STEPS = 5e7


class Control(NamedTuple):
    """The controller and its reference."""

    sampled: Sampled
    profile: int
    reference_parameters: Any
    encoder: float
    surroundings: Any
    motion: Any


class Acting(NamedTuple):
    """A `Control` by addresses: references to arrays would be counted at every sample."""

    controller: int
    settings: Any
    memory: Any
    state: Any
    parameters: Any
    compensation: int
    fault: int
    profile: int
    reference_parameters: Any
    encoder: float
    surroundings: Any
    motion: Any


def can_run(case: Case) -> str:
    """Say why this integrator cannot run `case`, in one sentence; "" if it can."""
    if case.numbers[SAMPLE_TIME] == 0.0:
        return "the controller acts in continuous time, not with a sample time"
    return ""


def cannot_locate(case: Case) -> str:
    """Say why the motion of `case` is no located flow but takes general steps, in one sentence; "" if it is one."""
    return not_located(case.plant)


def run(case: Case) -> Outcome:
    """Integrate the case.

    Returns
    -------
    Outcome
        One row per entry of ``case.grid`` (from the right where the controller's torque jumps), and rows per reversal,
        standstill and break-away. A run that ends early says so in ``code`` and keeps its rows.
    """
    n = case.numbers
    laid = general_axis(case) if cannot_locate(case) else axis_of(case)
    contact, stops = contact_of(case), stops_of(case)
    output = Output(
        np.ascontiguousarray(case.grid, dtype=np.float64), np.zeros(1, PROGRESS),
        new_meter(float(n[DURATION]), settle_band_of(case.reference, float(n[DURATION]))), np.zeros((4096, 2)),
        np.zeros((8, 5)),
    )  # fmt: skip
    control = Control(
        compiled(case.controller), case.profile, case.reference_parameters, float(n[ENCODER]),
        surroundings(n), np.zeros(3),
    )  # fmt: skip
    reached, z = output.reached[0], laid.state[0]

    def stop() -> None:
        reached["asked"] = 1

    rows, code = watched(
        lambda: integrate(control, laid.axis, laid.state, contact, stops, output),
        lambda: Reached(float(reached["time"]), float(n[DURATION]), float(z["steps"])), stop,
    )  # fmt: skip
    found = {name: int(z[name]) for name in ("steps", "rejected", "events")}
    return Outcome(
        rows, int(code), float(reached["time"]), output.acc, turning_points(output.acc, output.turns), found,
        control.sampled.state, control.sampled.memory,
    )  # fmt: skip


# ---- laying a case out -------------------------------------------------------------------------------------------


def stops_of(case: Case) -> Array:
    """When a stretch ends, how long it is, and whether the controller samples there (1); shape (n, 3)."""
    period, duration = float(case.numbers[SAMPLE_TIME]), float(case.numbers[DURATION])
    others = np.sort(np.concatenate([case.breaks, case.grid[case.grid > 0.0]]), kind="stable")
    return stops_among(period, math.ceil(duration / period - 1e-9) - 1, others, 1e-12 * max(1.0, duration))


@kernel()
def stops_among(period: float, samples: int, others: Any, apart: float) -> Any:
    """The stops of `samples` samples and of other times, s, ascending; one where they lie no further than `apart`."""
    out = np.zeros((samples + others.size, 3))
    count, sample, other = 0, 1, 0
    before, now = -math.inf, 0.0
    while sample <= samples or other < others.size:
        # The controller's own stop stands before another at the same time.
        acts = sample <= samples and (other == others.size or period * sample <= others[other])
        if acts:
            now = period * sample
            sample += 1
        else:
            now = others[other]
            other += 1
        if now - before > apart:
            length = now - out[count - 1, 0] if count > 0 else now
            # Exactly the sample time, so that the flow kept for it serves.
            out[count, 0], out[count, 1] = now, period if abs(length - period) < 1e-9 * period else length
            count += 1
        if acts:
            out[count - 1, 2] = 1.0
        before = now
    return out[:count]


# ---- the loop over time ------------------------------------------------------------------------------------------


@kernel(exact=False)
def acting(c: Control) -> Acting:
    """The addresses of a controller and its reference."""
    s = c.sampled
    return Acting(
        s.address, pointer(s.settings, 0), pointer(s.memory, 0), pointer(s.state, 0), pointer(s.parameters, 0),
        s.compensation, s.fault, c.profile, pointer(c.reference_parameters, 0), c.encoder,
        pointer(c.surroundings, 0), pointer(c.motion, 0),
    )  # fmt: skip


@kernel(exact=False)
def integrate(
    controlled: Control, axes: Any, states: Any, contact: Contact, stops: Any, output: Output
) -> tuple[Any, int]:  # fmt: skip
    """Run from 0 to the last stop; returns rows and code."""
    axis, z, reached, grid = (
        axes[0],
        states[0],
        output.reached[0],
        Grid(pointer(output.grid, 0), output.grid.size),
    )
    starts = states.copy()
    rows = np.empty((grid.size + 256, len(COLUMNS)))
    written = pointer(rows, 0)
    storm = np.full(STORM_EVENTS, -1.0)
    code = DONE
    control, plant, held = acting(controlled), plant_of(contact), held_of(contact)
    act(control, axis, z, held, plant, 0.0)
    if not math.isfinite(z.torque):
        code = NO_TORQUE
    put_out(control, axis, z, 0.0, grid, reached, written, True)
    for i in range(stops.shape[0]):
        left = stops[i, 1]
        while left > 0.0 and code == DONE:
            happened = z.events
            if axis.metered:
                starts[0] = z
            time = stops[i, 0] - left
            taken = advance(axis, z, held, plant, time, left)
            left = left - taken if left - taken > 1e-12 * axis.sample_time else 0.0
            z.steps += 1
            if axis.metered and taken > 0.0:
                measure(control, axis, starts[0], z, time, taken, output)
            if z.events != happened:
                # Room for the rows of the output times to come is kept.
                if rows.shape[0] - reached.rows <= grid.size - reached.outputs:
                    rows = with_room(rows)
                    written = pointer(rows, 0)
                write(control, axis, z, time + taken, 1.0, reached, written, False)
                code = stormy(z, time + taken, storm)
                if z.mode < STEPS:
                    refresh(axis, z)
            if z.failed:
                code = NO_STEP
            # Here and not once a stop: a stretch that gets nowhere ends, too.
            if reached.asked or z.steps + z.rejected > MOST_STEPS:
                code = TOO_STIFF
        reached.time = stops[i, 0] - left
        code = verdict(axis, z) if code == DONE else code
        if code != DONE:
            break
        if stops[i, 2] > 0.0:
            act(control, axis, z, held, plant, stops[i, 0])
            if not math.isfinite(z.torque):
                code = NO_TORQUE
        put_out(control, axis, z, stops[i, 0], grid, reached, written, stops[i, 2] > 0.0)
    if axis.metered:
        close_standstill(output.acc, reached.time)
    return rows[: reached.rows], code


@kernel(exact=False, inline=True)
def advance(axis: Any, z: Any, held: Held, plant: Plant, t: float, left: float) -> float:
    """Move on by at most `left` s under the held torque, until something changes; returns the time taken."""
    if z.mode == STEPS:
        return step_on(axis, z, held, plant, t, left)
    if z.mode == HOLDS:
        return hold(axis, z, held, plant, t, left)
    if z.mode == STUCK:
        return stick(axis, z, left)
    if z.mode == SLIPS:
        taken = rush(axis, z, left) if z.direction * z.velocity > RUNAWAY else 0.0
        return taken if taken > 0.0 else slip(axis, z, left)
    if z.mode == RESTS:
        return rest(axis, z, left)
    return creep(axis, z, left)


@kernel(exact=False, inline=True)
def act(control: Acting, axis: Any, z: Any, held: Held, plant: Plant, t: float) -> None:
    """Let the controller sample, and hold what it answers; ``control.motion`` is the reference then, as
    `Reference.sample` gives it: at a jump what comes behind."""
    motion = control.motion
    call_profile(control.profile, t, control.reference_parameters, motion)
    control.surroundings[0], control.surroundings[3] = z.position + z.moved, t
    z.torque = call_sample(
        control.controller, measured_position(z.position + z.moved, control.encoder),
        motion[0], motion[1], motion[2], control.settings, control.memory, control.state,
        control.parameters, control.surroundings,
    )  # fmt: skip
    if control.memory[control.fault] != 0.0:
        z.torque = math.nan
    if z.mode < STEPS:
        refresh(axis, z)
    else:
        act_on(axis, z, held, plant, t)


@kernel(exact=False)
def refresh(axis: Any, z: Any) -> None:
    """The acceleration after a jump of the torque or a change of what slips; a bristle at rest takes its direction."""
    z.acceleration = (z.torque - friction(axis, z)) / axis.inertia
    if never_sticks(axis) and z.velocity == 0.0:
        z.direction = sign(z.acceleration)


@kernel(exact=False)
def stormy(z: Any, t: float, storm: Any) -> int:
    """STORM where too many events lie too near; `storm` holds the times of the last ones."""
    last = z.events % storm.size
    if storm[last] >= 0.0 and t - storm[last] < STORM_TIME:
        return STORM
    storm[last] = t
    return DONE


@kernel(exact=False)
def verdict(axis: Any, z: Any) -> int:
    """DONE if the motion may go on, else why the run ends."""
    if not (math.isfinite(z.position + z.moved) and math.isfinite(z.velocity) and math.isfinite(z.torque)):
        return NOT_FINITE
    if abs(z.position + z.moved) > axis.position_limit or abs(z.velocity) > axis.velocity_limit:
        return DIVERGED
    return DONE
