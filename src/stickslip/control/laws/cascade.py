"""Position P around velocity PI, the cascade of most drives.

The integral is a sum of rectangles of the velocity error. At the torque limit it rests where that would drive the
torque further (conditional integration), or is driven back by what the limit took off (back-calculation).
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Choice, Option, Par


class Params(NamedTuple):
    """Gains of both loops."""

    kv: Annotated[float, Par("1/s", "K_v", "gain of the position loop", lower=0.0)]
    kvp: Annotated[float, Par("N·m·s/rad", "K_p", "gain of the velocity loop", lower=0.0)]
    kvi: Annotated[
        float,
        Par("N·m/rad", "K_i", "integral gain of the velocity loop, kvp over its reset time", lower=0.0),
    ]
    feed: Annotated[
        float, Par("-", "f", "part of the reference velocity that is fed forward", lower=0.0, default=1.0)
    ]


class State(NamedTuple):
    """Internal state."""

    integral: Annotated[float, Par("rad", "I", "integral of the velocity error")]


def conditional(growth: float, whole: float, y: Any, p: Any) -> float:
    """The growth that is kept, rad: none where the limit holds back a torque that it drives further."""
    if abs(whole) > y.torque_limit and whole * growth > 0.0:
        return 0.0
    return growth


class Tracking(NamedTuple):
    """Parameter of the back-calculation."""

    tracking_time: Annotated[
        float, Par("s", "T_t", "time in which the limit drives the integral back", positive=True)
    ]


def back_calculation(growth: float, whole: float, y: Any, p: Any) -> float:
    """The growth minus what the limit took off the last torque, over the tracking time, rad."""
    if p.kvi <= 0.0:
        return growth
    return growth + y.elapsed * (y.applied - y.commanded) / (p.kvi * p.tracking_time)


ANTI_WINDUP = Choice(
    "anti_windup",
    "admitted",
    {
        "conditional": Option(conditional),
        "back_calculation": Option(back_calculation, Tracking, example={"tracking_time": 0.02}),
    },
    "conditional",
    "what the integral does while the torque is at its limit",
)
admitted = conditional


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    error = p.kv * y.error + p.feed * y.reference_velocity - y.velocity
    growth = y.elapsed * error
    torque = p.kvp * error + p.kvi * (z.integral + growth)
    z.integral += admitted(growth, torque + y.others, y, p)
    return torque


def take_over(missing: float, y: Any, z: Any, p: Any, u: Any) -> float:
    """The integral takes it all, where there is one."""
    if p.kvi > 0.0:
        z.integral += missing / p.kvi
        return 0.0
    return missing


CONTROL_LAW = ControlLaw(
    "cascade", Params, sample, "loop",
    title="Position P around velocity PI",
    equation=r"T = K_p e_v + K_i \int e_v\,dt,\quad e_v = K_v e + f \dot\theta_d - v",
    source=("astrom1995",),
    example={"kv": 62.8, "kvp": 0.097067, "kvi": 3.0, "feed": 1.0},
    State=State,
    take_over=take_over,
    linear=True,
    integrates=True,
    choices=(ANTI_WINDUP,),
)  # fmt: skip
