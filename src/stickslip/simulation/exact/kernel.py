"""The loop of the exact integrator: step, look for an event, write, change modes."""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import kernel, pointer, record_at
from stickslip.simulation.case_arrays import (
    DIVERGED,
    DONE,
    DURATION,
    KI,
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
from stickslip.simulation.exact.bristle import bend
from stickslip.simulation.exact.event_functions import weigh_here
from stickslip.simulation.exact.events import find
from stickslip.simulation.exact.flow import FLOW, Linear, kept_flow
from stickslip.simulation.exact.metering import measure
from stickslip.simulation.exact.output import row_after, write_grid, write_rows
from stickslip.simulation.exact.perturbation import perturbation
from stickslip.simulation.exact.segment import (
    ERROR,
    LENGTH,
    ROUNDS,
    SEGMENT_SIZE,
    shows,
)
from stickslip.simulation.exact.state import (
    COUNT,
    COUNT_SIZE,
    EDGE,
    NOW,
    NOW_SIZE,
    PLAN,
    SIDE_SIZE,
    arrange,
)
from stickslip.simulation.exact.step import NOT_CONVERGED, correct, look_ahead
from stickslip.simulation.exact.stiction import rest
from stickslip.simulation.exact.transition import cross, finish_step, pass_break, start

SAFETY = 0.0015
"""Share of the tolerance that one step may be wrong by."""
FINEST = 5e-14  # rad
LONGEST_STEP = 64e-3
FIRST_STEP = 2.5e-4
"""Longest step after an event, s."""
DEEPEST = 24
"""Steps are the longest one halved up to this many times, so that their flows are computed once per mode."""
QUARTER_PERIODS = 3.2
"""A visible ringing is not stepped over: radians of it in one step."""
MOST_GROWTH = 8.0
"""Unstable motion grows by no more than exp of this in one step."""


LEVEL = FLOW + 1
"""Entries per level in the cache of flows: the flow over half its step, and the step. After the levels follow the
flow over the grid's spacing, and that of a step that is cut short."""
SPACED = LEVEL * (DEEPEST + 1)
CUT = SPACED + FLOW
AT_NOW = COUNT_SIZE
AT_SEGMENT = AT_NOW + NOW_SIZE
AT_CACHE = AT_SEGMENT + SEGMENT_SIZE
AT_SIDES = AT_CACHE + CUT + FLOW
AT_ELEMENTS = AT_SIDES + 2 * SIDE_SIZE
"""Places in `work`; the elements end it."""


@kernel(exact=False)
def growth_of(lin: Linear) -> float:
    """Rate at which unstable motion grows, 1/s; not positive where none does."""
    return lin.frequency - lin.decay if lin.discriminant < 0.0 else 0.0


@kernel(exact=False, inline=True)
def move(
    lin: Linear, parameters: Any, plan: Any, cells: Any, elements: Any, sides: Any, now: Any, segment: Any,
    cache: Any, generation: int, count: Any, level: int, left: float, tol: float,
) -> int:  # fmt: skip
    """Take one step of at most `left`, shortened until it is accurate; returns its level, or -1."""
    growth = growth_of(lin)
    while True:
        count.steps += 1
        while level < DEEPEST and growth * min(left, cache[level * LEVEL + FLOW]) > MOST_GROWTH:
            level += 1
        h = cache[level * LEVEL + FLOW]
        kept = pointer(cache, level * LEVEL)
        if h > left - 1e-9:
            h = left
            kept = pointer(cache, CUT)
            kept[FLOW - 1] = 0.0
        # The one call: a flow over `left` of its own would be taken out of the loop, and computed at every step.
        half = kept_flow(lin, kept, generation, 0.5 * h)
        look_ahead(parameters, plan, cells, now, segment, h, tol)
        error = correct(lin, parameters, plan, sides, now, segment, half, h, tol)
        segment[ERROR] = error
        rings = lin.frequency * h > QUARTER_PERIODS and h > 2e-6 and shows(lin, segment, 2.0 * tol)
        if error <= tol and not rings:
            return level
        if level >= DEEPEST:
            return -1 if error >= NOT_CONVERGED else level
        count.rejected += 1
        level += 1
        while level < DEEPEST and cache[level * LEVEL + FLOW] >= h:
            level += 1


@kernel(exact=False, inline=True)
def next_level(lin: Linear, now: Any, segment: Any, cache: Any, level: int, tol: float) -> int:
    """A longer step after an accurate one that was not cut short."""
    h = segment[LENGTH]
    if h < 0.999 * cache[level * LEVEL + FLOW]:
        return level
    error = segment[ERROR]
    shortest = max(0, level - 3)
    rounds = 3.0 if now.bent != 0 else 2.0
    while level > shortest and error < 0.03 * tol and segment[ROUNDS] <= rounds:
        h *= 2.0
        if lin.frequency * h > QUARTER_PERIODS and shows(lin, segment, 2.0 * tol):
            break
        error *= 32.0
        level -= 1
    return level


@kernel(exact=False)
def ended(parameters: Any, now: Any) -> int:
    """DONE, or why the run cannot go on."""
    theta = abs(now.position)
    v = abs(now.velocity)
    if theta <= parameters[POSITION_LIMIT] and v <= parameters[VELOCITY_LIMIT]:
        return DONE
    if math.isfinite(theta) and math.isfinite(v):
        return DIVERGED
    return NOT_FINITE


@kernel(exact=False)
def storms(count: Any, now: Any) -> bool:
    """Whether more than STORM_EVENTS events came within STORM_TIME; looked at after so many events."""
    if count.events < now.storm_count + STORM_EVENTS:
        return False
    soon = now.time - now.storm_since < STORM_TIME
    now.storm_count = count.events
    now.storm_since = now.time
    return soon


@kernel(exact=False)
def awaits(plan: Any, grid: Any, count: Any, t: float) -> bool:
    """Whether a time of the grid lies before t."""
    return count.grid_written < plan.grid_rows and grid[count.grid_written] <= t + EDGE


@kernel(exact=False)
def solve(
    parameter_array: Any, plan_array: Any, cell_array: Any, break_array: Any, grid_array: Any, work: Any,
    out_array: Any, row_array: Any, acc: Any, turns: Any, nodes: Any, light: bool, full: bool, metered: bool,
) -> int:  # fmt: skip
    """Run the loop; returns why it ended.

    ``work`` holds `count`, the loop's state (whose first entry is the time), and what `exact.state` calls sides
    and elements. Position and velocity on the grid go to ``out_array`` (n, 2) if `light`, all columns and the
    events to ``row_array`` if `full`, metrics to ``acc`` and ``turns`` if `metered`.
    """
    parameters = pointer(parameter_array, 0)
    plan = record_at(pointer(plan_array, 0), PLAN)
    cells = pointer(cell_array, 0)
    breaks = pointer(break_array, 0)
    grid = pointer(grid_array, 0)
    out = pointer(out_array, 0)
    rows = pointer(row_array, 0)
    count = record_at(pointer(work, 0), COUNT)
    now = record_at(pointer(work, AT_NOW), NOW)
    segment = pointer(work, AT_SEGMENT)
    cache = pointer(work, AT_CACHE)
    spaced = pointer(cache, SPACED)
    sides = pointer(work, AT_SIDES)
    elements = pointer(work, AT_ELEMENTS)
    tol = max(SAFETY * parameters[TOLERANCE], FINEST)
    longest = min(LONGEST_STEP, parameters[MAX_STEP])
    after_event = max(0, math.ceil(math.log2(longest / FIRST_STEP)))
    level = after_event
    generation = 1
    next_break = 0
    h = longest
    for i in range(DEEPEST + 1):
        cache[i * LEVEL + FLOW] = h
        h *= 0.5
    start(parameters, plan, cells, elements, sides, now, breaks)
    lin = arrange(parameters, plan, elements, sides, now)
    weigh_here(plan, elements, sides, now)
    while now.time < parameters[DURATION] - EDGE:
        left = breaks[next_break] - now.time
        held = now.held != 0
        if held:
            event = rest(parameters, plan, cells, elements, sides, now, segment, left)
        else:
            if now.bent != 0:
                lin = bend(parameters, plan, sides, now, min(left, cache[level * LEVEL + FLOW]))
                generation += 1
            level = move(
                lin, parameters, plan, cells, elements, sides, now, segment, cache, generation, count, level, left,
                tol,
            )  # fmt: skip
            if level < 0:
                return NO_STEP
            event = find(lin, parameters, plan, elements, sides, now, segment, tol)
        happens = event >= 0.0
        h = event if happens else segment[LENGTH]
        if light and awaits(plan, grid, count, now.time + h):
            write_grid(lin, plan, now, segment, grid, count, out, h, 0.1 * tol, spaced, generation)
        if full:
            write_rows(lin, parameters, plan, cells, sides, now, segment, grid, count, rows, h)
        if metered and not measure(lin, parameters, plan, cells, sides, now, segment, h, acc, turns, nodes):
            return TOO_FAST
        if happens:
            cross(parameters, plan, cells, elements, sides, now, segment, count, rows, h, tol, held, full)
            slow_again = growth_of(lin) * FIRST_STEP > MOST_GROWTH
            lin = arrange(parameters, plan, elements, sides, now)
            weigh_here(plan, elements, sides, now)
            generation += 1
            level = after_event if slow_again else max(level, after_event)
        else:
            finish_step(plan, sides, now, segment, now.time + h, parameters[KI])
            if parameters[PERTURBATION] != 0.0:
                perturbation(parameters, plan, elements, now, h, tol, False)
                weigh_here(plan, elements, sides, now)
            if not held:
                level = next_level(lin, now, segment, cache, level, tol)
        jumps = happens
        if h >= left - EDGE:
            following = min(next_break + 1, break_array.size - 1)
            if pass_break(parameters, plan, cells, sides, now, breaks[next_break], breaks[following]):
                jumps = True
            next_break = following
        if full and jumps:
            row_after(parameters, plan, sides, now, count, rows)
        code = ended(parameters, now)
        if code != DONE:
            return code
        if storms(count, now):
            return STORM
        if count.steps > plan.first_steps + plan.step_rate * now.time:
            return TOO_STIFF
    return DONE
