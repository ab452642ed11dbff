"""LuGre: the mean deflection z of elastic bristles.

dz/dt = v - sigma0 |v| z / s(v),  F = sigma0 z + sigma1 dz/dt + sigma2 v; thesis eqs. 2.8 to 2.10 (Table 4),
Canudas de Wit et al. 1995. Passive for sigma2 >= sigma1 (F_S - F_C)/F_C (Barabanov and Ortega 2000): a stiff contact
that is well damped while it sticks (sigma1 near 2 sqrt(sigma0 J)) is not. With sigma1 exp(-(v/v_d)^2) it is, as the
damping fades before the bristles slip (Olsson 1996).
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Bristle, Choice, Law, Option, Par
from stickslip.laws._viscous import VISCOUS
from stickslip.laws._viscous import linear as viscous
from stickslip.laws.sliding_curve import CURVE, GRID, extremes
from stickslip.laws.sliding_curve import stribeck as sliding
from stickslip.laws.sliding_curve import stribeck_scale as sliding_scale


class Params(NamedTuple):
    """Parameters besides the sliding curve's, thesis Table 4."""

    sigma0: Annotated[float, Par("N·m/rad", "sigma_0", "bristle stiffness", positive=True)]
    sigma1: Annotated[float, Par("N·m·s/rad", "sigma_1", "micro-viscous damping", lower=0.0, default=0.0)]


class State(NamedTuple):
    """Internal state."""

    z: Annotated[float, Par("rad", "z", "mean bristle deflection")]


# ---- micro-viscous damping -----------------------------------------------------------------------------------------


def constant(v: float, p: Any) -> float:
    """sigma_1, N·m·s/rad; thesis eq. 2.9."""
    return p.sigma1


class Fading(NamedTuple):
    """Parameter of fading damping."""

    vd: Annotated[float, Par("rad/s", "v_d", "velocity over which the damping fades", positive=True)]


def fading(v: float, p: Any) -> float:
    """sigma_1 exp(-(v/v_d)^2), N·m·s/rad; Olsson 1996."""
    return p.sigma1 * math.exp(-(v / p.vd) * (v / p.vd))


def fading_scale(p: Any) -> float:
    """The velocity over which it fades, rad/s."""
    return p.vd


DAMPING = Choice(
    "damping",
    replaces="damping",
    options={
        "constant": Option(constant),
        "fading": Option(
            fading, Fading, example={"vd": 1e-3}, velocity_scale=fading_scale, keeps_elements=False
        ),
    },
    default="constant",
    meaning="micro-viscous damping sigma1 over the velocity",
)
damping = constant


# ---- the law -------------------------------------------------------------------------------------------------------


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m; writes dz/dt, rad/s. Thesis eqs. 2.8, 2.9."""
    dz.z = v - p.sigma0 * abs(v) / sliding(v, p) * z.z
    return p.sigma0 * z.z + damping(v, p) * dz.z + viscous(v, p)


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m; thesis eq. 2.11."""
    if v > 0.0:
        return sliding(v, p) + viscous(v, p)
    if v < 0.0:
        return viscous(v, p) - sliding(v, p)
    return 0.0


def relax(v0: float, v1: float, dt: float, z: float, end: float, p: Any) -> float:
    """Deflection after `dt` at velocities of one sign, rad: exact where v is constant; `end` is s(v1), N·m.

    With q = |v|/s the equation reads dz/dt = sigma0 q (z_ss - z); z_ss is taken linear in time and the
    exponent by Simpson's rule, so that the bristle follows its steady value however large sigma0 q dt is.
    """
    vm = 0.5 * (v0 + v1)
    s0 = end
    s1 = end
    exponent = p.sigma0 * dt * abs(v0) / s0
    if v0 != v1:
        s0 = sliding(v0, p)
        exponent = p.sigma0 * dt / 6.0 * (abs(v0) / s0 + 4.0 * abs(vm) / sliding(vm, p) + abs(v1) / s1)
    if vm < 0.0:
        s0 = -s0
        s1 = -s1
    gain = -math.expm1(-exponent)
    rise = 0.0
    if s1 != s0:  # at constant velocity the division is spared
        follow = 0.5 * exponent
        if exponent > 1e-4:
            follow = 1.0 - gain / exponent
        rise = (s1 - s0) * follow
    return z * (1.0 - gain) + (s0 * gain + rise) / p.sigma0


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m; advances z.z. A reversal inside the step is cut at v = 0."""
    s1 = sliding(v1, p)
    if v0 * v1 < 0.0:
        part = dt * v0 / (v0 - v1)
        z.z = relax(v0, 0.0, part, z.z, sliding(0.0, p), p)
        z.z = relax(0.0, v1, dt - part, z.z, s1, p)
    else:
        z.z = relax(v0, v1, dt, z.z, s1, p)
    dz = v1 - p.sigma0 * abs(v1) / s1 * z.z
    return p.sigma0 * z.z + damping(v1, p) * dz + viscous(v1, p)


def sampled(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of a controller's sample, N·m; as `step`, in fewer operations where the velocity is held.

    exp takes half the time of expm1, and 1 - exp(-x) is as exact where the bristle goes more than half the way.
    """
    if v0 != v1:
        return step(v0, v1, dt, z, p, u)
    s = sliding(v1, p)
    exponent = p.sigma0 * dt * abs(v1) / s
    gain = 1.0  # the nearest number, far on
    if exponent <= 0.7:
        gain = -math.expm1(-exponent)
    elif exponent < 40.0:
        gain = 1.0 - math.exp(-exponent)
    z.z = z.z * (1.0 - gain) + math.copysign(s, v1) * gain / p.sigma0
    torque = p.sigma0 * z.z
    damped = damping(v1, p)
    if damped != 0.0:
        torque += damped * (v1 - p.sigma0 * abs(v1) / s * z.z)
    return torque + viscous(v1, p)


def stored(z: Any, p: Any) -> float:
    """Energy of the bristles, J."""
    return 0.5 * p.sigma0 * z.z * z.z


def is_passive(p: Any) -> bool:
    """Barabanov and Ortega's condition, necessary and sufficient for the curve of eq. 2.10.

    Of fading damping sigma1(v)^2 v <= 4 s(v) (sigma1(v) + sigma2) at every speed, sufficient by the energy stored.
    """
    low, high = extremes(sliding, p, sliding_scale(p))
    if p.sigma2 >= p.sigma1 * (high - low) / low:
        return True
    speeds = [x * sliding_scale(p) for x in GRID]
    if damping(speeds[-1], p) == p.sigma1:
        return False
    return all(damping(v, p) ** 2 * v <= 4.0 * sliding(v, p) * (damping(v, p) + p.sigma2) for v in speeds)


def modes(p: Any) -> Bristle:
    """The law as it stands, with F = sigma0 z."""
    return Bristle(p.sigma0, p.sigma1, p.sigma2, sliding(0.0, p), sliding_scale(p))


LAW = Law(
    "lugre",
    Params,
    step,
    title="LuGre",
    equation=r"\dot z = v - \sigma_0 \frac{|v|}{s(v)} z,\quad F = \sigma_0 z + \sigma_1 \dot z + \sigma_2 v",
    source=("thesis eqs. 2.8 to 2.10", "canudas1995", "barabanov2000", "olsson1996"),
    example={
        "sigma0": 3.5e4,
        "sigma1": 0.1,
        "sigma2": 0.018,
        "fs": 0.335,
        "fc": 0.285,
        "vs": 0.01,
    },  # Table 4
    State=State,
    sampled=sampled,
    rate=rate,
    steady=steady,
    modes=modes,
    choices=(CURVE, VISCOUS, DAMPING),
    passive="sigma2 >= sigma1 (fs - fc) / fc, or fading damping with sigma1(v)^2 v <= 4 s(v) (sigma1(v) + sigma2)",
    is_passive=is_passive,
    stored=stored,
)
