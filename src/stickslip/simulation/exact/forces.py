"""The torques of a loop: what time alone commands, springs of sticking elements, and what slips along the curve.

Some slipping forces change with the motion at once: bristles, and elements that are on the curve s(v). A bristle obeys
dF/dt = k (v - |v| F/s(v)): a spring at rest, fast relaxation while it slides. An element without inner time is
F = sigma A s(v). Both would couple the corrector's rounds too tightly; so what follows the motion to first order, a
spring G and a damper B taken anew at every step (`bend`), goes into the flow, and only the rest stays a slipping force:
S = F - G (theta - theta_0), S = F - B v. The division changes no result; nothing is left out.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.jit import call_profile, call_value, kernel, pointer
from stickslip.simulation._forcing import CELL_SIZE
from stickslip.simulation.case_arrays import GAIN, INERTIA, KD, KI, KP, KR
from stickslip.simulation.exact.flow import Linear, linear, relaxed, upper_terms
from stickslip.simulation.exact.state import (
    ASKED,
    BENDS,
    FOLLOWS,
    RELAXES,
    Loop,
    element_of,
    side_of,
    sides_of,
)

IN_LAYER = 1e-4
"""Stiffness added in a steep layer, over slope²/J."""
Torques = tuple[float, float, float]
"""Of motor, friction and compensator, N·m."""
FLAT = 5.0
"""Velocity, in parts of v_s, above which the slope of s(v) is not worth its price."""
STIFF = 0.01
"""Least stiffness times h²/J beside a bristle: the particular solution keeps its digits. Its spring is chosen so, or
what is missing is added for a step where damping lags by more: it would come along, and no short step takes it off."""
FARTHEST_LAG = 100.0
"""Largest damping over stiffness, in steps, for the same reason."""


class Command(NamedTuple):
    """What time alone commands: torque, N·m, and its rate, N·m/s; the reference's position and velocity, rad, rad/s."""

    torque: float
    torque_rate: float
    position: float
    velocity: float


@kernel(exact=False, inline=True)
def sliding(loop: Loop, side: Any, v: float) -> float:
    """The sliding curve of a side, N·m; two values are kept, since middle and end are asked for again."""
    own = side_of(loop, 0) if loop.plan.shared != 0 else side
    if own.curve == 0:
        return own.breakaway
    if own.velocity == v:
        return own.level
    if own.velocity_before == v:
        return own.level_before
    own.velocity_before = own.velocity
    own.level_before = own.level
    own.velocity = v
    own.level = call_value(own.curve, v, pointer(loop.parameters, own.law))
    return own.level


@kernel(exact=False, inline=True)
def command(loop: Loop, t: float) -> Command:
    """What time alone commands at t.

    kp theta_d + kr theta_d' + gain T_hat(t); ``cells`` hold the feedforward torque (`_forcing`).
    """
    parameters, plan, cells, now = loop.parameters, loop.plan, loop.cells, loop.now
    t = min(max(t, now.edge_low), now.edge_high)
    call_profile(plan.profile, t, pointer(parameters, plan.reference), pointer(now, ASKED))
    goal = now.asked_position
    rate = now.asked_velocity
    r = parameters[KP] * goal + parameters[KR] * rate
    dr = parameters[KP] * rate + parameters[KR] * now.asked_acceleration
    last = plan.cells - 1
    if last >= 0:
        i = now.cell
        while i < last and t >= cells[(i + 1) * CELL_SIZE]:
            i += 1
        while i > 0 and t < cells[i * CELL_SIZE]:
            i -= 1
        now.cell = i
        cell = pointer(cells, i * CELL_SIZE)
        x = (t - cell[0]) * cell[1]
        r += parameters[GAIN] * (cell[2] + x * (cell[3] + x * (cell[4] + x * (cell[5] + x * cell[6]))))
        slope = cell[3] + x * (2.0 * cell[4] + x * (3.0 * cell[5] + x * 4.0 * cell[6]))
        dr += parameters[GAIN] * cell[1] * slope
    return Command(r, dr, goal, rate)


@kernel(exact=False, inline=True)
def arrange(loop: Loop) -> Linear:
    """Set the loop up for the modes as they are: springs, slipping sums, flow.

    Where the stiffness nearly vanishes, a spring is added (and taken off again by the corrector), so that the
    cubic particular solution exists.
    """
    parameters, now = loop.parameters, loop.now
    v = now.velocity
    total = parameters[KP]
    damping = parameters[KD]
    now.base = 0.0
    now.bent = 0
    now.narrow = 0.0
    floor = loop.plan.stiffness_floor
    slips = False
    sticks = False
    now.nonlinear = 1 if parameters[KI] != 0.0 else 0
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        w = side.weight
        floor = set_up(loop, side, floor)
        damping += w * side.damping
        total += w * side.spring
        now.base += w * side.spring_offset
        sticks = sticks or side.sticking != 0
        if side.slipping > 0.0:
            slips = True
            begin_slip(loop, side, v)
            if side.varies != 0:
                now.nonlinear = 1
                if side.kind != RELAXES:
                    now.bent = 1
    now.watched = 1 if slips else 0
    calm = not sticks and total > 0.0 and damping > 0.0 and parameters[KI] == 0.0 and now.bent == 0
    now.calm = 1 if calm else 0
    now.even_stiffness = total
    now.even_damping = damping
    now.even_base = now.base
    now.floor = floor
    now.added = 0.0
    if abs(total) < floor:
        now.added = 2.0 * floor
        now.nonlinear = 1
    return linear(parameters[INERTIA], damping, total + now.added)


@kernel(exact=False, inline=True)
def set_up(loop: Loop, side: Any, floor: float) -> float:
    """Gather what sticks and what slips of a side; returns the least stiffness, more where it is in a steep layer."""
    now = loop.now
    side.damping = side.viscous
    if side.kind == BENDS:
        begin_bristle(side, now.position, now.held)
    else:
        gather(loop, side, now.position)
        side.slipping += side.rigid * abs(now.sigma)
    if side.steep > 0.0:
        if side.inside != 0:
            side.damping = side.steepness
            # Over the moment that a crossing takes, this spring moves nothing.
            steep = side.weight * side.steepness
            floor = max(floor, IN_LAYER * steep * steep / loop.parameters[INERTIA])
        else:
            side.slipping += side.steep
            now.narrow = max(now.narrow, side.layer)
    return floor


@kernel(exact=False, inline=True)
def gather(loop: Loop, side: Any, theta: float) -> None:
    """Sum up the springs of the sticking elements, and shares and forces of the slipping ones."""
    spring = 0.0
    offset = 0.0
    share = 0.0
    force = 0.0
    stuck = side.first
    for i in range(side.first, side.last):
        e = element_of(loop, i)
        if e.slips != 0:
            share += e.share
            force += e.force
        else:
            e.offset = e.force - e.stiffness * theta
            spring += e.stiffness
            offset += e.offset
            listed = element_of(loop, stuck)
            listed.load_at_0 = e.offset / e.share
            listed.load_slope = e.stiffness / e.share
            stuck += 1
    side.spring = spring
    side.spring_offset = offset
    side.sticking = stuck - side.first
    side.slipping = share
    side.force = force
    side.force_start = force
    side.force_now = force
    side.exponent = 0.0
    side.force_rate = 0.0


@kernel(exact=False, inline=True)
def begin_bristle(side: Any, theta: float, held: int) -> None:
    """All of a bristle's force is slipping force, until `bend` takes what follows the position."""
    side.force += side.spring * theta + side.spring_offset
    side.force_now = side.force
    side.spring = 0.0
    side.spring_offset = 0.0
    side.force_rate = 0.0
    side.slipping = 1.0 - held


@kernel(exact=False, inline=True)
def begin_slip(loop: Loop, side: Any, v: float) -> None:
    """Curve and slope of a side's slipping force at the start of a segment."""
    now = loop.now
    kind = side.kind
    if kind == RELAXES:
        s = sliding(loop, side, v)
        side.decay = 1.0 / s
        side.force_rate = side.attraction * (side.slipping * now.sigma - side.force / s)
    elif kind == FOLLOWS:
        s = sliding(loop, side, v)
        side.force = side.slipping * now.sigma * s
        side.force_now = side.force


@kernel(exact=False)
def curve_slope(loop: Loop, side: Any, v: float) -> float:
    """ds/dv by a central difference, one-sided at rest."""
    d = 1e-4 * side.scale
    low = v - d if abs(v) >= d else v
    high = v + d if v >= 0.0 or abs(v) >= d else v
    if low == v:
        low, high = (v, v + d) if v >= 0.0 else (v - d, v)
    return (sliding(loop, side, high) - sliding(loop, side, low)) / (high - low)


@kernel(exact=False, inline=True)
def torques(
    loop: Loop, asked: Command, integral: float, theta: float, v: float, s_plant: float, s_compensator: float
) -> Torques:  # fmt: skip
    """Motor, friction and compensating torque, N·m."""
    parameters = loop.parameters
    goal, rate = asked.position, asked.velocity
    helped = asked.torque - parameters[KP] * goal - parameters[KR] * rate
    if loop.plan.sides > 1:
        side = side_of(loop, 1)
        model = side.spring * theta + side.spring_offset + s_compensator + side.damping * v
        helped -= side.weight * model
    motor = parameters[KP] * (goal - theta) + parameters[KR] * rate - parameters[KD] * v
    motor += parameters[KI] * integral + helped
    if loop.now.held != 0:
        return motor, motor, helped
    contact = side_of(loop, 0)
    friction = contact.spring * theta + contact.spring_offset + s_plant + contact.damping * v
    return motor, friction, helped


@kernel(exact=False, inline=True)
def bend(loop: Loop, h: float) -> Linear:
    """Take the flow anew for a step of about h: springs of bristles, dampers of curves."""
    parameters, now = loop.parameters, loop.now
    theta = now.position
    v = now.velocity
    total = now.even_stiffness
    damping = now.even_damping
    now.base = now.even_base
    chosen, lagging = False, False
    stiff = STIFF * parameters[INERTIA] / (h * h)
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        w = side.weight
        if side.kind == BENDS and side.slipping > 0.0:
            g = bend_bristle(loop, side, h, total, max(stiff, now.floor))
            total += w * g
            damping += w * side.lag * g
            now.base -= w * g * theta
            if side.lag > h:
                lagging = True
            else:
                chosen = True
        elif side.kind == FOLLOWS and side.slipping > 0.0 and side.varies != 0:
            goal = side.slipping * now.sigma
            b = goal * curve_slope(loop, side, v)
            side.force = goal * sliding(loop, side, v) - b * v
            side.force_rate = 0.0
            side.damping = side.viscous + b
            damping += w * b
    now.added = 0.0
    floor = max(now.floor, stiff) if lagging else now.floor
    if lagging or not chosen:
        floor = max(floor, abs(damping) / (FARTHEST_LAG * h))
    if abs(total) < floor:
        now.added = 2.0 * floor
    return linear(parameters[INERTIA], damping, total + now.added)


@kernel(exact=False, inline=True)
def bend_bristle(loop: Loop, side: Any, h: float, total: float, least: float) -> float:
    """Divide a bristle's force; returns its spring. ``total`` is the stiffness of all before it, ``least`` what both
    are to come to."""
    now = loop.now
    theta = now.position
    v = now.velocity
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
    w = side.weight
    if side.lag <= h and abs(total + w * g) < least:
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
