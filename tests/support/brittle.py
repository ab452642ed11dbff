"""A law whose torque is not a number beyond a speed: a compensator that fails inside the compiled loop."""

import math
from typing import Annotated, NamedTuple

from stickslip.core.spec import Law, Par


class Params(NamedTuple):
    fc: Annotated[float, Par("N·m", "F_C", "Coulomb torque", positive=True)]
    vmax: Annotated[float, Par("rad/s", "v_max", "speed beyond which the square root fails", positive=True)]


def step(v0, v1, dt, z, p, u):
    return math.copysign(p.fc * math.sqrt(p.vmax - abs(v1)), v1)


LAW = Law(
    "brittle", Params, step, title="Brittle", equation="F = F_C", source=("thesis eq. 2.1",),
    example={"fc": 0.1, "vmax": 1.0},
)  # fmt: skip
