"""A law whose names are words of other languages, and whose loop counts to a constant of its file."""

from typing import Annotated, NamedTuple

from stickslip.core.spec import Law, Par

PIECES = 3


class Params(NamedTuple):
    register: Annotated[float, Par("N·m·s/rad", "b", "slope", positive=True)]
    INFINITY: Annotated[float, Par("N·m·s/rad", "b_0", "slope, a macro of C", default=0.01)]
    errno: Annotated[float, Par("N·m·s/rad", "b_1", "slope, a macro of C", default=0.02)]
    end_if: Annotated[float, Par("N·m·s/rad", "b_2", "slope, a word of structured text", default=0.03)]


def torque(end, double, p):
    total = 0.0
    for default in range(PIECES):
        total += p.register * end / PIECES + 0.0 * default * double
    PI = p.INFINITY + p.errno
    NAN = p.end_if
    return total + (PI + NAN) * end


def step(v0, v1, dt, z, p, u):
    return torque(v1, v0, p)


def steady(v, p):
    return torque(v, 0.0, p)


LAW = Law("odd-names", Params, step, title="Odd names", equation="F = b v", source=("here",),
          example={"register": 0.1, "INFINITY": 0.01, "errno": 0.02, "end_if": 0.03},
          steady=steady, passive="always")  # fmt: skip
