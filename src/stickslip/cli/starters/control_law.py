"""PD with a filtered derivative and a smooth friction feedforward. A control law to begin from.

Save it as NAME.py, give the law that name at the end, and try it: `stickslip law NAME.py --check`. Use it in its place:
ss.Controller(loop=ss.ControlBlock("NAME.py", kp=5.0, kd=0.1, corner=600.0), sample_time=1e-3), or
loop = {law = "NAME.py", kp = 5.0, ...} in the table [controller] of a TOML file.

`sample` is plain Python with numbers, `if`, `for i in range(n)` and functions of `math` (the scalar subset). It reads
the loop's signals `y` and its parameters `p`, and writes its state `z` and local names alone. The signals with their
units: help("stickslip.core.control_spec"); more in docs/howto/own_control_law.md in the source of the package.
"""

import math
from typing import Annotated, Any, NamedTuple

from stickslip import Par
from stickslip.core.control_spec import ControlLaw


class Params(NamedTuple):
    """Unit, symbol, meaning and bounds of every parameter."""

    kp: Annotated[float, Par("N·m/rad", "k_p", "proportional gain", lower=0.0)]
    kd: Annotated[float, Par("N·m·s/rad", "k_d", "derivative gain", lower=0.0)]
    corner: Annotated[float, Par("1/s", "omega_f", "corner of the filter of the derivative", positive=True)]
    fc: Annotated[float, Par("N·m", "F_C", "Coulomb torque", lower=0.0, default=0.0)]
    vs: Annotated[
        float, Par("rad/s", "v_s", "velocity over which its sign is smoothed", positive=True, default=0.1)
    ]


class State(NamedTuple):
    """What the law keeps from sample to sample; 0 at the start."""

    rate: Annotated[float, Par("rad/s", "", "filtered rate of the error")]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque of this sample, N·m."""
    rate = y.reference_velocity - y.velocity
    if y.started == 0.0:
        z.rate = rate
    z.rate += (1.0 - math.exp(-p.corner * y.elapsed)) * (rate - z.rate)
    return p.kp * y.error + p.kd * z.rate + p.fc * math.tanh(y.reference_velocity / p.vs)


CONTROL_LAW = ControlLaw(
    "control_law",
    Params,
    sample,
    "loop",
    title="PD with a filtered derivative and a smooth friction feedforward",
    equation=r"T = k_p e + k_d \dot e_f + F_C \tanh(\dot\theta_d / v_s)",
    source=(),
    example={"kp": 6.1, "kd": 0.097, "corner": 600.0, "fc": 0.28, "vs": 0.1},
    State=State,
)
