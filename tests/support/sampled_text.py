"""A sampled controller with gains and a compensator in one text of its own: an oracle for compositions, bit for bit.

Velocity is the difference of the last two measured positions over the sample time; the compensator's velocity may pass
a second-order Butterworth low-pass (bilinear transform, corner prewarped), the linear controller's a first-order one.
The integral is a sum of trapezoids that rests where the torque limit holds the torque back and it would go further.
Arguments: the settings ``n``, the memory ``m``, and the compensator's law with its state ``z``, parameters ``p`` and
surroundings ``u``.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable
from typing import Any

from stickslip.control.controller import Controller
from stickslip.control.linear import Cascade, Gains
from stickslip.core.rebinding import rescoped
from stickslip.core.spec import Law
from support.sampled_numbers import Memory, Settings

__all__ = [
    "FROM_MEASUREMENT",
    "FROM_REFERENCE",
    "NO_COMPENSATOR",
    "Memory",
    "Settings",
    "follow",
    "follow_turns",
    "functions_by",
    "sample",
    "sample_turns",
    "sampled_by",
    "settings",
]

NO_COMPENSATOR, FROM_REFERENCE, FROM_MEASUREMENT = 0.0, 1.0, 2.0
TURN = 2.0 * math.pi  # rad
LARGEST = 1e9  # rad, rad/s, N·m: an input beyond it is no measurement
FADE = 0.1
"""s, over which a torque that was taken over fades."""


def design_filter(n: Any, m: Any) -> None:
    """Coefficients of the second-order Butterworth low-pass; its corner lies below half the sample rate.

    `Controller` refuses another; the bound keeps a filter stable whose settings were changed afterwards.
    """
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


def since(n: Any, m: Any) -> float:
    """Time since the last usable sample, s."""
    return n.sample_time + m.waited


def observe(turns: float, position: float, wanted_turns: float, wanted: float, n: Any, m: Any) -> None:
    """Take a sample of the position: velocity, error, and what the integral would gain by it."""
    error = TURN * (wanted_turns - turns) + (wanted - position)
    m.growth = 0.0
    if m.started == 0.0:
        m.velocity = 0.0
        m.filtered = 0.0
        design_filter(n, m)
    else:
        m.velocity = (TURN * (turns - m.turns) + (position - m.position)) / since(n, m)
        m.filtered = m.velocity + n.slow * (m.filtered - m.velocity)
        m.growth = 0.5 * since(n, m) * (m.error + error)
    m.turns = turns
    m.position = position
    m.error = error


def linear(wanted_velocity: float, n: Any, m: Any) -> float:
    """Torque of the linear controller, N·m; in a cascade kd is the gain of the velocity loop and ki its integral's."""
    if n.kv <= 0.0:
        return n.kp * m.error + n.kr * wanted_velocity - n.kd * m.filtered + n.ki * (m.error_sum + m.growth)
    error = n.kv * m.error + n.feed * wanted_velocity - m.filtered
    m.growth = since(n, m) * error
    return n.kd * error + n.ki * (m.error_sum + m.growth)


def ahead(wanted_velocity: float, n: Any, m: Any) -> float:
    """The reference velocity a lead from now, rad/s, along its last two samples; rest stays rest."""
    found = wanted_velocity
    if m.started != 0.0 and wanted_velocity != 0.0:
        found = wanted_velocity + n.lead * (wanted_velocity - m.wanted_velocity) / since(n, m)
    return found


def law_step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """The compensator's law; `sampled_by` puts it here."""
    return 0.0


def law_steps(last: float, now: float, elapsed: float, n: Any, z: Any, p: Any, u: Any) -> float:
    """The law over a sample, in `substeps` steps with the velocity linear in between. Returns its torque, N·m."""
    parts = max(1.0, n.substeps)
    before = last
    for i in range(1, int(parts)):
        after = last + (now - last) * (float(i) / parts)
        law_step(before, after, elapsed / parts, z, p, u)
        before = after
    return law_step(before, now, elapsed / parts, z, p, u)


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
        elapsed = since(n, m)
    m.seen = now
    u.position = TURN * m.turns + m.position
    return n.gain * law_steps(last, now, elapsed, n, z, p, u)


def unusable(
    turns: float, position: float, wanted_turns: float, wanted: float, wanted_velocity: float,
    wanted_acceleration: float, u: Any,
) -> float:  # fmt: skip
    """1 where an input is no number, or one that no machine has; else 0."""
    size = abs(turns) + abs(position) + abs(wanted_turns) + abs(wanted) + abs(wanted_velocity)
    size += abs(wanted_acceleration)
    # Clocks that count from 1970 are beyond 1e9 s.
    size += abs(u.load) + abs(u.temperature) + 1e-6 * abs(u.time) + abs(u.applied)
    if size < LARGEST:
        return 0.0
    return 1.0


def faulty(n: Any, m: Any) -> float:
    """A sample without a usable input: the torque that is held falls to 0 over the fade. Returns it, N·m."""
    if m.fault == 0.0 or m.open != 0.0:
        m.taken = m.torque
        m.open = 0.0
        m.fault = 0.0
    m.fault += 1.0
    m.share = max(0.0, 1.0 - m.fault * n.sample_time / max(n.fade, n.sample_time))
    m.torque = m.share * m.taken
    m.compensation = 0.0
    return m.torque


def keep_time(n: Any, m: Any, u: Any) -> None:
    """The law's time, s; whole seconds are kept apart, so that single precision loses no sample in years."""
    if n.clock != 0.0:
        u.time = m.seconds + m.part
        m.part += n.sample_time
        whole = math.floor(m.part)
        m.seconds += whole
        m.part -= whole


def respond(
    turns: float, position: float, wanted_turns: float, wanted: float, wanted_velocity: float,
    wanted_acceleration: float, n: Any, m: Any, z: Any, p: Any, u: Any,
) -> float:  # fmt: skip
    """Measure, control, compensate. Returns the torque before the limit, N·m."""
    observe(turns, position, wanted_turns, wanted, n, m)
    torque = linear(wanted_velocity, n, m)
    m.compensation = 0.0
    if n.source == FROM_REFERENCE:
        m.compensation = compensate(ahead(wanted_velocity, n, m), n, m, z, p, u)
    elif n.source == FROM_MEASUREMENT:
        m.compensation = compensate(m.velocity, n, m, z, p, u)
    m.compensation += n.offset + n.inertia * wanted_acceleration
    m.wanted_velocity = wanted_velocity
    return torque + m.compensation


def start_at(held: float, torque: float, n: Any, m: Any) -> float:
    """The first sample after another had the axis: its torque is the one held, N·m; what lacks is in the integral."""
    m.open = 0.0
    m.fault = 0.0
    m.share = 0.0
    if n.ki > 0.0:
        m.error_sum += (held - torque) / n.ki
        return held
    if n.fade > 0.0:
        m.taken = held - torque
        m.share = 1.0
    return torque


def taken_over(torque: float, n: Any, m: Any) -> float:
    """The torque with what is left of the one that was taken over, or held in a fault, N·m."""
    whole = torque
    if m.open != 0.0:
        whole = start_at(m.torque, torque, n, m)
    elif m.fault > 0.0:
        m.fault = 0.0
        m.taken = m.torque - torque
        m.share = 1.0
    if m.share > 0.0:
        whole += m.share * m.taken
        m.share = max(0.0, m.share - n.sample_time / max(n.fade, n.sample_time))
    return whole


def sample_turns(
    turns: float, position: float, wanted_turns: float, wanted: float, wanted_velocity: float,
    wanted_acceleration: float, n: Any, m: Any, z: Any, p: Any, u: Any,
) -> float:  # fmt: skip
    """One sample with positions as whole turns and the rest, rad. Returns the torque to hold, N·m."""
    keep_time(n, m, u)
    if unusable(turns, position, wanted_turns, wanted, wanted_velocity, wanted_acceleration, u) != 0.0:
        m.waited += n.sample_time
        return faulty(n, m)
    torque = respond(
        turns, position, wanted_turns, wanted, wanted_velocity, wanted_acceleration, n, m, z, p, u
    )
    m.started = 1.0
    m.waited = 0.0
    if not abs(torque) < math.inf:
        return faulty(n, m)
    torque = taken_over(torque, n, m)
    m.torque = min(max(torque, -n.torque_limit), n.torque_limit)
    # The integral rests where the limit holds the torque back and it would go further.
    if not n.ki * m.growth * (torque - m.torque) > 0.0:
        m.error_sum += m.growth
    return m.torque


def sample(
    position: float, wanted: float, wanted_velocity: float, wanted_acceleration: float,
    n: Any, m: Any, z: Any, p: Any, u: Any,
) -> float:  # fmt: skip
    """One sample of the drive: measure, control, compensate, limit. Returns the torque to hold, N·m."""
    return sample_turns(0.0, position, 0.0, wanted, wanted_velocity, wanted_acceleration, n, m, z, p, u)


def follow_turns(
    turns: float, position: float, wanted_turns: float, wanted: float, wanted_velocity: float,
    wanted_acceleration: float, torque: float, n: Any, m: Any, z: Any, p: Any, u: Any,
) -> float:  # fmt: skip
    """Watch one sample while another has the axis with `torque`, N·m; the sample that takes over starts there."""
    keep_time(n, m, u)
    m.error_sum = 0.0
    m.share = 0.0
    m.fault = 0.0
    m.open = 1.0
    m.torque = 0.0
    if abs(torque) < LARGEST:
        m.torque = torque
    if unusable(turns, position, wanted_turns, wanted, wanted_velocity, wanted_acceleration, u) != 0.0:
        m.waited += n.sample_time
        m.fault = 1.0
        return m.torque
    respond(turns, position, wanted_turns, wanted, wanted_velocity, wanted_acceleration, n, m, z, p, u)
    m.started = 1.0
    m.waited = 0.0
    return m.torque


def follow(
    position: float, wanted: float, wanted_velocity: float, wanted_acceleration: float, torque: float,
    n: Any, m: Any, z: Any, p: Any, u: Any,
) -> float:  # fmt: skip
    """Watch one sample while another has the axis with `torque`, N·m; the sample that takes over starts there."""
    return follow_turns(
        0.0, position, 0.0, wanted, wanted_velocity, wanted_acceleration, torque, n, m, z, p, u
    )


def functions_by(law: Law | None) -> dict[str, Callable[..., float]]:
    """The functions of this file by name, with the law of the compensator in its place; None compensates nothing."""
    home = globals()
    own = {
        name: value
        for name, value in home.items()
        if isinstance(value, types.FunctionType) and value.__globals__ is home
    }
    if law is None:
        return own
    scope = dict(home)
    scope.update({name: rescoped(function, scope) for name, function in own.items()})
    scope["law_step"] = law.step
    return {name: scope[name] for name in own}


def sampled_by(law: Law | None) -> Callable[..., float]:
    """`sample` with the law of the compensator in its place; None compensates nothing."""
    return functions_by(law)["sample"]


def settings(controller: Controller) -> Settings:
    """The numbers of a controller."""
    helper, gains = controller.compensator, controller.gains
    cascade = gains if isinstance(gains, Cascade) else None
    if isinstance(gains, Cascade):
        gains = Gains(0.0, gains.kvi, gains.kvp)
    corner = 2.0 * math.pi * controller.velocity_filter
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
        helper.lead if helper else 0.0,
        helper.deadband if helper else 0.0,
        cascade.kv if cascade else 0.0,
        cascade.feed if cascade else 0.0,
        math.exp(-corner * controller.sample_time) if corner > 0.0 else 0.0,
        FADE,
        helper.offset if helper else 0.0,
        helper.inertia_feedforward if helper else 0.0,
        0.0,
        float(helper.substeps) if helper else 1.0,
    )
