"""The motion over a segment of the exact integrator, handed to the meter in a few windows.

What changes slowly is seen at five nodes a window; the ringing of the free motion enters the integrals in closed form
(`exact.ringing`). Extremes, reversals and standstills are looked for at fine steps only in windows whose bounds leave
room for one.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.jit import kernel
from stickslip.simulation._meter import LONG_WINDOW, Turns
from stickslip.simulation._nodes import (
    AT,
    COMPENSATING,
    ERROR,
    ERROR_RATE,
    FRICTION,
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
    Matrix,
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
from stickslip.simulation.exact.state import DEEPEST, Loop, kept_of, side_of
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
    """The reference over a segment: a cubic where the corrector takes it as one, a quintic where it turns slowly.

    The quintic is the cubic and y² (lift + tilt (x - middle)), y = x (h - x).
    """

    even: bool
    cubic: Cubic
    lift: float
    tilt: float
    middle: float


@kernel(exact=False, inline=True)
def way_of(loop: Loop, slow: bool) -> Way:
    """How the nodes of a segment get the reference.

    Where `exact.step.look_ahead` leaves out its middle, a cubic misses it by a small part of the tolerance. With its
    middle known, the quintic misses a turn of 0.3 radian by 2e-8 of its amplitude.
    """
    now, segment = loop.now, loop.segment
    middle = 0.5 * segment.length
    g2, g3 = upper_terms(
        now.goal, now.goal_rate, segment.goal_end, segment.rate_end, 1.0 / segment.length
    )  # fmt: skip
    cubic = (now.goal, now.goal_rate, g2, g3)
    if now.unseen != 0 or segment.asked == 0:
        return Way(True, cubic, 0.0, 0.0, middle)
    if not slow or loop.plan.cells != 0:
        return Way(False, cubic, 0.0, 0.0, middle)
    goal, rate = moved(cubic, UNMOVED, middle, 0.0, 0.0)
    inverse = 1.0 / (middle * middle * middle * middle)
    return Way(True, cubic, (segment.goal_mid - goal) * inverse, (segment.rate_mid - rate) * inverse, middle)


@kernel(exact=False, inline=True)
def commanded(loop: Loop, way: Way, x: float) -> Command:
    """What time alone commands at x inside the segment; without the torque's rate where the reference is a cubic."""
    if way.even:
        goal, rate = moved(way.cubic, UNMOVED, x, 0.0, 0.0)
        off = x - way.middle
        y = x * (2.0 * way.middle - x)
        bump = way.lift + way.tilt * off
        goal += y * y * bump
        rate += y * (way.tilt * y - 4.0 * off * bump)
        return Command(loop.parameters[KP] * goal + loop.parameters[KR] * rate, 0.0, goal, rate)
    return command(loop, loop.now.time + x)


# ---- windows --------------------------------------------------------------------------------------------------


@kernel(exact=False, inline=True)
def crowd_for(rate: float, speed: float, h: float) -> float:
    """Third power of the windows whose five nodes follow a free motion of that rate (1/s) and velocity (rad/s) over h.

    Boole's rule is wrong by about 2e-3 y^6 of the changing part for nodes y/2 of a radian apart.
    """
    y = 0.5 * h * abs(rate)
    if speed < DIED_OUT or y <= FINEST_NODES:
        return 1.0
    return y * y * y / max(FINEST_NODES * FINEST_NODES * FINEST_NODES, min(1.0, 1e-5 / speed))


@kernel(exact=False, inline=True)
def crowd_of(lin: Linear, segment: Any, h: float) -> float:
    """Third power of the windows whose nodes follow the first h of a segment; a root costs as much as the rest."""
    p = segment.free_position
    q = segment.free_velocity
    if lin.discriminant > 0.0:
        rate = max(lin.frequency, lin.decay)
        return crowd_for(rate, abs(q) + rate * abs(p), h)
    fast = -lin.decay - lin.frequency
    slow = -lin.decay + lin.frequency
    share = 0.5 / (lin.frequency + 1e-9)
    return max(
        crowd_for(fast, abs(fast * (q - slow * p)) * share, h),
        crowd_for(slow, abs(slow * (q - fast * p)) * share, h),
    )


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


@kernel(exact=False, inline=True)
def quarter_of(lin: Linear, loop: Loop, width: float, generation: int, level: int) -> Matrix:
    """The flow over a quarter of a window; over that of a whole step, half of the next shorter one, it may be kept.

    What is not kept stays so: with and without metrics, the motion is the same to the bit.
    """
    if width == kept_of(loop, level).step and level < DEEPEST:
        kept = kept_of(loop, level + 1)
        if kept.generation == generation:
            return kept.pp, kept.pv, kept.vp, kept.vv
    return flow(lin, 0.25 * width)


@kernel(exact=False)
def measure(
    lin: Linear, loop: Loop, h: float, generation: int, level: int, acc: Any, turns: Turns, nodes: Any
) -> bool:  # fmt: skip
    """Hand the first h of the segment to the meter, in windows of five nodes; False where they are too many.

    ``generation`` and ``level`` are those of the modes and of the step that was taken.
    """
    now, segment = loop.now, loop.segment
    if h < SHORTEST_WINDOW:
        return True
    slow = slowly(loop)
    longest = LONGEST if slow else LONG_WINDOW
    windows = math.ceil(h / longest * (1.0 - 1e-9))
    crowd = (1.0 - 1e-9) * crowd_of(lin, segment, h)
    crowded = crowd > float(windows) * windows * windows
    rings = crowded and has_closed_form(lin, h / windows)
    if rings:
        if h * math.sqrt(lin.square) > MOST_RADIANS * windows:
            return False
    elif crowded:
        windows = math.ceil(min(crowd ** (1.0 / 3.0), MOST_WINDOWS + 1.0))
    if windows > MOST_WINDOWS:
        return False
    width = h / windows
    c = cubic_of(segment)
    m = quarter_of(lin, loop, width, generation, level)
    p = segment.free_position
    v = segment.free_velocity
    share = shares(loop)
    way = way_of(loop, slow)
    if now.jumped != 0:
        fill(loop, way, 0.0, now.position, now.velocity, nodes, 4)
        now.jumped = 0
    for w in range(windows):
        begin = w * width
        for j in range(SIGNALS):
            nodes[5 * j] = nodes[5 * j + 4]
        p0 = p
        v0 = v
        if rings:
            shift(nodes, 0, share, -p, -v)
        for k in range(1, 5):
            x = begin + 0.25 * width * k
            # Nodes of a window that rings show all but the ringing.
            p, v = (0.0, 0.0) if rings else free_motion(m, p, v)
            theta, speed = moved(c, UNMOVED, x, p, v)
            fill(loop, way, x, theta, speed, nodes, k)
        span = Span(now.time + begin, width)
        if rings:
            p, v = free_motion(twice(twice(m)), p0, v0)
            ring = ringing(lin, width, p0, v0, p, v)
            ringing_window(acc, turns, nodes, span, Rings(lin, m, ring, share))
            shift(nodes, 4, share, p, v)
        else:
            window(acc, turns, nodes, span)
    return True


@kernel(exact=False, inline=True)
def fill(loop: Loop, way: Way, x: float, theta: float, v: float, nodes: Any, k: int) -> None:
    """Write one node of every signal that the meter reads."""
    asked = commanded(loop, way, x)
    motor, friction, compensating = torques_at(loop, x, asked, theta, v)
    nodes[ERROR + k] = asked.position - theta
    nodes[ERROR_RATE + k] = asked.velocity - v
    nodes[AT + k] = theta
    nodes[SPEED + k] = v
    nodes[REFERENCE_SPEED + k] = asked.velocity
    nodes[MOTOR + k] = motor
    nodes[FRICTION + k] = friction
    nodes[COMPENSATING + k] = compensating


@kernel(exact=False, inline=True)
def shift(nodes: Any, k: int, share: Shares, p: float, v: float) -> None:
    """Add a free motion to a node."""
    nodes[ERROR + k] -= p
    nodes[ERROR_RATE + k] -= v
    nodes[AT + k] += p
    nodes[SPEED + k] += v
    nodes[MOTOR + k] += share.motor_p * p + share.motor_v * v
    nodes[FRICTION + k] += share.friction_p * p + share.friction_v * v
    nodes[COMPENSATING + k] += share.compensating_p * p + share.compensating_v * v
