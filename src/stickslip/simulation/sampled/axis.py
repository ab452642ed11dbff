"""A case laid out for the sampled engine: the records that its kernels read."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from stickslip.core.spec import Bristle, Elements
from stickslip.machines.drivetrain import exponential
from stickslip.simulation.case_arrays import (
    INERTIA,
    MAX_STEP,
    METERED,
    PLANT_BAND,
    POSITION_0,
    POSITION_LIMIT,
    SAMPLE_TIME,
    TOLERANCE,
    VELOCITY_0,
    VELOCITY_LIMIT,
    Array,
    Case,
    Side,
)
from stickslip.simulation.exact.engine import (
    crosses_once,
    curve_of,
    is_literal,
    lacks_modes,
    layer_of,
    lowest,
    modulations,
)
from stickslip.simulation.exact.flow import flow, linear
from stickslip.simulation.sampled.modes import gather
from stickslip.simulation.sampled.rates import (
    AXIS,
    BENDS,
    CREEPS,
    FOLLOWS,
    HOLDS,
    LEVELS,
    RELAXES,
    RESTS,
    SLIPS,
    SPRING,
    STATE,
    STEPS,
    STUCK,
)

LOCAL = 1e-3
"""Of the tolerance, which one step may be wrong by."""
GENERAL = 1e-2
"""The same for a general step, whose errors the loop pulls back."""
NEAR = 1e-3
"""Of the torque that moves the stuck axis by that: a load at its limit."""
SETTLED = 0.1
"""Of the torque that bends a bristle by the tolerance of a step: it then is bent as in steady sliding."""
LEVEL = 1e-15
"""Of the curve, by which it may still vary where it counts as level."""


class Laid(NamedTuple):
    """The records of an axis: its constants, its state at the start, and its springs.

    The constants know where the springs are, and the parameters of the case's law: all are to outlive them.
    """

    axis: Any
    state: Any
    springs: Any


def not_located(side: Side) -> str:
    """Say why a contact has no located flow, in one sentence; "" if it has one."""
    assert side.model is not None
    law = side.model.law
    if law.reads_surroundings:
        return f"law {law.name!r} depends on its surroundings ({modulations(law)})"
    e = side.elements
    if e is None:
        return lacks_modes(side)
    if not e.constant_curve and (not side.pointers.sliding or e.velocity_scale <= 0.0):
        return f"law {law.name!r} has no sliding curve with a velocity scale"
    if isinstance(e, Bristle) and e.own_growth and not side.pointers.growth:
        return f"law {law.name!r} gives no `growth`, which its `modes` speaks of"
    if isinstance(e, Elements):
        rigid = [math.isinf(k) for k in e.stiffness]
        if any(rigid) and not (all(rigid) and math.isinf(e.attraction)):
            return f"law {law.name!r} has rigid elements in addition to springs, or with a finite attraction"
        if math.isfinite(e.slope) and not (all(rigid) and crosses_once(side, e)):
            return f"law {law.name!r} has a steep slope that meets the sliding curve more than once, or never"
    return ""


def general_axis(case: Case) -> Laid:
    """An axis that takes the general step: it has no springs."""
    n = case.numbers
    axis, state = np.zeros(1, AXIS), np.zeros(1, STATE)
    a, z = axis[0], state[0]
    a["inertia"], a["sample_time"], a["local"] = n[INERTIA], n[SAMPLE_TIME], GENERAL * n[TOLERANCE]
    a["position_limit"], a["velocity_limit"] = n[POSITION_LIMIT], n[VELOCITY_LIMIT]
    a["metered"], a["longest"] = int(n[METERED]), n[MAX_STEP]
    z["position"], z["velocity"], z["next"] = n[POSITION_0], n[VELOCITY_0], n[SAMPLE_TIME]
    z["direction"] = np.sign(z["velocity"])
    z["mode"] = STEPS
    if case.plant.pointers.holding and abs(z["velocity"]) <= n[PLANT_BAND]:
        z["mode"], z["velocity"], z["goal"] = HOLDS, 0.0, z["velocity"]
    return Laid(axis, state, np.zeros(0, SPRING))


def axis_of(case: Case) -> Laid:
    """An axis whose motion is a located flow."""
    e, n, side = case.plant.elements, case.numbers, case.plant
    assert e is not None
    axis, state, _ = general_axis(case)
    a, z = axis[0], state[0]
    a["local"] = LOCAL * n[TOLERANCE]
    z["velocity"], z["goal"] = n[VELOCITY_0], 0.0
    springs = contact_on(a, z, side, e)
    a["near"] = NEAR * a["local"] * z["spring"]
    a["glide"] = glide_of(a)
    if z["spring"] > 0.0:
        a["flow"] = flow(linear(a["inertia"], a["damped"], z["spring"]), a["sample_time"])
    return Laid(axis, state, springs)


def contact_on(a: Any, z: Any, side: Side, e: Elements | Bristle) -> Any:
    """Write the constants of a contact into those of an axis, and how it starts; returns its springs."""
    known = levels_of(side, e)
    a["literal"], a["breakaway"] = int(is_literal(side)), e.breakaway
    a["viscous"] = a["damped"] = e.viscous
    a["parameters"] = side.parameters.ctypes.data
    a["curve"], a["scale"] = (0, 1.0) if e.constant_curve else (side.pointers.sliding, e.velocity_scale)
    a["lowest"], a["floor"] = lowest(side, e), known.floors
    springs = fill_bristle(a, side, e) if isinstance(e, Bristle) else fill_elements(a, side, e)
    a["springs"], a["count"] = springs.ctypes.data, springs.size
    a["far"], a["level"] = known.far, known.level
    z["mode"] = starting_mode(a, z, springs)
    gather(a, z)
    return springs


def fill_bristle(a: Any, side: Side, e: Bristle) -> Any:
    """Write a bristle's constants; one that only bends at first is a spring until then."""
    a["kind"], a["bristle"], a["lag"] = BENDS, e.stiffness, e.damping / e.stiffness
    a["growth"] = side.pointers.growth if e.own_growth else 0
    a["settled"] = SETTLED * a["local"] * e.stiffness
    if a["metered"]:
        # The meter reads the motion between the ends of a step from a quintic, which must hold its ringing.
        a["longest"] = min(a["longest"], math.sqrt(a["inertia"] / e.stiffness))
    if e.elastic == 0.0:
        return np.zeros(0, SPRING)
    a["elastic"] = a["lowest"] = e.elastic
    a["damped"] = e.viscous + e.damping
    return np.array([(e.stiffness, 1.0, 0.0, 0.0)], dtype=SPRING)


def fill_elements(a: Any, side: Side, e: Elements) -> Any:
    """Write the constants of elements; returns those that are springs."""
    a["kind"] = FOLLOWS if math.isinf(e.attraction) else RELAXES
    a["attraction"] = 0.0 if math.isinf(e.attraction) else e.attraction
    sprung = [(k, s, 0.0, 0.0) for k, s in zip(e.stiffness, e.share, strict=True) if math.isfinite(k)]
    rigid = math.fsum(s for k, s in zip(e.stiffness, e.share, strict=True) if math.isinf(k))
    if math.isinf(e.slope):
        a["rigid"] = rigid
    else:
        a["steep"], a["slope"], a["layer"] = rigid, e.slope, layer_of(side, e)
    return np.array(sprung, dtype=SPRING)


def starting_mode(a: Any, z: Any, springs: Any) -> int:
    """What the axis does at the start."""
    if a["kind"] == BENDS and a["elastic"] == 0.0:
        return SLIPS
    if springs.size:
        return STUCK
    if a["steep"] > 0.0:
        return SLIPS if abs(z["velocity"]) > a["layer"] else CREEPS
    return SLIPS if z["velocity"] != 0.0 else RESTS


class Levels(NamedTuple):
    """What is known of a sliding curve beforehand: numbers in N·m, velocities in rad/s."""

    floors: Array
    """Bounds below it on velocities up to scale 2^(4 - LEVELS), twice that, and so on"""
    far: float
    """The velocity above which it no longer varies; infinite if it does"""
    level: float
    """Its value there"""


def levels_of(side: Side, e: Elements | Bristle) -> Levels:
    """What is known of the sliding curve of a side."""
    if e.constant_curve:
        return Levels(np.full(LEVELS, e.breakaway), 0.0, e.breakaway)
    assert side.model is not None
    curve = curve_of(side).function
    assert curve is not None
    return levels_on(curve, side.model.parameters, e.velocity_scale)


@functools.lru_cache(maxsize=4096, typed=True)
def levels_on(curve: Callable[..., float], p: Any, scale: float) -> Levels:
    """What is known of a sliding curve of that velocity scale (rad/s); kept, as a study has few of them."""
    return Levels(floors(curve, p, scale), *level_from(curve, p, scale))


def floors(curve: Callable[..., float], p: Any, scale: float) -> Array:
    """Bounds below a sliding curve, as `Levels` has them."""
    tops: list[float] = [scale * 2.0 ** (i + 4 - LEVELS) for i in range(LEVELS)]
    least: list[float] = []
    for low, top in zip([0.0, *tops], tops, strict=False):
        speeds = [low + (top - low) * i / 32.0 for i in range(33)]
        least.append(min(curve(v, p) for v in speeds))
    return (1.0 - 1e-4) * np.minimum.accumulate(least)


def level_from(curve: Callable[..., float], p: Any, scale: float) -> tuple[float, float]:
    """The velocity above which a sliding curve no longer varies, rad/s (infinite if it does), and its value there."""
    end = curve(1e6 * scale, p)
    speeds = scale * np.geomspace(1.0, 1e6, 400)
    varies = [abs(curve(float(v), p) - end) > LEVEL * end for v in speeds]
    if varies[-2]:
        return math.inf, end
    return float(speeds[1 + max((i for i, yes in enumerate(varies) if yes), default=-1)]), end


def glide_of(a: Any) -> Array:
    """What velocity, slipping force, held torque and pull make of displacement, velocity and slipping force."""
    attraction = 0.0 if a["kind"] == BENDS else a["attraction"]
    return glide_on(
        *(float(x) for x in (a["inertia"], a["viscous"], attraction, a["level"], a["sample_time"]))
    )


@functools.lru_cache(maxsize=4096)
def glide_on(inertia: float, viscous: float, attraction: float, level: float, time: float) -> Array:
    """The same by its numbers; kept, as it takes as long as a few hundred samples and a study has few of them."""
    rate = np.zeros((5, 5))
    rate[0, 1] = 1.0
    rate[1, 1:4] = -viscous, -1.0, 1.0
    rate[1] /= inertia
    if level > 0.0:  # else nothing slips against anything
        rate[2, 2], rate[2, 4] = -attraction / level, attraction
    return exponential(rate * time)[:3, 1:]
