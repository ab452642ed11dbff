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
from stickslip.simulation.exact.state import (
    ADDED,
    BASE,
    BENDS,
    BRISTLE,
    DAMPING,
    DS,
    DS_END,
    EVEN_BASE,
    EVEN_DAMPING,
    EVEN_STIFFNESS,
    FLOOR,
    FOLLOWS,
    KIND,
    LAG,
    POSITION,
    Q_END,
    Q_MID,
    S_END,
    S_MID,
    SCALE,
    SIDE_SIZE,
    SIGMA,
    SLIPPING,
    SPRING,
    SPRING_OFFSET,
    VARIES,
    VELOCITY,
    VISCOUS,
    WEIGHT,
    Q,
    S,
    curve_slope,
    sides_of,
    sliding,
)

FLAT = 5.0
"""Velocity, in parts of v_s, above which the slope of s(v) is not worth its price."""
STIFF = 0.01
"""Least stiffness times h²/J where a bristle's spring can be chosen: the particular solution keeps its digits."""
FARTHEST_LAG = 100.0
"""Largest damping over stiffness, in steps, for the same reason."""


@kernel(exact=False, inline=True)
def bend(parameters: Any, plan: Any, sides: Any, loop: Any, h: float) -> Linear:
    """Take the flow anew for a step of about h: springs of bristles, dampers of curves."""
    theta = loop[POSITION]
    v = loop[VELOCITY]
    total = loop[EVEN_STIFFNESS]
    damping = loop[EVEN_DAMPING]
    loop[BASE] = loop[EVEN_BASE]
    bristles = False
    least = max(STIFF * parameters[INERTIA] / (h * h), loop[FLOOR])
    for side in range(sides_of(plan)):
        w = sides[side * SIDE_SIZE + WEIGHT]
        if sides[side * SIDE_SIZE + KIND] == BENDS and sides[side * SIDE_SIZE + SLIPPING] > 0.0:
            g = bend_bristle(parameters, plan, sides, loop, side, h, total, least)
            total += w * g
            damping += w * sides[side * SIDE_SIZE + LAG] * g
            loop[BASE] -= w * g * theta
            bristles = True
        elif (
            sides[side * SIDE_SIZE + KIND] == FOLLOWS
            and sides[side * SIDE_SIZE + SLIPPING] > 0.0
            and sides[side * SIDE_SIZE + VARIES] > 0.0
        ):
            goal = sides[side * SIDE_SIZE + SLIPPING] * loop[SIGMA]
            b = goal * curve_slope(parameters, plan, sides, side, v)
            sides[side * SIDE_SIZE + S] = goal * sliding(parameters, plan, sides, side, v) - b * v
            sides[side * SIDE_SIZE + DS] = 0.0
            sides[side * SIDE_SIZE + DAMPING] = sides[side * SIDE_SIZE + VISCOUS] + b
            damping += w * b
    loop[ADDED] = 0.0
    floor = loop[FLOOR]
    if not bristles:
        floor = max(floor, abs(damping) / (FARTHEST_LAG * h))
    if abs(total) < floor:
        loop[ADDED] = 2.0 * floor
    return linear(parameters[INERTIA], damping, total + loop[ADDED])


@kernel(exact=False, inline=True)
def bend_bristle(
    parameters: Any, plan: Any, sides: Any, loop: Any, side: int, h: float, total: float, least: float
) -> float:  # fmt: skip
    """Divide a bristle's force; returns its spring. ``total`` is the stiffness of all the rest."""
    theta = loop[POSITION]
    v = loop[VELOCITY]
    w = sides[side * SIDE_SIZE + WEIGHT]
    k = sides[side * SIDE_SIZE + BRISTLE]
    force = sides[side * SIDE_SIZE + S] + sides[side * SIDE_SIZE + SPRING] * theta
    force += sides[side * SIDE_SIZE + SPRING_OFFSET]
    scale = sides[side * SIDE_SIZE + SCALE]
    steep = curve_slope(parameters, plan, sides, side, v) if abs(v) < FLAT * scale else 0.0
    s = sliding(parameters, plan, sides, side, v)
    filled = loop[SIGMA] * force / s
    decay = k * loop[SIGMA] * v / s
    # What is relaxed away within the step follows the velocity, not the position.
    g = k * (1.0 - filled * (1.0 - v * steep / s)) / (1.0 + 0.5 * decay * h)
    if abs(total + w * g) < least:
        g = (math.copysign(least, total + w * g) - total) / w
    sides[side * SIDE_SIZE + SPRING] = g
    sides[side * SIDE_SIZE + SPRING_OFFSET] = -g * theta
    sides[side * SIDE_SIZE + S] = force
    sides[side * SIDE_SIZE + DS] = (k - g) * v - decay * force
    sides[side * SIDE_SIZE + Q] = decay
    sides[side * SIDE_SIZE + DAMPING] = sides[side * SIDE_SIZE + VISCOUS] + sides[side * SIDE_SIZE + LAG] * g
    return g


@kernel(exact=False, inline=True)
def bristle_terms(
    parameters: Any, plan: Any, sides: Any, loop: Any, side: int, h: float, theta_mid: float, v_mid: float,
    theta_end: float, v_end: float,
) -> tuple[float, float]:  # fmt: skip
    """Advance what is left of a bristle's force along the motion; returns its two upper coefficients."""
    k = sides[side * SIDE_SIZE + BRISTLE] * loop[SIGMA]
    g = sides[side * SIDE_SIZE + SPRING]
    rest = sides[side * SIDE_SIZE + BRISTLE] - g
    d0 = sides[side * SIDE_SIZE + DS]
    decay_mid = k * v_mid / sliding(parameters, plan, sides, side, v_mid)
    decay_end = k * v_end / sliding(parameters, plan, sides, side, v_end)
    goal_mid = rest * v_mid - decay_mid * g * (theta_mid - loop[POSITION])
    goal_end = rest * v_end - decay_end * g * (theta_end - loop[POSITION])
    middle, end, slope = relaxed(goal_mid, goal_end, sides[side * SIDE_SIZE + S], d0, decay_mid, decay_end, h)
    sides[side * SIDE_SIZE + Q_MID] = decay_mid
    sides[side * SIDE_SIZE + Q_END] = decay_end
    sides[side * SIDE_SIZE + S_MID] = middle
    sides[side * SIDE_SIZE + S_END] = end
    sides[side * SIDE_SIZE + DS_END] = slope
    return upper_terms(sides[side * SIDE_SIZE + S], d0, end, slope, 1.0 / h)


@kernel(exact=False, inline=True)
def bristle_rate(
    parameters: Any, plan: Any, sides: Any, loop: Any, side: int, theta: float, v: float, force: float
) -> float:  # fmt: skip
    """Rate of what is left of a bristle's force, N·m/s."""
    g = sides[side * SIDE_SIZE + SPRING]
    k = sides[side * SIDE_SIZE + BRISTLE]
    decay = k * loop[SIGMA] * v / sliding(parameters, plan, sides, side, v)
    return (k - g) * v - decay * (force + g * (theta - loop[POSITION]))


@kernel(exact=False, inline=True)
def curve_terms(
    parameters: Any, plan: Any, sides: Any, loop: Any, side: int, h: float, v_mid: float, v_end: float
) -> tuple[float, float]:  # fmt: skip
    """What is left of a force on the curve, in the middle and at the end; returns its two upper coefficients."""
    middle = curve_rest(parameters, plan, sides, loop, side, v_mid)
    end = curve_rest(parameters, plan, sides, loop, side, v_end)
    sides[side * SIDE_SIZE + S_MID] = middle
    sides[side * SIDE_SIZE + S_END] = end
    # The cubic that starts flat and goes through both.
    inverse = 1.0 / h
    m = middle - sides[side * SIDE_SIZE + S]
    e = end - sides[side * SIDE_SIZE + S]
    sides[side * SIDE_SIZE + DS_END] = (4.0 * e - 8.0 * m) * inverse
    return (8.0 * m - e) * inverse * inverse, (2.0 * e - 8.0 * m) * inverse * inverse * inverse


@kernel(exact=False, inline=True)
def curve_rest(parameters: Any, plan: Any, sides: Any, loop: Any, side: int, v: float) -> float:
    """A force on the curve, less what the flow's damper takes."""
    b = sides[side * SIDE_SIZE + DAMPING] - sides[side * SIDE_SIZE + VISCOUS]
    goal = sides[side * SIDE_SIZE + SLIPPING] * loop[SIGMA]
    return goal * sliding(parameters, plan, sides, side, v) - b * v
