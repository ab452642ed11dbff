"""Nonlinear controller on Maxwell-slip elements: springs that the error winds up, and that slip at a level.

A rise of the error is answered by all springs at once, as by a high gain, up to the levels at which they slip; where
the error turns they let go. Along a loop of the error they take energy, so they add damping as well as stiffness.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    """Springs and levels."""

    k: Annotated[
        tuple[float, ...], Par("N·m/rad", "k_i", "stiffness of element i over the error", positive=True)
    ]
    w: Annotated[tuple[float, ...], Par("N·m", "W_i", "torque at which element i slips", positive=True)]


class State(NamedTuple):
    """Internal state."""

    error: Annotated[float, Par("rad", "e", "position error one sample ago")]
    force: Annotated[tuple[float, ...], Par("N·m", "T_i", "torque of element i")]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    rise = 0.0
    if y.started != 0.0:
        rise = y.error - z.error
    z.error = y.error
    torque = 0.0
    for i in range(len(p.k)):
        z.force[i] = min(max(z.force[i] + p.k[i] * rise, -p.w[i]), p.w[i])
        torque += z.force[i]
    return torque


CONTROL_LAW = ControlLaw(
    "nonlinear_maxwell_slip", Params, sample, "observer",
    title="Nonlinear Maxwell-slip controller",
    equation=r"T = \sum_i T_i,\quad T_i \leftarrow W_i\,\mathrm{sat}((T_i + k_i \Delta e)/W_i)",
    source=("iwan1966", "thesis chapter 1"),
    example={"k": [12.0, 6.0, 3.0], "w": [0.1, 0.1, 0.1]},
    State=State,
)  # fmt: skip
