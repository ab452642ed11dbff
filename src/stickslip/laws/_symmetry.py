"""Other parameters for v < 0 (thesis 2.1.7), for any law with parameters that belong to sliding.

The law's own functions run with the parameters of the direction in which the contact moves. Only what vanishes at
rest or belongs to sliding may differ (`Par.directional`): a stiffness that changed at a reversal would make
the torque jump.
"""

from __future__ import annotations

from typing import Any

from stickslip.core.rebinding import NEGATIVE, negative
from stickslip.core.spec import Choice, Option

# What the wrapped law has under these names, bound when the option is chosen.
inner_step: Any = None
inner_rate: Any = None
inner_guards: Any = None
inner_switch: Any = None
inner_steady: Any = None
inner_holding: Any = None
inner_check: Any = None
inner_velocity_scale: Any = None
inner_is_passive: Any = None


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m. A reversal inside is cut at v = 0."""
    if (v0 < 0.0 and v1 > 0.0) or (v0 > 0.0 and v1 < 0.0):
        part = dt * v0 / (v0 - v1)
        if v0 < 0.0:
            inner_step(v0, 0.0, part, z, negative(p), u)
            return inner_step(0.0, v1, dt - part, z, p, u)
        inner_step(v0, 0.0, part, z, p, u)
        return inner_step(0.0, v1, dt - part, z, negative(p), u)
    if v0 < 0.0 or v1 < 0.0:
        return inner_step(v0, v1, dt, z, negative(p), u)
    return inner_step(v0, v1, dt, z, p, u)


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m; writes the rates of the states."""
    if v < 0.0:
        return inner_rate(v, z, negative(p), u, dz)
    return inner_rate(v, z, p, u, dz)


def guards(v: float, z: Any, p: Any, u: Any, g: Any) -> None:
    """Write for each mode the value that rises to zero where it ends."""
    if v < 0.0:
        inner_guards(v, z, negative(p), u, g)
    else:
        inner_guards(v, z, p, u, g)


def switch(v: float, z: Any, p: Any, u: Any, g: Any) -> None:
    """Leave the modes that are due."""
    if v < 0.0:
        inner_switch(v, z, negative(p), u, g)
    else:
        inner_switch(v, z, p, u, g)


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m."""
    if v < 0.0:
        return inner_steady(v, negative(p))
    return inner_steady(v, p)


def holding(direction: float, z: Any, p: Any, u: Any) -> float:
    """Largest torque withstood at rest, N·m."""
    if direction < 0.0:
        return inner_holding(direction, z, negative(p), u)
    return inner_holding(direction, z, p, u)


def check(p: Any) -> str:
    """What is wrong with the parameters of either direction."""
    complaint = inner_check(negative(p))
    return inner_check(p) or (f"for v < 0: {complaint}" if complaint else "")


def velocity_scale(p: Any) -> float:
    """The smaller velocity scale of both directions, rad/s."""
    scales = [s for s in (inner_velocity_scale(p), inner_velocity_scale(negative(p))) if s > 0.0]
    return min(scales, default=0.0)


def is_passive(p: Any) -> bool:
    """Whether it only dissipates in both directions."""
    return inner_is_passive(p) and inner_is_passive(negative(p))


SYMMETRY = Choice(
    "symmetry",
    replaces="",
    options={
        "symmetric": Option(),
        "asymmetric": Option(
            doubles=NEGATIVE,
            wraps={
                "step": step,
                "rate": rate,
                "guards": guards,
                "switch": switch,
                "steady": steady,
                "holding": holding,
                "check": check,
                "velocity_scale": velocity_scale,
                "is_passive": is_passive,
            },
            keeps_elements=False,
        ),
    },
    default="symmetric",
    meaning="whether v < 0 has parameters of its own",
)
