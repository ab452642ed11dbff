"""One step of the adaptive integrator: tried, judged, and ended at the first event.

Dormand-Prince 5(4) (Dormand and Prince 1980) with the dense output of Hairer, Norsett and Wanner (Solving ODEs I,
II.6); where a fast decay limits smooth steps, Runge-Kutta-Chebyshev (`stickslip.simulation.adaptive.chebyshev`).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import kernel, pointer
from stickslip.simulation.adaptive.chebyshev import chebyshev, chebyshev_error, stages_for
from stickslip.simulation.adaptive.dormand_prince import ERROR, NODES, TABLEAU
from stickslip.simulation.adaptive.hybrid import calm_step, rates, small_enough
from stickslip.simulation.adaptive.layout import SCRATCH, STAGES, Loop, named
from stickslip.simulation.adaptive.switching import events
from stickslip.simulation.case_arrays import DONE, NO_STEP, NOT_FINITE, TOLERANCE

SHORTEST = 1e-14
LOCAL = 1e-3
"""Error allowed in one step over the tolerance of a run: thousands of steps add up, and events carry them on."""
RINGING, DECAYING = 1.6, 2.8
"""Step times the largest eigenvalue that explicit stages damp: imaginary ones to about 1.6, real ones to 3.3."""
RELY = 4
"""Chebyshev steps after which the decay rate is taken anew."""
PROBE = 100.0
"""Length of the probe, in tolerances."""
LARGEST_GAIN = 4.0
"""Step times decay rate from which Chebyshev steps cost less than Dormand-Prince ones."""


@kernel()
def stages(loop: Loop, t: float, h: float) -> None:
    """One Dormand-Prince step from y; row 0 of the rates holds those at its start, row 6 receives those at its end.

    ``middle`` is left with the state of stage 5.
    """
    n, y, k = loop.case.states, loop.y, loop.rates
    for s in range(1, 7):
        for j in range(n):
            rise = 0.0
            for m in range(s):
                rise += TABLEAU[s, m] * k[m * n + j]
            if s < 6:
                loop.middle[j] = y[j] + h * rise
            else:
                loop.end[j] = y[j] + h * rise
        if s < 6:
            rates(loop, t + NODES[s] * h, loop.middle, pointer(k, s * n))
        else:
            rates(loop, t + h, loop.end, pointer(k, s * n))
    for j in range(n):
        off = 0.0
        for m in range(STAGES):
            off += ERROR[m] * k[m * n + j]
        loop.error[j] = h * off


@kernel()
def dense(loop: Loop, h: float, x: float, out: Any) -> None:
    """State at the fraction x of a step: fourth order for Dormand-Prince steps, cubic for others."""
    n, y, k, end = loop.case.states, loop.y, loop.rates, loop.end
    fourth, z = loop.step.fourth, 1.0 - x
    for j in range(n):
        rise = end[j] - y[j]
        bend = h * k[j] - rise
        skew = rise - h * k[6 * n + j] - bend
        fine = (
            fourth
            * h
            * (
                -12715105075.0 / 11282082432.0 * k[j]
                + 87487479700.0 / 32700410799.0 * k[2 * n + j]
                - 10690763975.0 / 1880347072.0 * k[3 * n + j]
                + 701980252875.0 / 199316789632.0 * k[4 * n + j]
                - 1453857185.0 / 822651844.0 * k[5 * n + j]
                + 69997945.0 / 29380423.0 * k[6 * n + j]
            )
        )
        out[j] = y[j] + x * (rise + z * (bend + x * (skew + z * fine)))


@kernel()
def ratio(loop: Loop) -> float:
    """The largest error in units of its tolerance; infinite where it is no number."""
    largest = 0.0
    for j in range(loop.case.states):
        r = abs(loop.error[j]) / loop.tolerance[j]
        if not r <= 1e300:
            return np.inf
        largest = max(largest, r)
    return largest


@kernel()
def stiffness_limit(loop: Loop) -> tuple[float, float]:
    """Longest next step that follows the fastest motion present instead of ringing at the border of stability, and
    the rate of that motion if it decays (else 0).

    The last two stages belong to the same time: the difference of their rates against that of their states tells
    the largest eigenvalue and whether it decays or rings (Hairer and Wanner, Solving ODEs II, IV.2). ``middle`` holds
    the state of stage 5; ``direction`` receives the direction of the motion, of length 1 in tolerances.
    """
    n, k, end, u, tolerance = loop.case.states, loop.rates, loop.end, loop.middle, loop.tolerance
    above, below, along = 0.0, 0.0, 0.0
    for j in range(n):
        rate = (k[6 * n + j] - k[5 * n + j]) / tolerance[j]
        state = (end[j] - u[j]) / tolerance[j]
        above += rate * rate
        below += state * state
        along += rate * state
    if above <= 0.0 or below <= 0.0:
        return math.inf, 0.0
    size = math.sqrt(above / below)
    for j in range(n):
        loop.direction[j] = (end[j] - u[j]) / math.sqrt(below)
    decays = along < -0.95 * math.sqrt(above * below)
    return (DECAYING / size, size) if decays else (RINGING / size, 0.0)


@kernel()
def note(loop: Loop, y: Any, nodes: Any, i: int) -> None:
    """Write the signals of the state whose rates were taken last into column i of the meter's nodes."""
    now, position = loop.now, named(y).position
    nodes[0, i] = now.reference.position - position
    nodes[1, i] = now.reference.velocity - now.seen_velocity
    nodes[2, i] = position
    nodes[3, i] = now.seen_velocity
    nodes[4, i] = now.reference.velocity
    nodes[5, i] = now.motor_torque
    nodes[6, i] = now.friction_torque
    nodes[7, i] = now.compensation_torque


@kernel()
def turns_between(loop: Loop) -> bool:
    """Whether the acceleration changes its sign from the start of a step to its end."""
    return named(loop.rates).velocity * named(pointer(loop.rates, 6 * loop.case.states)).velocity < 0.0


@kernel()
def inside(loop: Loop, t: float, h: float) -> float:
    """Fraction of a step at which an event is due though none is at its end, or 0.

    Looked for half way, and where the velocity has an extreme: a grazing reversal dips through zero and back.
    """
    start, stop = named(loop.rates).velocity, named(pointer(loop.rates, 6 * loop.case.states)).velocity
    for i in range(2):
        if i == 1 and start * stop >= 0.0:
            break
        x = 0.5 if i == 0 else start / (start - stop)
        dense(loop, h, x, loop.middle)
        if events(loop, t + x * h, loop.middle) >= 0.0:
            return x
    return 0.0


@kernel()
def locate(loop: Loop, t: float, h: float, before: float, after: float, precision: float) -> float:
    """Shorten a step of length h to the first moment at which an event is due; returns its length.

    Illinois' method on real steps; the step is left on the far side of the event.
    """
    low, high = 0.0, h
    g_low = before if before < 0.0 else -1e-16
    g_high = after
    side = 0
    for i in range(80):
        if high - low <= precision or g_high == 0.0:
            break
        x = (low * g_high - high * g_low) / (g_high - g_low)
        if not low < x < high or i > 12:
            x = 0.5 * (low + high)
        stages(loop, t, x)
        now = events(loop, t + x, loop.end)
        if now >= 0.0:
            high, g_high = x, now
            if side == 1:
                g_low *= 0.5
            side = 1
        else:
            low, g_low = x, now
            if side == -1:
                g_high *= 0.5
            side = -1
    stages(loop, t, high)
    return high


@kernel()
def attempt(loop: Loop, t: float, stop: float, nodes: Any) -> int:
    """Try one step of length ``step.next`` from t; where it is accepted it ends at the first event."""
    tried = loop.step
    if tried.decay > 0.0:
        return glide(loop, t, stop, nodes)
    tried.fourth = 1.0
    h = min(tried.next, calm_step(loop))
    tried.final = t + h * (1.0 + 1e-9) >= stop
    step = stop - t if tried.final != 0 else h
    stages(loop, t, step)
    worst = ratio(loop)
    shrink = small_enough(loop)
    tried.taken = 0
    if not worst < np.inf and step <= SHORTEST:
        return NOT_FINITE
    if worst > 1.0 and step <= SHORTEST:
        return NO_STEP
    if (worst > 1.0 or shrink < 1.0) and step > SHORTEST:
        tried.next = step * min(shrink, max(0.2, 0.9 * worst**-0.2) if worst > 1.0 else 1.0)
        return DONE
    tried.taken = 1
    tried.smooth = worst < 1e-3
    grow = min(5.0, 0.9 * worst**-0.2) if worst > 1e-4 else 5.0
    resolved, decay = stiffness_limit(loop)
    note(loop, loop.end, nodes, 4)
    before, now = tried.value, events(loop, t + step, loop.end)
    # Far from any event at both ends, none lies between; an extreme of the velocity is looked at all the same.
    near = now > -4.0 * abs(now - before) or turns_between(loop)
    if now < 0.0 and near:
        early = inside(loop, t, step)
        if early > 0.0 and step > SHORTEST:
            step *= early
            tried.final = 0
            stages(loop, t, step)
            note(loop, loop.end, nodes, 4)
            now = events(loop, t + step, loop.end)
    tried.event = now >= 0.0
    if now >= 0.0:
        tried.final = 0
        before = events(loop, t, loop.y)
        precision = min(max(LOCAL * loop.numbers[TOLERANCE], 4e-16 * t), 1e-10)
        step = locate(loop, t, step, before, now, precision)
        note(loop, loop.end, nodes, 4)
        tried.next = max(min(h, step * grow, 1e-4, resolved), 1e-8)
    elif tried.final == 0 or step >= h:
        tried.next = min(step * grow, resolved)
        if decay * step > 2.0:
            tried.decay, tried.relied = decay, 0
            tried.next = max(tried.reach, LARGEST_GAIN / decay)
    tried.length = step
    tried.value = now
    return DONE


@kernel()
def glide(loop: Loop, t: float, stop: float, nodes: Any) -> int:
    """Try one Chebyshev step; whatever it cannot do (events, fast motion) is left to Dormand-Prince steps."""
    tried = loop.step
    decay = tried.decay
    tried.fourth = 0.0
    tried.final = t + tried.next * (1.0 + 1e-9) >= stop
    step = stop - t if tried.final != 0 else tried.next
    tried.taken = 0
    chebyshev(loop, t, step, stages_for(step, decay))
    note(loop, loop.end, nodes, 4)
    chebyshev_error(loop, step)
    worst = ratio(loop)
    factor = min(1.2, 0.8 * worst ** (-1.0 / 3.0)) if worst > 1e-3 else 1.2
    if not worst <= 1.0:
        tried.next = step * max(0.2, factor) if worst < np.inf else 0.1 * step
        tried.reach = tried.next
        if tried.next * decay < LARGEST_GAIN:
            tried.decay, tried.next = 0.0, DECAYING / decay
        return DONE
    before, now = tried.value, events(loop, t + step, loop.end)
    near = now > -4.0 * abs(now - before) or turns_between(loop)
    if now >= 0.0 or small_enough(loop) < 1.0 or (near and inside(loop, t, step) > 0.0):
        tried.decay, tried.next = 0.0, DECAYING / decay
        return DONE
    tried.taken, tried.event, tried.smooth = 1, 0, 0
    tried.length, tried.value = step, now
    tried.next = step * factor
    tried.reach = step
    tried.relied += 1
    if tried.relied >= RELY:
        tried.decay, tried.relied = probe(loop, t + step), 0
    if tried.next * tried.decay < LARGEST_GAIN:
        tried.next, tried.decay = min(tried.next, DECAYING / decay), 0.0
    return DONE


@kernel()
def probe(loop: Loop, t: float) -> float:
    """Rate of the fast motion at the end of a step, from the change of the rates along its direction, 1/s."""
    n, u = loop.case.states, loop.middle
    here, there = pointer(loop.rates, 6 * n), pointer(loop.rates, SCRATCH * n)
    for j in range(n):
        u[j] = loop.end[j] + PROBE * loop.direction[j]
    rates(loop, t, u, there)
    total = 0.0
    for j in range(n):
        change = (there[j] - here[j]) / (PROBE * loop.tolerance[j])
        total += change * change
    return math.sqrt(total)
