"""A machine laid out for the located flow of its train, where that takes it."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.core.spec import Elements
from stickslip.jit import WIDTH, kernel, pointer
from stickslip.machines.drivetrain import INPUTS, StateSpace
from stickslip.machines.machine import Machine
from stickslip.simulation.case_arrays import Side
from stickslip.simulation.sampled.axis import NEAR, contact_on, not_located
from stickslip.simulation.sampled.rates import AXIS, SPRING, STATE
from stickslip.simulation.train.blocks import ready
from stickslip.simulation.train.records import (
    AT,
    BLOCK,
    BLOCKS,
    CONTACT,
    KINDS,
    MATRIX,
    MOST,
    MOTOR,
    NOW,
    SLIDING,
    STICKING,
    SYSTEMS,
    TABLES,
    TRAIN,
    train_of,
)
from stickslip.simulation.train.shapes import PARTS, tables

Array = np.ndarray[Any, np.dtype[np.float64]]

RESOLVED = 1.0
"""omega h of the fastest mode, up to which the nodes of a step follow all that it does."""
WATCHED = 1.1
"""The same between two nodes, up to which they show how far the contact moves."""
MOST_HALVINGS = 8
"""Halvings of a sample for the modes; a machine whose modes need more takes general sub-steps."""
BEYOND = 4
"""More of them whose flows are kept, for sliding along a steep part of the curve."""
SHARE = 0.1
"""Of the tolerance, which one step may be wrong by at the end of its sample."""
NO_TRAIN = np.zeros(1)
"""Of a machine that takes general sub-steps."""


class Plan(NamedTuple):
    """A machine whose motion is a located flow.

    Attributes
    ----------
    side : Side
        Its contact's law.
    elements : Elements
    system : StateSpace
        Its linear part, the contact sliding.
    turning : int
        The state that is the velocity at the contact.
    pace : tuple of float
        The largest eigenvalue while the contact slides, and while it is a spring, 1/s.
    """

    side: Side
    elements: Elements
    system: StateSpace
    turning: int
    pace: tuple[float, float]


def cannot_locate(machine: Machine) -> str:
    """Say why a machine's motion is no located flow but takes general sub-steps, in one sentence; "" if it is one."""
    plan = plan_of(machine)
    return plan if isinstance(plan, str) else ""


def plan_of(machine: Machine) -> Plan | str:
    """How a machine moves along a located flow, or why it takes general sub-steps."""
    contact = machine.contact
    beside = {
        "ripple": contact.ripple.order, "cogging": machine.cogging.order, "bearings": contact.bearings.coulomb,
        "drift": contact.drift.change, "heat": contact.heat.coefficient or contact.heat.resistance,
    }  # fmt: skip
    if acts := [name for name, there in beside.items() if there]:
        return f"it has {', '.join(acts)}"
    side, law = Side.of(machine.clutch), machine.clutch.law.name
    if why := not_located(side):
        return why
    e = side.elements
    if not isinstance(e, Elements) or any(math.isinf(k) for k in e.stiffness):
        return f"law {law!r} is not made of springs"
    if math.isinf(e.attraction) and not e.constant_curve:
        return f"law {law!r} follows a sliding curve at once"
    system, turning = sliding(machine, e.viscous), turning_in(machine)
    pace = paces(system, turning, math.fsum(e.stiffness))
    if len(system.states) > MOST or halvings(max(pace) * machine.sample_time / RESOLVED) > MOST_HALVINGS:
        return "its modes are too many, or too fast for its samples"
    return Plan(side, e, system, turning, pace)


def lay_out_train(machine: Machine, parameters: Array, tolerance: float) -> Array:
    """The train of a machine at rest at position 0, or a single 0 where it takes general sub-steps.

    Parameters
    ----------
    parameters : array
        Of its law, to outlive the train.
    tolerance : float
        Error in position, rad.
    """
    plan = plan_of(machine)
    if isinstance(plan, str):
        return NO_TRAIN.copy()
    e, fastest = plan.elements, max(plan.pace) * machine.sample_time
    deepest = halvings(fastest / RESOLVED) + BEYOND
    springs_at = BLOCKS + (1 + KINDS * (deepest + 1)) * BLOCK
    out = np.zeros(springs_at + len(e.stiffness) * SPRING.itemsize // 8)
    n, axis, z = (
        out[at : at + kind.itemsize // 8].view(kind)[0] for at, kind in ((0, TRAIN), (AT, AXIS), (NOW, STATE))
    )
    n["size"], n["turning"], n["sample_time"] = len(plan.system.states), plan.turning, machine.sample_time
    n["pace"], n["resolved"], n["deepest"] = plan.pace, deepest - BEYOND, deepest
    n["watched"] = halvings(fastest / (WATCHED * PARTS))
    axis["inertia"], axis["sample_time"] = machine.inertia, machine.sample_time
    axis["local"], stiff = SHARE * tolerance, math.fsum(e.stiffness)
    axis["near"] = NEAR * axis["local"] * stiff
    # Behind the rest, so that one array is all of it.
    out[springs_at:].view(SPRING)[:] = contact_on(axis, z, plan.side, e)
    seat(out, parameters)
    out[TABLES:SYSTEMS] = tables()
    write(out, plan.system)
    prepare(out, stiff)
    return out


def seat(train: Array, parameters: Array) -> None:
    """Let a train, which may be a copy of another, know where its springs and its law's parameters lie."""
    if train.size > 1:
        axis = train[AT : AT + AXIS.itemsize // 8].view(AXIS)[0]
        springs_at = (
            BLOCKS + (1 + KINDS * (int(train[: TRAIN.itemsize // 8].view(TRAIN)[0]["deepest"]) + 1)) * BLOCK
        )
        axis["springs"], axis["parameters"] = train[springs_at:].ctypes.data, parameters.ctypes.data


def turning_in(machine: Machine) -> int:
    """The state that is the velocity at the contact."""
    return 2 * len(machine.linear().springs) + 1


def sliding(machine: Machine, viscous: float) -> StateSpace:
    """The linear part of a machine whose contact slides, with the contact's viscous friction (N·m·s/rad) in it."""
    system = machine.linear().state_space()
    turning = turning_in(machine)
    system.a[:, turning] -= viscous * system.b[:, INPUTS.index("load")]
    return system


def paces(system: StateSpace, turning: int, stiffness: float) -> tuple[float, float]:
    """The largest eigenvalue of the train while its contact slides, and while it is a spring, 1/s."""
    sticking = system.a.copy()
    sticking[:, turning - 1] -= stiffness * system.b[:, INPUTS.index("load")]
    slides, sticks = (float(np.max(np.abs(np.linalg.eigvals(a)))) for a in (system.a, sticking))
    return slides, sticks


def halvings(parts: float) -> int:
    """Halvings of a sample that make at least so many parts."""
    return max(math.ceil(math.log2(parts)), 0) if parts > 1.0 else 0


def write(out: Array, system: StateSpace) -> None:
    """Write matrix and inputs of the sliding system."""
    size = len(system.states)
    for j in range(size):
        at = SYSTEMS + MATRIX + j * WIDTH
        out[at : at + size] = system.a[:, j]
    for at, source in ((MOTOR, "command"), (CONTACT, "load")):
        out[SYSTEMS + at : SYSTEMS + at + size] = system.b[:, INPUTS.index(source)]


@kernel()
def prepare(out: Any, stiffness: float) -> None:
    """Make the flows that are kept."""
    train = train_of(pointer(out, 0))
    ready(train, SLIDING, 0.0)
    ready(train, STICKING, stiffness)


def stand_train(out: Array, position: float) -> None:
    """Let the contact rest unloaded at a position, rad."""
    if out.size > 1:
        out[NOW : NOW + STATE.itemsize // 8].view(STATE)[0]["position"] = position
