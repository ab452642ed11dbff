"""PR: proportional to the position error with rate feedback of the measured velocity; thesis eq. 3.4."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.control.linear import Gains, place
from stickslip.control.linear import pr as gains_of
from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    """Gains, thesis eq. 3.10."""

    kp: Annotated[float, Par("N·m/rad", "k_p", "proportional gain", lower=0.0)]
    kd: Annotated[float, Par("N·m·s/rad", "k_d", "gain on the measured velocity", lower=0.0)]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    return p.kp * y.error - p.kd * y.velocity


def placed(inertia: float, bandwidth: float, damping: float) -> dict[str, float]:
    """Thesis eq. 3.10."""
    gains = place("PR", inertia, bandwidth, damping)
    return {"kp": gains.kp, "kd": gains.kd}


def continuous(p: Any) -> Gains:
    """The same in continuous time."""
    return gains_of(p.kp, p.kd)


CONTROL_LAW = ControlLaw(
    "pr", Params, sample, "loop",
    title="PR",
    equation=r"T = k_p e - k_d v",
    source=("thesis eq. 3.4",),
    example={"kp": 6.099, "kd": 0.097067},
    continuous=continuous,
    placed=placed,
    linear=True,
)  # fmt: skip
