"""One step of the adaptive integrator: tried, judged, and ended at the first event.

Dormand-Prince 5(4) (Dormand and Prince 1980) with the dense output of Hairer, Norsett and Wanner (Solving ODEs I,
II.6); where a fast decay limits smooth steps, Runge-Kutta-Chebyshev (`stickslip.simulation.adaptive.chebyshev`).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import kernel
from stickslip.simulation.adaptive.chebyshev import chebyshev, chebyshev_error, stages_for
from stickslip.simulation.adaptive.dormand_prince import ERROR, NODES, TABLEAU
from stickslip.simulation.adaptive.hybrid import (
    COMPENSATION_TORQUE,
    FRICTION_TORQUE,
    MOTOR_TORQUE,
    OMEGA_D,
    POSITION,
    SEEN_VELOCITY,
    THETA_D,
    VELOCITY,
    calm_step,
    events,
    rates,
    small_enough,
)
from stickslip.simulation.case_arrays import DONE, NO_STEP, NOT_FINITE, TOLERANCE

SHORTEST = 1e-14
LOCAL = 1e-3
"""Error allowed in one step over the tolerance of a run: thousands of steps add up, and events carry them on."""
RINGING, DECAYING = 1.6, 2.8
"""Step times the largest eigenvalue that explicit stages damp: imaginary ones to about 1.6, real ones to 3.3."""
# Stages of the pair; the scratch row after them serves events and output.
STAGES, SCRATCH = 7, 7
# What a trial step leaves behind: its length, whether it ends the stretch, whether an event is due at its end, the
# value of the event function there, the length of the next step, whether it may be taken, and whether its error is so
# far below the tolerance that stability alone limits it.
# The rate of a decay that limits the steps (0: none, Dormand-Prince steps), how many Chebyshev steps have relied on
# it, how far they went, and whether the step is a Dormand-Prince one, whose dense output is of fourth order (else it
# is cubic).
STEP, FINAL, EVENT, VALUE, NEXT, TAKEN, SMOOTH, DECAY, RELIED, REACH, FOURTH, TRIAL = range(12)
RELY = 4
"""Chebyshev steps after which the decay rate is taken anew."""
PROBE = 100.0
"""Length of the probe, in tolerances."""
LARGEST_GAIN = 4.0
"""Step times decay rate from which Chebyshev steps cost less than Dormand-Prince ones."""


@kernel()
def stages(a: Any, w: Any, t: float, h: float, y: Any, k: Any, end: Any, error: Any, u: Any) -> None:
    """One Dormand-Prince step from y; row 0 of k holds the rates at its start, row 6 receives those at its end.

    ``u`` is left with the state of stage 5.
    """
    n = y.shape[0]
    for s in range(1, 7):
        for j in range(n):
            rise = 0.0
            for m in range(s):
                rise += TABLEAU[s, m] * k[m, j]
            if s < 6:
                u[j] = y[j] + h * rise
            else:
                end[j] = y[j] + h * rise
        if s < 6:
            rates(a, w, t + NODES[s] * h, u, k, s)
        else:
            rates(a, w, t + h, end, k, s)
    for j in range(n):
        off = 0.0
        for m in range(STAGES):
            off += ERROR[m] * k[m, j]
        error[j] = h * off


@kernel()
def dense(h: float, y: Any, k: Any, end: Any, x: float, fourth: float, out: Any) -> None:
    """State at the fraction x of a step: fourth order for Dormand-Prince steps (1), cubic for others (0)."""
    z = 1.0 - x
    for j in range(y.shape[0]):
        rise = end[j] - y[j]
        bend = h * k[0, j] - rise
        skew = rise - h * k[6, j] - bend
        fine = (
            fourth
            * h
            * (
                -12715105075.0 / 11282082432.0 * k[0, j]
                + 87487479700.0 / 32700410799.0 * k[2, j]
                - 10690763975.0 / 1880347072.0 * k[3, j]
                + 701980252875.0 / 199316789632.0 * k[4, j]
                - 1453857185.0 / 822651844.0 * k[5, j]
                + 69997945.0 / 29380423.0 * k[6, j]
            )
        )
        out[j] = y[j] + x * (rise + z * (bend + x * (skew + z * fine)))


@kernel()
def ratio(error: Any, tolerance: Any) -> float:
    """The largest error in units of its tolerance; infinite where it is no number."""
    largest = 0.0
    for j in range(error.shape[0]):
        r = abs(error[j]) / tolerance[j]
        if not r <= 1e300:
            return np.inf
        largest = max(largest, r)
    return largest


@kernel()
def stiffness_limit(k: Any, end: Any, u: Any, tolerance: Any, fast: Any) -> tuple[float, float]:
    """Longest next step that follows the fastest motion present instead of ringing at the border of stability, and
    the rate of that motion if it decays (else 0).

    The last two stages belong to the same time: the difference of their rates against that of their states tells
    the largest eigenvalue and whether it decays or rings (Hairer and Wanner, Solving ODEs II, IV.2). ``u`` holds
    the state of stage 5; ``fast`` receives the direction of the motion, of length 1 in tolerances.
    """
    above, below, along = 0.0, 0.0, 0.0
    for j in range(u.shape[0]):
        rate = (k[6, j] - k[5, j]) / tolerance[j]
        state = (end[j] - u[j]) / tolerance[j]
        above += rate * rate
        below += state * state
        along += rate * state
    if above <= 0.0 or below <= 0.0:
        return math.inf, 0.0
    size = math.sqrt(above / below)
    for j in range(u.shape[0]):
        fast[j] = (end[j] - u[j]) / math.sqrt(below)
    decays = along < -0.95 * math.sqrt(above * below)
    return (DECAYING / size, size) if decays else (RINGING / size, 0.0)


@kernel()
def note(w: Any, y: Any, nodes: Any, i: int) -> None:
    """Write the signals of the state whose rates were taken last into column i of the meter's nodes."""
    nodes[0, i] = w[THETA_D] - y[POSITION]
    nodes[1, i] = w[OMEGA_D] - w[SEEN_VELOCITY]
    nodes[2, i] = y[POSITION]
    nodes[3, i] = w[SEEN_VELOCITY]
    nodes[4, i] = w[OMEGA_D]
    nodes[5, i] = w[MOTOR_TORQUE]
    nodes[6, i] = w[FRICTION_TORQUE]
    nodes[7, i] = w[COMPENSATION_TORQUE]


@kernel()
def inside(
    a: Any, w: Any, t: float, h: float, y: Any, k: Any, end: Any, u: Any, g: Any, fourth: float
) -> float:
    """Fraction of a step at which an event is due though none is at its end, or 0.

    Looked for half way, and where the velocity has an extreme: a grazing reversal dips through zero and back.
    """
    start, stop = k[0, VELOCITY], k[6, VELOCITY]
    for i in range(2):
        if i == 1 and start * stop >= 0.0:
            break
        x = 0.5 if i == 0 else start / (start - stop)
        dense(h, y, k, end, x, fourth, u)
        if events(a, w, t + x * h, u, k, SCRATCH, g) >= 0.0:
            return x
    return 0.0


@kernel()
def locate(
    a: Any, w: Any, t: float, h: float, y: Any, k: Any, end: Any, error: Any, u: Any, g: Any,
    before: float, after: float, precision: float,
) -> float:  # fmt: skip
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
        stages(a, w, t, x, y, k, end, error, u)
        now = events(a, w, t + x, end, k, SCRATCH, g)
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
    stages(a, w, t, high, y, k, end, error, u)
    return high


@kernel()
def attempt(
    a: Any, w: Any, t: float, stop: float, y: Any, k: Any, end: Any, error: Any, u: Any, g: Any, tolerance: Any,
    nodes: Any, trial: Any, fast: Any,
) -> int:  # fmt: skip
    """Try one step of length ``trial[NEXT]`` from t; where it is accepted it ends at the first event."""
    if trial[DECAY] > 0.0:
        return glide(a, w, t, stop, y, k, end, error, u, g, tolerance, nodes, trial, fast)
    trial[FOURTH] = 1.0
    h = min(trial[NEXT], calm_step(w, y, k[0, VELOCITY]))
    trial[FINAL] = t + h * (1.0 + 1e-9) >= stop
    step = stop - t if trial[FINAL] else h
    stages(a, w, t, step, y, k, end, error, u)
    worst = ratio(error, tolerance)
    shrink = small_enough(w, y, end)
    trial[TAKEN] = 0.0
    if not worst < np.inf and step <= SHORTEST:
        return NOT_FINITE
    if worst > 1.0 and step <= SHORTEST:
        return NO_STEP
    if (worst > 1.0 or shrink < 1.0) and step > SHORTEST:
        trial[NEXT] = step * min(shrink, max(0.2, 0.9 * worst**-0.2) if worst > 1.0 else 1.0)
        return DONE
    trial[TAKEN] = 1.0
    trial[SMOOTH] = worst < 1e-3
    grow = min(5.0, 0.9 * worst**-0.2) if worst > 1e-4 else 5.0
    resolved, decay = stiffness_limit(k, end, u, tolerance, fast)
    note(w, end, nodes, 4)
    before, now = trial[VALUE], events(a, w, t + step, end, k, SCRATCH, g)
    # Far from any event at both ends, none lies between; an extreme of the velocity is looked at all the same.
    near = now > -4.0 * abs(now - before) or k[0, VELOCITY] * k[6, VELOCITY] < 0.0
    if now < 0.0 and near:
        early = inside(a, w, t, step, y, k, end, u, g, 1.0)
        if early > 0.0 and step > SHORTEST:
            step *= early
            trial[FINAL] = 0.0
            stages(a, w, t, step, y, k, end, error, u)
            note(w, end, nodes, 4)
            now = events(a, w, t + step, end, k, SCRATCH, g)
    trial[EVENT] = now >= 0.0
    if now >= 0.0:
        trial[FINAL] = 0.0
        before = events(a, w, t, y, k, SCRATCH, g)
        precision = min(max(LOCAL * w[TOLERANCE], 4e-16 * t), 1e-10)
        step = locate(a, w, t, step, y, k, end, error, u, g, before, now, precision)
        note(w, end, nodes, 4)
        trial[NEXT] = max(min(h, step * grow, 1e-4, resolved), 1e-8)
    elif not trial[FINAL] or step >= h:
        trial[NEXT] = min(step * grow, resolved)
        if decay * step > 2.0:
            trial[DECAY], trial[RELIED] = decay, 0.0
            trial[NEXT] = max(trial[REACH], LARGEST_GAIN / decay)
    trial[STEP] = step
    trial[VALUE] = now
    return DONE


@kernel()
def glide(
    a: Any, w: Any, t: float, stop: float, y: Any, k: Any, end: Any, error: Any, u: Any, g: Any, tolerance: Any,
    nodes: Any, trial: Any, fast: Any,
) -> int:  # fmt: skip
    """Try one Chebyshev step; whatever it cannot do (events, fast motion) is left to Dormand-Prince steps."""
    decay = trial[DECAY]
    trial[FINAL] = t + trial[NEXT] * (1.0 + 1e-9) >= stop
    step = stop - t if trial[FINAL] else trial[NEXT]
    trial[TAKEN] = 0.0
    chebyshev(a, w, t, step, stages_for(step, decay), y, k, end, u, error)
    note(w, end, nodes, 4)
    chebyshev_error(step, y, k, end, error)
    worst = ratio(error, tolerance)
    factor = min(1.2, 0.8 * worst ** (-1.0 / 3.0)) if worst > 1e-3 else 1.2
    if not worst <= 1.0:
        trial[NEXT] = step * max(0.2, factor) if worst < np.inf else 0.1 * step
        trial[REACH] = trial[NEXT]
        if trial[NEXT] * decay < LARGEST_GAIN:
            trial[DECAY], trial[NEXT] = 0.0, DECAYING / decay
        return DONE
    before, now = trial[VALUE], events(a, w, t + step, end, k, SCRATCH, g)
    near = now > -4.0 * abs(now - before) or k[0, VELOCITY] * k[6, VELOCITY] < 0.0
    if (
        now >= 0.0
        or small_enough(w, y, end) < 1.0
        or (near and inside(a, w, t, step, y, k, end, u, g, 0.0) > 0.0)
    ):
        trial[DECAY], trial[NEXT] = 0.0, DECAYING / decay
        return DONE
    trial[TAKEN], trial[EVENT], trial[SMOOTH], trial[FOURTH] = 1.0, 0.0, 0.0, 0.0
    trial[STEP], trial[VALUE] = step, now
    trial[NEXT] = step * factor
    trial[REACH] = step
    trial[RELIED] += 1.0
    if trial[RELIED] >= RELY:
        trial[DECAY], trial[RELIED] = probe(a, w, t + step, end, k, u, tolerance, fast), 0.0
    if trial[NEXT] * trial[DECAY] < LARGEST_GAIN:
        trial[NEXT], trial[DECAY] = min(trial[NEXT], DECAYING / decay), 0.0
    return DONE


@kernel()
def probe(a: Any, w: Any, t: float, y: Any, k: Any, u: Any, tolerance: Any, fast: Any) -> float:
    """Rate of the fast motion at y, from the change of the rates (row 6 of k) along its direction, 1/s."""
    for j in range(y.shape[0]):
        u[j] = y[j] + PROBE * fast[j]
    rates(a, w, t, u, k, SCRATCH)
    total = 0.0
    for j in range(y.shape[0]):
        change = (k[SCRATCH, j] - k[6, j]) / (PROBE * tolerance[j])
        total += change * change
    return math.sqrt(total)
