"""A torque in the direction of the error where the axis stands: just below break-away, it leaves little to the loop."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    """How much, and where."""

    torque: Annotated[
        float, Par("N·m", "T_p", "largest torque; above break-away it may cycle", positive=True)
    ]
    error: Annotated[float, Par("rad", "e_p", "error from which it is given whole", positive=True)]
    speed: Annotated[float, Par("rad/s", "v_p", "speed from which nothing is given", positive=True)]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    still = min(max(1.0 - abs(y.slow_velocity) / p.speed, 0.0), 1.0)
    return p.torque * min(max(y.error / p.error, -1.0), 1.0) * still


CONTROL_LAW = ControlLaw(
    "stiction_push", Params, sample, "observer",
    title="Push against stiction",
    equation=r"T = T_p\,\mathrm{sat}(e/e_p)\,\max(0, 1 - |v_f|/v_p)",
    source=("own",),
    example={"torque": 0.3, "error": 2e-3, "speed": 0.02},
)  # fmt: skip
