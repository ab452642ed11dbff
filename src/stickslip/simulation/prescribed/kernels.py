"""A law under prescribed motion: its states over time, by its ``rate`` or by its ``step``.

By ``rate``: Dormand and Prince's pair 5(4) (1980) with local extrapolation; a mode that ends inside a step is
located on repeated steps from the same start. By ``step``: step doubling with Richardson's extrapolation
(Hairer, Norsett and Wanner 1993, II.4); the law itself finds its switches. Steps end on every stop, on every
zero of the velocity, and stay short near rest, where a limit s(v) can be passed and left again inside a longer
one.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.jit import (
    LawPointers,
    call_guards,
    call_profile,
    call_rate,
    call_step,
    call_switch,
    kernel,
    pointer,
    record_at,
)
from stickslip.simulation.adaptive.dormand_prince import ERROR, NODES, TABLEAU
from stickslip.simulation.case_arrays import AROUND, MOTION

NUDGE = 1e-11  # s, by which one-sided values of the motion lie inside the stretch between two kinks
FINE = 0.1  # of the law's velocity scale, by which the velocity near rest may change in a step
SHORTEST = 1e-14  # s, relative above 1 s


class Motion(NamedTuple):
    """What the kernels read besides time and state, and their scratch arrays."""

    law: LawPointers
    parameters: Any
    modes: Any
    scale: float
    profile: int
    reference: Any
    tolerance: float
    largest: Any
    between: Any
    motion: Any
    surroundings: Any
    slopes: Any
    events: Any
    trial: Any


@kernel()
def move(m: Motion, t: float) -> float:
    """Set the motion at t, seen from inside the stretch between two kinks; returns the velocity."""
    inside = min(max(t, m.between[0] + NUDGE), m.between[1] - NUDGE)
    call_profile(m.profile, inside, pointer(m.reference, 0), pointer(m.motion, 0))
    asked, around = record_at(pointer(m.motion, 0), MOTION), record_at(pointer(m.surroundings, 0), AROUND)
    around.position, around.time = asked.position, t
    return asked.velocity


@kernel()
def attempt_rate(m: Motion, t: float, h: float, y: Any, out: Any) -> float:
    """One step of Dormand and Prince from y to out; returns its error over the tolerance."""
    n = y.size
    for stage in range(7):
        for j in range(n):
            total = 0.0
            for i in range(stage):
                total += TABLEAU[stage, i] * m.slopes[i, j]
            out[j] = y[j] + h * total
            m.slopes[stage, j] = 0.0
        v = move(m, t + NODES[stage] * h)
        call_rate(
            m.law.rate, v, pointer(out, 0), pointer(m.parameters, 0), pointer(m.surroundings, 0),
            pointer(m.slopes, stage * n),
        )  # fmt: skip
    worst = 0.0
    for j in range(n):
        error = 0.0
        for i in range(7):
            error += h * ERROR[i] * m.slopes[i, j]
        worst = max(worst, excess(m, j, error, y[j], out[j]))
    return worst


@kernel()
def excess(m: Motion, j: int, error: float, before: float, after: float) -> float:
    """An error of state j over its tolerance, which is relative to the largest value it has had."""
    size = max(m.largest[j], abs(before), abs(after))
    if m.modes[j] or error == 0.0:
        return 0.0
    return abs(error) / (m.tolerance * size)


@kernel()
def law_step(m: Motion, t: float, h: float, z: Any) -> float:
    """Advance z by the law's step from t to t + h; returns the torque there, N·m."""
    v0 = move(m, t)
    v1 = move(m, t + h)
    return call_step(
        m.law.step, v0, v1, h, pointer(z, 0), pointer(m.parameters, 0), pointer(m.surroundings, 0)
    )


@kernel()
def attempt_step(m: Motion, t: float, h: float, y: Any, out: Any) -> float:
    """Two half steps of the law from y to out, extrapolated with a whole one; error over tolerance."""
    whole = m.trial
    for j in range(y.size):
        whole[j] = y[j]
        out[j] = y[j]
    law_step(m, t, h, whole)
    law_step(m, t, 0.5 * h, out)
    law_step(m, t + 0.5 * h, 0.5 * h, out)
    worst = 0.0
    for j in range(y.size):
        error = (out[j] - whole[j]) / 3.0
        worst = max(worst, excess(m, j, error, y[j], out[j]))
        if not m.modes[j]:
            out[j] += error
    return worst


@kernel()
def due(m: Motion, t: float, y: Any) -> float:
    """The largest value of a guard at t: a mode is due to end where it is not negative."""
    if m.law.guards == 0:
        return -1.0
    v = move(m, t)
    for j in range(y.size):
        m.events[j] = -1.0
    call_guards(
        m.law.guards,
        v,
        pointer(y, 0),
        pointer(m.parameters, 0),
        pointer(m.surroundings, 0),
        pointer(m.events, 0),
    )
    worst = -math.inf
    for j in range(y.size):
        if m.modes[j]:
            worst = max(worst, m.events[j])
        else:
            m.events[j] = -1.0
    return worst


@kernel()
def change_modes(m: Motion, t: float, y: Any) -> None:
    """Leave the modes that are due at t."""
    if due(m, t, y) >= 0.0:
        v = move(m, t)
        call_switch(
            m.law.switch, v, pointer(y, 0), pointer(m.parameters, 0), pointer(m.surroundings, 0),
            pointer(m.events, 0),
        )  # fmt: skip


@kernel()
def locate(m: Motion, t: float, h: float, y: Any, out: Any) -> float:
    """The length of the step that ends where the first mode is due, which it is at h; out holds its end."""
    low, high = 0.0, h
    f_low, f_high = due(m, t, y), due(m, t + h, out)
    if f_low >= 0.0:
        f_low = -1e-300
    for i in range(100):
        if high - low <= SHORTEST * max(1.0, t) or f_high <= 1e-14:
            break
        x = low - f_low * (high - low) / (f_high - f_low)
        if i % 3 == 2 or not low < x < high:
            x = 0.5 * (low + high)
        attempt_rate(m, t, x, y, out)
        f = due(m, t + x, out)
        if f >= 0.0:
            high, f_high, f_low = x, f, 0.5 * f_low
        else:
            low, f_low, f_high = x, f, 0.5 * f_high
    attempt_rate(m, t, high, y, out)
    return high


@kernel()
def shortened(m: Motion, t: float, h: float) -> float:
    """The step, shortened near rest to a fraction of the velocity scale, and to the velocity's next zero."""
    v0 = move(m, t)
    slope = abs(record_at(pointer(m.motion, 0), MOTION).acceleration)
    if m.scale > 0.0 and abs(v0) < 3.0 * m.scale and slope * h > FINE * m.scale:
        h = FINE * m.scale / slope
    if v0 * move(m, t + h) >= 0.0:
        return h
    low, high = 0.0, h
    while high - low > SHORTEST * max(1.0, t):
        x = 0.5 * (low + high)
        if v0 * move(m, t + x) < 0.0:
            high = x
        else:
            low = x
        if x == low + high:
            break
    return high


@kernel()
def torque_at(m: Motion, t: float, y: Any, by_step: bool) -> float:
    """Torque at t with the states y, which stay as they are, N·m."""
    for j in range(y.size):
        m.trial[j] = y[j]
    if by_step:
        return law_step(m, t, 0.0, m.trial)
    v = move(m, t)
    return call_rate(
        m.law.rate, v, pointer(m.trial, 0), pointer(m.parameters, 0), pointer(m.surroundings, 0),
        pointer(m.slopes, 0),
    )  # fmt: skip


@kernel()
def march(m: Motion, y: Any, stops: Any, kinks: Any, torques: Any, by_step: bool) -> int:
    """Run over all stops and write the torque at each; returns how many were reached.

    ``kinks`` marks the stops at which the motion is not smooth, or reverses.
    """
    out = y.copy()
    t, h = 0.0, 1e-4
    m.between[0] = 0.0
    last_kink = -1
    for stop in range(stops.size):
        if stop > last_kink:
            last_kink = stop
            while last_kink < stops.size - 1 and not kinks[last_kink]:
                last_kink += 1
            m.between[1] = stops[last_kink]
            if not by_step:
                change_modes(m, t, y)
        while stops[stop] - t > SHORTEST * max(1.0, t):
            taken, h = accepted_step(m, t, min(h, stops[stop] - t), h, y, out, by_step)
            if taken <= 0.0:
                return stop
            for j in range(y.size):
                y[j] = out[j]
                m.largest[j] = max(m.largest[j], abs(y[j]))
            t += taken
        t = stops[stop]
        torques[stop] = torque_at(m, t, y, by_step)
        if kinks[stop]:
            m.between[0] = t
    return stops.size


@kernel()
def accepted_step(
    m: Motion, t: float, h: float, usual: float, y: Any, out: Any, by_step: bool
) -> tuple[float, float]:
    """A step from y to out that meets the tolerance, at most h; its length (0: none) and the next one's."""
    order = 3.0 if by_step else 5.0
    while h > SHORTEST * max(1.0, t) * 0.01:
        h = shortened(m, t, h)
        error = attempt_step(m, t, h, y, out) if by_step else attempt_rate(m, t, h, y, out)
        if error <= 1.0:
            if not by_step and due(m, t + h, out) >= 0.0:
                h = locate(m, t, h, y, out)
                change_modes(m, t + h, out)
            grown = h * min(5.0, 0.9 * max(error, 1e-6) ** (-1.0 / order))
            return h, max(grown, min(usual, 10.0 * h))
        if not error < math.inf:
            error = 1e6
        h *= max(0.1, 0.9 * error ** (-1.0 / order))
    return 0.0, usual
