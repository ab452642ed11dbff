"""The loop of the exact integrator: step, look for an event, write, change modes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import kernel
from stickslip.simulate._case import (
    DIVERGED,
    DONE,
    DURATION,
    KI,
    MAX_STEP,
    NO_STEP,
    NOT_FINITE,
    POSITION_0,
    POSITION_LIMIT,
    STORM,
    STORM_EVENTS,
    STORM_TIME,
    TOLERANCE,
    VELOCITY_0,
    VELOCITY_LIMIT,
)
from stickslip.simulate._exact_events import add_exponents, find, release, set_off, switch, too_long
from stickslip.simulate._exact_flow import Linear, Matrix, flow
from stickslip.simulate._exact_output import measure, row_after, row_before, write_grid, write_rows
from stickslip.simulate._exact_rest import rest
from stickslip.simulate._exact_state import (
    DR,
    DS,
    DS_END,
    EDGE,
    EDGE_HIGH,
    EDGE_LOW,
    GOAL,
    GOAL_RATE,
    HELD,
    INTEGRAL,
    LOOP_SIZE,
    POSITION,
    Q_END,
    S_END,
    S_NOW,
    SIDES,
    SIGMA,
    SLIPPING,
    TIME,
    VARIES,
    VELOCITY,
    Q,
    R,
    S,
    arrange,
    begin_slopes,
    command,
)
from stickslip.simulate._exact_step import (
    AMPLITUDE,
    DR_END,
    ERROR,
    GOAL_END,
    INTEGRAL_END,
    LENGTH,
    NOT_CONVERGED,
    POSITION_END,
    R_END,
    RATE_END,
    ROUNDS,
    STRETCH_SIZE,
    VELOCITY_END,
    correct,
    free_amplitude,
    integral_at,
    look_ahead,
    slip_force_at,
    state_at,
)
from stickslip.simulate._meter import close_standstill

STEPS, REJECTED, EVENTS, COUNTS = range(4)
SAFETY = 0.02
"""Share of the tolerance that one step may be wrong by."""
FINEST = 2e-12  # rad
LONGEST_STEP = 8e-3
FIRST_STEP = 2.5e-4
"""Longest step after an event, s."""
DEEPEST = 24
"""Steps are the longest one halved up to this many times, so that their flows are computed once per mode."""
QUARTER_PERIODS = 3.2
"""A visible ringing is not stepped over: radians of it in one step."""


@kernel(exact=False)
def flow_of_level(lin: Linear, cache: Any, generation: int, level: int, half: float) -> Matrix:
    """The flow over half a step of a level, computed once for every set of modes."""
    if cache[level, 4] != generation:
        m = flow(lin, half)
        cache[level, 0] = m[0]
        cache[level, 1] = m[1]
        cache[level, 2] = m[2]
        cache[level, 3] = m[3]
        cache[level, 4] = generation
        return m
    return cache[level, 0], cache[level, 1], cache[level, 2], cache[level, 3]


@kernel(exact=False)
def move(
    lin: Linear, parameters: Any, plan: Any, cells: Any, elements: Any, sides: Any, loop: Any, stretch: Any,
    cache: Any, generation: int, counts: Any, level: int, longest: float, left: float,
) -> int:  # fmt: skip
    """Take one step of at most `left`, shortened until it is accurate; returns its level, or -1."""
    tol = max(SAFETY * parameters[TOLERANCE], FINEST)
    while True:
        counts[STEPS] += 1
        h = math.ldexp(longest, -level)
        if h > left - 1e-9:
            h = left
            half = flow(lin, 0.5 * h)
        else:
            half = flow_of_level(lin, cache, generation, level, 0.5 * h)
        look_ahead(parameters, plan, cells, loop, stretch, h)
        error = correct(lin, parameters, plan, sides, loop, stretch, half, h, tol)
        stretch[ERROR] = error
        amplitude = free_amplitude(lin, stretch)
        stretch[AMPLITUDE] = amplitude
        rings = amplitude > 2.0 * tol and lin.frequency * h > QUARTER_PERIODS and h > 2e-6
        if error <= tol and not rings and not too_long(plan, elements, sides, loop, stretch):
            return level
        if level >= DEEPEST:
            return -1 if error >= NOT_CONVERGED else level
        counts[REJECTED] += 1
        level += 1
        while level < DEEPEST and math.ldexp(longest, -level) >= h:
            level += 1


@kernel(exact=False)
def next_level(lin: Linear, stretch: Any, level: int, longest: float, tol: float) -> int:
    """A longer step after an accurate one that was not cut short."""
    h = stretch[LENGTH]
    if level == 0 or h < 0.999 * math.ldexp(longest, -level):
        return level
    rings = stretch[AMPLITUDE] > 2.0 * tol and 2.0 * lin.frequency * h > QUARTER_PERIODS
    if stretch[ERROR] < 0.03 * tol and stretch[ROUNDS] <= 2 and not rings:
        return level - 1
    return level


@kernel(exact=False)
def finish_step(plan: Any, sides: Any, loop: Any, stretch: Any, t: float, ki: float) -> None:
    """Stand at the end of the stretch; modes stay."""
    add_exponents(plan, sides, stretch[LENGTH], stretch[LENGTH])
    for side in range(plan[SIDES]):
        if sides[side, SLIPPING] > 0.0 and sides[side, VARIES] > 0.0:
            sides[side, S] = sides[side, S_END]
            sides[side, S_NOW] = sides[side, S_END]
            sides[side, DS] = sides[side, DS_END]
            sides[side, Q] = sides[side, Q_END]
    loop[TIME] = t
    loop[POSITION] = stretch[POSITION_END]
    loop[VELOCITY] = stretch[VELOCITY_END]
    loop[R] = stretch[R_END]
    loop[DR] = stretch[DR_END]
    loop[GOAL] = stretch[GOAL_END]
    loop[GOAL_RATE] = stretch[RATE_END]
    if ki != 0.0:
        loop[INTEGRAL] = stretch[INTEGRAL_END]


@kernel(exact=False)
def finish_event(
    parameters: Any, plan: Any, cells: Any, sides: Any, loop: Any, stretch: Any, x: float, theta: float, v: float
) -> None:  # fmt: skip
    """Stand at the event x; modes are about to change."""
    add_exponents(plan, sides, stretch[LENGTH], x)
    for side in range(plan[SIDES]):
        sides[side, S_NOW] = slip_force_at(sides, stretch, side, x)
    loop[INTEGRAL] = integral_at(parameters, loop, stretch, x)
    loop[TIME] += x
    loop[POSITION] = theta
    loop[VELOCITY] = v
    stand(parameters, plan, cells, loop)


@kernel(exact=False)
def stand(parameters: Any, plan: Any, cells: Any, loop: Any) -> None:
    """Take the reference where the loop stands."""
    r, dr, goal, rate = command(parameters, plan, cells, loop, loop[TIME])
    loop[R] = r
    loop[DR] = dr
    loop[GOAL] = goal
    loop[GOAL_RATE] = rate


@kernel(exact=False)
def start(parameters: Any, plan: Any, cells: Any, elements: Any, sides: Any, breaks: Any) -> Any:
    """Return the loop at t = 0."""
    loop = np.zeros(LOOP_SIZE)
    loop[EDGE_LOW] = EDGE
    loop[EDGE_HIGH] = breaks[0] - EDGE
    loop[POSITION] = parameters[POSITION_0]
    loop[VELOCITY] = parameters[VELOCITY_0]
    if loop[VELOCITY] != 0.0:
        loop[SIGMA] = 1.0 if loop[VELOCITY] > 0.0 else -1.0
    stand(parameters, plan, cells, loop)
    if loop[VELOCITY] == 0.0:
        set_off(plan, elements, sides, parameters, loop)
    return loop


@kernel(exact=False)
def ended(parameters: Any, loop: Any) -> int:
    """DONE, or why the run cannot go on."""
    theta = abs(loop[POSITION])
    v = abs(loop[VELOCITY])
    if theta <= parameters[POSITION_LIMIT] and v <= parameters[VELOCITY_LIMIT]:
        return DONE
    if math.isfinite(theta) and math.isfinite(v):
        return DIVERGED
    return NOT_FINITE


@kernel(exact=False)
def solve(
    parameters: Any, plan: Any, cells: Any, elements: Any, sides: Any, breaks: Any, grid: Any, spacing: float,
    out: Any, rows: Any, metered: bool, acc: Any, turns: Any, counts: Any, written: Any, stiffness_floor: float,
) -> tuple[int, float]:  # fmt: skip
    """Run the loop; returns why it ended, and when.

    ``out`` (n, 2) receives position and velocity on the grid, ``rows`` every column and the events; either may
    be empty. ``written`` is (rows, grid rows) written, ``counts`` steps, rejected steps and events.
    """
    loop = start(parameters, plan, cells, elements, sides, breaks)
    stretch = np.zeros(STRETCH_SIZE)
    cache = np.zeros((DEEPEST + 1, 5))
    nodes = np.zeros((8, 5))
    tol = max(SAFETY * parameters[TOLERANCE], FINEST)
    ki = parameters[KI]
    longest = min(LONGEST_STEP, parameters[MAX_STEP])
    after_event = max(0, int(math.ceil(math.log2(longest / FIRST_STEP))))
    level = after_event
    generation = 1
    storm_events = 0
    storm_time = 0.0
    code = DONE
    next_break = 0
    full = rows.shape[0] > 0
    light = out.shape[0] > 0
    lin = arrange(parameters, plan, elements, sides, loop, stiffness_floor)
    while loop[TIME] < parameters[DURATION] - EDGE:
        left = breaks[next_break] - loop[TIME]
        held = loop[HELD] > 0.0
        if held:
            event = rest(parameters, plan, cells, elements, sides, loop, stretch, left)
        else:
            level = move(
                lin, parameters, plan, cells, elements, sides, loop, stretch, cache, generation, counts, level,
                longest, left,
            )  # fmt: skip
            if level < 0:
                code = NO_STEP
                break
            event = find(lin, parameters, plan, elements, sides, loop, stretch, tol)
        happens = event >= 0.0
        h = event if happens else stretch[LENGTH]
        if light:
            written[1] = write_grid(lin, loop, stretch, grid, spacing, out, written[1], h)
        if full:
            write_rows(lin, parameters, plan, cells, sides, loop, stretch, grid, written, rows, h)
        if metered:
            measure(lin, parameters, plan, cells, sides, loop, stretch, h, acc, turns, nodes)
        reaches = h >= left - EDGE
        if happens:
            counts[EVENTS] += 1
            theta, v = state_at(lin, stretch, h)
            if full:
                row_before(parameters, plan, cells, sides, loop, stretch, grid, written, rows, h, theta, v)
            finish_event(parameters, plan, cells, sides, loop, stretch, h, theta, v)
            switch(parameters, plan, elements, sides, loop)
            if held:
                release(plan, elements, sides, parameters, loop)
            lin = arrange(parameters, plan, elements, sides, loop, stiffness_floor)
            generation += 1
            level = max(level, after_event)
            storm_events += 1
        else:
            finish_step(plan, sides, loop, stretch, loop[TIME] + h, ki)
            if not held:
                level = next_level(lin, stretch, level, longest, tol)
        if reaches:
            loop[TIME] = breaks[next_break]
            loop[EDGE_LOW] = loop[TIME] + EDGE
            next_break = min(next_break + 1, breaks.shape[0] - 1)
            loop[EDGE_HIGH] = breaks[next_break] - EDGE
            before = loop[R]
            stand(parameters, plan, cells, loop)
            begin_slopes(parameters, plan, sides, loop, lin)
            if full and abs(loop[R] - before) > 1e-9:
                row_after(parameters, plan, sides, loop, grid, written, rows)
        if happens and full:
            row_after(parameters, plan, sides, loop, grid, written, rows)
        code = ended(parameters, loop)
        if code != DONE:
            break
        if storm_events >= STORM_EVENTS:
            if loop[TIME] - storm_time < STORM_TIME:
                code = STORM
                break
            storm_events = 0
            storm_time = loop[TIME]
    if metered:
        close_standstill(acc, loop[TIME])
    return code, loop[TIME]
