"""Elasto-plastic friction: a bristle that only bends up to its break-away deflection z_ba, and slides beyond.

dz/dt = v (1 - alpha(z, v) sign(v) z / z_ss(v)),  F = sigma0 z + sigma1 dz/dt + sigma2 v, z_ss(v) = s(v)/sigma0; Dupont,
Hayward, Armstrong and Altpeter 2002. alpha is 0 up to z_ba and where z and v differ in sign, rises as a half sine
between z_ba and z_ss(v), and is 1 beyond. With alpha = 1 everywhere it is LuGre; because alpha is 0 up to z_ba a
load that oscillates below sigma0 z_ba does not move the contact for good, where LuGre drifts.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Bristle, Law, Par
from stickslip.laws._viscous import VISCOUS
from stickslip.laws._viscous import linear as viscous
from stickslip.laws.sliding_curve import CURVE, extremes
from stickslip.laws.sliding_curve import stribeck as sliding
from stickslip.laws.sliding_curve import stribeck_scale as sliding_scale

SUBSTEP = 0.05
"""Length of a substep between z_ba and z_ss over the length on which the bristle's rate changes."""
SETTLED = 1e-5
"""Distance from the steady value, over z_ss - z_ba, below which its equation counts as linear."""


class Params(NamedTuple):
    """Parameters besides the sliding curve's, Dupont et al. 2002."""

    sigma0: Annotated[float, Par("N·m/rad", "sigma_0", "bristle stiffness", positive=True)]
    sigma1: Annotated[float, Par("N·m·s/rad", "sigma_1", "micro-viscous damping", lower=0.0, default=0.0)]
    z_ba: Annotated[float, Par("rad", "z_ba", "break-away deflection: elastic up to it", positive=True)]


class State(NamedTuple):
    """Internal state."""

    z: Annotated[float, Par("rad", "z", "mean bristle deflection")]


def growth(y: float, limit: float, p: Any) -> float:
    """dy/dx of a deflection y >= 0 (rad) in the direction of motion, with z_ss(v) = `limit`."""
    if y <= p.z_ba:
        return 1.0
    if y >= limit:
        return 1.0 - y / limit
    alpha = 0.5 - 0.5 * math.cos(math.pi * (y - p.z_ba) / (limit - p.z_ba))
    return 1.0 - alpha * y / limit


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m; writes dz/dt, rad/s."""
    dz.z = v
    if v * z.z > 0.0:
        dz.z = v * growth(abs(z.z), sliding(v, p) / p.sigma0, p)
    return p.sigma0 * z.z + p.sigma1 * dz.z + viscous(v, p)


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m: that of LuGre."""
    if v > 0.0:
        return sliding(v, p) + viscous(v, p)
    if v < 0.0:
        return viscous(v, p) - sliding(v, p)
    return 0.0


def slide(x: float, y: float, first: float, last: float) -> float:
    """Deflection after a displacement `x`, rad, with alpha = 1, z_ss from `first` to `last`: exact at constant z_ss."""
    exponent = 2.0 * x / (first + last)
    gain = -math.expm1(-exponent)
    if exponent > 1e-4:
        follow = 1.0 - gain / exponent
    else:
        follow = 0.5 * exponent
    return y * (1.0 - gain) + first * gain + (last - first) * follow


def lag(slope: float, limit: float, p: Any) -> float:
    """e = 1 - y/z_ss behind a z_ss with dz_ss/dx = `slope` > 0: the root of e (1 + slope) + curvature e^2 = slope."""
    width = (limit - p.z_ba) / limit
    curvature = 0.25 * math.pi * math.pi / (width * width)
    one = 1.0 + slope
    return 2.0 * slope / (one + math.sqrt(one * one + 4.0 * curvature * slope))


def settle(x: float, y: float, first: float, last: float, slope: float, p: Any) -> float:
    """Deflection after a displacement `x`, rad, from near its steady value."""
    if slope <= 0.0:
        return slide(x, y, first, last)
    goal = lag(slope, last, p)
    return last * (1.0 - goal - (1.0 - y / first - goal) * math.exp(-2.0 * x / (first + last)))


def substep(y: float, limit: float, slope: float, p: Any) -> float:
    """Displacement over which dy/dx changes little, rad: short where alpha is steep, also for z_ba close to z_ss."""
    width = limit - p.z_ba
    return SUBSTEP * width / (5.0 * max(limit - y, 0.0) / width + width / limit + 0.25 * abs(slope))


def slip(x: float, y: float, first: float, last: float, p: Any) -> float:
    """Deflection after a displacement `x`, rad, from y >= z_ba, while z_ss runs linearly from `first` to `last`.

    Between z_ba and z_ss there is no closed form: Runge-Kutta steps over the displacement, whatever the velocity, until
    the bristle has settled.
    """
    slope = (last - first) / x
    rest = x
    limit = first
    for _ in range(400):
        if slope <= 0.0:
            settled = limit - y < SETTLED * (limit - p.z_ba)
        else:
            settled = abs(limit * (1.0 - lag(slope, limit, p)) - y) < SETTLED * (limit - p.z_ba)
        if settled or rest <= 0.0:
            break
        h = min(substep(y, limit, slope, p), rest)
        after = last - slope * (rest - h)
        middle = 0.5 * (limit + after)
        k1 = growth(y, limit, p)
        k2 = growth(y + 0.5 * h * k1, middle, p)
        k3 = growth(y + 0.5 * h * k2, middle, p)
        k4 = growth(y + h * k3, after, p)
        y += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        rest -= h
        limit = after
    if rest > 0.0:
        return settle(rest, y, limit, last, slope, p)
    return y


def move(v0: float, v1: float, dt: float, z: Any, p: Any) -> None:
    """Move the contact at velocities of one sign. Up to z_ba the bristle takes all of the displacement: exact."""
    x = 0.5 * abs(v0 + v1) * dt
    direction = math.copysign(1.0, v0 + v1)
    y = direction * z.z
    free = p.z_ba - y
    if x <= free:
        z.z = direction * (y + x)
    elif x > 0.0:
        v = v0
        if free > 0.0:
            v = math.sqrt(max(v0 * v0 + (v1 * v1 - v0 * v0) * (free / x), 0.0))
            y = p.z_ba
            x -= free
        z.z = direction * slip(x, y, sliding(v, p) / p.sigma0, sliding(v1, p) / p.sigma0, p)


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m; advances z.z. A reversal inside the step is cut at v = 0."""
    if v0 * v1 < 0.0:
        part = dt * v0 / (v0 - v1)
        move(v0, 0.0, part, z, p)
        move(0.0, v1, dt - part, z, p)
    else:
        move(v0, v1, dt, z, p)
    dz = v1
    if v1 * z.z > 0.0:
        dz = v1 * growth(abs(z.z), sliding(v1, p) / p.sigma0, p)
    return p.sigma0 * z.z + p.sigma1 * dz + viscous(v1, p)


def stored(z: Any, p: Any) -> float:
    """Energy of the bristles, J."""
    return 0.5 * p.sigma0 * z.z * z.z


def is_passive(p: Any) -> bool:
    """Our own derivation, sufficient: with alpha <= 1 and |z| <= max s/sigma0, sigma1 v dz/dt + sigma2 v^2 >= 0."""
    low, high = extremes(sliding, p, sliding_scale(p))
    return p.sigma2 >= p.sigma1 * (high - low) / low


def modes(p: Any) -> Bristle:
    """The law as it stands, with F = sigma0 z."""
    force = p.sigma0 * p.z_ba
    return Bristle(
        p.sigma0, p.sigma1, p.sigma2, sliding(0.0, p), sliding_scale(p), own_growth=True, elastic=force
    )


def check(p: Any) -> str:
    """The bristle breaks away before it slides, at every velocity."""
    low, _ = extremes(sliding, p, sliding_scale(p))
    if p.z_ba * p.sigma0 >= low:
        return f"z_ba = {p.z_ba:g} rad must lie below the smallest s(v)/sigma0, {low / p.sigma0:.4g} rad"
    return ""


LAW = Law(
    "elasto_plastic",
    Params,
    step,
    title="Elasto-plastic",
    equation=r"\dot z = v \left(1 - \alpha(z, v)\,\frac{\sigma_0\,\mathrm{sign}(v)}{s(v)} z\right),\quad "
    r"F = \sigma_0 z + \sigma_1 \dot z + \sigma_2 v",
    source=("dupont2002", "thesis eq. 2.10"),
    example={
        "sigma0": 3.5e4,
        "sigma1": 0.1,
        "sigma2": 0.018,
        "z_ba": 4e-6,  # below the smallest s(v)/sigma0 of every curve
        "fs": 0.335,
        "fc": 0.285,
        "vs": 0.01,
    },  # Table 4
    State=State,
    rate=rate,
    steady=steady,
    modes=modes,
    growth=growth,
    check=check,
    choices=(CURVE, VISCOUS),
    passive="sigma2 >= sigma1 (fs - fc) / fc",
    is_passive=is_passive,
    stored=stored,
)
