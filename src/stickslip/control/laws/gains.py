"""Four gains of your own: on the error, its integral, the measured velocity and that of the reference; thesis eq. 3.3.

PR, PD and PID are cases of it; what lies between them (a PID that feeds half the reference velocity) is here.
The integral is a sum of trapezoids and rests at the torque limit where it would go further.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.control.linear import Gains
from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    """The gains."""

    kp: Annotated[float, Par("N·m/rad", "k_p", "proportional gain", lower=0.0)]
    ki: Annotated[float, Par("N·m/(rad·s)", "k_i", "integral gain", lower=0.0, default=0.0)]
    kd: Annotated[float, Par("N·m·s/rad", "k_d", "gain on the measured velocity", lower=0.0, default=0.0)]
    kr: Annotated[float, Par("N·m·s/rad", "k_r", "gain on the reference velocity", lower=0.0, default=0.0)]


class State(NamedTuple):
    """Internal state."""

    integral: Annotated[float, Par("rad·s", "I", "integral of the position error")]
    error: Annotated[float, Par("rad", "e", "position error one sample ago")]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    growth = 0.0
    if y.started != 0.0:
        growth = 0.5 * y.elapsed * (y.error + z.error)
    z.error = y.error
    torque = p.kp * y.error + p.kr * y.reference_velocity - p.kd * y.velocity + p.ki * (z.integral + growth)
    whole = torque + y.others
    if not (abs(whole) > y.torque_limit and whole * growth > 0.0):
        z.integral += growth
    return torque


def take_over(missing: float, y: Any, z: Any, p: Any, u: Any) -> float:
    """The integral takes it all, where there is one."""
    if p.ki > 0.0:
        z.integral += missing / p.ki
        return 0.0
    return missing


def continuous(p: Any) -> Gains:
    """The same in continuous time."""
    return Gains(p.kp, p.ki, p.kd, p.kr)


CONTROL_LAW = ControlLaw(
    "gains", Params, sample, "loop",
    title="Four gains",
    equation=r"T = k_p e + k_i \int e\,dt + k_r \dot\theta_d - k_d v",
    source=("thesis eq. 3.3", "astrom1995"),
    example={"kp": 18.297, "ki": 766.4, "kd": 0.1456, "kr": 0.0728},
    State=State,
    take_over=take_over,
    continuous=continuous,
    linear=True,
    integrates=True,
)  # fmt: skip
