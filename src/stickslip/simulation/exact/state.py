"""What the exact integrator remembers: elements, slipping forces, and the state of the loop.

Flat arrays with named columns. A *side* is a law in the loop: 0 the plant's friction, 1 the law of a feedback
compensator (weighted by minus its gain). All of them are handed on as addresses, which costs kernels nothing
(arrays are counted references). The slipping elements of a side share one curve s(v), so that their sum
S alone is integrated, dS/dt = C (A sigma - S/s(v)) with A the sum of their shares; each element's force follows
from the decay exp(-integral of C/s) when a mode changes. Where C is infinite, S = A sigma s(v).
"""

from __future__ import annotations

from typing import Any

from stickslip.jit import call_profile, call_value, kernel, pointer
from stickslip.simulation._forcing import CELL_SIZE
from stickslip.simulation.case_arrays import GAIN, INERTIA, KD, KI, KP, KR
from stickslip.simulation.exact.flow import Linear, linear

# ---- columns of `elements` (those of finite stiffness) -------------------------------------------------------
STIFFNESS, SHARE, FORCE, OFFSET, SLIPS, LOAD_AT_0, LOAD_SLOPE, ELEMENT_SIZE = range(8)
"""The last two list the sticking elements of a side without gaps: force per share = LOAD_AT_0 + LOAD_SLOPE theta."""

# ---- columns of `sides` --------------------------------------------------------------------------------------
(
    WEIGHT, ATTRACTION, BREAKAWAY, LOWEST, SCALE, VISCOUS, RIGID, SLIPPING, STICKING, SPRING, SPRING_OFFSET,
    VARIES, S, DS, Q, S_START, EXPONENT, S_MID, S_END, DS_END, Q_MID, Q_END, S_NOW, LIFT,
    KIND, BRISTLE, LAG, STEEP, STEEPNESS, LAYER, INSIDE, DAMPING, TOP, TOP_NEXT, KEPT,
) = range(35)  # fmt: skip
"""BRISTLE: stiffness of a bristle, LAG: its damping over its stiffness. STEEP: share that rises with the slope
STEEPNESS through the layer |v| < LAYER; INSIDE is 1 there. DAMPING: torque over velocity in the flow. TOP: largest
load per share of a sticking element where the loop stands, TOP_NEXT: at the next node of the segment."""

RELAXES, FOLLOWS, BENDS = 0.0, 1.0, 2.0
"""What KIND says of the force of what slips: it relaxes towards the curve, is on the curve at once, or is that of a
bristle (`exact.bristle` has the last two)."""

SIDE_SIZE = KEPT + 4
"""From KEPT on: two velocities with their values of the sliding curve."""

# ---- entries of `loop`: the state, and the reference where it stands -----------------------------------------
(
    TIME, POSITION, VELOCITY, SIGMA, HELD, INTEGRAL, ADDED, WATCHED, NONLINEAR, BASE,
    R, DR, GOAL, GOAL_RATE, EDGE_LOW, EDGE_HIGH, CELL, UNSEEN, SEEN_LENGTH, STORM_COUNT, STORM_SINCE, CALM,
    BENT, EVEN_STIFFNESS, EVEN_DAMPING, EVEN_BASE, FLOOR, NARROW, JUMPED, PROFILE_OUT,
) = range(30)  # fmt: skip
"""BENT: a force changes the flow from step to step; EVEN_...: stiffness, damping and offset of all the others. FLOOR:
least stiffness. NARROW: the velocity at which a steep layer begins, where the axis is outside. JUMPED: signals
may differ from those at the end of the last segment that was measured."""

LOOP_SIZE = PROFILE_OUT + 3

# ---- entries of `plan`: addresses (exact as floats), offsets and sizes ---------------------------------------
(
    CURVE_0, PARAMETERS_0, CURVE_1, PARAMETERS_1, PROFILE, PROFILE_PARAMETERS, LITERAL_0, LITERAL_1, FIRST_1, ELEMENTS,
    SIDES, CELLS, GRID_ROWS, ROWS, SPACING, STIFFNESS_FLOOR, SHARED, FIRST_STEPS,
    STEP_RATE, PLAN_SIZE,
) = range(20)  # fmt: skip
"""``parameters`` begins with Case.numbers; elements of side 1 begin at FIRST_1; SHARED: both sides have one curve.
FIRST_STEPS, STEP_RATE: how many steps there may be, and how many more for each second of the motion."""

# ---- entries of `count` --------------------------------------------------------------------------------------
STEPS, REJECTED, EVENTS, ROWS_WRITTEN, GRID_WRITTEN, COUNTS = range(6)

IN_LAYER = 1e-4
"""Stiffness added in a steep layer, over slope²/J."""
EDGE = 1e-12
"""One-sided limits at a break are taken this far from it, s."""


@kernel(exact=False, inline=True)
def sides_of(plan: Any) -> int:
    """Number of sides, told to the compiler as one or two: it would gather and scatter them as vectors of many."""
    return 2 if plan[SIDES] > 1.0 else 1


@kernel(exact=False, inline=True)
def sliding(parameters: Any, plan: Any, sides: Any, side: int, v: float) -> float:
    """The sliding curve of a side, N·m; two values are kept, since middle and end are asked for again."""
    own = 0 if plan[SHARED] > 0.0 else side
    address = int(plan[CURVE_0 + 2 * own])
    if address == 0:
        return sides[own * SIDE_SIZE + BREAKAWAY]
    kept = pointer(sides, own * SIDE_SIZE + KEPT)
    if kept[0] == v:
        return kept[1]
    if kept[2] == v:
        return kept[3]
    kept[2] = kept[0]
    kept[3] = kept[1]
    kept[0] = v
    kept[1] = call_value(address, v, pointer(parameters, int(plan[PARAMETERS_0 + 2 * own])))
    return kept[1]


@kernel(exact=False, inline=True)
def command(parameters: Any, plan: Any, cells: Any, loop: Any, t: float) -> tuple[float, float, float, float]:
    """Torque commanded by time alone, its slope, and the reference's position and velocity, at t.

    kp theta_d + kr theta_d' + gain T_hat(t); ``cells`` hold the feedforward torque (`_forcing`).
    """
    t = min(max(t, loop[EDGE_LOW]), loop[EDGE_HIGH])
    profile_parameters = pointer(parameters, int(plan[PROFILE_PARAMETERS]))
    call_profile(int(plan[PROFILE]), t, profile_parameters, pointer(loop, PROFILE_OUT))
    goal = loop[PROFILE_OUT]
    rate = loop[PROFILE_OUT + 1]
    r = parameters[KP] * goal + parameters[KR] * rate
    dr = parameters[KP] * rate + parameters[KR] * loop[PROFILE_OUT + 2]
    last = int(plan[CELLS]) - 1
    if last >= 0:
        i = int(loop[CELL])
        while i < last and t >= cells[(i + 1) * CELL_SIZE]:
            i += 1
        while i > 0 and t < cells[i * CELL_SIZE]:
            i -= 1
        loop[CELL] = i
        cell = pointer(cells, i * CELL_SIZE)
        x = (t - cell[0]) * cell[1]
        r += parameters[GAIN] * (cell[2] + x * (cell[3] + x * (cell[4] + x * (cell[5] + x * cell[6]))))
        slope = cell[3] + x * (2.0 * cell[4] + x * (3.0 * cell[5] + x * 4.0 * cell[6]))
        dr += parameters[GAIN] * cell[1] * slope
    return r, dr, goal, rate


@kernel(exact=False, inline=True)
def arrange(parameters: Any, plan: Any, elements: Any, sides: Any, loop: Any) -> Linear:
    """Set the loop up for the modes as they are: springs, slipping sums, flow.

    Where the stiffness nearly vanishes, a spring is added (and taken off again by the corrector), so that the
    cubic particular solution exists.
    """
    theta = loop[POSITION]
    v = loop[VELOCITY]
    total = parameters[KP]
    damping = parameters[KD]
    loop[BASE] = 0.0
    loop[BENT] = 0.0
    loop[NARROW] = 0.0
    floor = plan[STIFFNESS_FLOOR]
    slips = False
    sticks = False
    loop[NONLINEAR] = 1.0 if parameters[KI] != 0.0 else 0.0
    for side in range(sides_of(plan)):
        w = sides[side * SIDE_SIZE + WEIGHT]
        sides[side * SIDE_SIZE + DAMPING] = sides[side * SIDE_SIZE + VISCOUS]
        if sides[side * SIDE_SIZE + KIND] == BENDS:
            begin_bristle(sides, side, theta, loop[HELD])
        else:
            gather(plan, elements, sides, side, theta)
            sides[side * SIDE_SIZE + SLIPPING] += sides[side * SIDE_SIZE + RIGID] * abs(loop[SIGMA])
        if sides[side * SIDE_SIZE + STEEP] > 0.0:
            if sides[side * SIDE_SIZE + INSIDE] > 0.0:
                sides[side * SIDE_SIZE + DAMPING] = sides[side * SIDE_SIZE + STEEPNESS]
                # Over the moment that a crossing takes, this spring moves nothing.
                steep = w * sides[side * SIDE_SIZE + STEEPNESS]
                floor = max(floor, IN_LAYER * steep * steep / parameters[INERTIA])
            else:
                sides[side * SIDE_SIZE + SLIPPING] += sides[side * SIDE_SIZE + STEEP]
                loop[NARROW] = max(loop[NARROW], sides[side * SIDE_SIZE + LAYER])
        damping += w * sides[side * SIDE_SIZE + DAMPING]
        total += w * sides[side * SIDE_SIZE + SPRING]
        loop[BASE] += w * sides[side * SIDE_SIZE + SPRING_OFFSET]
        sticks = sticks or sides[side * SIDE_SIZE + STICKING] > 0.0
        if sides[side * SIDE_SIZE + SLIPPING] > 0.0:
            slips = True
            begin_slip(parameters, plan, sides, loop, side, v)
            if sides[side * SIDE_SIZE + VARIES] > 0.0:
                loop[NONLINEAR] = 1.0
                if sides[side * SIDE_SIZE + KIND] != RELAXES:
                    loop[BENT] = 1.0
    loop[WATCHED] = 1.0 if slips else 0.0
    calm = not sticks and total > 0.0 and damping > 0.0 and parameters[KI] == 0.0 and loop[BENT] == 0.0
    loop[CALM] = 1.0 if calm else 0.0
    loop[EVEN_STIFFNESS] = total
    loop[EVEN_DAMPING] = damping
    loop[EVEN_BASE] = loop[BASE]
    loop[FLOOR] = floor
    loop[ADDED] = 0.0
    if abs(total) < floor:
        loop[ADDED] = 2.0 * floor
        loop[NONLINEAR] = 1.0
    return linear(parameters[INERTIA], damping, total + loop[ADDED])


@kernel(exact=False, inline=True)
def first_of(plan: Any, side: int) -> int:
    """Index of the first element of a side; that of side 2 ends side 1."""
    if side == 0:
        return 0
    return int(plan[FIRST_1]) if side == 1 else int(plan[ELEMENTS])


@kernel(exact=False, inline=True)
def gather(plan: Any, elements: Any, sides: Any, side: int, theta: float) -> None:
    """Sum up the springs of the sticking elements, and shares and forces of the slipping ones."""
    spring = 0.0
    offset = 0.0
    share = 0.0
    force = 0.0
    first = first_of(plan, side)
    stuck = first
    for i in range(first, first_of(plan, side + 1)):
        e = pointer(elements, i * ELEMENT_SIZE)
        if e[SLIPS] > 0.0:
            share += e[SHARE]
            force += e[FORCE]
        else:
            e[OFFSET] = e[FORCE] - e[STIFFNESS] * theta
            spring += e[STIFFNESS]
            offset += e[OFFSET]
            listed = pointer(elements, stuck * ELEMENT_SIZE)
            listed[LOAD_AT_0] = e[OFFSET] / e[SHARE]
            listed[LOAD_SLOPE] = e[STIFFNESS] / e[SHARE]
            stuck += 1
    sides[side * SIDE_SIZE + SPRING] = spring
    sides[side * SIDE_SIZE + SPRING_OFFSET] = offset
    sides[side * SIDE_SIZE + STICKING] = stuck - first
    sides[side * SIDE_SIZE + SLIPPING] = share
    sides[side * SIDE_SIZE + S] = force
    sides[side * SIDE_SIZE + S_START] = force
    sides[side * SIDE_SIZE + S_NOW] = force
    sides[side * SIDE_SIZE + EXPONENT] = 0.0
    sides[side * SIDE_SIZE + DS] = 0.0


@kernel(exact=False, inline=True)
def begin_bristle(sides: Any, side: int, theta: float, held: float) -> None:
    """All of a bristle's force is slipping force, until `_exact_bend.bend` takes the part that follows the position."""
    sides[side * SIDE_SIZE + S] += (
        sides[side * SIDE_SIZE + SPRING] * theta + sides[side * SIDE_SIZE + SPRING_OFFSET]
    )
    sides[side * SIDE_SIZE + S_NOW] = sides[side * SIDE_SIZE + S]
    sides[side * SIDE_SIZE + SPRING] = 0.0
    sides[side * SIDE_SIZE + SPRING_OFFSET] = 0.0
    sides[side * SIDE_SIZE + DS] = 0.0
    sides[side * SIDE_SIZE + SLIPPING] = 1.0 - held


@kernel(exact=False, inline=True)
def begin_slip(parameters: Any, plan: Any, sides: Any, loop: Any, side: int, v: float) -> None:
    """Curve and slope of a side's slipping force at the start of a segment."""
    kind = sides[side * SIDE_SIZE + KIND]
    if kind == RELAXES:
        s = sliding(parameters, plan, sides, side, v)
        sides[side * SIDE_SIZE + Q] = 1.0 / s
        sides[side * SIDE_SIZE + DS] = sides[side * SIDE_SIZE + ATTRACTION] * (
            sides[side * SIDE_SIZE + SLIPPING] * loop[SIGMA] - sides[side * SIDE_SIZE + S] / s
        )
    elif kind == FOLLOWS:
        s = sliding(parameters, plan, sides, side, v)
        sides[side * SIDE_SIZE + S] = sides[side * SIDE_SIZE + SLIPPING] * loop[SIGMA] * s
        sides[side * SIDE_SIZE + S_NOW] = sides[side * SIDE_SIZE + S]


@kernel(exact=False)
def curve_slope(parameters: Any, plan: Any, sides: Any, side: int, v: float) -> float:
    """ds/dv by a central difference, one-sided at rest."""
    d = 1e-4 * sides[side * SIDE_SIZE + SCALE]
    low = v - d if abs(v) >= d else v
    high = v + d if v >= 0.0 or abs(v) >= d else v
    if low == v:
        low, high = (v, v + d) if v >= 0.0 else (v - d, v)
    return (sliding(parameters, plan, sides, side, high) - sliding(parameters, plan, sides, side, low)) / (
        high - low
    )


@kernel(exact=False, inline=True)
def torques(
    parameters: Any, plan: Any, sides: Any, loop: Any, r: float, goal: float, rate: float, integral: float,
    theta: float, v: float, s_plant: float, s_compensator: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Motor, friction and compensating torque, N·m."""
    helped = r - parameters[KP] * goal - parameters[KR] * rate
    if plan[SIDES] > 1:
        model = (
            sides[SIDE_SIZE + SPRING] * theta
            + sides[SIDE_SIZE + SPRING_OFFSET]
            + s_compensator
            + sides[SIDE_SIZE + DAMPING] * v
        )
        helped -= sides[SIDE_SIZE + WEIGHT] * model
    motor = parameters[KP] * (goal - theta) + parameters[KR] * rate - parameters[KD] * v
    motor += parameters[KI] * integral + helped
    if loop[HELD] > 0.0:
        return motor, motor, helped
    friction = sides[SPRING] * theta + sides[SPRING_OFFSET] + s_plant + sides[DAMPING] * v
    return motor, friction, helped
