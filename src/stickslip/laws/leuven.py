"""Leuven, modified: LuGre's bristle with a hysteresis of non-local memory in the place of its spring.

dz/dt = v (1 - sign(r) |r|^delta_i) with r = F_h(z) sign(v) / s(v), F = F_h(z) + sigma1 dz/dt + sigma2 v; thesis eqs.
2.12 to 2.15, Lampaert et al. 2002. F_h is a Maxwell-slip hysteresis of z: element i is a spring k_i up to W_i. The
limits add up to the largest torque of s(v) or more, else the contact cannot reach it. Passive for
sigma2 >= sigma1 ((sum W_i / F_C)^delta_i - 1): LuGre's condition, to which it comes down for delta_i = 1 and
sum W_i = F_S.

The hysteresis has non-local memory in z. In the position it has not: dz/dx = 1 -+ |F_h/s|^delta_i differs on the two
branches of a loop, so that inner loops drift as LuGre's do, the less the larger delta_i.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Law, Mode, Par
from stickslip.laws._direction import direction_ends, direction_of
from stickslip.laws._viscous import VISCOUS
from stickslip.laws._viscous import linear as viscous
from stickslip.laws.sliding_curve import CURVE, extremes
from stickslip.laws.sliding_curve import stribeck as sliding
from stickslip.laws.sliding_curve import stribeck_scale as sliding_scale

GAMMA = 1.0 - math.sqrt(0.5)
"""Alexander's coefficient (1977): two stages of backward Euler, of second order and stable for any step."""
ROUNDING = 4.5e-16
"""Two units in the last place, of the travel without slip."""


class Params(NamedTuple):
    """Parameters besides the sliding curve's."""

    k: Annotated[tuple[float, ...], Par("N·m/rad", "k_i", "stiffness of element i", positive=True)]
    w: Annotated[
        tuple[float, ...],
        Par("N·m", "W_i", "torque at which element i slips", positive=True, directional=True),
    ]
    delta_i: Annotated[
        float, Par("-", "delta_i", "shape factor of the bristle's rate", lower=1.0, upper=20.0, default=1.0)
    ]
    sigma1: Annotated[float, Par("N·m·s/rad", "sigma_1", "micro-viscous damping", lower=0.0, default=0.0)]


class State(NamedTuple):
    """Internal state."""

    direction: Annotated[float, Mode("-", "m_v", "direction of motion, 0 at rest")]
    force: Annotated[tuple[float, ...], Par("N·m", "F_i", "torque of element i")]
    mode: Annotated[tuple[float, ...], Mode("-", "m_i", "0 sticks, +1 or -1 slips in that direction")]


def elements_torque(z: Any, p: Any) -> float:
    """F_h, N·m; thesis eq. 2.15."""
    total = 0.0
    for i in range(len(p.k)):
        total += z.force[i]
    return total


def highest(i: int, z: Any, p: Any) -> float:
    """Where element i stops rising, N·m. What it brought from a direction with a higher limit, it keeps at first."""
    return max(p.w[i], z.force[i])


def lowest(i: int, z: Any, p: Any) -> float:
    """Where element i stops falling, N·m."""
    return min(-p.w[i], z.force[i])


def torque_after(travel: float, z: Any, p: Any) -> float:
    """F_h after the bristle has moved by `travel`, rad, N·m; thesis eq. 2.14."""
    total = 0.0
    for i in range(len(p.k)):
        total += min(max(z.force[i] + p.k[i] * travel, lowest(i, z, p)), highest(i, z, p))
    return total


def bristle_rate(v: float, torque: float, p: Any) -> float:
    """dz/dt at the hysteresis torque `torque`, rad/s; thesis eq. 2.12."""
    r = direction_of(v) * torque / sliding(v, p)
    return v * (1.0 - math.copysign(abs(r) ** p.delta_i, r))


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m; writes dF_i/dt, N·m/s. Thesis eqs. 2.12, 2.13."""
    torque = elements_torque(z, p)
    pace = bristle_rate(v, torque, p)
    for i in range(len(p.k)):
        dz.force[i] = 0.0
        if z.mode[i] == 0.0:
            dz.force[i] = p.k[i] * pace
    return torque + p.sigma1 * pace + viscous(v, p)


def guards(v: float, z: Any, p: Any, u: Any, g: Any) -> None:
    """Write the values that rise to zero where the direction ends, or an element's mode."""
    g.direction = direction_ends(z.direction, v)
    pace = bristle_rate(v, elements_torque(z, p), p)
    direction = 1.0
    if pace < 0.0:
        direction = -1.0
    for i in range(len(p.k)):
        if z.mode[i] == 0.0:
            g.mode[i] = direction * z.force[i] - p.w[i]
            if pace == 0.0:  # a loaded element at rest holds
                g.mode[i] = min(g.mode[i], -1e-300)
        else:
            g.mode[i] = -z.mode[i] * pace


def switch(v: float, z: Any, p: Any, u: Any, g: Any) -> None:
    """Leave the modes whose guard is not negative."""
    if g.direction >= 0.0:
        z.direction = direction_of(v)
    direction = direction_of(bristle_rate(v, elements_torque(z, p), p))
    for i in range(len(p.k)):
        if g.mode[i] >= 0.0:
            if z.mode[i] == 0.0:
                z.mode[i] = direction
            else:
                z.mode[i] = 0.0


def backward_euler(base: float, v: float, dt: float, z: Any, p: Any) -> float:
    """Travel of the bristle with travel = base + dt dz/dt(travel), rad; the only solution, bracketed."""
    low = base
    f_low = -dt * bristle_rate(v, torque_after(low, z, p), p)
    if f_low == 0.0:
        return low
    # The rate falls with the travel in the direction of motion: the solution lies where it drives.
    high = base - f_low
    f_high = high - base - dt * bristle_rate(v, torque_after(high, z, p), p)
    if f_low * f_high > 0.0:
        return high
    close = ROUNDING * max(abs(base), dt * abs(v))
    for i in range(100):
        # The function rises at least as fast as the travel: the solution is no farther off than its value.
        if abs(f_high) <= close:
            break
        x = high - f_high * (high - low) / (f_high - f_low)
        if i % 4 == 3 or not min(low, high) < x < max(low, high):
            x = 0.5 * (low + high)
        f = x - base - dt * bristle_rate(v, torque_after(x, z, p), p)
        if f * f_high < 0.0:
            low = high
            f_low = f_high
        else:
            f_low *= 0.5
        high = x
        f_high = f
    return high


def advance(v0: float, v1: float, dt: float, z: Any, p: Any) -> None:
    """Advance the elements over `dt` at velocities of one sign."""
    first = backward_euler(0.0, v0 + GAMMA * (v1 - v0), GAMMA * dt, z, p)
    travel = backward_euler((1.0 - GAMMA) / GAMMA * first, v1, GAMMA * dt, z, p)
    for i in range(len(p.k)):
        force = z.force[i] + p.k[i] * travel
        z.mode[i] = 0.0
        if force >= highest(i, z, p):
            force = highest(i, z, p)
            z.mode[i] = 1.0
        elif force <= lowest(i, z, p):
            force = lowest(i, z, p)
            z.mode[i] = -1.0
        z.force[i] = force
    z.direction = direction_of(v0 + v1)


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m; advances the elements. A reversal inside the step is cut at v = 0."""
    if v0 * v1 < 0.0:
        part = dt * v0 / (v0 - v1)
        advance(v0, 0.0, part, z, p)
        advance(0.0, v1, dt - part, z, p)
    elif dt > 0.0:
        advance(v0, v1, dt, z, p)
    torque = elements_torque(z, p)
    return torque + p.sigma1 * bristle_rate(v1, torque, p) + viscous(v1, p)


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m; thesis eq. 2.11."""
    return direction_of(v) * sliding(v, p) + viscous(v, p)


def stored(z: Any, p: Any) -> float:
    """Energy of the elements' springs, J."""
    energy = 0.0
    for i in range(len(p.k)):
        energy += 0.5 * z.force[i] * z.force[i] / p.k[i]
    return energy


def check(p: Any) -> str:
    """The elements together carry the whole curve."""
    total = math.fsum(p.w)
    high = extremes(sliding, p, sliding_scale(p))[1]
    if total < high * (1.0 - 1e-9):
        return (
            f"w adds up to {total:g} N·m, below the curve's largest torque {high:g} N·m; the elements together "
            "carry at least that"
        )
    return ""


def is_passive(p: Any) -> bool:
    """LuGre's condition (Barabanov and Ortega) with the largest torque of the hysteresis over the lowest level."""
    low = extremes(sliding, p, sliding_scale(p))[0]
    return p.sigma2 >= p.sigma1 * ((math.fsum(p.w) / low) ** p.delta_i - 1.0)


LAW = Law(
    "leuven",
    Params,
    step,
    title="Leuven, modified",
    equation=r"\dot z = v\left(1 - \mathrm{sign}\left(\frac{F_h(z)}{s(v)\,\mathrm{sign}(v)}\right)"
    r"\left|\frac{F_h(z)}{s(v)}\right|^{\delta_i}\right),\quad F = F_h(z) + \sigma_1 \dot z + \sigma_2 v",
    source=("thesis eqs. 2.12 to 2.15", "lampaert2002", "swevers2000"),
    example={  # Table 1 of the thesis, with a quarter of the static torque to each element
        "k": [1e4, 7e3, 5e3, 3e3],
        "w": [0.08375] * 4,
        "delta_i": 1.0,
        "sigma1": 0.1,
        "sigma2": 0.018,
        "fs": 0.335,
        "fc": 0.285,
        "vs": 0.01,
    },
    State=State,
    rate=rate,
    guards=guards,
    switch=switch,
    steady=steady,
    check=check,
    stored=stored,
    choices=(CURVE, VISCOUS),
    passive="sigma2 >= sigma1 ((sum w / fc)^delta_i - 1)",
    is_passive=is_passive,
)
