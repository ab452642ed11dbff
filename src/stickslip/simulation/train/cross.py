"""A sample of a train under a held torque, from event to event.

Steps lie on halves, quarters and so on of the sample, whose flows are kept; only behind an event, until the next of
these, are flows made for one step.
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import kernel
from stickslip.simulation.sampled.modes import break_away, turn
from stickslip.simulation.sampled.rates import SLIPS, STUCK
from stickslip.simulation.train.blocks import kept, partial, series
from stickslip.simulation.train.events import BREAKS, NONE, TURNS, UNSEEN, look
from stickslip.simulation.train.records import BLOCKS, SLIDING, STICKING, Train
from stickslip.simulation.train.step import begin, solve, take

DEEPEST = 40
"""Halvings of a sample that a step may need; then there is none."""
FAR = 500.0
"""Tolerances by which a step may be wrong that half as long a one would keep."""
STORM = 1000
"""Events in a sample that are too many."""
GROWS = 1e-3
"""Of the tolerance, below which the next step is twice as long: its error then grows some 500 times."""
SLIVER = 0.2
"""Of a step: less than that up to its place on the sample is taken together with it."""
SNAP = 1e-13
"""Of a sample: an event so near to the end of a step is there."""


@kernel()
def advance(train: Train, x: Any, torque: float, start: float, end: float) -> int:
    """Move on from one part of a sample to another under a torque, N·m; returns the steps, or -1 if there are none."""
    n, z = train.n, train.z
    place, steps = start, 0
    n.events = 0
    while place < end:
        place = step(train, x, torque, place, end)
        steps += 1
        if n.level > DEEPEST or n.events > STORM or not math.isfinite(z.velocity):
            return -1
    return steps


@kernel()
def step(train: Train, x: Any, torque: float, place: float, end: float) -> float:
    """Take one step; returns the part of the sample that it ends at."""
    n, z = train.n, train.z
    kind = SLIDING if z.mode == SLIPS else STICKING
    if kind == SLIDING and z.spring > 0.0:
        kind = partial(train, z.spring)
    level = n.level if kind == SLIDING else max(n.level, n.watched)
    begin(train, x, torque)
    while True:
        level, length = fitting(n, level, place, end)
        block = flow_over(train, kind, level, length)
        wrong = solve(train, block, length * n.sample_time)
        found, at, way = NONE, 1.0, 0.0
        if wrong <= 1.0:
            found, at, way = look(train, length * n.sample_time, level >= n.resolved, level >= n.watched)
        if found != UNSEEN and 0.0 < at < 1.0:
            # Cut where the axis turns, the step meets the curve's peak there, which the whole one may not have seen.
            length *= at
            block = flow_over(train, kind, DEEPEST, length)
            wrong = solve(train, block, length * n.sample_time)
        if wrong <= 1.0 and found != UNSEEN:
            break
        level += 1 if found == UNSEEN or wrong < FAR else 2
        while length * float(1 << level) < 1.0:
            level += 1
        if level > DEEPEST:
            n.level = level
            return place
    n.level = level - 1 if wrong < GROWS and level > 0 else level
    if at > 0.0:
        take(train, block, length * n.sample_time, x)
    else:
        length = 0.0
    if found != NONE:
        happen(train, x, found, way)
    return snapped(place + length, n.deepest, end)


@kernel(inline=True)
def flow_over(train: Train, kind: int, level: int, length: float) -> int:
    """Where the flow of a system over a part of the sample lies, made where it is not kept."""
    n = train.n
    if level <= n.deepest and length * float(1 << level) == 1.0:
        return kept(train, kind, level)
    series(train, kind, length * n.sample_time, BLOCKS)
    return BLOCKS


@kernel(inline=True)
def snapped(place: float, deepest: int, end: float) -> float:
    """A part of the sample, or the end of a step that it lies beside by rounding."""
    parts = float(1 << deepest)
    whole = math.floor(place * parts + 0.5) / parts
    if abs(place - whole) < SNAP:
        place = whole
    return end if end - place < SNAP else place


@kernel(inline=True)
def fitting(n: Any, level: int, place: float, end: float) -> tuple[int, float]:
    """How long a step of about so many halvings may be, in samples, to lie on a part of it; its halvings."""
    while level < n.resolved:
        parts = float(1 << level)
        at = place * parts
        if at == math.floor(at) and at + 1.0 <= end * parts:
            return level, 1.0 / parts
        level += 1
    parts = float(1 << level)
    following = math.floor(place * parts) + 1.0
    if following - place * parts < SLIVER:
        following += 1.0
    return level, min(following / parts, end) - place


@kernel()
def happen(train: Train, x: Any, what: int, way: float) -> None:
    """An element breaks away, or the axis turns."""
    n, z = train.n, train.z
    n.events += 1
    if what == BREAKS:
        break_away(train.axis, z, way)
    elif what == TURNS:
        turn(train.axis, z)
        x[n.turning] = 0.0
    if z.mode == STUCK:
        n.level = 0
