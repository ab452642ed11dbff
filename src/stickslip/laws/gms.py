"""Generalized Maxwell-slip (GMS): N elements that stick as springs and slip along s(v).

Stick: dF_i/dt = k_i v, until the load reaches alpha_i s(v). Slip: dF_i/dt = C (alpha_i sign(v) - F_i/s(v)),
until v passes through zero. F = sum F_i + sigma2 v. Thesis eqs. 2.16 to 2.19 (Tables 1 and 5), Lampaert et al.
2003, Al-Bender et al. 2005. The rule from stick to slip is `stickslip.laws.slip_rule`.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Elements, Law, Mode, Par
from stickslip.laws._viscous import VISCOUS
from stickslip.laws._viscous import linear as viscous
from stickslip.laws.sliding_curve import CURVE, extremes
from stickslip.laws.sliding_curve import stribeck as sliding
from stickslip.laws.sliding_curve import stribeck_scale as sliding_scale
from stickslip.laws.slip_rule import SLIP_RULE, switch
from stickslip.laws.slip_rule import signed as load_of


class Params(NamedTuple):
    """Parameters besides the sliding curve's, thesis Table 1."""

    k: Annotated[tuple[float, ...], Par("N·m/rad", "k_i", "stiffness of element i", positive=True)]
    alpha: Annotated[
        tuple[float, ...],
        Par("-", "alpha_i", "share of element i in s(v)", positive=True, upper=1.0, shares=True),
    ]
    c: Annotated[float, Par("N·m/s", "C", "attraction parameter", positive=True)]


class State(NamedTuple):
    """Internal state."""

    force: Annotated[tuple[float, ...], Par("N·m", "F_i", "torque of element i")]
    mode: Annotated[tuple[float, ...], Mode("-", "m_i", "0 sticks, +1 or -1 slips in that direction")]


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m; writes dF_i/dt, N·m/s. Thesis eqs. 2.16 to 2.18."""
    s = sliding(v, p)
    torque = viscous(v, p)
    for i in range(len(p.k)):
        torque += z.force[i]
        if z.mode[i] == 0.0:
            dz.force[i] = p.k[i] * v
        else:
            dz.force[i] = p.c * (p.alpha[i] * z.mode[i] - z.force[i] / s)
    return torque


def guards(v: float, z: Any, p: Any, u: Any, g: Any) -> None:
    """Write for each element the value that rises to zero where its mode ends."""
    s = sliding(v, p)
    direction = 1.0
    if v < 0.0:
        direction = -1.0
    for i in range(len(p.k)):
        if z.mode[i] == 0.0:
            g.mode[i] = load_of(direction, z.force[i]) / p.alpha[i] - s
            if v == 0.0:
                g.mode[i] = min(g.mode[i], -1e-300)
        else:
            g.mode[i] = -z.mode[i] * v


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m; thesis eq. 2.11."""
    total = 0.0
    for i in range(len(p.k)):
        total += p.alpha[i]
    if v > 0.0:
        return total * sliding(v, p) + viscous(v, p)
    if v < 0.0:
        return viscous(v, p) - total * sliding(v, p)
    return 0.0


def advance(v0: float, v1: float, dt: float, z: Any, p: Any) -> None:
    """Advance the elements over `dt` at velocities of one sign; exact at constant velocity.

    A sticking element that reaches its limit inside the step breaks away where the interpolated load meets
    it, and relaxes along the curve for the rest of the step.
    """
    vm = 0.5 * (v0 + v1)
    if vm == 0.0:
        return  # at rest every element holds, even one above a curve that rises with the velocity
    direction = 1.0
    if vm < 0.0:
        direction = -1.0
    s1 = sliding(v1, p)
    s0 = 0.0  # with the rate of slip, of use only where something slips
    rate_of_slip = 0.0
    known = 0.0  # elements that slip all the way share one exponent
    gain = 0.0
    follow = 0.0
    for i in range(len(p.k)):
        part = 1.0
        if z.mode[i] * direction < 0.0:
            z.mode[i] = 0.0
        if z.mode[i] == 0.0:
            stuck = z.force[i] + p.k[i] * vm * dt
            gap1 = p.alpha[i] * s1 - load_of(direction, stuck)
            if gap1 > 0.0:
                z.force[i] = stuck
                part = 0.0
        if part > 0.0:
            if s0 == 0.0:
                s0 = sliding(v0, p)
                rate_of_slip = p.c * dt / 6.0 * (1.0 / s0 + 4.0 / sliding(vm, p) + 1.0 / s1)
            start = s0
            if z.mode[i] == 0.0:
                stuck = z.force[i] + p.k[i] * vm * dt
                gap0 = p.alpha[i] * s0 - load_of(direction, z.force[i])
                gap1 = p.alpha[i] * s1 - load_of(direction, stuck)
                z.mode[i] = direction
                if gap0 > 0.0:
                    part = gap1 / (gap1 - gap0)
                    z.force[i] = z.force[i] + (1.0 - part) * (stuck - z.force[i])
                    start = s0 + (1.0 - part) * (s1 - s0)
            exponent = part * rate_of_slip
            if exponent != known:
                known = exponent
                gain = -math.expm1(-exponent)
                if exponent > 1e-4:
                    follow = 1.0 - gain / exponent
                else:
                    follow = 0.5 * exponent
            goal = p.alpha[i] * z.mode[i]
            z.force[i] = z.force[i] * (1.0 - gain) + goal * (start * gain + (s1 - start) * follow)


def stick(z: Any, p: Any) -> None:
    """Every element sticks: the velocity passes through zero."""
    for i in range(len(p.k)):
        z.mode[i] = 0.0


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m; advances the elements. A reversal is cut at v = 0."""
    if v0 * v1 < 0.0:
        part = dt * v0 / (v0 - v1)
        advance(v0, 0.0, part, z, p)
        stick(z, p)
        advance(0.0, v1, dt - part, z, p)
    else:
        if v0 == 0.0:
            stick(z, p)
        advance(v0, v1, dt, z, p)
    if v1 == 0.0:
        stick(z, p)
    torque = viscous(v1, p)
    for i in range(len(p.k)):
        torque += z.force[i]
    return torque


def sampled(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of a controller's sample, N·m; as `step`, but for a velocity that is held.

    Held, the velocity jumps between samples, and a sticking element may find itself beyond the curve: it broke away
    somewhere on the way there, and is put on the curve, as where it breaks away inside the sample.
    """
    if v0 == v1 and v0 != 0.0 and dt > 0.0:
        direction = math.copysign(1.0, v0)
        s = sliding(v0, p)
        for i in range(len(p.k)):
            load = load_of(direction, z.force[i])
            if z.mode[i] * direction <= 0.0 and load > p.alpha[i] * s:
                z.mode[i] = direction
                z.force[i] = math.copysign(p.alpha[i] * s, z.force[i])
    return step(v0, v1, dt, z, p, u)


def check(p: Any) -> str:
    """The shares make up the whole curve (thesis eq. 2.19)."""
    total = math.fsum(p.alpha)
    if abs(total - 1.0) > 1e-6:
        return f"alpha adds up to {total:g}; the shares of the elements add up to 1 (thesis eq. 2.19)"
    return ""


def modes(p: Any) -> Elements:
    """The law as it stands: this is the form itself."""
    return Elements(p.k, p.alpha, p.c, p.sigma2, sliding(0.0, p), sliding_scale(p))


def is_passive(p: Any) -> bool:
    """Whether a slipping element never gains: where s(v) rises as the axis slows down, F_i rises without work."""
    low, high = extremes(sliding, p, sliding_scale(p))
    return high - low <= 1e-12 * high


LAW = Law(
    "gms",
    Params,
    step,
    title="Generalized Maxwell-slip (GMS)",
    equation=r"F = \sum_i F_i + \sigma_2 v,\quad \dot F_i = k_i v \text{ (stick)},\quad "
    r"\dot F_i = C\left(\alpha_i\,\mathrm{sign}(v) - \frac{F_i}{s(v)}\right) \text{ (slip)}",
    source=("thesis eqs. 2.16 to 2.19", "lampaert2003", "albender2005"),
    example={  # thesis Table 1
        "k": [1e4, 7e3, 5e3, 3e3],
        "alpha": [0.25] * 4,
        "c": 24.0,
        "sigma2": 0.018,
        "fs": 0.335,
        "fc": 0.285,
        "vs": 0.01,
    },
    State=State,
    sampled=sampled,
    rate=rate,
    guards=guards,
    switch=switch,
    steady=steady,
    check=check,
    modes=modes,
    choices=(CURVE, VISCOUS, SLIP_RULE),
    passive="signed slip rule and constant s(v); else each stop may give back up to (F_S^2 - F_C^2) / (2 k)",
    is_passive=is_passive,
    non_local_memory=True,
)
