"""Dahl: the stress-strain curve of a solid contact, by displacement alone.

dF/dx = sigma0 |1 - F sign(v)/F_C|^delta_d sign(1 - F sign(v)/F_C), thesis eq. 2.7, Dahl 1968. With
r = 1 - F sign(v)/F_C and s the distance in one direction, dr/ds = -(sigma0/F_C) |r|^delta_d sign(r) has a closed
solution for every delta_d. For delta_d >= 1 (ductile) F approaches F_C, for delta_d < 1 (brittle) it reaches F_C
after a finite distance and stays there: the mode "at the level".
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Bristle, Law, Mode, Par
from stickslip.laws._direction import direction_ends, direction_of
from stickslip.laws._viscous import VISCOUS
from stickslip.laws._viscous import linear as viscous

CLOSE = 1e-12
"""Of F_C, from the level on which a brittle contact's force rises evenly through it: the level, which it meets as a
tangent with a slope without bound, is then crossed, and the crossing located. Pulled back from beyond, an explicit
step never gets there."""


class Params(NamedTuple):
    """Parameters of thesis eq. 2.7."""

    sigma0: Annotated[float, Par("N·m/rad", "sigma_0", "stiffness at rest", positive=True)]
    fc: Annotated[float, Par("N·m", "F_C", "Coulomb torque", positive=True, directional=True)]
    delta_d: Annotated[
        float,
        # It may differ by direction: at one force the slope is at most sigma0 while loading and at least sigma0
        # while unloading whatever the shape, so that no loop gives energy back.
        Par(
            "-",
            "delta_d",
            "shape factor of the stress-strain curve",
            lower=0.0,
            upper=20.0,
            default=1.0,
            directional=True,
        ),
    ]


class State(NamedTuple):
    """Internal state."""

    force: Annotated[float, Par("N·m", "F", "torque of the contact")]
    mode: Annotated[
        float, Mode("-", "m", "direction of motion (0 at rest, +1, -1), doubled at the level F_C")
    ]


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m; writes dF/dt, N·m/s."""
    dz.force = 0.0
    if abs(z.mode) < 2.0:
        r = 1.0 - direction_of(v) * z.force / p.fc
        if p.delta_d < 1.0:
            dz.force = p.sigma0 * max(r, CLOSE) ** p.delta_d * v
        else:
            dz.force = math.copysign(p.sigma0 * abs(r) ** p.delta_d, r) * v
    return z.force + viscous(v, p)


def guards(v: float, z: Any, p: Any, u: Any, g: Any) -> None:
    """Write the value that rises to zero where the direction ends, or a brittle contact reaches F_C."""
    if abs(z.mode) > 1.0:
        g.mode = -z.mode * v
    else:
        g.mode = direction_ends(z.mode, v)
        if z.mode != 0.0 and p.delta_d < 1.0:
            g.mode = max(g.mode, z.mode * z.force / p.fc - 1.0)


def switch(v: float, z: Any, p: Any, u: Any, g: Any) -> None:
    """Take the new direction, or stay at the level."""
    if g.mode >= 0.0:
        if z.mode * v > 0.0:
            z.force = z.mode * p.fc
            z.mode = 2.0 * z.mode
        else:
            z.mode = direction_of(v)


def slide(distance: float, z: Any, p: Any) -> None:
    """Move the contact by `distance`, rad, in one direction: exact, whatever the velocity."""
    direction = direction_of(distance)
    r = 1.0 - direction * z.force / p.fc
    way = p.sigma0 * abs(distance) / p.fc
    size = abs(r)
    if size > 0.0:
        ductility = p.delta_d - 1.0
        if ductility == 0.0:
            size *= math.exp(-way)
        else:
            # |r|^-ductility grows linearly with the way; where it falls to 0 (brittle) the level is reached.
            growth = ductility * way * size**ductility
            if growth > -1.0:
                size *= math.exp(-math.log1p(growth) / ductility)
            else:
                size = 0.0
    if distance != 0.0:
        z.force = direction * p.fc * (1.0 - math.copysign(size, r))
        z.mode = direction
        if size == 0.0:
            z.mode = 2.0 * direction


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m: exact. A reversal inside the step is cut at v = 0."""
    if v0 * v1 < 0.0:
        part = dt * v0 / (v0 - v1)
        slide(0.5 * v0 * part, z, p)
        slide(0.5 * v1 * (dt - part), z, p)
    else:
        slide(0.5 * (v0 + v1) * dt, z, p)
    return z.force + viscous(v1, p)


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m."""
    return p.fc * direction_of(v) + viscous(v, p)


def stored(z: Any, p: Any) -> float:
    """Energy of the spring F/sigma0, J: what is not in it is dissipated, for every shape factor."""
    return 0.5 * z.force * z.force / p.sigma0


def growth(y: float, limit: float, p: Any) -> float:
    """dy/dx of the deflection F/sigma0 (rad) in the direction of motion, with F_C/sigma0 = `limit`; thesis eq. 2.7."""
    r = 1.0 - y / limit
    return math.copysign(abs(r) ** p.delta_d, r)


def modes(p: Any) -> Bristle | None:
    """The law as it stands; a brittle contact, which reaches its level with a kink, has no such form."""
    if p.delta_d < 1.0:
        return None
    return Bristle(p.sigma0, 0.0, p.sigma2, p.fc, 0.0, constant_curve=True, own_growth=True)


LAW = Law(
    "dahl",
    Params,
    step,
    title="Dahl",
    equation=r"\frac{dF}{dx} = \sigma_0 \left|1 - \frac{F}{F_C}\mathrm{sign}(v)\right|^{\delta_d}"
    r"\mathrm{sign}\left(1 - \frac{F}{F_C}\mathrm{sign}(v)\right)",
    source=("thesis eq. 2.7", "dahl1968"),
    example={"sigma0": 3.5e4, "fc": 0.285, "delta_d": 1.0},
    State=State,
    rate=rate,
    guards=guards,
    switch=switch,
    steady=steady,
    modes=modes,
    growth=growth,
    stored=stored,
    choices=(VISCOUS,),
    passive="always",
    rate_independent=True,
)
