"""Disturbance observer: the torque that did not accelerate the nominal inertia, low-passed, is given back.

d = Q(s) (T - J dv/dt) with Q = g/(s + g), or its square. In exact discretisation it is the momentum observer of
robotics, with the other sign: one filter, two names. It is an integrator: against stiction it hunts at rest, as
the integral of a PID does, unless it is reset there.

The nominal inertia should be too small rather than too large, and its corner stays below what delay and inertia
error allow. It is handed the applied torque minus the feedforward: handed the whole, it would cancel the
feedforward exactly.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import REST, ControlLaw
from stickslip.core.spec import Choice, Option, Par

MOST_DELAY = 2.0


class Params(NamedTuple):
    """Nominal machine and corner."""

    inertia: Annotated[float, Par("kg·m²", "J_n", "nominal inertia", positive=True)]
    corner: Annotated[float, Par("1/s", "g", "corner of the low-pass Q", positive=True)]
    delay: Annotated[
        float,
        Par(
            "-",
            "d",
            "samples by which the torque acts later",
            lower=0.0,
            upper=MOST_DELAY,
            default=0.0,
            whole=True,
        ),
    ]


class State(NamedTuple):
    """Internal state."""

    estimate: Annotated[float, Par("N·m", "d", "estimated disturbance")]
    first: Annotated[float, Par("N·m", "d_1", "output of the first low-pass, where Q is of second order")]
    velocity: Annotated[float, Par("rad/s", "v", "velocity one sample ago")]
    error: Annotated[float, Par("rad", "e", "position error one sample ago")]
    torque_1: Annotated[float, Par("N·m", "", "torque one sample before the last")]
    torque_2: Annotated[float, Par("N·m", "", "torque two samples before the last")]
    torque_3: Annotated[float, Par("N·m", "", "torque three samples before the last")]
    weight: Annotated[float, Par("-", "", "1 - exp(-g T), by which the low-pass moves in a sample")]
    weight_at: Annotated[float, Par("-", "g T", "corner times sample time that it holds for")]


# ---- what it is fed with -----------------------------------------------------------------------------------------


def residual(y: Any) -> float:
    """The torque applied last minus the feedforward given with it, N·m."""
    return y.residual


def whole(y: Any) -> float:
    """The torque applied last, N·m: a feedforward is cancelled, and leaves a standing error."""
    return y.applied


FED_WITH = Choice(
    "fed_with",
    "handed",
    {"residual": Option(residual), "whole": Option(whole)},
    "residual",
    "the torque that the observer is handed",
)
handed = residual


def sample_torque(now: float, before: float) -> float:
    """The torque that was applied while the velocity changed, as the last command has it, N·m."""
    return now


def aligned_torque(now: float, before: float) -> float:
    """The mean of two commands: a difference of positions is the velocity half a sample ago, N·m."""
    return 0.5 * (now + before)


ALIGNED = Choice(
    "aligned",
    "acting",
    {"no": Option(sample_torque), "yes": Option(aligned_torque)},
    "no",
    "whether the torque is averaged as the velocity is, half a sample later",
)
acting = sample_torque


def exact(y: Any, p: Any) -> float:
    """1: the inertia weighs as the torque does."""
    return 1.0


def textbook(y: Any, p: Any) -> float:
    """Below 1: the form w - g J v of the textbooks takes the inertia for smaller the larger g T is."""
    return p.corner * y.elapsed / math.expm1(p.corner * y.elapsed)


FORM = Choice(
    "form",
    "weighed",
    {"exact": Option(exact), "textbook": Option(textbook)},
    "exact",
    "how the inertia weighs in a sample: exactly, or as in the auxiliary variable w of the textbooks",
)
weighed = exact


# ---- the low-pass Q ----------------------------------------------------------------------------------------------


def weight(y: Any, z: Any, p: Any) -> float:
    """1 - exp(-g T), computed where g T changes: an exponential costs as much as the rest of the law."""
    x = p.corner * y.elapsed
    if x != z.weight_at:
        z.weight_at = x
        z.weight = 1.0 - math.exp(-x)
    return z.weight


def first_order(raw: float, y: Any, z: Any, p: Any) -> float:
    """The next estimate by Q = g/(s + g), N·m."""
    share = weight(y, z, p)
    return z.estimate + share * (raw - z.estimate)


def second_order(raw: float, y: Any, z: Any, p: Any) -> float:
    """The next estimate by Q = g²/(s + g)², N·m: half the rejection, less noise, a larger stable corner."""
    share = weight(y, z, p)
    z.first += share * (raw - z.first)
    return z.estimate + share * (z.first - z.estimate)


ORDER = Choice(
    "order",
    "low_pass",
    {"first": Option(first_order), "second": Option(second_order)},
    "first",
    "order of the low-pass Q",
)
low_pass = first_order


# ---- at rest -----------------------------------------------------------------------------------------------------


def goes_on(y: Any, z: Any) -> float:
    """0: it estimates at rest as anywhere."""
    return 0.0


def reset(y: Any, z: Any) -> float:
    """1 where the error changes its sign at rest: then nothing is given, the feedforward included."""
    if y.rest >= REST and y.error * z.error <= 0.0 and z.error != 0.0:
        return 1.0
    return 0.0


AT_REST = Choice(
    "at_rest",
    "resets",
    {"goes_on": Option(goes_on), "reset": Option(reset, linear=False)},
    "goes_on",
    "what the estimate does while the reference stands still",
)
resets = goes_on


# ---- the law -----------------------------------------------------------------------------------------------------


def raw_torque(y: Any, z: Any, p: Any) -> float:
    """The torque that did not accelerate the nominal inertia, N·m."""
    given = handed(y)
    now = given
    before = z.torque_1
    if p.delay >= 1.0:
        now = z.torque_1
        before = z.torque_2
    if p.delay >= 2.0:
        now = z.torque_2
        before = z.torque_3
    z.torque_3 = z.torque_2
    z.torque_2 = z.torque_1
    z.torque_1 = given
    raw = acting(now, before) - weighed(y, p) * p.inertia * (y.velocity - z.velocity) / y.elapsed
    z.velocity = y.velocity
    return raw


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    raw = raw_torque(y, z, p)
    if resets(y, z) != 0.0:
        z.estimate = -y.feedforward
        z.first = -y.feedforward
    else:
        z.estimate = low_pass(raw, y, z, p)
    z.error = y.error
    return z.estimate


CONTROL_LAW = ControlLaw(
    "disturbance_observer", Params, sample, "observer",
    title="Disturbance observer",
    equation=r"T = Q(s)\,(T_m - J_n \dot v),\quad Q = \frac{g}{s + g}",
    source=("ohnishi1996", "deluca2003"),
    example={"inertia": 3.8623e-4, "corner": 400.0},
    State=State,
    linear=True,
    integrates=True,
    choices=(FED_WITH, ALIGNED, FORM, ORDER, AT_REST),
)  # fmt: skip
