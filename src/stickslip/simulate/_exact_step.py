"""One stretch of the exact integrator: predictor and corrector, error, and the state inside it.

The flow is exact for a cubic forcing. Reference torque and slipping forces are fitted by cubics over the stretch
and corrected until the motion no longer changes; what a cubic cannot follow is the error of the stretch.
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import kernel
from stickslip.simulate._case import INERTIA, KI
from stickslip.simulate._exact_flow import (
    Cubic,
    Linear,
    Matrix,
    acceleration,
    flow,
    hermite,
    moved,
    particular,
    relaxed,
    twice,
    upper_terms,
)
from stickslip.simulate._exact_state import (
    ADDED,
    ATTRACTION,
    BASE,
    CELLS,
    DR,
    DS,
    DS_END,
    GOAL,
    GOAL_RATE,
    INTEGRAL,
    NONLINEAR,
    POSITION,
    Q_END,
    Q_MID,
    S_END,
    S_MID,
    SEEN_LENGTH,
    SIDE_SIZE,
    SIDES,
    SIGMA,
    SLIPPING,
    TIME,
    UNSEEN,
    VARIES,
    VELOCITY,
    WEIGHT,
    R,
    S,
    command,
    curve_slope,
    sliding,
)

# ---- entries of `stretch`: the motion over one accepted step -------------------------------------------------
(
    LENGTH, C0, C1, C2, C3, FREE_POSITION, FREE_VELOCITY, POSITION_MID, VELOCITY_MID, POSITION_END, VELOCITY_END,
    R_MID, R_END, DR_END, GOAL_MID, RATE_MID, GOAL_END, RATE_END, INTEGRAL_END, AMPLITUDE, ERROR, ROUNDS, STRETCH_SIZE,
) = range(23)  # fmt: skip

NOT_CONVERGED = 1e9
SHORT = 2e-8  # s
STEEPEST = 1e5
"""Largest particular solution, rad: more would cost too many digits."""
MOST_ROUNDS = 5
MOST_UNSEEN = 4.0
BUMP = 8.0 / 15.0
"""Mean of x²(1 - x)² over its value in the middle."""
LASTING = 5e-3
"""How long an error of a slipping force lasts, s: no more than C/s lets it."""


@kernel(exact=False)
def look_ahead(parameters: Any, plan: Any, cells: Any, loop: Any, stretch: Any, h: float, tol: float) -> None:
    """Commanded torque and reference in the middle and at the end of the next h.

    Where the middle has lain on the cubic to a small part of the tolerance, the next few are taken from it.
    """
    r, dr, goal, rate = command(parameters, plan, cells, loop, loop[TIME] + h)
    stretch[R_END] = r
    stretch[DR_END] = dr
    stretch[GOAL_END] = goal
    stretch[RATE_END] = rate
    middle = 0.5 * (loop[R] + r) + 0.125 * h * (loop[DR] - dr)
    if loop[UNSEEN] > 0.0 and h <= loop[SEEN_LENGTH]:
        loop[UNSEEN] -= 1.0
        stretch[R_MID] = middle
        return
    r, _, goal, rate = command(parameters, plan, cells, loop, loop[TIME] + 0.5 * h)
    stretch[R_MID] = r
    stretch[GOAL_MID] = goal
    stretch[RATE_MID] = rate
    # A torque m bends a free axis by less than m h²/8J.
    smooth = abs(r - middle) * h * h < 0.1 * tol * parameters[INERTIA]
    loop[UNSEEN] = MOST_UNSEEN if smooth and plan[CELLS] == 0.0 and parameters[KI] == 0.0 else 0.0
    loop[SEEN_LENGTH] = h


@kernel(exact=False)
def slip_terms(
    lin: Linear, parameters: Any, plan: Any, sides: Any, loop: Any, c: Cubic, side: int, h: float, v_mid: float,
    theta_end: float, v_end: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Advance the slipping force of a side along the motion; returns its two upper coefficients and its misfit."""
    s0 = sides[side * SIDE_SIZE + S]
    d0 = sides[side * SIDE_SIZE + DS]
    goal = sides[side * SIDE_SIZE + SLIPPING] * loop[SIGMA]
    s_mid = sliding(parameters, plan, sides, side, v_mid)
    s_end = sliding(parameters, plan, sides, side, v_end)
    if sides[side * SIDE_SIZE + ATTRACTION] < math.inf:
        q_mid = 1.0 / s_mid
        q_end = 1.0 / s_end
        attraction = sides[side * SIDE_SIZE + ATTRACTION]
        middle, end, slope = relaxed(attraction, attraction * goal, s0, d0, q_mid, q_end, h)
        sides[side * SIDE_SIZE + Q_MID] = q_mid
        sides[side * SIDE_SIZE + Q_END] = q_end
    else:
        middle = goal * s_mid
        end = goal * s_end
        steepness = curve_slope(parameters, plan, sides, side, v_end)
        slope = goal * steepness * acceleration(lin, c, h, theta_end, v_end)
    sides[side * SIDE_SIZE + S_MID] = middle
    sides[side * SIDE_SIZE + S_END] = end
    sides[side * SIDE_SIZE + DS_END] = slope
    u2, u3 = upper_terms(s0, d0, end, slope, 1.0 / h)
    # Zero for relaxing forces: Lobatto's middle lies on the cubic. `slip_error` judges those.
    return u2, u3, abs(middle - (0.5 * (s0 + end) + 0.125 * h * (d0 - slope)))


@kernel(exact=False)
def slip_error(lin: Linear, parameters: Any, plan: Any, sides: Any, loop: Any, stretch: Any) -> float:
    """Error of the relaxing slipping forces at the end of the stretch, N·m.

    Lobatto's rule takes dS/dt as a parabola; the error is judged by how far dS/dt lies from it at a quarter.
    """
    h = stretch[LENGTH]
    c = cubic_of(stretch)
    a0 = acceleration(lin, c, 0.0, loop[POSITION], loop[VELOCITY])
    a1 = acceleration(lin, c, 0.5 * h, stretch[POSITION_MID], stretch[VELOCITY_MID])
    v = 0.5 * (loop[VELOCITY] + stretch[VELOCITY_MID]) + 0.0625 * h * (a0 - a1)
    total = 0.0
    for side in range(int(plan[SIDES])):
        attraction = sides[side * SIDE_SIZE + ATTRACTION]
        if sides[side * SIDE_SIZE + SLIPPING] > 0.0 and attraction < math.inf:
            goal = attraction * sides[side * SIDE_SIZE + SLIPPING] * loop[SIGMA]
            force = slip_force_at(sides, stretch, side, 0.25 * h)
            slope = goal - attraction * force / sliding(parameters, plan, sides, side, v)
            middle = goal - attraction * sides[side * SIDE_SIZE + Q_MID] * sides[side * SIDE_SIZE + S_MID]
            parabola = (
                0.375 * sides[side * SIDE_SIZE + DS]
                + 0.75 * middle
                - 0.125 * sides[side * SIDE_SIZE + DS_END]
            )
            total += abs(sides[side * SIDE_SIZE + WEIGHT] * (slope - parabola))
    return 0.5 * h * total


@kernel(exact=False)
def loop_terms(
    lin: Linear, parameters: Any, loop: Any, stretch: Any, impulse: float, h: float, theta_mid: float, v_mid: float,
    theta_end: float, v_end: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Torque of the integral controller and of the added spring: upper coefficients and misfit in the middle.

    The integral of the position follows from the equation of motion itself: K int x = int p - D dx - J dv.
    """
    gain = parameters[KI]
    added = loop[ADDED]
    travelled = (
        impulse - lin.damping * (theta_end - loop[POSITION]) - lin.inertia * (v_end - loop[VELOCITY])
    ) / lin.stiffness
    wanted = h / 30.0 * (7.0 * (loop[GOAL] + stretch[GOAL_END]) + 16.0 * stretch[GOAL_MID])
    wanted += h * h / 60.0 * (loop[GOAL_RATE] - stretch[RATE_END])
    stretch[INTEGRAL_END] = loop[INTEGRAL] + wanted - travelled
    e0 = loop[GOAL] - loop[POSITION]
    e_mid = stretch[GOAL_MID] - theta_mid
    slopes = loop[GOAL_RATE] - loop[VELOCITY] - stretch[RATE_MID] + v_mid
    i_mid = loop[INTEGRAL] + 0.25 * h * (e0 + e_mid) + h * h / 48.0 * slopes
    y0 = gain * loop[INTEGRAL] + added * loop[POSITION]
    d0 = gain * e0 + added * loop[VELOCITY]
    y1 = gain * stretch[INTEGRAL_END] + added * theta_end
    d1 = gain * (stretch[GOAL_END] - theta_end) + added * v_end
    u2, u3 = upper_terms(y0, d0, y1, d1, 1.0 / h)
    return u2, u3, gain * i_mid + added * theta_mid - (0.5 * (y0 + y1) + 0.125 * h * (d0 - d1))


@kernel(exact=False)
def correct(
    lin: Linear, parameters: Any, plan: Any, sides: Any, loop: Any, stretch: Any, half: Matrix, h: float, tol: float
) -> float:  # fmt: skip
    """Move the axis over h; fills `stretch` and returns the error in position, rad (or NOT_CONVERGED)."""
    full = twice(half)
    inverse = 1.0 / h
    r1 = loop[DR]
    r2, r3 = upper_terms(loop[R], r1, stretch[R_END], stretch[DR_END], inverse)
    misfit = stretch[R_MID] - 0.5 * (loop[R] + stretch[R_END]) - 0.125 * h * (r1 - stretch[DR_END])
    # Over very short stretches the upper terms are rounding errors, or a kink that the particular solution
    # blows up: there the forcing is a straight line.
    lag = lin.damping / lin.stiffness
    bent = 1.0
    if h < SHORT or abs(r3 * lag * lag * lag) > STEEPEST * abs(lin.stiffness):
        bent = 0.0
        r1 = (stretch[R_END] - loop[R]) * inverse
        r2 = 0.0
        r3 = 0.0
    # First guess: slipping forces and integral go on along their tangents.
    p0 = loop[R] - loop[BASE]
    p1 = r1
    for side in range(int(plan[SIDES])):
        p0 -= sides[side * SIDE_SIZE + WEIGHT] * sides[side * SIDE_SIZE + S]
        p1 -= sides[side * SIDE_SIZE + WEIGHT] * sides[side * SIDE_SIZE + DS]
    if parameters[KI] != 0.0 or loop[ADDED] != 0.0:
        p0 += parameters[KI] * loop[INTEGRAL] + loop[ADDED] * loop[POSITION]
        p1 += parameters[KI] * (loop[GOAL] - loop[POSITION]) + loop[ADDED] * loop[VELOCITY]
    p2 = r2
    p3 = r3
    # The cubic is lifted by the mean of the bump that it leaves out, so that the impulse is right.
    p0 += bent * BUMP * misfit
    r0 = p0
    forcing_misfit = abs(misfit)
    misfit = forcing_misfit
    theta_end = loop[POSITION]
    v_end = loop[VELOCITY]
    error = 0.0
    rounds = 0
    while True:
        c = particular(lin, p0, p1, p2, p3)
        free_position = loop[POSITION] - c[0]
        free_velocity = loop[VELOCITY] - c[1]
        theta_mid, v_mid = moved(c, half, 0.5 * h, free_position, free_velocity)
        theta_before = theta_end
        v_before = v_end
        theta_end, v_end = moved(c, full, h, free_position, free_velocity)
        if loop[NONLINEAR] == 0.0:
            break
        if rounds > 0:
            change = max(abs(theta_end - theta_before), 1e-3 * abs(v_end - v_before))
            if change < 0.1 * tol:
                break
            if rounds == MOST_ROUNDS or not change < 1e300:
                error = NOT_CONVERGED
                break
        impulse = h * (p0 + h * (0.5 * p1 + h * (p2 / 3.0 + h * 0.25 * p3)))
        p0 = r0
        p2 = r2
        p3 = r3
        misfit = forcing_misfit
        for side in range(int(plan[SIDES])):
            if sides[side * SIDE_SIZE + SLIPPING] > 0.0 and sides[side * SIDE_SIZE + VARIES] > 0.0:
                u2, u3, m = slip_terms(
                    lin, parameters, plan, sides, loop, c, side, h, v_mid, theta_end, v_end
                )
                p2 -= bent * sides[side * SIDE_SIZE + WEIGHT] * u2
                p3 -= bent * sides[side * SIDE_SIZE + WEIGHT] * u3
                misfit += abs(sides[side * SIDE_SIZE + WEIGHT]) * m
        if parameters[KI] != 0.0 or loop[ADDED] != 0.0:
            u2, u3, m = loop_terms(
                lin, parameters, loop, stretch, impulse, h, theta_mid, v_mid, theta_end, v_end
            )
            p0 += BUMP * m
            p2 += bent * u2
            p3 += bent * u3
            misfit += abs(m)
        rounds += 1
    remember(stretch, c, h, free_position, free_velocity, theta_mid, v_mid, theta_end, v_end, rounds)
    if loop[NONLINEAR] > 0.0 and error == 0.0:
        # What a slipping force is wrong by stays for as long as it relaxes; the position follows through K.
        error = slip_error(lin, parameters, plan, sides, loop, stretch)
        error *= min(LASTING * LASTING / lin.inertia, 1.0 / abs(lin.stiffness))
    # A torque wrong by m in the middle moves a free axis by about m h²/20J, a spring by less than m/2K; of its
    # impulse little is left.
    k = abs(lin.stiffness)
    moves = h * (0.05 * h / lin.inertia + 0.02 / math.sqrt(lin.inertia * k))
    return error + misfit * min(moves, 0.5 / k)


@kernel(exact=False)
def remember(
    stretch: Any, c: Cubic, h: float, free_position: float, free_velocity: float, theta_mid: float, v_mid: float,
    theta_end: float, v_end: float, rounds: int,
) -> None:  # fmt: skip
    """Keep the motion over the stretch."""
    stretch[LENGTH] = h
    stretch[C0] = c[0]
    stretch[C1] = c[1]
    stretch[C2] = c[2]
    stretch[C3] = c[3]
    stretch[FREE_POSITION] = free_position
    stretch[FREE_VELOCITY] = free_velocity
    stretch[POSITION_MID] = theta_mid
    stretch[VELOCITY_MID] = v_mid
    stretch[POSITION_END] = theta_end
    stretch[VELOCITY_END] = v_end
    stretch[ROUNDS] = rounds


@kernel(exact=False)
def free_amplitude(lin: Linear, stretch: Any) -> float:
    """Amplitude of the ringing in this stretch, rad; 0 where nothing rings."""
    if lin.discriminant <= 0.0:
        return 0.0
    u = stretch[FREE_VELOCITY] / lin.frequency
    return math.sqrt(stretch[FREE_POSITION] * stretch[FREE_POSITION] + u * u)


@kernel(exact=False)
def cubic_of(stretch: Any) -> Cubic:
    """The particular solution of the stretch."""
    return stretch[C0], stretch[C1], stretch[C2], stretch[C3]


@kernel(exact=False)
def state_at(lin: Linear, stretch: Any, x: float) -> tuple[float, float]:
    """Position and velocity at x inside the stretch, exact for its forcing."""
    return moved(cubic_of(stretch), flow(lin, x), x, stretch[FREE_POSITION], stretch[FREE_VELOCITY])


@kernel(exact=False)
def slip_force_at(sides: Any, stretch: Any, side: int, x: float) -> float:
    """Slipping force of a side at x inside the stretch."""
    if sides[side * SIDE_SIZE + VARIES] == 0.0 or sides[side * SIDE_SIZE + SLIPPING] == 0.0:
        return sides[side * SIDE_SIZE + S]
    return hermite(
        sides[side * SIDE_SIZE + S],
        sides[side * SIDE_SIZE + DS],
        sides[side * SIDE_SIZE + S_END],
        sides[side * SIDE_SIZE + DS_END],
        stretch[LENGTH],
        x,
    )


@kernel(exact=False)
def integral_at(parameters: Any, loop: Any, stretch: Any, x: float) -> float:
    """Integral of the position error at x inside the stretch, rad·s."""
    if parameters[KI] == 0.0:
        return 0.0
    return hermite(
        loop[INTEGRAL],
        loop[GOAL] - loop[POSITION],
        stretch[INTEGRAL_END],
        stretch[GOAL_END] - stretch[POSITION_END],
        stretch[LENGTH],
        x,
    )
