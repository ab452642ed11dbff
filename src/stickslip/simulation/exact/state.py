"""What the exact integrator remembers: elements, slipping forces, and the state of the loop.

Records in flat arrays. A *side* is a law in the loop: 0 the plant's friction, 1 the law of a feedback
compensator (weighted by minus its gain). All of them are handed on as addresses, which costs kernels nothing
(arrays are counted references). The slipping elements of a side share one curve s(v), so that their sum
S alone is integrated, dS/dt = C (A sigma - S/s(v)) with A the sum of their shares; each element's force follows
from the decay exp(-integral of C/s) when a mode changes. Where C is infinite, S = A sigma s(v).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.jit import call_profile, call_value, kernel, pointer, record_at, spliced
from stickslip.simulation._forcing import CELL_SIZE
from stickslip.simulation.case_arrays import GAIN, INERTIA, KD, KI, KP, KR
from stickslip.simulation.exact.flow import Linear, linear

PLAN = np.dtype(
    [
        *((name, np.int64) for name in (
            # Address of the reference's profile, and where its parameters begin in `parameters`.
            "profile", "reference",
            # How many: sides, elements of finite stiffness, cells of the feedforward torque, times of the grid, rows.
            "sides", "elements", "cells", "grid_rows", "rows",
            # Whether both sides slide along one curve.
            "shared",
        )),
        *((name, np.float64) for name in (
            # The grid's spacing where it is even, s, else 0; N·m/rad that the flow's stiffness is not below.
            "spacing", "stiffness_floor",
            # How many steps there may be, and how many more for each second of the motion.
            "first_steps", "step_rate",
        )),
    ]
)  # fmt: skip
"""What a loop is; ``parameters`` begins with `Case.numbers`, those of the laws and of the reference follow."""

COUNT = np.dtype(
    [(name, np.int64) for name in ("steps", "rejected", "events", "rows_written", "grid_written")]
)
"""How many there were so far."""

NOW = np.dtype(
    [
        *((name, np.float64) for name in (
            # s, rad and rad/s; the direction in which slipping elements slip, -1, 0 or 1; rad·s of the error.
            "time", "position", "velocity", "sigma", "integral",
            # N·m/rad added to the flow's stiffness; N·m of the springs at angle 0.
            "added", "base",
            # Torque commanded by time alone, N·m, and N·m/s; the reference's position and velocity, rad and rad/s.
            "command", "command_rate", "goal", "goal_rate",
            # What the reference's profile said where it was asked last: rad, rad/s, rad/s².
            "asked_position", "asked_velocity", "asked_acceleration",
            # One-sided limits of the reference are taken between these times, s.
            "edge_low", "edge_high",
            # The last step in whose middle the reference was asked for, s; begin of the last STORM_EVENTS events, s.
            "seen_length", "storm_since",
            # Without the forces that change the flow from step to step: N·m/rad, N·m·s/rad, N·m; the least stiffness.
            "even_stiffness", "even_damping", "even_base", "floor",
            # The velocity at which a steep layer begins, where the axis is outside, rad/s.
            "narrow",
        )),
        *((name, np.int64) for name in (
            # Whether rigid friction holds the axis; a reversal ends a mode; forces follow the motion; all is damped
            # without sticking elements; a force changes the flow from step to step.
            "held", "watched", "nonlinear", "calm", "bent",
            # Whether signals may differ from those at the end of the last segment that was measured.
            "jumped",
            # Steps in whose middle the reference need not be asked for; the feedforward's cell; events before the last
            # look for a storm.
            "unseen", "cell", "storm_count",
        )),
    ]
)  # fmt: skip
"""The state of the loop, and the reference where it stands."""

ELEMENT = np.dtype(
    [
        *((name, np.float64) for name in (
            # N·m/rad, part of the side's torque, N·m; N·m at angle 0 while it sticks.
            "stiffness", "share", "force", "offset",
            # A list of the sticking elements of a side without gaps: N·m per share at angle 0, and its rise per rad.
            "load_at_0", "load_slope",
        )),
        ("slips", np.int64),
    ]
)  # fmt: skip
"""An element of finite stiffness."""

SIDE = np.dtype(
    [
        *((name, np.int64) for name in (
            # RELAXES, FOLLOWS or BENDS; whether the slipping force varies; whether elements break away by the literal
            # rule; whether the axis is inside the steep layer.
            "kind", "varies", "literal", "inside",
            # Address of the sliding curve, 0: constant; where the law's parameters begin in `parameters`.
            "curve", "law",
            # Its elements are those from `first` to before `last`; how many of them stick.
            "first", "last", "sticking",
        )),
        *((name, np.float64) for name in (
            # Of its torque in the loop: 1, or minus the compensator's gain.
            "weight",
            # Rate of attraction C, N·m/s; N·m at which elements break away at rest, and below which none does.
            "attraction", "breakaway", "lowest",
            # Of the sliding curve, rad/s; N·m·s/rad.
            "scale", "viscous",
            # Share of rigid elements; of those that slip, which bristles do with 1.
            "rigid", "slipping",
            # Of what sticks: N·m/rad, and N·m at angle 0.
            "spring", "spring_offset",
            # Torque of what slips, together, N·m: here, its rate, N·m/s, and its decay; where modes changed last.
            "force", "force_rate", "decay", "force_start", "exponent",
            # The same in the middle and at the end of the segment; at an event; what a cubic misses over x²(h - x)².
            "force_mid", "force_end", "force_rate_end", "decay_mid", "decay_end", "force_now", "lift",
            # Stiffness of a bristle, N·m/rad, and its damping over its stiffness, s.
            "bristle", "lag",
            # Share that rises with the slope, N·m·s/rad, through the layer |v| < layer, rad/s.
            "steep", "steepness", "layer",
            # Torque over velocity in the flow, N·m·s/rad.
            "damping",
            # Largest load per share of a sticking element where the loop stands, and at the segment's next node, N·m.
            "top", "top_next",
            # Two velocities with their values of the sliding curve.
            "velocity", "level", "velocity_before", "level_before",
        )),
    ]
)  # fmt: skip
"""A law in the loop."""

RELAXES, FOLLOWS, BENDS = range(3)
"""What `kind` says of the force of what slips: it relaxes towards the curve, is on the curve at once, or is that of a
bristle (`exact.bristle` has the last two)."""

PLAN_SIZE, COUNT_SIZE, NOW_SIZE, ELEMENT_SIZE, SIDE_SIZE = (
    kind.itemsize // 8 for kind in (PLAN, COUNT, NOW, ELEMENT, SIDE)
)
ASKED = NOW.names.index("asked_position") if NOW.names else 0

IN_LAYER = 1e-4
"""Stiffness added in a steep layer, over slope²/J."""
EDGE = 1e-12
"""One-sided limits at a break are taken this far from it, s."""


@spliced
def side_of(sides: Any, i: int) -> Any:
    """Side 0, the plant's friction, or 1, that of a feedback compensator."""
    return record_at(pointer(sides, i * SIDE_SIZE), SIDE)


@spliced
def element_of(elements: Any, i: int) -> Any:
    """An element of finite stiffness; those of a side lie together."""
    return record_at(pointer(elements, i * ELEMENT_SIZE), ELEMENT)


@kernel(exact=False, inline=True)
def sides_of(plan: Any) -> int:
    """Number of sides, told to the compiler as one or two: it would gather and scatter them as vectors of many."""
    return 2 if plan.sides > 1 else 1


@kernel(exact=False, inline=True)
def sliding(parameters: Any, plan: Any, sides: Any, side: Any, v: float) -> float:
    """The sliding curve of a side, N·m; two values are kept, since middle and end are asked for again."""
    own = side_of(sides, 0) if plan.shared != 0 else side
    if own.curve == 0:
        return own.breakaway
    if own.velocity == v:
        return own.level
    if own.velocity_before == v:
        return own.level_before
    own.velocity_before = own.velocity
    own.level_before = own.level
    own.velocity = v
    own.level = call_value(own.curve, v, pointer(parameters, own.law))
    return own.level


@kernel(exact=False, inline=True)
def command(parameters: Any, plan: Any, cells: Any, now: Any, t: float) -> tuple[float, float, float, float]:
    """Torque commanded by time alone, its slope, and the reference's position and velocity, at t.

    kp theta_d + kr theta_d' + gain T_hat(t); ``cells`` hold the feedforward torque (`_forcing`).
    """
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
    return r, dr, goal, rate


@kernel(exact=False, inline=True)
def arrange(parameters: Any, plan: Any, elements: Any, sides: Any, now: Any) -> Linear:
    """Set the loop up for the modes as they are: springs, slipping sums, flow.

    Where the stiffness nearly vanishes, a spring is added (and taken off again by the corrector), so that the
    cubic particular solution exists.
    """
    theta = now.position
    v = now.velocity
    total = parameters[KP]
    damping = parameters[KD]
    now.base = 0.0
    now.bent = 0
    now.narrow = 0.0
    floor = plan.stiffness_floor
    slips = False
    sticks = False
    now.nonlinear = 1 if parameters[KI] != 0.0 else 0
    for i in range(sides_of(plan)):
        side = side_of(sides, i)
        w = side.weight
        side.damping = side.viscous
        if side.kind == BENDS:
            begin_bristle(side, theta, now.held)
        else:
            gather(elements, side, theta)
            side.slipping += side.rigid * abs(now.sigma)
        if side.steep > 0.0:
            if side.inside != 0:
                side.damping = side.steepness
                # Over the moment that a crossing takes, this spring moves nothing.
                steep = w * side.steepness
                floor = max(floor, IN_LAYER * steep * steep / parameters[INERTIA])
            else:
                side.slipping += side.steep
                now.narrow = max(now.narrow, side.layer)
        damping += w * side.damping
        total += w * side.spring
        now.base += w * side.spring_offset
        sticks = sticks or side.sticking != 0
        if side.slipping > 0.0:
            slips = True
            begin_slip(parameters, plan, sides, now, side, v)
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
def gather(elements: Any, side: Any, theta: float) -> None:
    """Sum up the springs of the sticking elements, and shares and forces of the slipping ones."""
    spring = 0.0
    offset = 0.0
    share = 0.0
    force = 0.0
    stuck = side.first
    for i in range(side.first, side.last):
        e = element_of(elements, i)
        if e.slips != 0:
            share += e.share
            force += e.force
        else:
            e.offset = e.force - e.stiffness * theta
            spring += e.stiffness
            offset += e.offset
            listed = element_of(elements, stuck)
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
    """All of a bristle's force is slipping force, until `exact.bristle.bend` takes what follows the position."""
    side.force += side.spring * theta + side.spring_offset
    side.force_now = side.force
    side.spring = 0.0
    side.spring_offset = 0.0
    side.force_rate = 0.0
    side.slipping = 1.0 - held


@kernel(exact=False, inline=True)
def begin_slip(parameters: Any, plan: Any, sides: Any, now: Any, side: Any, v: float) -> None:
    """Curve and slope of a side's slipping force at the start of a segment."""
    kind = side.kind
    if kind == RELAXES:
        s = sliding(parameters, plan, sides, side, v)
        side.decay = 1.0 / s
        side.force_rate = side.attraction * (side.slipping * now.sigma - side.force / s)
    elif kind == FOLLOWS:
        s = sliding(parameters, plan, sides, side, v)
        side.force = side.slipping * now.sigma * s
        side.force_now = side.force


@kernel(exact=False)
def curve_slope(parameters: Any, plan: Any, sides: Any, side: Any, v: float) -> float:
    """ds/dv by a central difference, one-sided at rest."""
    d = 1e-4 * side.scale
    low = v - d if abs(v) >= d else v
    high = v + d if v >= 0.0 or abs(v) >= d else v
    if low == v:
        low, high = (v, v + d) if v >= 0.0 else (v - d, v)
    return (sliding(parameters, plan, sides, side, high) - sliding(parameters, plan, sides, side, low)) / (
        high - low
    )


@kernel(exact=False, inline=True)
def torques(
    parameters: Any, plan: Any, sides: Any, now: Any, r: float, goal: float, rate: float, integral: float,
    theta: float, v: float, s_plant: float, s_compensator: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Motor, friction and compensating torque, N·m."""
    helped = r - parameters[KP] * goal - parameters[KR] * rate
    if plan.sides > 1:
        side = side_of(sides, 1)
        model = side.spring * theta + side.spring_offset + s_compensator + side.damping * v
        helped -= side.weight * model
    motor = parameters[KP] * (goal - theta) + parameters[KR] * rate - parameters[KD] * v
    motor += parameters[KI] * integral + helped
    if now.held != 0:
        return motor, motor, helped
    contact = side_of(sides, 0)
    friction = contact.spring * theta + contact.spring_offset + s_plant + contact.damping * v
    return motor, friction, helped
