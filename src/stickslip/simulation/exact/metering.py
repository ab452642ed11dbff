"""The motion over a segment of the exact integrator, handed to the meter in a few windows.

What changes slowly is seen at five nodes a window; the ringing of the free motion enters the integrals in closed form
(`exact.ringing`). Extremes, reversals and standstills are looked for at fine steps only in windows whose bounds leave
room for one.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.jit import kernel
from stickslip.simulation._meter import (
    AT,
    COMPENSATING,
    ERROR,
    ERROR_RATE,
    FRICTION,
    LONG_WINDOW,
    MOTOR,
    REFERENCE_SPEED,
    SIGNALS,
    SPEED,
)
from stickslip.simulation.case_arrays import KD, KP, KR
from stickslip.simulation.exact.flow import (
    UNMOVED,
    Cubic,
    Linear,
    flow,
    free_motion,
    moved,
    twice,
    upper_terms,
)
from stickslip.simulation.exact.forces import Command, command
from stickslip.simulation.exact.output import torques_at
from stickslip.simulation.exact.ringing import has_closed_form, ringing
from stickslip.simulation.exact.scan import Span
from stickslip.simulation.exact.segment import cubic_of
from stickslip.simulation.exact.state import Loop, side_of
from stickslip.simulation.exact.window import Rings, Shares, ringing_window, window

LONGEST = 64e-3
"""Longest window where the reference changes slowly, s."""
SHORTEST_WINDOW = 1e-10
"""Shorter segments are left out of the metrics (s)."""
FINEST_NODES = 0.03
"""Half a window in radians (or e-folds) of the free motion, that need not be undercut."""
MOST_WINDOWS = 250_000
"""Of a step, each of four nodes: half a second of work, in which nothing hears a wish to end."""
MOST_RADIANS = 5e5
"""Of ringing in a window, which may all be looked through for a peak: as long."""
DIED_OUT = 1e-8
"""Free motion slower than this (rad/s) adds nothing to a metric; the nodes need not follow it."""


@kernel(exact=False, inline=True)
def shares(loop: Loop) -> Shares:
    """The shares of the loop as its modes are."""
    parameters = loop.parameters
    spring = 0.0
    damping = 0.0
    contact = side_of(loop, 0)
    if loop.plan.sides > 1:
        side = side_of(loop, 1)
        spring = -side.weight * side.spring
        damping = -side.weight * side.damping
    return Shares(
        spring - parameters[KP], damping - parameters[KD], contact.spring, contact.damping, spring, damping
    )


class Way(NamedTuple):
    """The reference over a segment: a cubic where the corrector takes it as one."""

    even: bool
    cubic: Cubic


@kernel(exact=False, inline=True)
def way_of(loop: Loop) -> Way:
    """How the nodes of a segment get the reference.

    Where `exact.step.look_ahead` leaves out its middle, a cubic misses it by a small part of the tolerance.
    """
    now, segment = loop.now, loop.segment
    g2, g3 = upper_terms(
        now.goal, now.goal_rate, segment.goal_end, segment.rate_end, 1.0 / segment.length
    )  # fmt: skip
    return Way(now.unseen != 0, (now.goal, now.goal_rate, g2, g3))


@kernel(exact=False, inline=True)
def commanded(loop: Loop, way: Way, x: float) -> Command:
    """What time alone commands at x inside the segment; without the torque's rate where the reference is a cubic."""
    if way.even:
        goal, rate = moved(way.cubic, UNMOVED, x, 0.0, 0.0)
        return Command(loop.parameters[KP] * goal + loop.parameters[KR] * rate, 0.0, goal, rate)
    return command(loop, loop.now.time + x)


# ---- windows --------------------------------------------------------------------------------------------------


@kernel(exact=False, inline=True)
def windows_for(rate: float, speed: float, h: float) -> float:
    """Windows whose five nodes follow a free motion of that rate (1/s) and velocity (rad/s) over h, at least 1.

    Boole's rule is wrong by about 2e-3 y^6 of the changing part for nodes y/2 of a radian apart.
    """
    y = 0.5 * h * abs(rate)
    # Most segments are short; a root costs as much as the rest.
    if speed < DIED_OUT or y <= FINEST_NODES or (y <= 1.0 and y * y * y * speed <= 1e-5):
        return 1.0
    return y / max(FINEST_NODES, min(1.0, 0.1 * (1e-2 / speed) ** (1.0 / 3.0)))


@kernel(exact=False, inline=True)
def windows_of(lin: Linear, segment: Any, h: float, longest: float) -> float:
    """Windows, none longer than `longest`, whose nodes follow the first h of a segment."""
    p = segment.free_position
    q = segment.free_velocity
    if lin.discriminant > 0.0:
        rate = max(lin.frequency, lin.decay)
        most = windows_for(rate, abs(q) + rate * abs(p), h)
    else:
        fast = -lin.decay - lin.frequency
        slow = -lin.decay + lin.frequency
        share = 0.5 / (lin.frequency + 1e-9)
        most = max(
            windows_for(fast, abs(fast * (q - slow * p)) * share, h),
            windows_for(slow, abs(slow * (q - fast * p)) * share, h),
        )
    return min(max(most, h / longest), MOST_WINDOWS + 1.0) * (1.0 - 1e-9)


@kernel(exact=False, inline=True)
def slowly(loop: Loop) -> bool:
    """Whether the reference turns by less than 0.3 radian in a segment: its way leaves that of its mean velocity by a
    twelfth of the angle's square."""
    now, segment = loop.now, loop.segment
    h = segment.length
    if h > LONGEST * 1.001:
        return False
    r0 = now.goal_rate
    r1 = segment.rate_end
    off = segment.goal_end - now.goal - 0.5 * h * (r0 + r1)
    return abs(off) <= 0.0075 * h * max(abs(r0), abs(r1))


@kernel(exact=False)
def measure(lin: Linear, loop: Loop, h: float, acc: Any, turns: Any, nodes: Any) -> bool:
    """Hand the first h of the segment to the meter, in windows of five nodes; False where they are too many."""
    now, segment = loop.now, loop.segment
    if h < SHORTEST_WINDOW:
        return True
    longest = LONGEST if slowly(loop) else LONG_WINDOW
    windows = math.ceil(windows_of(lin, segment, h, longest))
    fewest = math.ceil(h / longest * (1.0 - 1e-9))
    rings = windows > fewest and has_closed_form(lin, h / fewest)
    if rings:
        windows = fewest
        if h * math.sqrt(lin.square) > MOST_RADIANS * windows:
            return False
    elif windows > MOST_WINDOWS:
        return False
    width = h / windows
    c = cubic_of(segment)
    m = flow(lin, 0.25 * width)
    p = segment.free_position
    v = segment.free_velocity
    share = shares(loop)
    way = way_of(loop)
    if now.jumped != 0:
        fill(loop, way, 0.0, now.position, now.velocity, nodes, 4)
        now.jumped = 0
    for w in range(windows):
        begin = w * width
        for j in range(SIGNALS):
            nodes[j, 0] = nodes[j, 4]
        if rings:
            shift(nodes, 0, share, -p, -v)
            for k in range(1, 5):
                x = begin + 0.25 * width * k
                theta, speed = moved(c, UNMOVED, x, 0.0, 0.0)
                fill(loop, way, x, theta, speed, nodes, k)
            p0 = p
            v0 = v
            p, v = free_motion(twice(twice(m)), p0, v0)
            ring = ringing(lin, width, p0, v0, p, v)
            ringing_window(acc, turns, nodes, Span(now.time + begin, width), Rings(lin, m, ring, share))
            shift(nodes, 4, share, p, v)
        else:
            for k in range(1, 5):
                x = begin + 0.25 * width * k
                p, v = free_motion(m, p, v)
                theta, speed = moved(c, UNMOVED, x, p, v)
                fill(loop, way, x, theta, speed, nodes, k)
            window(acc, turns, nodes, Span(now.time + begin, width))
    return True


@kernel(exact=False)
def fill(loop: Loop, way: Way, x: float, theta: float, v: float, nodes: Any, k: int) -> None:
    """Write one node of every signal that the meter reads."""
    asked = commanded(loop, way, x)
    motor, friction, compensating = torques_at(loop, x, asked, theta, v)
    nodes[ERROR, k] = asked.position - theta
    nodes[ERROR_RATE, k] = asked.velocity - v
    nodes[AT, k] = theta
    nodes[SPEED, k] = v
    nodes[REFERENCE_SPEED, k] = asked.velocity
    nodes[MOTOR, k] = motor
    nodes[FRICTION, k] = friction
    nodes[COMPENSATING, k] = compensating


@kernel(exact=False, inline=True)
def shift(nodes: Any, k: int, share: Shares, p: float, v: float) -> None:
    """Add a free motion to a node."""
    nodes[ERROR, k] -= p
    nodes[ERROR_RATE, k] -= v
    nodes[AT, k] += p
    nodes[SPEED, k] += v
    nodes[MOTOR, k] += share.motor_p * p + share.motor_v * v
    nodes[FRICTION, k] += share.friction_p * p + share.friction_v * v
    nodes[COMPENSATING, k] += share.compensating_p * p + share.compensating_v * v
