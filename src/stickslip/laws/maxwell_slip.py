"""Maxwell-slip: N elements that stick as springs and slip at a constant level.

dF_i/dt = k_i v while |F_i| < W_i, else F_i = W_i sign(v); F = sum F_i + sigma2 v. Thesis eqs. 2.14 and 2.15 with
xi_i = x - F_i / k_i (Iwan 1966, Lampaert et al. 2003). A hysteresis of the position alone, with non-local memory:
inner loops close, and the outer curve is resumed where it was left.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Elements, Law, Mode, Par
from stickslip.laws._viscous import VISCOUS
from stickslip.laws._viscous import linear as viscous
from stickslip.laws.slip_rule import switch


class Params(NamedTuple):
    """Parameters of the elements, thesis eq. 2.14."""

    k: Annotated[tuple[float, ...], Par("N·m/rad", "k_i", "stiffness of element i", positive=True)]
    w: Annotated[
        tuple[float, ...],
        Par("N·m", "W_i", "torque at which element i slips", positive=True, directional=True),
    ]


class State(NamedTuple):
    """Internal state."""

    force: Annotated[tuple[float, ...], Par("N·m", "F_i", "torque of element i")]
    mode: Annotated[tuple[float, ...], Mode("-", "m_i", "0 sticks, +1 or -1 slips in that direction")]


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m; writes dF_i/dt, N·m/s."""
    torque = viscous(v, p)
    for i in range(len(p.k)):
        torque += z.force[i]
        dz.force[i] = 0.0
        if z.mode[i] == 0.0:
            dz.force[i] = p.k[i] * v
    return torque


def guards(v: float, z: Any, p: Any, u: Any, g: Any) -> None:
    """Write for each element the value that rises to zero where its mode ends."""
    direction = 1.0
    if v < 0.0:
        direction = -1.0
    for i in range(len(p.k)):
        if z.mode[i] == 0.0:
            g.mode[i] = direction * z.force[i] - p.w[i]
            if v == 0.0:  # a loaded element at rest holds
                g.mode[i] = min(g.mode[i], -1e-300)
        else:
            g.mode[i] = -z.mode[i] * v


def slide(distance: float, z: Any, p: Any) -> None:
    """Move the elements by `distance`, rad, in one direction: exact, whatever the velocity."""
    for i in range(len(p.k)):
        force = z.force[i] + p.k[i] * distance
        if distance != 0.0:
            z.mode[i] = 0.0
        if distance > 0.0 and force >= p.w[i]:
            force = p.w[i]
            z.mode[i] = 1.0
        elif distance < 0.0 and force <= -p.w[i]:
            force = -p.w[i]
            z.mode[i] = -1.0
        z.force[i] = force


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m: exact. A reversal inside the step is cut at v = 0."""
    if v0 * v1 < 0.0:
        part = dt * v0 / (v0 - v1)
        slide(0.5 * v0 * part, z, p)
        slide(0.5 * v1 * (dt - part), z, p)
    else:
        slide(0.5 * (v0 + v1) * dt, z, p)
    torque = viscous(v1, p)
    for i in range(len(p.k)):
        torque += z.force[i]
    return torque


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m."""
    total = 0.0
    for i in range(len(p.k)):
        total += p.w[i]
    if v > 0.0:
        return total + viscous(v, p)
    if v < 0.0:
        return viscous(v, p) - total
    return 0.0


def stored(z: Any, p: Any) -> float:
    """Energy of the springs, J."""
    energy = 0.0
    for i in range(len(p.k)):
        energy += 0.5 * z.force[i] * z.force[i] / p.k[i]
    return energy


def modes(p: Any) -> Elements:
    """The law as it stands: elements whose curve is constant and met at once."""
    total = math.fsum(p.w)
    shares = tuple(w / total for w in p.w)
    return Elements(p.k, shares, math.inf, p.sigma2, total, 0.0, constant_curve=True)


LAW = Law(
    "maxwell_slip",
    Params,
    step,
    title="Maxwell-slip",
    equation=r"F = \sum_i F_i + \sigma_2 v,\quad \dot F_i = k_i v \text{ while } |F_i| < W_i,"
    r"\quad F_i = W_i\,\mathrm{sign}(v) \text{ otherwise}",
    source=("thesis eqs. 2.14, 2.15", "iwan1966", "lampaert2003"),
    # Table 1 of the thesis, with the levels of its element shares at rest.
    example={"k": [1e4, 7e3, 5e3, 3e3], "w": [0.08375] * 4, "sigma2": 0.018},
    State=State,
    rate=rate,
    guards=guards,
    switch=switch,
    steady=steady,
    stored=stored,
    choices=(VISCOUS,),
    modes=modes,
    passive="always",
    rate_independent=True,
    non_local_memory=True,
)
