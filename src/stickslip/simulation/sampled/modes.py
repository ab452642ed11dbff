"""What sticks and what slips: break-away and reversal of a contact in the sampled engine, written down in its state."""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import kernel
from stickslip.simulation.sampled.rates import (
    CREEPS,
    FOLLOWS,
    LEVELS,
    RELAXES,
    RESTS,
    SLIPS,
    STEPS,
    STUCK,
    bends_by,
    curve_at,
    level_now,
    never_sticks,
    spring_of,
)
from stickslip.simulation.sampled.stretch import Stretch

AT_ONCE = 1e-12
"""Of the curve: elements whose load lies this near to it break away with the first one."""
OUT = 1.0 + 1e-12
"""Of the velocity that ends a steep slope, beyond which the slope is left: not to and fro by rounding."""


@kernel(exact=False, inline=True)
def sign(x: float) -> float:
    """+1, -1, or 0."""
    if x > 0.0:
        return 1.0
    return -1.0 if x < 0.0 else 0.0


@kernel(exact=False, inline=True)
def floor_below(axis: Any, v: float) -> float:
    """A bound below s on all velocities up to v, N·m."""
    if axis.elastic > 0.0:
        return axis.elastic
    if axis.curve == 0:
        return axis.breakaway
    top = axis.scale * 2.0 ** (4 - LEVELS)
    for i in range(LEVELS):
        if v <= top:
            return axis.floor[i]
        top *= 2.0
    return axis.lowest


@kernel(exact=False, inline=True)
def breaks_at(axis: Any, v: float) -> float:
    """The load over its share at which an element that sticks gives way, N·m."""
    return axis.elastic if axis.elastic > 0.0 else curve_at(axis, v)


@kernel(exact=False, inline=True)
def heaviest(axis: Any, moved: float, direction: float) -> float:
    """The largest load of a sticking element over its share, N·m (`stickslip.laws.slip_rule`)."""
    most = -math.inf
    for i in range(axis.count):
        spring = spring_of(axis, i)
        if spring.slips == 0.0:
            force = spring.force + spring.stiffness * moved
            load = abs(force) if axis.literal else direction * force
            most = max(most, load / spring.share)
    return most


@kernel(exact=False)
def stays_below(axis: Any, most: float, piece: Stretch, way: float) -> bool:
    """Whether loads of at most `most` N·m cannot meet the curve in a stretch between two velocities of one sign."""
    if most < axis.lowest:
        return True
    return keeps_below(axis, most, piece, way, breaks_at(axis, piece.v0), breaks_at(axis, piece.v1))


@kernel(exact=False)
def keeps_below(axis: Any, most: float, piece: Stretch, way: float, begin: float, end: float) -> bool:
    """The same where the curve at both ends is known, N·m.

    For a curve that rises or falls throughout the velocities of the stretch; its tangents bound these where the
    acceleration changes its sign.
    """
    fastest, slowest = max(way * piece.v0, way * piece.v1), min(way * piece.v0, way * piece.v1)
    if piece.a0 * piece.a1 >= 0.0 and slowest >= 0.0:
        return most < min(begin, end)
    if piece.a0 * piece.a1 < 0.0:
        bulge = 0.5 * piece.time * max(abs(piece.a0), abs(piece.a1))
        fastest, slowest = fastest + bulge, slowest - bulge
    if most >= breaks_at(axis, way * fastest):
        return False
    return most < breaks_at(axis, way * max(slowest, 0.0))


@kernel(exact=False)
def fold(axis: Any, z: Any) -> None:
    """Write every element's force down as it is now."""
    relaxed = math.exp(-z.relaxed)
    level = 0.0
    if axis.kind == FOLLOWS:
        level = z.direction * level_now(axis, z)
    elif z.share > 0.0:
        level = (z.slipping - relaxed * z.slipped_from) / z.share
    for i in range(axis.count):
        spring = spring_of(axis, i)
        if spring.slips == 0.0:
            spring.force += spring.stiffness * z.moved
        elif axis.kind == FOLLOWS:
            spring.force = spring.share * level
        else:
            spring.force = relaxed * spring.force + spring.share * level
    z.position += z.moved
    z.moved = 0.0


@kernel(exact=False)
def gather(axis: Any, z: Any) -> None:
    """Sum up what sticks and what slips."""
    if never_sticks(axis):
        return
    z.held = z.spring = z.slipping = z.relaxed = 0.0
    z.share = axis.rigid + axis.steep if z.mode == SLIPS else 0.0
    for i in range(axis.count):
        spring = spring_of(axis, i)
        if spring.slips == 0.0:
            z.held += spring.force
            z.spring += spring.stiffness
        else:
            z.slipping += spring.force
            z.share += spring.share
    z.slipped_from = z.slipping


@kernel(exact=False)
def break_away(axis: Any, z: Any, direction: float) -> None:
    """Let the elements slip whose load has reached their share of the curve; the heaviest in any case."""
    fold(axis, z)
    level = axis.elastic if axis.elastic > 0.0 else level_now(axis, z)
    enough = min(level * (1.0 - AT_ONCE), heaviest(axis, 0.0, direction))
    for i in range(axis.count):
        spring = spring_of(axis, i)
        if spring.slips == 0.0:
            load = abs(spring.force) if axis.literal else direction * spring.force
            if load >= enough * spring.share:
                spring.slips = 1.0
    z.direction, z.mode = direction, SLIPS
    z.events += 1
    gather(axis, z)


@kernel(exact=False)
def turn(axis: Any, z: Any) -> None:
    """The velocity has fallen to zero (or to where the steep slope begins): what slipped sticks."""
    z.velocity = z.direction * axis.layer
    z.events += 1
    if never_sticks(axis):
        z.direction = sign(z.torque - z.slipping)
        return
    fold(axis, z)
    for i in range(axis.count):
        spring_of(axis, i).slips = 0.0
    z.mode = STUCK
    if axis.rigid > 0.0:
        z.mode = RESTS
    elif axis.steep > 0.0:
        z.mode = CREEPS
    gather(axis, z)


@kernel(exact=False)
def set_off(axis: Any, z: Any, direction: float) -> None:
    """A rigid contact begins to slide."""
    z.direction, z.mode = direction, SLIPS
    z.position += z.moved
    z.moved = 0.0
    z.events += 1
    gather(axis, z)


@kernel(exact=False)
def rest(axis: Any, z: Any, left: float) -> float:
    """A rigid contact holds the axis, or lets it go; returns the time taken."""
    z.velocity = z.acceleration = 0.0
    if abs(z.torque) <= axis.rigid * curve_at(axis, 0.0):
        return left
    set_off(axis, z, sign(z.torque))
    return 0.0


@kernel(exact=False)
def creep(axis: Any, z: Any, left: float) -> float:
    """Follow a steep slope, J dv/dt = u - slope v, at most to where it meets the curve; returns the time taken."""
    slope = axis.slope
    rate = slope / axis.inertia
    goal, v = z.torque / slope, z.velocity
    leaves = abs(goal) > axis.layer * OUT
    edge = math.copysign(axis.layer, goal)
    taken = left
    if leaves:
        gone = (goal - edge) / (goal - v) if (edge - v) * edge > 0.0 else 1.0
        taken = -math.log(gone) / rate
        leaves = taken < left
        taken = min(taken, left)
    faded = -math.expm1(-rate * taken)
    z.goal = goal
    z.moved += goal * taken + (v - goal) * faded / rate
    z.velocity = edge if leaves else v + (goal - v) * faded
    z.acceleration = (z.torque - slope * z.velocity) / axis.inertia
    if leaves:
        set_off(axis, z, sign(goal))
    return taken


@kernel(exact=False, inline=True)
def friction(axis: Any, z: Any) -> float:
    """Torque of the contact now, N·m."""
    v = z.velocity
    if z.mode == RESTS:
        return z.torque
    if z.mode >= STEPS:
        return z.held
    if z.mode == CREEPS:
        return axis.slope * v
    force = z.held + z.spring * z.moved
    if z.mode == STUCK:
        return force + axis.damped * v
    force += axis.viscous * v
    if axis.kind == RELAXES:
        return force + z.slipping
    level = level_now(axis, z)
    if axis.kind == FOLLOWS:
        return force + z.share * z.direction * level
    return force + z.slipping + axis.lag * bends_by(axis, v, z.slipping, level, z.direction)
