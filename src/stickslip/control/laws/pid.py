"""PID with a choice of what the integral does at the torque limit, and at rest; thesis eq. 3.11.

The integral is a sum of trapezoids. At the limit it rests (conditional integration) or is driven back by what
the limit took off (back-calculation). Stiction and an integral alone hunt for ever: at rest the integral may be
reset where the error changes its sign (Clegg's integrator), or stop inside a dead band.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.control.linear import Gains, place
from stickslip.control.linear import pid as gains_of
from stickslip.core.control_spec import REST, ControlLaw
from stickslip.core.spec import Choice, Option, Par


class Params(NamedTuple):
    """Gains, thesis eq. 3.15."""

    kp: Annotated[float, Par("N·m/rad", "k_p", "proportional gain", lower=0.0)]
    ki: Annotated[float, Par("N·m/(rad·s)", "k_i", "integral gain", positive=True)]
    kd: Annotated[float, Par("N·m·s/rad", "k_d", "gain on the velocity error", lower=0.0)]


class State(NamedTuple):
    """Internal state."""

    integral: Annotated[float, Par("rad·s", "I", "integral of the position error")]
    error: Annotated[float, Par("rad", "e", "position error one sample ago")]


# ---- at the torque limit -----------------------------------------------------------------------------------------


def conditional(growth: float, torque: float, y: Any, z: Any, p: Any) -> float:
    """The growth that the limit admits, rad·s: none where the torque would be driven further beyond it."""
    whole = torque + p.ki * (z.integral + growth) + y.others
    if abs(whole) > y.torque_limit and whole * growth > 0.0:
        return 0.0
    return growth


class Tracking(NamedTuple):
    """Parameter of the back-calculation."""

    tracking_time: Annotated[
        float, Par("s", "T_t", "time in which the limit drives the integral back", positive=True)
    ]


def back_calculation(growth: float, torque: float, y: Any, z: Any, p: Any) -> float:
    """The growth minus what the limit took off the last torque, over the tracking time, rad·s."""
    return growth + y.elapsed * (y.applied - y.commanded) / (p.ki * p.tracking_time)


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


# ---- at rest -----------------------------------------------------------------------------------------------------


def goes_on(growth: float, y: Any, z: Any, p: Any) -> float:
    """Integrates at rest as anywhere, rad·s."""
    return growth


class Reset(NamedTuple):
    """Parameter of the reset."""

    kept: Annotated[
        float,
        Par("-", "alpha", "share of the integral kept, sign changed", lower=0.0, upper=1.0, default=0.0),
    ]


def reset(growth: float, y: Any, z: Any, p: Any) -> float:
    """Where the error changes its sign at rest, the integral begins anew; else the growth, rad·s."""
    if y.rest >= REST and y.error * z.error <= 0.0 and z.error != 0.0:
        z.integral = -p.kept * z.integral
        return 0.0
    return growth


class Band(NamedTuple):
    """Parameter of the dead band."""

    dead_band: Annotated[float, Par("rad", "e_db", "error below which nothing is integrated", lower=0.0)]


def dead_band(growth: float, y: Any, z: Any, p: Any) -> float:
    """No growth at rest inside the band, rad·s."""
    if y.rest >= REST and abs(y.error) <= p.dead_band:
        return 0.0
    return growth


AT_REST = Choice(
    "at_rest",
    "rested",
    {
        "goes_on": Option(goes_on),
        "reset": Option(reset, Reset, linear=False),
        "dead_band": Option(dead_band, Band, example={"dead_band": 2e-4}, linear=False),
    },
    "goes_on",
    "what the integral does while the reference stands still",
)
rested = goes_on


# ---- the law -----------------------------------------------------------------------------------------------------


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    growth = 0.0
    if y.started != 0.0:
        growth = 0.5 * y.elapsed * (y.error + z.error)
    growth = rested(growth, y, z, p)
    z.error = y.error
    torque = p.kp * y.error + p.kd * (y.reference_velocity - y.velocity)
    growth = admitted(growth, torque, y, z, p)
    z.integral += growth
    return torque + p.ki * z.integral


def take_over(missing: float, y: Any, z: Any, p: Any, u: Any) -> float:
    """The integral takes it all."""
    z.integral += missing / p.ki
    return 0.0


def placed(inertia: float, bandwidth: float, damping: float) -> dict[str, float]:
    """Thesis eq. 3.15."""
    gains = place("PID", inertia, bandwidth, damping)
    return {"kp": gains.kp, "ki": gains.ki, "kd": gains.kd}


def continuous(p: Any) -> Gains:
    """The same in continuous time."""
    return gains_of(p.kp, p.ki, p.kd)


CONTROL_LAW = ControlLaw(
    "pid", Params, sample, "loop",
    title="PID",
    equation=r"T = k_p e + k_i \int e\,dt + k_d (\dot\theta_d - v)",
    source=("thesis eq. 3.11", "astrom1995", "clegg1958"),
    example={"kp": 18.297, "ki": 766.4, "kd": 0.1456},
    State=State,
    take_over=take_over,
    continuous=continuous,
    placed=placed,
    linear=True,
    integrates=True,
    choices=(ANTI_WINDUP, AT_REST),
)  # fmt: skip
