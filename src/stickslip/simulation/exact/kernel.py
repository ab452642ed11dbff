"""The loop of the exact integrator: step, look for an event, write, change modes."""

from __future__ import annotations

import math

from stickslip.jit import kernel, pointer
from stickslip.simulation._meter import meter_of, turns_of
from stickslip.simulation.case_arrays import (
    DIVERGED,
    DONE,
    DURATION,
    MAX_STEP,
    NO_STEP,
    NOT_FINITE,
    PERTURBATION,
    POSITION_LIMIT,
    STORM,
    STORM_EVENTS,
    STORM_TIME,
    TOLERANCE,
    TOO_FAST,
    TOO_STIFF,
    VELOCITY_LIMIT,
)
from stickslip.simulation.exact.events import find, weigh_here
from stickslip.simulation.exact.flow import Linear, kept_flow
from stickslip.simulation.exact.forces import arrange, bend
from stickslip.simulation.exact.metering import measure
from stickslip.simulation.exact.output import row_after, write_grid, write_rows
from stickslip.simulation.exact.segment import shows
from stickslip.simulation.exact.state import CUT, DEEPEST, EDGE, Laid, Loop, Output, kept_of, loop_of
from stickslip.simulation.exact.step import NOT_CONVERGED, correct, look_ahead
from stickslip.simulation.exact.transition import cross, finish_step, pass_break, perturbation, rest, start

SAFETY = 0.0015
"""Share of the tolerance that one step may be wrong by."""
FINEST = 5e-14  # rad
LONGEST_STEP = 64e-3
FIRST_STEP = 2.5e-4
"""Longest step after an event, s."""
QUARTER_PERIODS = 3.2
"""A visible ringing is not stepped over: radians of it in one step."""
MOST_GROWTH = 8.0
"""Unstable motion grows by no more than exp of this in one step."""


@kernel(exact=False, inline=True)
def lay_steps(loop: Loop, longest: float) -> None:
    """Give every level its step."""
    h = longest
    for i in range(DEEPEST + 1):
        kept_of(loop, i).step = h
        h *= 0.5


@kernel(exact=False)
def growth_of(lin: Linear) -> float:
    """Rate at which unstable motion grows, 1/s; not positive where none does."""
    return lin.frequency - lin.decay if lin.discriminant < 0.0 else 0.0


@kernel(exact=False, inline=True)
def move(lin: Linear, loop: Loop, generation: int, level: int, left: float, tol: float) -> int:
    """Take one step of at most `left`, shortened until it is accurate; returns its level, or -1."""
    segment, count = loop.segment, loop.count
    growth = growth_of(lin)
    while True:
        count.steps += 1
        while level < DEEPEST and growth * min(left, kept_of(loop, level).step) > MOST_GROWTH:
            level += 1
        kept = kept_of(loop, level)
        h = kept.step
        if h > left - 1e-9:
            h = left
            kept = kept_of(loop, CUT)
            kept.generation = 0
        # The one call: a flow over `left` of its own would be taken out of the loop, and computed at every step.
        half = kept_flow(lin, kept, generation, 0.5 * h)
        look_ahead(loop, h, tol)
        error = correct(lin, loop, half, h, tol)
        segment.error = error
        rings = lin.frequency * h > QUARTER_PERIODS and h > 2e-6 and shows(lin, segment, 2.0 * tol)
        if error <= tol and not rings:
            return level
        if level >= DEEPEST:
            return -1 if error >= NOT_CONVERGED else level
        count.rejected += 1
        level += 1
        while level < DEEPEST and kept_of(loop, level).step >= h:
            level += 1


@kernel(exact=False, inline=True)
def next_level(lin: Linear, loop: Loop, level: int, tol: float) -> int:
    """A longer step after an accurate one that was not cut short."""
    segment = loop.segment
    h = segment.length
    if h < 0.999 * kept_of(loop, level).step:
        return level
    error = segment.error
    shortest = max(0, level - 3)
    rounds = 3 if loop.now.bent != 0 else 2
    while level > shortest and error < 0.03 * tol and segment.rounds <= rounds:
        h *= 2.0
        if lin.frequency * h > QUARTER_PERIODS and shows(lin, segment, 2.0 * tol):
            break
        error *= 32.0
        level -= 1
    return level


@kernel(exact=False, inline=True)
def go_on(lin: Linear, loop: Loop, h: float, held: bool, level: int, tol: float) -> int:
    """Stand at the end of a segment without an event; returns the level of the next step."""
    finish_step(loop, loop.now.time + h)
    if loop.parameters[PERTURBATION] != 0.0:
        perturbation(loop, h, tol, False)
        weigh_here(loop)
    return level if held else next_level(lin, loop, level, tol)


@kernel(exact=False)
def storms(loop: Loop) -> bool:
    """Whether more than STORM_EVENTS events came within STORM_TIME; looked at after so many events."""
    now, count = loop.now, loop.count
    if count.events < now.storm_count + STORM_EVENTS:
        return False
    soon = now.time - now.storm_since < STORM_TIME
    now.storm_count = count.events
    now.storm_since = now.time
    return soon


@kernel(exact=False)
def ended(loop: Loop) -> int:
    """DONE, or why the run cannot go on."""
    parameters, plan, now = loop.parameters, loop.plan, loop.now
    theta = abs(now.position)
    v = abs(now.velocity)
    if not (theta <= parameters[POSITION_LIMIT] and v <= parameters[VELOCITY_LIMIT]):
        return DIVERGED if math.isfinite(theta) and math.isfinite(v) else NOT_FINITE
    if storms(loop):
        return STORM
    return TOO_STIFF if loop.count.steps > plan.first_steps + plan.step_rate * now.time else DONE


@kernel(exact=False)
def awaits(loop: Loop, t: float) -> bool:
    """Whether a time of the grid lies before t."""
    written = loop.count.grid_written
    return written < loop.plan.grid_rows and loop.grid[written] <= t + EDGE


@kernel(exact=False)
def solve(laid: Laid, output: Output, light: bool, full: bool, metered: bool) -> int:
    """Run the loop; returns why it ended.

    Position and velocity on the grid are written if `light`, all columns and the events if `full`, metrics if
    `metered`.
    """
    loop = loop_of(laid, output)
    parameters, now = loop.parameters, loop.now
    breaks, acc = pointer(laid.breaks, 0), meter_of(output.acc)
    turns, nodes = turns_of(output.turns), pointer(output.nodes, 0)
    tol = max(SAFETY * parameters[TOLERANCE], FINEST)
    longest = min(LONGEST_STEP, parameters[MAX_STEP])
    after_event = max(0, math.ceil(math.log2(longest / FIRST_STEP)))
    level = after_event
    generation = 1
    next_break = 0
    lay_steps(loop, longest)
    start(loop, breaks[0])
    lin = arrange(loop)
    weigh_here(loop)
    while now.time < parameters[DURATION] - EDGE:
        left = breaks[next_break] - now.time
        held = now.held != 0
        if held:
            event = rest(loop, left)
        else:
            if now.bent != 0:
                lin = bend(loop, min(left, kept_of(loop, level).step))
                generation += 1
            level = move(lin, loop, generation, level, left, tol)
            if level < 0:
                return NO_STEP
            event = find(lin, loop, tol)
        happens = event >= 0.0
        h = event if happens else loop.segment.length
        if light and awaits(loop, now.time + h):
            write_grid(lin, loop, h, 0.1 * tol, generation)
        if full:
            write_rows(lin, loop, h)
        if metered and not measure(lin, loop, h, generation, level, acc, turns, nodes):
            return TOO_FAST
        if happens:
            cross(loop, h, tol, held, full)
            slow_again = growth_of(lin) * FIRST_STEP > MOST_GROWTH
            lin = arrange(loop)
            weigh_here(loop)
            generation += 1
            level = after_event if slow_again else max(level, after_event)
        else:
            level = go_on(lin, loop, h, held, level, tol)
        jumps = happens
        if h >= left - EDGE:
            following = min(next_break + 1, laid.breaks.size - 1)
            if pass_break(loop, breaks[next_break], breaks[following]):
                jumps = True
            next_break = following
        if full and jumps:
            row_after(loop)
        code = ended(loop)
        if code != DONE:
            return code
    return DONE
