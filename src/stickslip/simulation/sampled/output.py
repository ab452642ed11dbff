"""Rows and metrics of the sampled engine."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.jit import call_profile, kernel, pointer
from stickslip.simulation._meter import MAX_WINDOW, meter
from stickslip.simulation.case_arrays import COLUMNS
from stickslip.simulation.exact.flow import flow, free_motion, linear
from stickslip.simulation.sampled.modes import friction
from stickslip.simulation.sampled.rates import CREEPS, STUCK
from stickslip.simulation.sampled.stretch import Stretch, velocity_in, within

BESIDE = 1e-11
"""s, by which one-sided values of the reference lie inside a stretch."""
RINGING = 3.0
"""rad of a stuck axis's oscillation in a window of the meter, whose five nodes then resolve it."""


PROGRESS = np.dtype(
    [
        # The time reached, s.
        ("time", np.float64),
        # Whether the run is to end; rows written, and output times met.
        *((name, np.int64) for name in ("asked", "rows", "outputs")),
    ]
)
"""How far a run has come."""


class Output(NamedTuple):
    """What a run writes.

    Attributes
    ----------
    grid : array, shape (n,)
        Output times, s.
    reached : array, shape (1,)
        A `PROGRESS`.
    acc, turns : array
        The meter's (`stickslip.simulation._meter`).
    nodes : array, shape (signals, 5)
        Of a window of the meter; scratch.
    """

    grid: Any
    reached: Any
    acc: Any
    turns: Any
    nodes: Any


class Grid(NamedTuple):
    """Output times: their address, s, and how many."""

    times: Any
    size: int


@kernel(exact=False, inline=True)
def write(
    control: Any, axis: Any, z: Any, t: float, event: float, reached: Any, rows: Any, known: bool
) -> None:  # fmt: skip
    """Write the row at t, for which there is room at the address `rows`; whether the reference there is `known`.

    An address and no array: counting references to arrays would cost more than the row.
    """
    row, motion = pointer(rows, reached.rows * len(COLUMNS)), control.motion
    if not known:
        call_profile(control.profile, t, control.reference_parameters, motion)
    row[0], row[1], row[2] = t, motion[0], motion[1]
    row[3], row[4] = z.position + z.moved, z.velocity
    row[5], row[6] = z.torque, friction(axis, z)
    row[7] = control.memory[control.compensation]
    row[8] = event
    reached.rows += 1


@kernel(exact=False, inline=True)
def put_out(
    control: Any, axis: Any, z: Any, t: float, grid: Grid, reached: Any, rows: Any, known: bool
) -> None:  # fmt: skip
    """Write the rows of the output times up to t, at which the reference may be `known`."""
    while reached.outputs < grid.size and grid.times[reached.outputs] <= t + 1e-12 * max(1.0, t):
        write(control, axis, z, grid.times[reached.outputs], 0.0, reached, rows, known)
        reached.outputs += 1


@kernel(exact=False)
def with_room(rows: Any) -> Any:
    """Twice as many rows, the first ones those that are there."""
    grown = np.empty((2 * rows.shape[0], rows.shape[1]))
    grown[: rows.shape[0]] = rows
    return grown


@kernel(exact=False)
def moved_after(axis: Any, was: Any, z: Any, h: float, t: float) -> tuple[float, float, float]:
    """Position, velocity and acceleration t into a stretch of h that has led from `was` to `z`."""
    start = was.position + was.moved
    v0, a0 = was.velocity, was.acceleration
    if was.mode == STUCK:
        lin = linear(axis.inertia, axis.damped, was.spring)
        off = was.moved - z.goal
        e, v = free_motion(flow(lin, t), off, v0)
        return start + (e - off), v, -lin.square * e - 2.0 * lin.decay * v
    if was.mode == CREEPS:
        rate = axis.slope / axis.inertia
        faded = -math.expm1(-rate * t)
        v = v0 + (z.goal - v0) * faded
        return start + z.goal * t + (v0 - z.goal) * faded / rate, v, (z.goal - v) * rate
    v1, a1 = z.velocity, z.acceleration
    whole = Stretch(h, z.position + z.moved - start, v0, a0, v1, a1)
    x = t / h
    # The slope of the cubic of velocities.
    a = 6.0 * x * (1.0 - x) * (v1 - v0) / h + (1.0 - x) * (1.0 - 3.0 * x) * a0 + x * (3.0 * x - 2.0) * a1
    return start + within(whole, t)[0], velocity_in(whole, t), a


@kernel(exact=False)
def measure(control: Any, axis: Any, was: Any, z: Any, t: float, h: float, output: Output) -> None:
    """Hand the stretch that has led from `was` to `z` to the meter."""
    nodes = output.nodes
    span = MAX_WINDOW
    if was.mode == STUCK:
        span = min(span, RINGING * math.sqrt(axis.inertia / was.spring))
    windows = math.ceil(h / span * (1.0 - 1e-9))
    beside = min(BESIDE, 0.5 * h)
    for window in range(windows):
        for i in range(5):
            x = h * (window + 0.25 * i) / windows
            inside = min(max(t + x, t + beside), t + h - beside)
            call_profile(control.profile, inside, control.reference_parameters, control.motion)
            position, v, a = moved_after(axis, was, z, h, x)
            nodes[0, i] = control.motion[0] - position
            nodes[1, i] = control.motion[1] - v
            nodes[2, i] = position
            nodes[3, i] = v
            nodes[4, i] = control.motion[1]
            nodes[5, i] = was.torque
            nodes[6, i] = was.torque - axis.inertia * a
            nodes[7, i] = control.memory[control.compensation]
        meter(output.acc, output.turns, t + h * window / windows, h / windows, nodes)
