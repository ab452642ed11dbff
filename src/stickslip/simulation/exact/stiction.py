"""Rest of the exact integrator: an axis that rigid friction holds at v = 0, until the applied torque is larger."""

from __future__ import annotations

from stickslip.jit import kernel
from stickslip.simulation.case_arrays import KI, KP
from stickslip.simulation.exact.forces import command
from stickslip.simulation.exact.segment import remember
from stickslip.simulation.exact.state import BENDS, Loop, element_of, side_of, sides_of
from stickslip.simulation.exact.step import look_ahead

NONE = -1.0
LONGEST_REST = 2e-3


@kernel(exact=False)
def rest(loop: Loop, left: float) -> float:
    """Stay at rest for at most `left` s; fills `segment`, returns when the axis breaks away or NONE."""
    now, segment = loop.now, loop.segment
    h = min(left, LONGEST_REST)
    theta = now.position
    look_ahead(loop, h, 0.0)
    remember(segment, (theta, 0.0, 0.0, 0.0), h, (0.0, 0.0), (theta, 0.0), (theta, 0.0), 0)
    reference_integral = h / 30.0 * (7.0 * (now.goal + segment.goal_end) + 16.0 * segment.goal_mid)
    reference_integral += h * h / 60.0 * (now.goal_rate - segment.rate_end)
    segment.integral_end = now.integral + reference_integral - theta * h
    segment.position_event = theta
    segment.velocity_event = 0.0
    low = 0.0
    if excess(loop, 0.0) > 0.0:
        return 0.0
    for node in range(1, 3):
        high = 0.5 * node * h
        if excess(loop, high) > 0.0:
            for _ in range(60):
                x = 0.5 * (low + high)
                if excess(loop, x) > 0.0:
                    high = x
                else:
                    low = x
                if high - low < 1e-13:
                    break
            return high
        low = high
    return NONE


@kernel(exact=False)
def excess(loop: Loop, x: float) -> float:
    """Applied torque beyond what is held, after another x at rest, N·m."""
    parameters, now = loop.parameters, loop.now
    middle = command(loop, now.time + 0.5 * x)
    end = command(loop, now.time + x)
    torque = applied(loop) + end.torque - now.command
    if parameters[KI] != 0.0:
        reference_integral = x / 30.0 * (7.0 * (now.goal + end.position) + 16.0 * middle.position)
        reference_integral += x * x / 60.0 * (now.goal_rate - end.velocity)
        torque += parameters[KI] * (reference_integral - now.position * x)
    return abs(torque) - max(stiction(loop), 0.0)


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
