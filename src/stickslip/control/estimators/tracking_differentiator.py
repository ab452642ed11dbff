"""Tracking differentiator: follows the position as fast as a bounded acceleration can, without overshoot.

Steps of the position larger than the acceleration can follow (a glitch, a count) reach the velocity rounded off. Below
a speed of acceleration times window it is a critically damped filter with both poles at 1/window.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    """How fast it follows."""

    acceleration: Annotated[
        float, Par("rad/s²", "r", "largest acceleration with which it follows", positive=True)
    ]
    window: Annotated[
        float, Par("s", "h_0", "time constant of small motion; at least two samples are taken", positive=True)
    ]


class State(NamedTuple):
    """Internal state."""

    ahead: Annotated[float, Par("rad", "", "followed minus measured position")]
    velocity: Annotated[float, Par("rad/s", "v", "followed velocity")]


def fastest(distance: float, velocity: float, acceleration: float, window: float) -> float:
    """Acceleration that brings distance and velocity to rest in the shortest time, by steps of the window, rad/s²."""
    most = acceleration * window
    y = distance + window * velocity
    a = velocity + y / window
    if abs(y) > window * most:
        root = math.sqrt(most * most + 8.0 * acceleration * abs(y))
        a = velocity + math.copysign(0.5 * (root - most), y)
    if abs(a) > most:
        return -math.copysign(acceleration, a)
    return -acceleration * a / most


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Velocity, rad/s."""
    window = max(p.window, 2.0 * y.elapsed)
    z.ahead -= y.moved
    pull = fastest(z.ahead, z.velocity, p.acceleration, window)
    z.ahead += y.elapsed * z.velocity
    z.velocity += y.elapsed * pull
    return z.velocity


def delay(p: Any, sample_time: float) -> float:
    """At low frequency, below a speed of acceleration times window, s."""
    return 2.0 * max(p.window, 2.0 * sample_time) - 1.5 * sample_time


CONTROL_LAW = ControlLaw(
    "tracking_differentiator", Params, sample, "estimator",
    title="Tracking differentiator",
    equation=r"\dot v_1 = v_2,\quad \dot v_2 = \mathrm{fhan}(v_1 - \theta, v_2, r, h_0)",
    source=("han2009",),
    example={"acceleration": 2000.0, "window": 0.004},
    State=State,
    delay=delay,
)  # fmt: skip
