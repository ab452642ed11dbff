"""Extended state observer: position, velocity and the acceleration that nothing else explains, all poles at one place.

It needs no velocity, and predicts with the torque that was applied. What it calls a disturbance is given back. Its
rejection is that of a disturbance observer with a third of its corner; against stiction it hunts at rest as that one.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    """Nominal machine and poles."""

    inertia: Annotated[float, Par("kg·m²", "J_n", "nominal inertia", positive=True)]
    corner: Annotated[float, Par("1/s", "omega_o", "all poles, as of a continuous observer", positive=True)]


class State(NamedTuple):
    """Internal state."""

    ahead: Annotated[float, Par("rad", "", "estimated minus measured position")]
    velocity: Annotated[float, Par("rad/s", "x_2", "estimated velocity")]
    disturbance: Annotated[float, Par("rad/s²", "x_3", "acceleration that the torque does not explain")]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m; nothing has been applied before the first sample."""
    time = y.elapsed
    pole = math.exp(-p.corner * time)
    left = 1.0 - pole
    acceleration = z.disturbance + y.residual / p.inertia
    error = -(z.ahead - y.moved + time * z.velocity + 0.5 * time * time * acceleration)
    z.ahead = -pole * pole * pole * error
    z.velocity += time * acceleration + 1.5 * left * left * (1.0 + pole) / time * error
    z.disturbance += left * left * left / (time * time) * error
    return -p.inertia * z.disturbance


CONTROL_LAW = ControlLaw(
    "extended_state_observer", Params, sample, "observer",
    title="Extended state observer",
    equation=r"\hat x_k = \hat x_{k|k-1} + l (\theta_k - \hat\theta_{k|k-1}),\quad T = -J_n \hat x_3",
    source=("miklosovic2006", "han2009"),
    example={"inertia": 3.8623e-4, "corner": 400.0},
    State=State,
    linear=True,
    integrates=True,
)  # fmt: skip
