"""Where the loop of the exact integrator stands: at its start, after a step, at a break, at rest, and at an event,
where its modes change.

Rest is an axis that rigid friction holds at v = 0, until the applied torque is larger. Steps may be made wrong on
purpose: what a run shows that it is sensitive to (`stickslip.simulation.accuracy`).
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import kernel
from stickslip.simulation.case_arrays import KI, KP, PERTURBATION, POSITION_0, TOLERANCE, VELOCITY_0
from stickslip.simulation.exact.events import BARELY, NONE, load_of
from stickslip.simulation.exact.forces import command, sliding
from stickslip.simulation.exact.output import row_before
from stickslip.simulation.exact.segment import integral_at, remember, slip_force_at
from stickslip.simulation.exact.state import BENDS, EDGE, RELAXES, Loop, element_of, side_of, sides_of
from stickslip.simulation.exact.step import look_ahead

SOON = 1e-9
"""Time at which the commanded torque tells where a free axis sets off, s."""
ROUNDING = 1e-10
"""N·m by which a load may seem to miss the limit that it was located at."""
ON_EDGE = 1e-6
"""Velocities this near the edge of a steep layer, in parts of it, are on it."""
LONGEST_REST, SHORTEST_REST = 2e-3, 1e-9
"""s, at rest between two looks at the torque."""
SEEN = 0.05
"""Part of what is held, by which the torque may lie off its cubic there."""
HOLDS, BREAKS = 0, 1
LASTING, LEAST = 1e-4, 1e-3
"""A step that is shorter than this (s) is perturbed by as much less, but by no less than this share."""


@kernel(exact=False, inline=True)
def finish_step(loop: Loop, t: float) -> None:
    """Stand at the end of the segment; modes stay."""
    now, segment = loop.now, loop.segment
    add_exponents(loop, segment.length, segment.length)
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        if side.slipping > 0.0 and side.varies != 0:
            side.force = side.force_end
            side.force_now = side.force_end
            side.force_rate = side.force_rate_end
            side.decay = side.decay_end
    now.time = t
    now.position = segment.position_end
    now.velocity = segment.velocity_end
    now.command = segment.command_end
    now.command_rate = segment.command_rate_end
    now.goal = segment.goal_end
    now.goal_rate = segment.rate_end
    if loop.parameters[KI] != 0.0:
        now.integral = segment.integral_end


@kernel(exact=False)
def finish_event(loop: Loop, x: float, theta: float, v: float) -> None:
    """Stand at the event x; modes are about to change."""
    now, segment = loop.now, loop.segment
    add_exponents(loop, segment.length, x)
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        side.force_now = slip_force_at(side, segment, x)
    now.integral = integral_at(loop, x)
    now.time += x
    now.position = theta
    now.velocity = v
    stand(loop)


@kernel(exact=False, inline=True)
def cross(loop: Loop, h: float, tol: float, held: bool, full: bool) -> None:
    """Stand at the event h, with a row of it if `full`, and change modes."""
    segment = loop.segment
    loop.count.events += 1
    loop.now.jumped = 1
    theta = segment.position_event
    v = segment.velocity_event
    if full:
        row_before(loop, h, theta, v)
    finish_event(loop, h, theta, v)
    switch(loop)
    if held:
        release(loop)
    if loop.parameters[PERTURBATION] != 0.0:
        perturbation(loop, h, tol, True)


@kernel(exact=False)
def stand(loop: Loop) -> None:
    """Take the reference where the loop stands."""
    now = loop.now
    now.command, now.command_rate, now.goal, now.goal_rate = command(loop, now.time)


@kernel(exact=False)
def start(loop: Loop, following: float) -> None:
    """Stand at t = 0, before the first break."""
    parameters, now = loop.parameters, loop.now
    now.jumped = 1
    now.edge_low = EDGE
    now.edge_high = following - EDGE
    now.position = parameters[POSITION_0]
    now.velocity = parameters[VELOCITY_0]
    if now.velocity != 0.0:
        now.sigma = 1.0 if now.velocity > 0.0 else -1.0
    stand(loop)
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        side.inside = 1 if abs(now.velocity) < side.layer else 0
    if now.velocity == 0.0 and not set_off(loop):
        push = applied(loop) + command(loop, SOON).torque - now.command
        now.sigma = 1.0 if push >= 0.0 else -1.0


@kernel(exact=False)
def pass_break(loop: Loop, t: float, following: float) -> bool:
    """Stand on the other side of a break; returns whether the commanded torque jumps."""
    now = loop.now
    before = now.command
    now.jumped = 1
    now.time = t
    now.edge_low = t + EDGE
    now.edge_high = following - EDGE
    now.unseen = 0
    stand(loop)
    return abs(now.command - before) > 1e-9


@kernel(exact=False, inline=True)
def add_exponents(loop: Loop, h: float, x: float) -> None:
    """Add the decay C int 1/s dt of slipping elements over the first x of a segment of length h."""
    f = x / h
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        if side.slipping > 0.0 and side.kind == RELAXES:
            attraction = side.attraction
            q0 = side.decay
            bend = 2.0 * (q0 + side.decay_end) - 4.0 * side.decay_mid
            slope = side.decay_end - q0 - bend
            side.exponent += attraction * x * (q0 + f * (0.5 * slope + f * bend / 3.0))


@kernel(exact=False, inline=True)
def settle_forces(loop: Loop) -> None:
    """Write every element's force where the loop stands, before modes change."""
    now = loop.now
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        if side.kind == BENDS:
            side.force = side.force_now
            continue
        decay = math.exp(-side.exponent)
        moves = side.kind == RELAXES
        s = 0.0 if moves else sliding(loop, side, now.velocity)
        for j in range(side.first, side.last):
            e = element_of(loop, j)
            if e.slips == 0:
                e.force = e.offset + e.stiffness * now.position
            elif moves:
                part = e.share / side.slipping
                gained = side.force_now - decay * side.force_start
                e.force = decay * e.force + part * gained
            else:
                e.force = e.share * now.sigma * s


@kernel(exact=False, inline=True)
def switch(loop: Loop) -> None:
    """Change the modes that end here: stick at a reversal, slip where the limit is reached."""
    now = loop.now
    v = now.velocity
    settle_forces(loop)
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        enter_or_leave(loop, side, v)
    if now.watched != 0 and now.sigma * v <= 1e-9 * abs(v):
        for i in range(loop.plan.elements):
            element_of(loop, i).slips = 0
        if now.sigma * v > 0.0:
            now.velocity = 0.0
        if not set_off(loop):
            now.sigma = -now.sigma
        # Where the curve rises with the velocity, what stuck before may be loaded beyond it in the new direction.
        if now.sigma != 0.0:
            v = now.sigma * max(now.sigma * now.velocity, BARELY)
            break_away(loop, v, now.sigma)
        return
    break_away(loop, v, 1.0 if v >= 0.0 else -1.0)


@kernel(exact=False, inline=True)
def break_away(loop: Loop, v: float, direction: float) -> None:
    """Let the sticking elements slip whose load in `direction` is at its limit."""
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        if side.first == side.last:
            continue
        s = sliding(loop, side, v)
        for j in range(side.first, side.last):
            e = element_of(loop, j)
            load = load_of(side.literal != 0, direction, e.force)
            if e.slips == 0 and load >= e.share * s - ROUNDING:
                e.slips = 1
                loop.now.sigma = direction


@kernel(exact=False)
def enter_or_leave(loop: Loop, side: Any, v: float) -> None:
    """Pass the edge of a steep layer if the axis stands there."""
    now = loop.now
    edge = side.layer
    if edge == 0.0:
        return
    if side.inside != 0:
        if abs(v) >= (1.0 - ON_EDGE) * edge:
            side.inside = 0
            now.sigma = 1.0 if v > 0.0 else -1.0
    elif now.sigma * v <= (1.0 + ON_EDGE) * edge:
        side.inside = 1


@kernel(exact=False)
def rest(loop: Loop, left: float) -> float:
    """Stay at rest for at most `left` s; fills `segment`, returns when the axis breaks away or NONE."""
    limit = max(stiction(loop), 0.0)
    if abs(applied(loop)) > limit:
        stay(loop, min(left, LONGEST_REST))
        return 0.0
    seen, h = overseen(loop, min(left, LONGEST_REST), limit)
    if seen == HOLDS:
        stay(loop, h)
        return NONE
    low = 0.0
    for _ in range(60):
        x = 0.5 * (low + h)
        if abs(torque_after(loop, x)[0]) > limit:
            h = x
        else:
            low = x
        if h - low < 1e-13:
            break
    stay(loop, h)
    return h


@kernel(exact=False)
def stay(loop: Loop, h: float) -> None:
    """Fill `segment` with h at rest."""
    now, segment = loop.now, loop.segment
    theta = now.position
    look_ahead(loop, h, 0.0)
    remember(segment, (theta, 0.0, 0.0, 0.0), h, (0.0, 0.0), (theta, 0.0), (theta, 0.0), 0)
    reference_integral = h / 30.0 * (7.0 * (now.goal + segment.goal_end) + 16.0 * segment.goal_mid)
    reference_integral += h * h / 60.0 * (now.goal_rate - segment.rate_end)
    segment.integral_end = now.integral + reference_integral - theta * h
    segment.position_event = theta
    segment.velocity_event = 0.0


@kernel(exact=False)
def overseen(loop: Loop, longest: float, limit: float) -> tuple[int, float]:
    """How long the torque at rest is overseen, s, and whether it `HOLDS` that long or `BREAKS` away.

    It is where it lies on its cubic, and its control polygon (Bernstein) holds or only rises: no peak hides between.
    """
    now = loop.now
    start = applied(loop)
    slope = now.command_rate + loop.parameters[KI] * (now.goal - now.position)
    h = longest
    while True:
        middle = torque_after(loop, 0.5 * h)[0]
        end, end_slope = torque_after(loop, h)
        first, last = start + h / 3.0 * slope, end - h / 3.0 * end_slope
        off = abs(middle - 0.5 * (start + end) - 0.125 * h * (slope - end_slope))
        soon = h < SHORTEST_REST
        if soon or (off <= SEEN * limit and integrates(loop, h)):
            if max(abs(first), abs(last), abs(middle), abs(end)) + off <= limit:
                return HOLDS, h
            sign = 1.0 if end > 0.0 else -1.0
            rises = sign * start <= sign * first <= sign * last <= sign * end
            if abs(end) > limit and (rises or soon):
                return BREAKS, h
            if soon:
                return (BREAKS, 0.5 * h) if abs(middle) > limit else (HOLDS, h)
        h *= 0.5


@kernel(exact=False)
def integrates(loop: Loop, h: float) -> bool:
    """Whether the integral of the reference over h is good to the tolerance."""
    parameters, now = loop.parameters, loop.now
    if parameters[KI] == 0.0:
        return True
    middle = command(loop, now.time + 0.5 * h).position
    end = command(loop, now.time + h)
    off = middle - 0.5 * (now.goal + end.position) - 0.125 * h * (now.goal_rate - end.velocity)
    return parameters[KI] * h * abs(off) <= parameters[TOLERANCE] * max(parameters[KP], parameters[KI] * h)


@kernel(exact=False)
def torque_after(loop: Loop, x: float) -> tuple[float, float]:
    """Applied torque after another x at rest, N·m, and its rate."""
    parameters, now = loop.parameters, loop.now
    end = command(loop, now.time + x)
    torque = applied(loop) + end.torque - now.command
    rate = end.torque_rate
    if parameters[KI] != 0.0:
        middle = command(loop, now.time + 0.5 * x)
        reference_integral = x / 30.0 * (7.0 * (now.goal + end.position) + 16.0 * middle.position)
        reference_integral += x * x / 60.0 * (now.goal_rate - end.velocity)
        torque += parameters[KI] * (reference_integral - now.position * x)
        rate += parameters[KI] * (end.position - now.position)
    return torque, rate


@kernel(exact=False)
def stiction(loop: Loop) -> float:
    """Half the net interval of torque that rigid elements hold at rest, N·m; negative where they repel."""
    total = 0.0
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        total += side.weight * side.rigid * side.breakaway
    return total


@kernel(exact=False)
def applied(loop: Loop) -> float:
    """Torque on the resting axis without its rigid elements, N·m."""
    parameters, now = loop.parameters, loop.now
    torque = now.command + parameters[KI] * now.integral - parameters[KP] * now.position
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        if side.kind == BENDS:
            force = side.spring * now.position + side.spring_offset
            torque -= side.weight * (force + side.force)
        for j in range(side.first, side.last):
            torque -= side.weight * element_of(loop, j).force
    return torque


@kernel(exact=False)
def set_off(loop: Loop) -> bool:
    """At v = 0: rest, or the direction in which the axis goes on; False where no rigid elements decide that.

    Rigid friction in the plant holds what lies inside its interval, less the jump of a compensator that acts on
    sign(v). A compensator that jumps by more than the plant repels: the axis goes on through zero.
    """
    now = loop.now
    rigid = side_of(loop, 0).rigid > 0.0 or (loop.plan.sides > 1 and side_of(loop, 1).rigid > 0.0)
    if not rigid:
        return False
    interval = stiction(loop)
    torque = applied(loop)
    before = now.sigma
    now.held = 0
    if abs(torque) > max(interval, 0.0):
        now.sigma = 1.0 if torque > 0.0 else -1.0
    elif interval < 0.0 and before != 0.0:
        now.sigma = -before
    else:
        now.sigma = 0.0
        now.held = 1
        now.velocity = 0.0
    if now.sigma * now.velocity < 0.0:
        now.velocity = 0.0
    return True


@kernel(exact=False)
def release(loop: Loop) -> None:
    """Leave rest in the direction of the applied torque."""
    now = loop.now
    now.held = 0
    now.sigma = 1.0 if applied(loop) > 0.0 else -1.0


@kernel(exact=False)
def perturbation(loop: Loop, h: float, tol: float, switched: bool) -> None:
    """Move the axis after a step of h by PERTURBATION times what the step may be wrong by; springs that stick follow.

    Always along the motion, or always against it: such errors add up, and in a limit cycle shift its phase.
    """
    now = loop.now
    distance = loop.parameters[PERTURBATION] * tol * min(1.0, LEAST + h / LASTING)
    if now.velocity < 0.0:
        distance = -distance
    now.position += distance
    if not switched:
        return
    # After a switch the springs are set up anew from the elements' forces.
    for i in range(loop.plan.elements):
        e = element_of(loop, i)
        if e.slips == 0:
            e.force += e.stiffness * distance
