"""What the exact integrator remembers: elements, slipping forces, and the state of the loop.

Records in flat arrays. A *side* is a law in the loop: 0 the plant's friction, 1 the law of a feedback
compensator (weighted by minus its gain). All of them are handed on as addresses, which costs kernels nothing
(arrays are counted references). The slipping elements of a side share one curve s(v), so that their sum
S alone is integrated, dS/dt = C (A sigma - S/s(v)) with A the sum of their shares; each element's force follows
from the decay exp(-integral of C/s) when a mode changes. Where C is infinite, S = A sigma s(v).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stickslip.jit import kernel, pointer, record_at, spliced
from stickslip.simulation.case_arrays import COLUMNS
from stickslip.simulation.exact.flow import KEPT

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
bristle (`exact.forces.bend` has to do with the last two)."""

SEGMENT = np.dtype(
    [
        *((name, np.float64) for name in (
            # s; coefficients of the particular solution; at its begin the free motion, rad and rad/s.
            "length", "c0", "c1", "c2", "c3", "free_position", "free_velocity",
            # The axis in the middle, at the end and at an event, rad and rad/s.
            "position_mid", "velocity_mid", "position_end", "velocity_end", "position_event", "velocity_event",
            # Commanded torque, N·m and N·m/s; the reference's position and velocity, rad and rad/s.
            "command_mid", "command_end", "command_rate_end", "goal_mid", "rate_mid", "goal_end", "rate_end",
            # rad·s of the error at the end; what the end may be wrong by, rad.
            "integral_end", "error",
        )),
        # Rounds of the corrector; whether the reference was asked for in the middle.
        ("rounds", np.int64),
        ("asked", np.int64),
    ]
)  # fmt: skip
"""The motion over one accepted step."""

ROW = np.dtype([(name, np.float64) for name in COLUMNS])

PLAN_SIZE, COUNT_SIZE, NOW_SIZE, ELEMENT_SIZE, SIDE_SIZE, SEGMENT_SIZE, ROW_SIZE, KEPT_SIZE = (
    kind.itemsize // 8 for kind in (PLAN, COUNT, NOW, ELEMENT, SIDE, SEGMENT, ROW, KEPT)
)
DEEPEST = 24
"""Steps are the longest one halved up to this many times, so that their flows are computed once per mode."""
SPACED, CUT, FLOWS = range(DEEPEST + 1, DEEPEST + 4)
"""Kept flows: over half of each of these steps, over the grid's spacing, and over half of a step that is cut short."""
AT_NOW = COUNT_SIZE
AT_SEGMENT = AT_NOW + NOW_SIZE
AT_FLOWS = AT_SEGMENT + SEGMENT_SIZE
AT_SIDES = AT_FLOWS + FLOWS * KEPT_SIZE
AT_ELEMENTS = AT_SIDES + 2 * SIDE_SIZE
"""Places in `work`; the counts begin it and the elements end it."""
ASKED = NOW.names.index("asked_position") if NOW.names else 0

EDGE = 1e-12
"""One-sided limits at a break are taken this far from it, s."""


class Laid(NamedTuple):
    """A loop laid out in arrays of float64, which a call takes at a tenth of the price of structures.

    Attributes
    ----------
    parameters : array
        `Case.numbers`, and the parameters of the laws and of the reference.
    plan : array
        The bytes of a `PLAN`.
    cells : array
        The feedforward torque (`stickslip.simulation._forcing`).
    breaks, grid : array
        Times that are stepped onto, and those of the rows, s; ascending.
    work : array
        What the kernels work on, as it begins; see `AT_ELEMENTS`.
    """

    parameters: Any
    plan: Any
    cells: Any
    breaks: Any
    grid: Any
    work: Any


class Output(NamedTuple):
    """What a run writes.

    Attributes
    ----------
    motion : array, shape (n, 2)
        Position (rad) and velocity (rad/s) on the grid.
    rows : array, shape (n, columns)
        By `case_arrays.COLUMNS`, on the grid and at events.
    acc, turns : array
        The meter's (`stickslip.simulation._meter`).
    nodes : array, shape (signals, 5)
        Of a window of the meter; scratch.
    """

    motion: Any
    rows: Any
    acc: Any
    turns: Any
    nodes: Any


class Loop(NamedTuple):
    """What kernels read and write: records and addresses, since arrays in a tuple count references at every access."""

    parameters: Any
    plan: Any
    cells: Any
    grid: Any
    count: Any
    now: Any
    segment: Any
    flows: Any
    sides: Any
    elements: Any
    motion: Any
    rows: Any


@spliced
def loop_of(laid: Laid, output: Output) -> Loop:
    """The addresses of arrays that outlive the call."""
    work = laid.work
    return Loop(
        pointer(laid.parameters, 0), record_at(pointer(laid.plan, 0), PLAN), pointer(laid.cells, 0),
        pointer(laid.grid, 0), record_at(pointer(work, 0), COUNT), record_at(pointer(work, AT_NOW), NOW),
        record_at(pointer(work, AT_SEGMENT), SEGMENT), pointer(work, AT_FLOWS), pointer(work, AT_SIDES),
        pointer(work, AT_ELEMENTS), pointer(output.motion, 0), pointer(output.rows, 0),
    )  # fmt: skip


@spliced
def side_of(loop: Loop, i: int) -> Any:
    """Side 0, the plant's friction, or 1, that of a feedback compensator."""
    return record_at(pointer(loop.sides, i * SIDE_SIZE), SIDE)


@spliced
def element_of(loop: Loop, i: int) -> Any:
    """An element of finite stiffness; those of a side lie together."""
    return record_at(pointer(loop.elements, i * ELEMENT_SIZE), ELEMENT)


@spliced
def kept_of(loop: Loop, i: int) -> Any:
    """A kept flow: of a step, SPACED or CUT."""
    return record_at(pointer(loop.flows, i * KEPT_SIZE), KEPT)


@spliced
def row_of(loop: Loop, i: int) -> Any:
    """A row of the output."""
    return record_at(pointer(loop.rows, i * ROW_SIZE), ROW)


@kernel(exact=False, inline=True)
def sides_of(loop: Loop) -> int:
    """Number of sides, told to the compiler as one or two: it would gather and scatter them as vectors of many."""
    return 2 if loop.plan.sides > 1 else 1
