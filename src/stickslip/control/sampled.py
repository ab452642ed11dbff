"""The controller as a drive runs it: every sample time, from a counted position, its output held in between.

Velocity is the difference of the last two measured positions over the sample time; the compensator's velocity
may pass a second-order Butterworth low-pass (bilinear transform, corner prewarped: ``oppenheim1999``, section
7.1); the integral is a sum of trapezoids.

Written in the scalar subset (`stickslip.subset`): the fixed-step integrator and the rigs run it compiled, exports
write it in other languages. Arguments: the settings ``n``, the memory ``m``, and the compensator's law with its
state ``z``, parameters ``p`` and surroundings ``u``.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

from stickslip.binding import rescoped
from stickslip.control.controller import Controller
from stickslip.spec import Law, Par

__all__ = [
    "FROM_MEASUREMENT",
    "FROM_REFERENCE",
    "NO_COMPENSATOR",
    "Memory",
    "Settings",
    "sample",
    "sampled_by",
    "settings",
]

NO_COMPENSATOR, FROM_REFERENCE, FROM_MEASUREMENT = 0.0, 1.0, 2.0


class Settings(NamedTuple):
    """Numbers of a sampled controller."""

    kp: Annotated[float, Par("N·m/rad", "k_p", "proportional gain")]
    ki: Annotated[float, Par("N·m/(rad·s)", "k_i", "integral gain")]
    kd: Annotated[float, Par("N·m·s/rad", "k_d", "gain on the measured velocity")]
    kr: Annotated[float, Par("N·m·s/rad", "k_r", "gain on the reference velocity")]
    source: Annotated[
        float, Par("-", "", "0 no compensator, 1 driven by the reference, 2 by the measurement")
    ]
    gain: Annotated[float, Par("-", "", "factor on the compensating torque")]
    filter: Annotated[
        float, Par("rad/s", "omega_c", "corner of the compensator's velocity filter; 0 for none")
    ]
    torque_limit: Annotated[float, Par("N·m", "T_max", "largest torque")]
    sample_time: Annotated[float, Par("s", "T", "sample time")]
    encoder: Annotated[float, Par("-", "N", "counts per revolution; 0 measures exactly")]
    lead: Annotated[float, Par("s", "", "time by which a feedforward looks ahead of the reference")]
    deadband: Annotated[float, Par("rad/s", "", "velocity below which the compensator's law sees rest")]


class Memory(NamedTuple):
    """What the drive remembers from sample to sample."""

    started: Annotated[float, Par("-", "", "1 after the first sample")]
    position: Annotated[float, Par("rad", "theta", "measured position")]
    velocity: Annotated[float, Par("rad/s", "v", "difference of measured positions over the sample time")]
    error: Annotated[float, Par("rad", "e", "reference less measured position")]
    error_sum: Annotated[float, Par("rad·s", "", "integral of the error")]
    wanted_velocity: Annotated[float, Par("rad/s", "", "reference velocity one sample ago")]
    seen: Annotated[float, Par("rad/s", "", "velocity that the compensator's law saw")]
    in_1: Annotated[float, Par("rad/s", "", "filter: input one sample ago")]
    in_2: Annotated[float, Par("rad/s", "", "filter: input two samples ago")]
    out_1: Annotated[float, Par("rad/s", "", "filter: output one sample ago")]
    out_2: Annotated[float, Par("rad/s", "", "filter: output two samples ago")]
    forward: Annotated[float, Par("-", "", "filter: weight of the inputs")]
    back_1: Annotated[float, Par("-", "", "filter: weight of the last output")]
    back_2: Annotated[float, Par("-", "", "filter: weight of the output before")]
    compensation: Annotated[float, Par("N·m", "T_hat", "compensating torque")]
    torque: Annotated[float, Par("N·m", "T_m", "torque that is held")]


def measured_position(position: float, counts: float) -> float:
    """The position in whole counts of the encoder, rad; exact where it has none."""
    if counts <= 0.0:
        return position
    count = 2.0 * math.pi / counts
    return count * math.floor(position / count + 0.5)


def design_filter(n: Any, m: Any) -> None:
    """Coefficients of the second-order Butterworth low-pass; its corner lies below half the sample rate."""
    g = math.tan(0.5 * min(n.filter * n.sample_time, 0.99 * math.pi))
    scale = 1.0 / (1.0 + math.sqrt(2.0) * g + g * g)
    m.forward = g * g * scale
    m.back_1 = 2.0 * (g * g - 1.0) * scale
    m.back_2 = (1.0 - math.sqrt(2.0) * g + g * g) * scale


def low_passed(m: Any, x: float) -> float:
    """The next value of the filtered velocity, rad/s."""
    y = m.forward * (x + 2.0 * m.in_1 + m.in_2) - m.back_1 * m.out_1 - m.back_2 * m.out_2
    m.in_2 = m.in_1
    m.in_1 = x
    m.out_2 = m.out_1
    m.out_1 = y
    return y


def observe(position: float, wanted: float, n: Any, m: Any) -> None:
    """Take a sample of the position: velocity, error and its integral."""
    measured = measured_position(position, n.encoder)
    error = wanted - measured
    if m.started == 0.0:
        m.velocity = 0.0
        design_filter(n, m)
    else:
        m.velocity = (measured - m.position) / n.sample_time
        m.error_sum += 0.5 * n.sample_time * (m.error + error)
    m.position = measured
    m.error = error


def ahead(wanted_velocity: float, n: Any, m: Any) -> float:
    """The reference velocity a lead from now, rad/s, along its last two samples; rest stays rest."""
    found = wanted_velocity
    if m.started != 0.0 and wanted_velocity != 0.0:
        found = wanted_velocity + n.lead * (wanted_velocity - m.wanted_velocity) / n.sample_time
    m.wanted_velocity = wanted_velocity
    return found


def law_step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """The compensator's law; `sampled_by` puts it here."""
    return 0.0


def compensate(velocity: float, n: Any, m: Any, z: Any, p: Any, u: Any) -> float:
    """Torque of the compensator's law, which moved from the last velocity to the present one, N·m."""
    now = velocity
    if n.filter > 0.0:
        now = low_passed(m, velocity)
    if abs(now) < n.deadband:
        now = 0.0
    last = now
    elapsed = 0.0  # before the first sample nothing has moved yet
    if m.started != 0.0:
        last = m.seen
        elapsed = n.sample_time
    m.seen = now
    u.position = m.position
    return n.gain * law_step(last, now, elapsed, z, p, u)


def sample(
    position: float, wanted: float, wanted_velocity: float, n: Any, m: Any, z: Any, p: Any, u: Any
) -> float:
    """One sample of the drive: measure, control, compensate, limit. Returns the torque to hold, N·m."""
    observe(position, wanted, n, m)
    torque = n.kp * m.error + n.kr * wanted_velocity - n.kd * m.velocity + n.ki * m.error_sum
    m.compensation = 0.0
    if n.source == FROM_REFERENCE:
        m.compensation = compensate(ahead(wanted_velocity, n, m), n, m, z, p, u)
    elif n.source == FROM_MEASUREMENT:
        m.compensation = compensate(m.velocity, n, m, z, p, u)
    m.torque = min(max(torque + m.compensation, -n.torque_limit), n.torque_limit)
    m.started = 1.0
    return m.torque


def sampled_by(law: Law | None) -> Callable[..., float]:
    """`sample` with the law of the compensator in its place; None compensates nothing."""
    if law is None:
        return sample
    scope = dict(globals())
    for name, value in globals().items():
        if isinstance(value, types.FunctionType) and value.__globals__ is globals():
            scope[name] = rescoped(value, scope)
    scope["law_step"] = law.step
    return scope["sample"]


def settings(controller: Controller) -> Settings:
    """The numbers of a controller."""
    helper, gains = controller.compensator, controller.gains
    source = NO_COMPENSATOR
    if helper:
        source = FROM_REFERENCE if helper.velocity == "reference" else FROM_MEASUREMENT
    return Settings(
        gains.kp,
        gains.ki,
        gains.kd,
        gains.kr,
        source,
        helper.gain if helper else 0.0,
        2.0 * math.pi * helper.filter_hz if helper and helper.filter_hz else 0.0,
        controller.torque_limit,
        controller.sample_time,
        controller.encoder_counts,
        helper.lead if helper else 0.0,
        helper.deadband if helper else 0.0,
    )
