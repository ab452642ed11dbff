"""A law whose names no PLC permits: two that differ by case, underscores, words of the norm; and truth as a number."""

import math
from typing import Annotated, NamedTuple

from stickslip.core.spec import Law, Par


class Params(NamedTuple):
    K: Annotated[float, Par("N·m·s/rad", "b", "slope", positive=True)]
    k: Annotated[float, Par("N·m", "c", "step", positive=True)]
    end_if: Annotated[float, Par("-", "", "one", positive=True)]
    a__b_: Annotated[float, Par("-", "", "one", positive=True)]
    Friction: Annotated[float, Par("-", "", "one", positive=True)]


class State(NamedTuple):
    time_: Annotated[float, Par("-", "", "steps with a velocity")]
    time: Annotated[float, Par("-", "", "steps")]


def __sign_(v):
    if v == 0.0:
        return 0.0
    return math.copysign(1.0, v)


def moves(v):
    return v != 0.0


def rests(v):
    if v == 0.0:
        return 1.0
    return 0.0


def count(v, z):
    z.time += 1.0
    if moves(v) and not rests(v):
        z.time_ += 1.0


def step(v0, v1, dt_, z, p, u):
    count(v1, z)
    done = dt_ >= 0.0
    Done = p.K * v1 * p.end_if
    if done and z.time >= z.time_:
        Done = Done + p.k * __sign_(v1) * p.a__b_ / p.Friction
    return Done


LAW = Law("hard-names", Params, step, title="Hard names", equation="F = b v + c sign(v)", source=("here",),
          example={"K": 0.1, "k": 0.3, "end_if": 1.0, "a__b_": 1.0, "Friction": 1.0}, State=State,
          passive="always")  # fmt: skip
