"""Armstrong: a stiff spring at rest, and sliding friction that lags behind the velocity.

Seven parameters (Armstrong-Helouvry, Dupont and Canudas de Wit 1994; thesis 2.2.4). Stuck: F = F_0 + k_t (x - x_0).
Sliding: F = (F_C + F_s / (1 + (v(t - tau_L) / v_s)^2)) sign(v) + F_v v. The static torque rises with the dwell time:
F_s = F_s,a + (F_s,inf - F_s,a) t_2 / (t_2 + gamma), and the contact breaks away where the spring reaches F_C + F_s.
The survey leaves two things open. Here F_s,a is the Stribeck part at the end of the last sliding, and F_0 the last
sliding torque, so that the torque is continuous where the motion stops. So closed, the law is passive: the delay
acts on the size of the sliding torque, never on its direction.

The delay is eight samples of the past velocity, no nearer than tau_L / 6, and a straight line between two of them. It
has no rate: the law runs by its steps, in the fixed and the sampled integrator.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Law, Memory, Mode, Par
from stickslip.laws._direction import direction_of
from stickslip.laws._viscous import VISCOUS
from stickslip.laws._viscous import linear as viscous


class Params(NamedTuple):
    """Parameters besides the viscous one."""

    kt: Annotated[float, Par("N·m/rad", "k_t", "stiffness at rest", positive=True)]
    fc: Annotated[float, Par("N·m", "F_C", "Coulomb torque", positive=True, directional=True)]
    fs_inf: Annotated[
        float,
        Par("N·m", "F_s,inf", "static torque above Coulomb's after a long rest", lower=0.0, directional=True),
    ]
    vs: Annotated[float, Par("rad/s", "v_s", "Stribeck velocity", positive=True, directional=True)]
    tau: Annotated[float, Par("s", "tau_L", "time by which friction lags the velocity", lower=0.0)]
    gamma: Annotated[float, Par("s", "gamma", "dwell time for half of the rise", positive=True)]


class State(NamedTuple):
    """Internal state; the samples are numbered from the latest one."""

    force: Annotated[float, Par("N·m", "F_0", "torque of the spring")]
    dwell: Annotated[float, Par("s", "t_2", "time at rest")]
    static: Annotated[float, Par("N·m", "F_s", "Stribeck part, kept from the last break-away or stop")]
    lagged: Annotated[float, Par("rad/s", "v(t - tau_L)", "velocity that the friction sees")]
    mode: Annotated[float, Mode("-", "m", "0 sticks, +1 or -1 slips in that direction")]
    a1: Annotated[float, Memory("s", "a_1", "age of sample 1")]
    v1: Annotated[float, Memory("rad/s", "v_1", "velocity of sample 1")]
    a2: Annotated[float, Memory("s", "a_2", "age of sample 2")]
    v2: Annotated[float, Memory("rad/s", "v_2", "velocity of sample 2")]
    a3: Annotated[float, Memory("s", "a_3", "age of sample 3")]
    v3: Annotated[float, Memory("rad/s", "v_3", "velocity of sample 3")]
    a4: Annotated[float, Memory("s", "a_4", "age of sample 4")]
    v4: Annotated[float, Memory("rad/s", "v_4", "velocity of sample 4")]
    a5: Annotated[float, Memory("s", "a_5", "age of sample 5")]
    v5: Annotated[float, Memory("rad/s", "v_5", "velocity of sample 5")]
    a6: Annotated[float, Memory("s", "a_6", "age of sample 6")]
    v6: Annotated[float, Memory("rad/s", "v_6", "velocity of sample 6")]
    a7: Annotated[float, Memory("s", "a_7", "age of sample 7")]
    v7: Annotated[float, Memory("rad/s", "v_7", "velocity of sample 7")]
    a8: Annotated[float, Memory("s", "a_8", "age of sample 8")]
    v8: Annotated[float, Memory("rad/s", "v_8", "velocity of sample 8")]


def between(age: float, a0: float, v0: float, a1: float, v1: float) -> float:
    """Velocity on the line between two samples, rad/s."""
    if a1 > a0:
        return v0 + (v1 - v0) * (age - a0) / (a1 - a0)
    return v0


def look_back(v0: float, v1: float, dt: float, z: Any, p: Any) -> float:
    """Velocity at tau_L before the end of a step whose length the ages already include, rad/s."""
    if p.tau <= dt:
        return between(p.tau, 0.0, v1, dt, v0)
    if p.tau <= z.a1:
        return between(p.tau, dt, v0, z.a1, z.v1)
    if p.tau <= z.a2:
        return between(p.tau, z.a1, z.v1, z.a2, z.v2)
    if p.tau <= z.a3:
        return between(p.tau, z.a2, z.v2, z.a3, z.v3)
    if p.tau <= z.a4:
        return between(p.tau, z.a3, z.v3, z.a4, z.v4)
    if p.tau <= z.a5:
        return between(p.tau, z.a4, z.v4, z.a5, z.v5)
    if p.tau <= z.a6:
        return between(p.tau, z.a5, z.v5, z.a6, z.v6)
    if p.tau <= z.a7:
        return between(p.tau, z.a6, z.v6, z.a7, z.v7)
    if p.tau <= z.a8:
        return between(p.tau, z.a7, z.v7, z.a8, z.v8)
    return z.v8


def remember(v0: float, v1: float, dt: float, z: Any, p: Any) -> None:
    """Move on by dt: store the velocity at its start where the last sample is old enough."""
    if z.a1 >= p.tau / 6.0:
        z.a8 = z.a7
        z.v8 = z.v7
        z.a7 = z.a6
        z.v7 = z.v6
        z.a6 = z.a5
        z.v6 = z.v5
        z.a5 = z.a4
        z.v5 = z.v4
        z.a4 = z.a3
        z.v4 = z.v3
        z.a3 = z.a2
        z.v3 = z.v2
        z.a2 = z.a1
        z.v2 = z.v1
        z.a1 = 0.0
        z.v1 = v0
    z.a1 += dt
    z.a2 += dt
    z.a3 += dt
    z.a4 += dt
    z.a5 += dt
    z.a6 += dt
    z.a7 += dt
    z.a8 += dt
    z.lagged = look_back(v0, v1, dt, z, p)


def risen(dwell: float, z: Any, p: Any) -> float:
    """F_s after a dwell time, N·m."""
    return z.static + (p.fs_inf - z.static) * dwell / (dwell + p.gamma)


def stribeck_part(z: Any, p: Any) -> float:
    """F_s / (1 + (v(t - tau_L) / v_s)^2), N·m."""
    x = z.lagged / p.vs
    return z.static / (1.0 + x * x)


def excess(part: float, direction: float, v0: float, slope: float, z: Any, p: Any) -> float:
    """Torque of the spring above the break-away torque after `part` seconds of a step, N·m."""
    spring = z.force + p.kt * part * (v0 + 0.5 * slope * part)
    return direction * spring - p.fc - risen(z.dwell + part, z, p)


def break_away(dt: float, direction: float, v0: float, slope: float, z: Any, p: Any) -> float:
    """The time within a step at which the spring reaches the break-away torque, s (Illinois' method)."""
    low = 0.0
    high = dt
    f_low = excess(low, direction, v0, slope, z, p)
    f_high = excess(high, direction, v0, slope, z, p)
    if f_low >= 0.0:
        return 0.0
    for i in range(100):
        if f_high == 0.0 or high - low <= 1e-16 * dt:
            break
        x = high - f_high * (high - low) / (f_high - f_low)
        if i % 4 == 3 or not low < x < high:
            x = 0.5 * (low + high)
        f = excess(x, direction, v0, slope, z, p)
        if f >= 0.0:
            high = x
            f_high = f
            f_low *= 0.5
        else:
            low = x
            f_low = f
            f_high *= 0.5
    return high


def stop(z: Any, p: Any) -> None:
    """The motion ends: the spring takes the torque over, and the contact dwells."""
    if z.mode != 0.0:
        part = stribeck_part(z, p)
        z.force = z.mode * (p.fc + part)
        z.static = part
        z.dwell = 0.0
        z.mode = 0.0


def advance(v0: float, v1: float, dt: float, z: Any, p: Any) -> None:
    """Advance the state over `dt` at velocities of one sign."""
    direction = direction_of(v0 + v1)
    if z.mode * direction < 0.0:
        stop(z, p)
    remember(v0, v1, dt, z, p)
    if z.mode == 0.0:
        slope = 0.0
        if dt > 0.0:
            slope = (v1 - v0) / dt
        if direction != 0.0 and excess(dt, direction, v0, slope, z, p) >= 0.0:
            part = break_away(dt, direction, v0, slope, z, p)
            z.static = risen(z.dwell + part, z, p)
            z.force = direction * (p.fc + z.static)
            z.mode = direction
        else:
            z.force += p.kt * 0.5 * (v0 + v1) * dt
            z.dwell += dt
    if v1 == 0.0:
        stop(z, p)


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m. A reversal inside the step is cut at v = 0."""
    if v0 * v1 < 0.0:
        part = dt * v0 / (v0 - v1)
        advance(v0, 0.0, part, z, p)
        advance(0.0, v1, dt - part, z, p)
    elif dt > 0.0:
        advance(v0, v1, dt, z, p)
    if z.mode == 0.0:
        return z.force
    return z.mode * (p.fc + stribeck_part(z, p)) + viscous(v1, p)


def stored(z: Any, p: Any) -> float:
    """Energy of the spring, J; while sliding, what it had at break-away: no later stop gives back more."""
    return 0.5 * z.force * z.force / p.kt


LAW = Law(
    "armstrong",
    Params,
    step,
    title="Armstrong",
    equation=r"F = \begin{cases} F_0 + k_t (x - x_0) & \text{stuck} \\"
    r" \left(F_C + \frac{F_s}{1 + (v(t - \tau_L)/v_s)^2}\right)\mathrm{sign}(v) + \sigma_2 v & \text{sliding}"
    r"\end{cases},\quad F_s = F_{s,a} + (F_{s,\infty} - F_{s,a}) \frac{t_2}{t_2 + \gamma}",
    source=("thesis 2.2.4", "armstrong1994"),
    example={
        "kt": 2.5e4,
        "fc": 0.285,
        "fs_inf": 0.05,
        "vs": 0.01,
        "tau": 1e-3,
        "gamma": 0.1,
        "sigma2": 0.018,
    },
    State=State,
    stored=stored,
    velocity_scale=lambda p: p.vs,
    choices=(VISCOUS,),
    passive="always",
    continuous=False,
)
