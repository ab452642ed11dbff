"""What the sampled engine remembers of an axis, and the rates of one that slips under a held torque.

J dv/dt = u - F (thesis eq. 3.1 with T_m = u): while something slips, F is the springs of the sticking elements, one
slipping force s for all that slip (they share a curve: thesis eq. 2.17 summed up) and the viscous part.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.jit import call_growth, call_value, kernel, pointer, pointer_at, record_at, spliced

RELAXES, FOLLOWS, BENDS = range(3)
"""What a slipping force does: relax towards the curve (GMS), lie on it (Coulomb, Maxwell-slip), bend as a bristle."""
STUCK, SLIPS, RESTS, CREEPS, STEPS, HOLDS = range(6)
"""What the axis does: every spring sticks; something slips; a rigid contact holds; it is on its steep slope. And of the
general step: it moves; a contact that jumps at rest holds."""
LEVELS = 24
"""Velocities up to which the lowest value of the sliding curve is kept, each twice the one before."""

AXIS = np.dtype(
    [
        *((name, np.float64) for name in (
            "inertia", "viscous", "attraction", "bristle", "lag", "elastic", "damped",
            "breakaway", "scale", "lowest", "rigid", "steep",
            "slope", "layer", "far", "level", "settled", "sample_time", "local", "near", "longest", "position_limit",
            "velocity_limit",
        )),
        ("flow", np.float64, (4,)),
        ("glide", np.float64, (3, 4)),
        ("floor", np.float64, (LEVELS,)),
        *((name, np.int64) for name in ("kind", "literal", "metered")),
        # Addresses: of the sliding curve (0: none), of a bristle's own growth (0: none), of the law's parameters and of
        # the springs, with their number.
        *((name, np.int64) for name in ("curve", "growth", "parameters", "springs", "count")),
    ]
)  # fmt: skip
"""Constants of an axis: SI units; `stickslip.simulation.sampled.axis` fills them in. A bristle that only bends up to
``elastic`` N·m sticks until then as a spring does. ``damped`` is the damping while everything sticks, ``viscous`` that
while something slips, N·m·s/rad. ``flow`` leads a stuck axis over a sample, ``glide`` one on which everything slips
faster than ``far``, where the curve is level."""
STATE = np.dtype(
    [
        *((name, np.float64) for name in (
            "position", "moved", "velocity", "acceleration", "torque", "direction", "slipping", "slipped_from",
            "relaxed", "held", "spring", "share", "next", "goal", "level", "level_at",
        )),
        *((name, np.int64) for name in ("mode", "events", "steps", "rejected", "failed")),
    ]
)  # fmt: skip
"""The motion at one time. ``moved`` is the displacement since the springs' forces were written down, rad; ``held`` and
``spring`` are force and stiffness of the sticking ones, ``slipping`` and ``share`` force and share of the others;
``goal`` is where a stuck axis would come to rest, or the velocity at which one on its steep slope would go on.
``level`` is the curve at the velocity ``level_at``, where it was called last; 0 before that."""
SPRING = np.dtype([(name, np.float64) for name in ("stiffness", "share", "force", "slips")])
"""One element: ``force`` in N·m where ``moved`` is 0; ``slips`` is 1 or 0."""
SPRING_SIZE = SPRING.itemsize // 8


@spliced
def spring_of(axis: Any, i: int) -> Any:
    """A spring of an axis."""
    return record_at(pointer(pointer_at(axis.springs), i * SPRING_SIZE), SPRING)


class Slip(NamedTuple):
    """The constants of one step in which something slips."""

    kind: int
    mobility: float
    free: float
    spring: float
    viscous: float
    pull: float
    attraction: float
    direction: float
    bristle: float
    lag: float
    breakaway: float
    curve: int
    growth: int
    parameters: int
    of_velocity: float
    of_force: float


class Start(NamedTuple):
    """Where a step starts: the motion, and the rates that every step from there begins with."""

    velocity: float
    slipping: float
    """slipping force, N·m"""
    acceleration: float
    building: float
    """rate of the slipping force, N·m/s"""
    decay: float
    """rate of its relaxation, 1/s"""
    level: float
    """the curve there, N·m"""


class Trial(NamedTuple):
    """A step that may be taken."""

    time: float
    """its length, s"""
    moved: float
    """displacement over it, rad"""
    velocity: float
    """at its end, rad/s"""
    slipping: float
    """slipping force there, N·m"""
    relaxed: float
    """exponent by which slipping elements have relaxed"""
    error: float
    """estimate of what it is wrong by, as a position, rad"""


@kernel(exact=False, inline=True)
def slip_of(axis: Any, z: Any) -> Slip:
    """The constants of the present step."""
    time = axis.sample_time
    of_force = time * time / axis.inertia
    of_velocity = time
    if axis.kind == BENDS:
        # A bristle's force is balanced by its spring, or drives the axis for a period of that.
        period = math.sqrt(axis.inertia / axis.bristle)
        of_velocity = max(time, period)
        of_force = max(1.0, time / period) / axis.bristle
    return Slip(
        axis.kind, 1.0 / axis.inertia, z.torque - z.held - z.spring * z.moved, z.spring, axis.viscous,
        z.share * z.direction, axis.attraction, z.direction, axis.bristle, axis.lag, axis.breakaway, axis.curve,
        axis.growth, axis.parameters, of_velocity, of_force,
    )  # fmt: skip


@kernel(exact=False, inline=True)
def never_sticks(axis: Any) -> bool:
    """Whether the contact gives way from the first on, as LuGre's bristle does."""
    return axis.kind == BENDS and axis.elastic == 0.0


@kernel(exact=False, inline=True)
def curve_at(axis: Any, v: float) -> float:
    """s(v) of an axis, or of what `Slip` has of it, N·m."""
    if axis.curve == 0:
        return axis.breakaway
    return call_value(axis.curve, v, pointer_at(axis.parameters))


@kernel(exact=False, inline=True)
def level_now(axis: Any, z: Any) -> float:
    """s(v) now, N·m: not called again where the last step ended with it."""
    return z.level if z.level > 0.0 and z.velocity == z.level_at else curve_at(axis, z.velocity)


@kernel(exact=False)
def grows_by(growth: int, parameters: int, stiffness: float, v: float, load: float, level: float) -> float:
    """Rate of a bristle's force by the law's own growth, N·m/s.

    Apart, since text that seldom runs costs the rates time where it is inlined.
    """
    return stiffness * v * call_growth(growth, load / stiffness, level / stiffness, pointer_at(parameters))


@kernel(exact=False, inline=True)
def bends_by(axis: Any, v: float, s: float, level: float, way: float) -> float:
    """Rate of a bristle's force, N·m/s, by an axis, or by what `Slip` has of it."""
    if axis.growth == 0:
        return axis.bristle * v * (1.0 - way * s / level)
    return grows_by(axis.growth, axis.parameters, axis.bristle, v, way * s, level)


@kernel(exact=False, inline=True)
def rates(m: Slip, d: float, v: float, s: float) -> tuple[float, float, float]:
    """Acceleration, rate of the slipping force and rate of its relaxation, d after the step's start."""
    return rates_on(m, d, v, s, curve_at(m, v))


@kernel(exact=False, inline=True)
def rates_on(m: Slip, d: float, v: float, s: float, level: float) -> tuple[float, float, float]:
    """The same where the curve is known."""
    ds = 0.0
    decay = 0.0
    force = s
    if m.kind == RELAXES:
        decay = m.attraction / level
        ds = m.attraction * m.pull - decay * s
    elif m.kind == FOLLOWS:
        force = m.pull * level
    else:
        ds = bends_by(m, v, s, level, m.direction)
        force = s + m.lag * ds
    return m.mobility * (m.free - m.spring * d - force - m.viscous * v), ds, decay


@kernel(exact=False, inline=True)
def start_of(m: Slip, z: Any) -> Start:
    """Where the next step starts."""
    level = level_now(m, z)
    a, ds, decay = rates_on(m, 0.0, z.velocity, z.slipping, level)
    return Start(z.velocity, z.slipping, a, ds, decay, level)


@kernel(exact=False, inline=True)
def combined(fifth: float, third: float) -> float:
    """Hairer's estimate of a step's error from those of orders 5 and 3."""
    five, three = fifth * fifth, third * third
    if five == 0.0:
        return 0.0
    return five / math.sqrt(five + 0.01 * three)
