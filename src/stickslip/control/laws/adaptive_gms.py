"""Adaptive GMS: Maxwell-slip elements on the velocity whose sliding curve is a learned polynomial of the speed.

s(v; theta) = sum_j theta_j (|v| / v0)^j is linear in theta, so that the torque of what slips is, too. An element sticks
as a spring until it carries alpha_i s, and then carries alpha_i s sgn(v) until v reverses: GMS with an attraction that
is fast against the speed's changes. The regressor of theta_j is the sum of alpha_i over the elements that slip times
sgn(v) (|v| / v0)^j: nothing is learned by what sticks, nor while the reference stands still.

d theta_j/dt = Gamma_j (phi_j s_e - sigma_l (theta_j - theta_j0)) with s_e = de/dt + lambda e: the gradient law of
`stickslip.control.laws.adaptive_friction`, but with a leak towards what was believed. Bounds hold theta.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.control.laws.dual_observer import VELOCITY
from stickslip.control.laws.dual_observer import reference as velocity_of
from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Kept, Learned, Par


class Params(NamedTuple):
    """Elements, the believed curve, pace, leak and bound of what is learned."""

    k: Annotated[tuple[float, ...], Par("N·m/rad", "k_i", "stiffness of element i", positive=True)]
    alpha: Annotated[
        tuple[float, ...],
        Par("-", "alpha_i", "share of element i in s(v)", positive=True, upper=1.0),
    ]
    level: Annotated[
        tuple[float, ...],
        Par("N·m", "theta_j0", "believed coefficient of power j, from 0 up", per="power"),
    ]
    rate: Annotated[
        tuple[float, ...],
        Par("N·m/rad", "Gamma_j", "how fast coefficient j is learnt", lower=0.0, per="power"),
    ]
    top: Annotated[
        float,
        Par("rad/s", "v_0", "speed by which speeds are divided; beyond it the powers hold", positive=True),
    ]
    sigma2: Annotated[
        float, Par("N·m·s/rad", "sigma_2", "viscous friction, not learnt", lower=0.0, default=0.0)
    ]
    slope: Annotated[float, Par("1/s", "lambda", "weight of the position error in s_e", positive=True)]
    leak: Annotated[
        float, Par("rad/(N·m·s)", "sigma_l", "leak towards the believed curve", lower=0.0, default=0.05)
    ]
    largest: Annotated[float, Par("N·m", "", "largest coefficient, and largest s(v)", positive=True)]


class State(NamedTuple):
    """Internal state."""

    force: Annotated[tuple[float, ...], Par("N·m", "G_i", "torque of element i")]
    side: Annotated[tuple[float, ...], Par("-", "", "0: element i sticks; +1 or -1: it slips that way")]
    curve: Annotated[
        tuple[float, ...], Learned("N·m", "theta_j", "coefficient of power j of the speed", per="power")
    ]
    known: Annotated[float, Kept("-", "", "1 once there is a curve")]


def sliding(share: float, z: Any, p: Any) -> float:
    """s at that share of the top speed by what is learned, N·m; never negative."""
    power = 1.0
    total = 0.0
    for j in range(len(p.level)):
        total += z.curve[j] * power
        power = power * share
    return min(max(total, 0.0), p.largest)


def moved(v: float, s: float, y: Any, z: Any, p: Any) -> float:
    """Move the elements over a sample at that velocity; the shares of those that slip, with the velocity's sign."""
    direction = 1.0
    if v < 0.0:
        direction = -1.0
    slipping = 0.0
    for i in range(len(p.k)):
        if z.side[i] * direction < 0.0:
            z.side[i] = 0.0
        if z.side[i] == 0.0:
            z.force[i] += p.k[i] * v * y.elapsed
            if z.force[i] * direction >= p.alpha[i] * s:
                z.side[i] = direction
        if z.side[i] != 0.0:
            z.force[i] = p.alpha[i] * s * direction
            slipping += p.alpha[i]
    return slipping * direction


def learn(phi: float, share: float, y: Any, z: Any, p: Any) -> None:
    """The next coefficients; ``phi`` is the regressor of the first."""
    s = y.reference_velocity - y.velocity + p.slope * y.error
    value = phi
    for j in range(len(p.level)):
        off = z.curve[j] - p.level[j]
        grown = z.curve[j] + y.elapsed * p.rate[j] * (value * s - p.leak * off)
        z.curve[j] = min(max(grown, -p.largest), p.largest)
        value = value * share


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m; the velocity holds over the sample."""
    if z.known == 0.0:
        for j in range(len(p.level)):
            z.curve[j] = min(max(p.level[j], -p.largest), p.largest)
        z.known = 1.0
    v = velocity_of(y)
    if v != 0.0:
        share = min(abs(v) / p.top, 1.0)
        slipping = moved(v, sliding(share, z, p), y, z, p)
        if slipping != 0.0 and y.reference_velocity != 0.0:
            learn(slipping, share, y, z, p)
    torque = p.sigma2 * v
    for i in range(len(p.k)):
        torque += z.force[i]
    return torque


def check(p: Any) -> str:
    """The shares make up the whole curve, which is positive over its speeds (thesis eq. 2.19)."""
    total = sum(p.alpha)
    if abs(total - 1.0) > 1e-6:
        return f"alpha adds up to {total:g}; the shares of the elements add up to 1 (thesis eq. 2.19)"
    for i in range(101):
        s = sum(level * (0.01 * i) ** j for j, level in enumerate(p.level))
        if not 0.0 < s <= p.largest:
            v = 0.01 * i * p.top
            return f"level gives s = {s:.3g} N·m at {v:.3g} rad/s; give one between 0 and largest = {p.largest:g} N·m"
    return ""


CONTROL_LAW = ControlLaw(
    "adaptive_gms", Params, sample, "observer",
    title="Adaptive GMS",
    equation=r"T = \sum_i G_i + \sigma_2 v,\quad s(v) = \sum_j \theta_j (|v|/v_0)^j,\quad "
    r"\dot\theta_j = \Gamma_j\left(\sum_{i\ \mathrm{slips}} \alpha_i\,\mathrm{sgn}(v)\,(|v|/v_0)^j\,"
    r"(\dot e + \lambda e) - \sigma_l (\theta_j - \theta_{j0})\right)",
    source=("thesis chapter 1", "lampaert2003", "slotine1991"),
    example={
        "k": [12896.0, 8141.0, 4273.0], "alpha": [1.0 / 3.0] * 3, "level": [0.3368, -0.032, -0.115, 0.0981],
        "rate": [12.0, 3.0, 3.0, 3.0], "top": 0.02, "sigma2": 0.018, "slope": 62.83, "largest": 1.0,
    },
    State=State,
    check=check,
    choices=(VELOCITY,),
    adapts=True,
)  # fmt: skip
