"""Where the loop of the exact integrator stands: at its start, after a step, at an event, at a break."""

from __future__ import annotations

from stickslip.jit import kernel
from stickslip.simulation.case_arrays import (
    KI,
    PERTURBATION,
    POSITION_0,
    VELOCITY_0,
)
from stickslip.simulation.exact.events import add_exponents, switch
from stickslip.simulation.exact.forces import command
from stickslip.simulation.exact.output import row_before
from stickslip.simulation.exact.perturbation import perturbation
from stickslip.simulation.exact.segment import integral_at, slip_force_at
from stickslip.simulation.exact.state import EDGE, Loop, side_of, sides_of
from stickslip.simulation.exact.stiction import applied, release, set_off

SOON = 1e-9
"""Time at which the commanded torque tells where a free axis sets off, s."""


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
