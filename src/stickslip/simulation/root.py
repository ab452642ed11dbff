"""The root finder of every implicit step: the velocity at which what is left of its equation vanishes.

Written in the scalar subset and turned inside out: the caller evaluates the equation, `improve` says where next. So one
text serves compiled engines, vectors of cases and C, and knows nothing of what it solves.

**What is solved.** f(v) = 0, where f is the momentum (or velocity) that a step lacks at its end velocity v. f rises
with v where friction does; it falls where friction falls steeply with the velocity, and jumps where friction jumps.

**Which root.** The one next to the velocity guessed: the first change of sign that is met from there in the direction
in which f drives. Beyond a stretch where f falls lie others, which the motion does not reach.

**How.** A step of Newton's kind with the slope that the last search ended with, which a linear contact needs no second
one after; then secants that lead at least as far again, at most ten times, until the sign changes; then secants between
the two ends, and the middle where they do not help (Bus and Dekker 1975: so no search takes longer than by halves).
Where friction rises like a power of the velocity (|v|^0.38 of thesis Table 10 has no slope at rest) secants are blind:
rest is looked at where it lies between the ends, and what exceeds f at rest is followed as factor |v|^power.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import compiled_kernels
from stickslip.subset import Layout

ROOT = Layout(
    (
        "x", "last", "f_last", "other", "phase", "inverse", "enough", "rounding", "least", "sharp", "rested", "rest",
        "power", "factor",
    )
)  # fmt: skip
"""x: where the equation is to be evaluated, in the end the root. inverse: of the slope, kept from search to search.
enough: |f| over max(|x|, least) that is none; rounding: of x, to which ends that enclose a jump approach. sharp: 1
where powers are looked for. power, factor: of the rise beyond f at rest, kept as well."""
SEARCH = np.dtype([(name, np.float64) for name in ROOT.scalars])
"""The same as a record."""
MOST = 200
"""Evaluations of a search."""
GUESSED, LEADS_ON, NARROWS, SOLVED = 0.0, 1.0, 2.0, 3.0  # phase
FINEST = 1e-3
"""rad/s, below which ends approach no further than rounding of it."""
TINIEST = 1e-12
"""rad/s, below which a velocity is none where ends lie far apart."""


def ready(r: Any, rises: float, rounding: float, least: float, sharp: float) -> None:
    """What is kept from search to search, before the first: f rises at least by `rises` with x, which is found to the
    part `rounding` of itself above `least`."""
    r.inverse = 1.0 / rises
    r.enough = rises * rounding
    r.rounding = rounding
    r.least = least
    r.sharp = sharp
    r.power = 0.0
    r.factor = 0.0


def begin(r: Any, guess: float) -> None:
    """Look for the root next to `guess`; from rest, where the last one was found by a power."""
    r.x = 0.0 if r.sharp > 0.0 and r.power > 0.0 and r.power < 0.9 else guess
    r.phase = GUESSED
    r.rested = 0.0


def begin_beyond(r: Any, last: float, f_last: float, guess: float) -> None:
    """Look for the root next to `last`, where f is known to be `f_last`, from `guess` on."""
    r.x = guess
    r.last = last
    r.f_last = f_last
    r.phase = LEADS_ON
    r.rested = 1.0 if last == 0.0 else 0.0
    r.rest = f_last


def improve(r: Any, f: float) -> float:
    """Take f at ``x``; returns 1 where it is to be evaluated at the new ``x``, 0 where ``x`` is the root.

    It is over, too, where f is not finite.
    """
    if r.phase == SOLVED:
        return 0.0
    x = r.x
    inverse = r.inverse
    if r.phase != GUESSED:
        inverse = (x - r.last) / (f - r.f_last) if f != r.f_last else math.inf
        if f * r.f_last <= 0.0:
            r.phase = NARROWS
            r.other = r.last
    apart = r.phase < NARROWS or abs(x - r.other) > r.rounding * max(abs(x), FINEST)
    if apart and abs(f) > r.enough * max(abs(x), r.least) and abs(f) < math.inf:
        r.x = next_place(r, x, f, x - f * inverse)
        r.last = x
        r.f_last = f
        return 1.0
    if inverse > 0.0 and inverse < math.inf:
        r.inverse = inverse
    r.phase = SOLVED
    return 0.0


def next_place(r: Any, x: float, f: float, secant: float) -> float:
    """Where to evaluate next, and what kind of place that is."""
    if r.phase == NARROWS:
        return narrower(r, x, f, secant)
    goal = farther(r, x, f, secant) if r.phase == LEADS_ON else secant
    r.phase = LEADS_ON
    if r.sharp > 0.0 and x == 0.0:
        return from_rest(r, f, goal)
    return goal


def farther(r: Any, x: float, f: float, secant: float) -> float:
    """On from x, beyond which the root lies: at least a tenth as far again, at most ten times."""
    run = x - r.last
    step = secant - x
    if r.sharp > 0.0 and r.rested > 0.0:
        leap = by_power(r, x, f)
        if leap * x > 0.0 and abs(leap) > abs(x):
            return leap
    if step * run > 0.0 and 1.1 * abs(step) < 10.0 * abs(run):
        return x + 1.1 * step
    return x + 10.0 * run


def narrower(r: Any, x: float, f: float, secant: float) -> float:
    """A place between x and ``other``, which enclose the root."""
    other = r.other
    goal = secant
    if r.sharp > 0.0 and x == 0.0:
        r.rested = 1.0
        r.rest = f
    elif r.sharp > 0.0 and r.rested > 0.0:
        goal = by_power(r, x, f)
    if min(x, other) < goal and goal < max(x, other) and abs(f) <= 0.5 * abs(r.f_last):
        return goal
    if r.sharp > 0.0:
        r.power = 0.0
        if x * other < 0.0:
            return 0.0
        near = min(abs(x), abs(other))
        far = max(abs(x), abs(other))
        if far > 8.0 * near and far > 8.0 * TINIEST:
            return math.copysign(math.sqrt(max(near, TINIEST) * far), x + other)
    return 0.5 * (x + other)


def from_rest(r: Any, f: float, goal: float) -> float:
    """Remember f at rest; where the last search ended with a power, that leads on from there."""
    r.rested = 1.0
    r.rest = f
    if r.power > 0.0 and r.power < 0.9:
        return math.copysign((abs(f) / r.factor) ** (1.0 / r.power), -f)
    return goal


def by_power(r: Any, x: float, f: float) -> float:
    """Where the rise beyond f at rest, taken as factor |x|^power, makes up for it; x where it does not rise."""
    rise = math.copysign(1.0, x) * (f - r.rest)
    needed = -math.copysign(1.0, x) * r.rest
    if rise <= 0.0 or needed <= 0.0:
        return x
    power = r.power if r.power > 0.0 else 1.0
    if r.last * x > 0.0 and r.last != x:
        before = math.copysign(1.0, x) * (r.f_last - r.rest)
        if before > 0.0 and before != rise:
            power = min(max(math.log(rise / before) / math.log(x / r.last), 0.2), 2.0)
    r.power = power
    if abs(power - 1.0) < 0.1:
        return x * needed / rise
    r.factor = rise / abs(x) ** power
    return x * (needed / rise) ** (1.0 / power)


compiled: Any = compiled_kernels(
    "root", {each.__name__: each for each in (ready, begin, begin_beyond, improve)}, {"r": ROOT}
)
"""The functions above for kernels; ``r`` is an address."""
