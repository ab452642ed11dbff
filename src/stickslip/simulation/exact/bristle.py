"""Slipping forces that change with the motion at once: bristles, and elements that are on the curve s(v).

A bristle obeys dF/dt = k (v - |v| F/s(v)): a spring at rest, fast relaxation while it slides. An element without
inner time is F = sigma A s(v). Both would couple the corrector's rounds too tightly; so what follows the motion to
first order, a spring G and a damper B taken anew at every step, goes into the flow, and only the rest stays a
slipping force: S = F - G (theta - theta_0), S = F - B v. The division changes no result; nothing is left out.
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import kernel
from stickslip.simulation.case_arrays import INERTIA
from stickslip.simulation.exact.flow import Linear, linear, relaxed, upper_terms
from stickslip.simulation.exact.forces import curve_slope, sliding
from stickslip.simulation.exact.state import BENDS, FOLLOWS, Loop, side_of, sides_of

FLAT = 5.0
"""Velocity, in parts of v_s, above which the slope of s(v) is not worth its price."""
STIFF = 0.01
"""Least stiffness times h²/J where a bristle's spring can be chosen: the particular solution keeps its digits."""
FARTHEST_LAG = 100.0
"""Largest damping over stiffness, in steps, for the same reason."""


@kernel(exact=False, inline=True)
def bend(loop: Loop, h: float) -> Linear:
    """Take the flow anew for a step of about h: springs of bristles, dampers of curves."""
    parameters, now = loop.parameters, loop.now
    theta = now.position
    v = now.velocity
    total = now.even_stiffness
    damping = now.even_damping
    now.base = now.even_base
    bristles = False
    least = max(STIFF * parameters[INERTIA] / (h * h), now.floor)
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        w = side.weight
        if side.kind == BENDS and side.slipping > 0.0:
            g = bend_bristle(loop, side, h, total, least)
            total += w * g
            damping += w * side.lag * g
            now.base -= w * g * theta
            bristles = True
        elif side.kind == FOLLOWS and side.slipping > 0.0 and side.varies != 0:
            goal = side.slipping * now.sigma
            b = goal * curve_slope(loop, side, v)
            side.force = goal * sliding(loop, side, v) - b * v
            side.force_rate = 0.0
            side.damping = side.viscous + b
            damping += w * b
    now.added = 0.0
    floor = now.floor
    if not bristles:
        floor = max(floor, abs(damping) / (FARTHEST_LAG * h))
    if abs(total) < floor:
        now.added = 2.0 * floor
    return linear(parameters[INERTIA], damping, total + now.added)


@kernel(exact=False, inline=True)
def bend_bristle(loop: Loop, side: Any, h: float, total: float, least: float) -> float:
    """Divide a bristle's force; returns its spring. ``total`` is the stiffness of all the rest."""
    now = loop.now
    theta = now.position
    v = now.velocity
    w = side.weight
    k = side.bristle
    force = side.force + side.spring * theta
    force += side.spring_offset
    scale = side.scale
    steep = curve_slope(loop, side, v) if abs(v) < FLAT * scale else 0.0
    s = sliding(loop, side, v)
    filled = now.sigma * force / s
    decay = k * now.sigma * v / s
    # What is relaxed away within the step follows the velocity, not the position.
    g = k * (1.0 - filled * (1.0 - v * steep / s)) / (1.0 + 0.5 * decay * h)
    if abs(total + w * g) < least:
        g = (math.copysign(least, total + w * g) - total) / w
    side.spring = g
    side.spring_offset = -g * theta
    side.force = force
    side.force_rate = (k - g) * v - decay * force
    side.decay = decay
    side.damping = side.viscous + side.lag * g
    return g


@kernel(exact=False, inline=True)
def bristle_terms(
    loop: Loop, side: Any, h: float, theta_mid: float, v_mid: float, theta_end: float, v_end: float,
) -> tuple[float, float]:  # fmt: skip
    """Advance what is left of a bristle's force along the motion; returns its two upper coefficients."""
    now = loop.now
    k = side.bristle * now.sigma
    g = side.spring
    rest = side.bristle - g
    d0 = side.force_rate
    decay_mid = k * v_mid / sliding(loop, side, v_mid)
    decay_end = k * v_end / sliding(loop, side, v_end)
    goal_mid = rest * v_mid - decay_mid * g * (theta_mid - now.position)
    goal_end = rest * v_end - decay_end * g * (theta_end - now.position)
    middle, end, slope = relaxed(goal_mid, goal_end, side.force, d0, decay_mid, decay_end, h)
    side.decay_mid = decay_mid
    side.decay_end = decay_end
    side.force_mid = middle
    side.force_end = end
    side.force_rate_end = slope
    return upper_terms(side.force, d0, end, slope, 1.0 / h)


@kernel(exact=False, inline=True)
def bristle_rate(loop: Loop, side: Any, theta: float, v: float, force: float) -> float:
    """Rate of what is left of a bristle's force, N·m/s."""
    now = loop.now
    g = side.spring
    k = side.bristle
    decay = k * now.sigma * v / sliding(loop, side, v)
    return (k - g) * v - decay * (force + g * (theta - now.position))


@kernel(exact=False, inline=True)
def curve_terms(loop: Loop, side: Any, h: float, v_mid: float, v_end: float) -> tuple[float, float]:
    """What is left of a force on the curve, in the middle and at the end; returns its two upper coefficients."""
    middle = curve_rest(loop, side, v_mid)
    end = curve_rest(loop, side, v_end)
    side.force_mid = middle
    side.force_end = end
    # The cubic that starts flat and goes through both.
    inverse = 1.0 / h
    m = middle - side.force
    e = end - side.force
    side.force_rate_end = (4.0 * e - 8.0 * m) * inverse
    return (8.0 * m - e) * inverse * inverse, (2.0 * e - 8.0 * m) * inverse * inverse * inverse


@kernel(exact=False, inline=True)
def curve_rest(loop: Loop, side: Any, v: float) -> float:
    """A force on the curve, less what the flow's damper takes."""
    b = side.damping - side.viscous
    goal = side.slipping * loop.now.sigma
    return goal * sliding(loop, side, v) - b * v
