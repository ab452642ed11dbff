"""One segment of the exact integrator: predictor and corrector, error, and the state inside it.

The flow is exact for a cubic forcing. Reference torque and slipping forces are fitted by cubics over the segment
and corrected until the motion no longer changes; what a cubic cannot follow is the error of the segment.
"""

from __future__ import annotations

from typing import Any

from stickslip.jit import kernel
from stickslip.simulation.case_arrays import INERTIA, KI
from stickslip.simulation.exact.flow import (
    Linear,
    Matrix,
    acceleration,
    moved,
    particular,
    relaxed,
    twice,
    upper_terms,
)
from stickslip.simulation.exact.forces import (
    bristle_rate,
    bristle_terms,
    command,
    curve_rest,
    curve_terms,
    sliding,
)
from stickslip.simulation.exact.segment import Pair, cubic_of, remember, slip_force_at
from stickslip.simulation.exact.state import BENDS, FOLLOWS, Loop, side_of, sides_of

NOT_CONVERGED = 1e9
UNCHANGED, FINEST_CHANGE, ROUNDING, STALLED = 0.01, 1e-14, 4e-16, 1e-13
"""The corrector ends at a change in position below the largest of: parts of the tolerance, 1e-14 rad, parts of the
particular solution. What it leaves must be less than `stickslip.simulation.accuracy` makes steps wrong by; where
rounding keeps it from that, 1e-13 rad will do."""
WIDEST = 1.0
"""Change of velocity over half a segment, in parts of v_s, above which s(v) is not resolved near v = 0."""
CALM_SHARE = 0.2
"""Where nothing sticks, the loop's own damping takes away what slipping forces are wrong by."""
BRISTLE_SHARE = 4.0
"""Errors of a bristle in feedback grow: it is a negative spring near rest."""
SHORT = 2e-8  # s
STEEPEST = 3e5
"""Largest particular solution, rad: more would cost too many digits."""
LAST_DIGIT, LOST, LEAST_LOST = 2.2e-16, 67.0, 1e-11
"""What rounding may take of a particular solution: parts of a step's tolerance (a tenth of the run's), and rad. Under a
command that changes within microseconds no step is exact; another integrator runs it."""
MOST_ROUNDS = 5
MOST_UNSEEN = 4
BUMP, PARABOLA = 8.0 / 15.0, 2.0 / 3.0
"""Means of x²(1 - x)² and of x(1 - x) over their values in the middle."""
ONE_SIDED, PASSING = 0.2, 1e-3
"""Of a torque taken for a straight line: parts of its third power of time, and of its bend, that count as a misfit."""
LASTING = 5e-3
"""How long an error of a slipping force lasts, s: no more than C/s lets it."""


@kernel(exact=False, inline=True)
def look_ahead(loop: Loop, h: float, tol: float) -> None:
    """Commanded torque and reference in the middle and at the end of the next h.

    Where the middle has lain on the cubic to a small part of the tolerance, the next few are taken from it.
    """
    parameters, now, segment = loop.parameters, loop.now, loop.segment
    end = command(loop, now.time + h)
    segment.command_end, segment.command_rate_end, segment.goal_end, segment.rate_end = end
    middle = 0.5 * (now.command + end.torque) + 0.125 * h * (now.command_rate - end.torque_rate)
    if now.unseen != 0 and h <= now.seen_length:
        now.unseen -= 1
        segment.asked = 0
        segment.command_mid = middle
        return
    segment.asked = 1
    asked = command(loop, now.time + 0.5 * h)
    segment.command_mid, segment.goal_mid, segment.rate_mid = asked.torque, asked.position, asked.velocity
    # A torque m bends a free axis by less than m h²/8J.
    smooth = abs(asked.torque - middle) * h * h < 0.1 * tol * parameters[INERTIA]
    now.unseen = MOST_UNSEEN if smooth and loop.plan.cells == 0 and parameters[KI] == 0.0 else 0
    now.seen_length = h


@kernel(exact=False, inline=True)
def slip_terms(
    loop: Loop, side: Any, h: float, theta_mid: float, v_mid: float, theta_end: float, v_end: float,
) -> tuple[float, float]:  # fmt: skip
    """Advance the slipping force of a side along the motion; returns its two upper coefficients."""
    kind = side.kind
    if kind == BENDS:
        return bristle_terms(loop, side, h, theta_mid, v_mid, theta_end, v_end)
    if kind == FOLLOWS:
        return curve_terms(loop, side, h, v_mid, v_end)
    q_mid = 1.0 / sliding(loop, side, v_mid)
    q_end = 1.0 / sliding(loop, side, v_end)
    attraction = side.attraction
    goal = attraction * side.slipping * loop.now.sigma
    s0 = side.force
    d0 = side.force_rate
    middle, end, slope = relaxed(goal, goal, s0, d0, attraction * q_mid, attraction * q_end, h)
    side.decay_mid = q_mid
    side.decay_end = q_end
    side.force_mid = middle
    side.force_end = end
    side.force_rate_end = slope
    return upper_terms(s0, d0, end, slope, 1.0 / h)


@kernel(exact=False, inline=True)
def hides_curve(loop: Loop, v0: float, v1: float, v2: float) -> bool:
    """Whether a slipping force would pass the bend of s(v) near rest unseen between start, middle and end."""
    jump = max(abs(v1 - v0), abs(v2 - v1))
    turns = v0 * v1 < 0.0 or v1 * v2 < 0.0
    slowest = 0.0 if turns else min(abs(v0), abs(v1), abs(v2))
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        scale = side.scale
        if side.slipping > 0.0 and jump > WIDEST * scale > 0.0 and slowest < 3.0 * scale:
            return True
    return False


@kernel(exact=False, inline=True)
def slip_error(lin: Linear, loop: Loop) -> tuple[float, float]:
    """Errors of the slipping forces, N·m: at the end of the segment, and between its nodes.

    Lobatto's rule takes dS/dt as a parabola; the error is judged by how far dS/dt lies from it at a quarter.
    """
    now, segment = loop.now, loop.segment
    h = segment.length
    c = cubic_of(segment)
    a0 = acceleration(lin, c, 0.0, now.position, now.velocity)
    a1 = acceleration(lin, c, 0.5 * h, segment.position_mid, segment.velocity_mid)
    v = 0.5 * (now.velocity + segment.velocity_mid) + 0.0625 * h * (a0 - a1)
    total = 0.0
    between = 0.0
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        kind = side.kind
        if side.slipping > 0.0 and kind == FOLLOWS:
            if side.varies != 0:
                between += curve_error(lin, loop, side)
        elif side.slipping > 0.0:
            side.lift = 0.0
            force = slip_force_at(side, segment, 0.25 * h)
            if kind == BENDS:
                theta = 0.5 * (now.position + segment.position_mid)
                theta += 0.0625 * h * (now.velocity - segment.velocity_mid)
                slope = bristle_rate(loop, side, theta, v, force)
                middle = bristle_rate(loop, side, segment.position_mid, segment.velocity_mid, side.force_mid)
            else:
                attraction = side.attraction
                goal = attraction * side.slipping * now.sigma
                slope = goal - attraction * force / sliding(loop, side, v)
                middle = goal - attraction * side.decay_mid * side.force_mid
            parabola = 0.375 * side.force_rate + 0.75 * middle - 0.125 * side.force_rate_end
            side.lift = 16.0 / 3.0 * (slope - parabola) / (h * h * h)
            off = abs(side.weight * (slope - parabola))
            total += BRISTLE_SHARE * off if kind == BENDS else off
            between += side.lag * off
    return h / 3.0 * total, between


@kernel(exact=False, inline=True)
def curve_error(lin: Linear, loop: Loop, side: Any) -> float:
    """How far a force on the curve lies from its cubic at three quarters, N·m."""
    segment = loop.segment
    h = segment.length
    c = cubic_of(segment)
    a1 = acceleration(lin, c, 0.5 * h, segment.position_mid, segment.velocity_mid)
    a2 = acceleration(lin, c, h, segment.position_end, segment.velocity_end)
    v = 0.5 * (segment.velocity_mid + segment.velocity_end) + 0.0625 * h * (a1 - a2)
    side.lift = 0.0
    off = curve_rest(loop, side, v) - slip_force_at(side, segment, 0.75 * h)
    return abs(side.weight * off)


@kernel(exact=False)
def loop_terms(
    lin: Linear, loop: Loop, impulse: float, h: float, theta_mid: float, v_mid: float, theta_end: float, v_end: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Torque of the integral controller and of the added spring: upper coefficients and misfit in the middle.

    The integral of the position follows from the equation of motion itself: K int x = int p - D dx - J dv.
    """
    now, segment = loop.now, loop.segment
    gain = loop.parameters[KI]
    added = now.added
    travelled = (
        impulse - lin.damping * (theta_end - now.position) - lin.inertia * (v_end - now.velocity)
    ) * lin.compliance
    reference_integral = h / 30.0 * (7.0 * (now.goal + segment.goal_end) + 16.0 * segment.goal_mid)
    reference_integral += h * h / 60.0 * (now.goal_rate - segment.rate_end)
    segment.integral_end = now.integral + reference_integral - travelled
    e0 = now.goal - now.position
    e_mid = segment.goal_mid - theta_mid
    slopes = now.goal_rate - now.velocity - segment.rate_mid + v_mid
    i_mid = now.integral + 0.25 * h * (e0 + e_mid) + h * h / 48.0 * slopes
    y0 = gain * now.integral + added * now.position
    d0 = gain * e0 + added * now.velocity
    y1 = gain * segment.integral_end + added * theta_end
    d1 = gain * (segment.goal_end - theta_end) + added * v_end
    u2, u3 = upper_terms(y0, d0, y1, d1, 1.0 / h)
    return u2, u3, gain * i_mid + added * theta_mid - (0.5 * (y0 + y1) + 0.125 * h * (d0 - d1))


@kernel(exact=False, inline=True)
def commanded(lin: Linear, loop: Loop, h: float) -> tuple[float, float, float, float, float, float]:
    """The commanded torque over the segment: three coefficients, its misfit in the middle and the mean of that, 1 or 0
    if straight.

    Over very short segments the upper terms are rounding errors, or a kink that the particular solution blows
    up: there the forcing is a straight line, of which the torque is off by a parabola.
    """
    now, segment = loop.now, loop.segment
    inverse = 1.0 / h
    r1 = now.command_rate
    r2, r3 = upper_terms(now.command, r1, segment.command_end, segment.command_rate_end, inverse)
    misfit = (
        segment.command_mid
        - 0.5 * (now.command + segment.command_end)
        - 0.125 * h * (r1 - segment.command_rate_end)
    )
    lag = abs(lin.damping * lin.compliance)
    size = 6.0 * abs(r3 * lin.compliance) * lag * (lag * lag + 2.0 * abs(lin.inertia * lin.compliance))
    if h < SHORT or size > STEEPEST:
        off = segment.command_mid - 0.5 * (now.command + segment.command_end)
        # Lifted, the parabola has no impulse left: damping brings little of it back, the motion inside sees it pass.
        share = PASSING + min(h * lin.damping / lin.inertia, 1.0)
        misfit = abs(misfit) + ONE_SIDED * abs(r3) * h * h * h + share * abs(off)
        return (segment.command_end - now.command) * inverse, 0.0, 0.0, misfit, PARABOLA * off, 0.0
    return r1, r2, r3, misfit, BUMP * misfit, 1.0


@kernel(exact=False, inline=True)
def tangents(loop: Loop) -> tuple[float, float]:
    """Torque at the start without the command, and its slope: slipping forces, integral and added spring."""
    parameters, now = loop.parameters, loop.now
    p0 = -now.base
    p1 = 0.0
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        lagging = side.lag * side.force_rate
        p0 -= side.weight * (side.force + lagging)
        p1 -= side.weight * side.force_rate
    if parameters[KI] != 0.0 or now.added != 0.0:
        p0 += parameters[KI] * now.integral + now.added * now.position
        p1 += parameters[KI] * (now.goal - now.position) + now.added * now.velocity
    return p0, p1


@kernel(exact=False, inline=True)
def with_slips(
    loop: Loop, upper: tuple[float, float, float], bent: float, h: float, middle: Pair, end: Pair
) -> tuple[float, float, float]:  # fmt: skip
    """The upper coefficients of the forcing with the slipping forces along a motion, given in its middle and at its
    end."""
    p1, p2, p3 = upper
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        if side.slipping > 0.0 and side.varies != 0:
            u2, u3 = slip_terms(loop, side, h, middle[0], middle[1], end[0], end[1])
            w = bent * side.weight
            lag = side.lag
            p1 -= 2.0 * w * lag * u2
            p2 -= w * (u2 + 3.0 * lag * u3)
            p3 -= w * u3
    return p1, p2, p3


@kernel(exact=False, inline=True)
def correct(lin: Linear, loop: Loop, half: Matrix, h: float, tol: float) -> float:
    """Move the axis over h; fills `segment` and returns the error in position, rad (or NOT_CONVERGED)."""
    now = loop.now
    full = twice(half)
    r1, r2, r3, command_misfit, lift, bent = commanded(lin, loop, h)
    p0, p1 = tangents(loop)
    # The cubic is lifted by the mean of the bump that it leaves out, so that the impulse is right.
    p0 += now.command + lift
    p1 += r1
    p2 = r2
    p3 = r3
    start = p0
    tangent = p1
    misfit = abs(command_misfit)
    theta_end = now.position
    v_end = now.velocity
    rounds = 0
    while True:
        c = particular(lin, p0, p1, p2, p3)
        free_position = now.position - c[0]
        free_velocity = now.velocity - c[1]
        theta_mid, v_mid = moved(c, half, 0.5 * h, free_position, free_velocity)
        theta_before = theta_end
        v_before = v_end
        theta_end, v_end = moved(c, full, h, free_position, free_velocity)
        if now.nonlinear == 0:
            break
        if rounds == 0 and hides_curve(loop, now.velocity, v_mid, v_end):
            return NOT_CONVERGED
        if rounds > 0:
            change = max(abs(theta_end - theta_before), 1e-3 * abs(v_end - v_before))
            # A particular solution that is huge leaves rounding errors behind.
            if change < max(UNCHANGED * tol, FINEST_CHANGE, ROUNDING * abs(c[0])):
                break
            if rounds == MOST_ROUNDS and change < STALLED:
                break
            if rounds == MOST_ROUNDS or not change < 1e300:
                return NOT_CONVERGED
        impulse = h * (p0 + h * (0.5 * p1 + h * (p2 / 3.0 + h * 0.25 * p3)))
        p0 = start
        p1, p2, p3 = with_slips(
            loop, (tangent, r2, r3), bent, h, (theta_mid, v_mid), (theta_end, v_end)
        )  # fmt: skip
        misfit = abs(command_misfit)
        if loop.parameters[KI] != 0.0 or now.added != 0.0:
            u2, u3, m = loop_terms(lin, loop, impulse, h, theta_mid, v_mid, theta_end, v_end)
            p0 += BUMP * m
            p2 += bent * u2
            p3 += bent * u3
            misfit += abs(m)
        rounds += 1
    if LAST_DIGIT * abs(c[0]) > max(LOST * tol, LEAST_LOST):
        return NOT_CONVERGED
    remember(
        loop.segment, c, h, (free_position, free_velocity), (theta_mid, v_mid), (theta_end, v_end), rounds
    )
    return error_of(lin, loop, misfit)


@kernel(exact=False, inline=True)
def error_of(lin: Linear, loop: Loop, misfit: float) -> float:
    """Error of the segment in position, rad; the forcing is wrong by `misfit` in the middle."""
    # A torque wrong by m in the middle moves a free axis by about m h²/20J, a spring by less than m/2K; of its
    # impulse little is left.
    now = loop.now
    h = loop.segment.length
    soft = abs(lin.compliance)
    light = h * abs(lin.square) * soft
    moves = min(h * (0.05 * light + 0.02 * lin.mobility), 0.5 * soft)
    error = misfit * moves
    if now.nonlinear != 0:
        bump, between = slip_error(lin, loop)
        error += between * min(h * (0.1 * light + 0.25 * lin.mobility), 0.5 * soft)
        # What a slipping force is wrong by at the end stays for as long as it relaxes.
        slip = bump * (moves + 0.5 * min(LASTING * LASTING / lin.inertia, soft))
        error += CALM_SHARE * slip if now.calm != 0 else slip
    return error
