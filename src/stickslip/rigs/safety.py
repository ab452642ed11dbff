"""The safety of the loop: limits, the reasons to stop, and the stop itself, one sample at a time.

`guarded` is one whole sample of the loop: it watches the limits, runs the controller
(`stickslip.control.composition`), and from the sample that sees a reason to stop on it ramps the torque to zero. It is
written in the scalar subset (`stickslip.subset`), so that it is the same compiled code in every loop, and plain
Python in a test. Once the ramp has begun nothing but the number of samples decides the torque: no measurement, no
setpoint and no controller can prolong it.

While the loop is open the laws run, so that an observer knows the disturbance when it is closed.

Arguments: what is measured ``y`` (`Measurement`) and its setpoint ``w`` (`Setpoint`), the bounds ``b``, the memory of
the safety ``s``, and the controller's settings ``n``, memory ``m``, and laws ``z``, ``p``, ``u``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, NamedTuple

from stickslip.binding import bound
from stickslip.control.composition import follow, sample
from stickslip.rigs.rig import Limits
from stickslip.spec import Par

# States; from STOPPED on no sample follows. ENDED: the segment's travel is reached, which is no fault; the next segment
# goes on.
RUNNING, STOPPING, STOPPED, ENDED = 0.0, 1.0, 2.0, 3.0

# Reasons to stop.
NONE, POSITION, SPEED, TORQUE, TEMPERATURE, FOLLOWING, NOT_FINITE, STATUS, ASKED = (
    0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0,
)  # fmt: skip
REASONS = (
    "none", "position", "speed", "torque", "temperature", "following error", "not a number", "the rig's fault",
    "asked",
)  # fmt: skip
"""Words for the channel ``reason`` of a record."""

MEASURED = 1.25  # of the largest command, that a measured torque may reach: overshoot and noise
UNBOUNDED = 1e300  # stands for no bound


class Bounds(NamedTuple):
    """The limits of a run, as numbers."""

    low: Annotated[float, Par("rad", "", "lowest position")]
    high: Annotated[float, Par("rad", "", "highest position")]
    speed: Annotated[float, Par("rad/s", "", "highest speed")]
    torque: Annotated[float, Par("N·m", "", "largest command")]
    temperature: Annotated[float, Par("°C", "", "highest temperature")]
    following: Annotated[float, Par("rad", "", "largest following error")]
    fall: Annotated[float, Par("N·m", "", "by which the torque falls in a sample of the stop")]
    travel: Annotated[float, Par("rad", "", "displacement that ends a segment")]
    sample_time: Annotated[float, Par("s", "T", "sample time")]


class Safety(NamedTuple):
    """What the safety remembers from sample to sample."""

    state: Annotated[float, Par("-", "", "0 running, 1 stopping, 2 stopped, 3 segment ended")]
    reason: Annotated[float, Par("-", "", "why it stops: `REASONS`")]
    torque: Annotated[float, Par("N·m", "", "torque command")]
    started: Annotated[float, Par("-", "", "1 after the first sample")]
    position: Annotated[float, Par("rad", "", "position one sample ago")]
    velocity: Annotated[float, Par("rad/s", "", "difference of the positions over the sample time")]
    origin: Annotated[float, Par("rad", "", "position at the start of the segment")]
    value: Annotated[float, Par("-", "", "the value that crossed its limit")]


def bounds(limits: Limits, sample_time: float, travel: float = math.inf) -> Bounds:
    """The limits laid out; the ramp has as many samples as fit into ``stop_time``, at least one."""
    steps = max(1, math.floor(limits.stop_time / sample_time + 1e-9))
    low, high = limits.position
    return Bounds(
        max(low, -UNBOUNDED),
        min(high, UNBOUNDED),
        limits.speed,
        limits.torque,
        min(limits.temperature, UNBOUNDED),
        min(limits.following_error, UNBOUNDED),
        limits.torque / steps,
        min(travel, UNBOUNDED),
        sample_time,
    )


def stop(reason: float, value: float, s: Any) -> None:
    """Begin to stop; the first reason is kept."""
    if s.state == RUNNING or s.state == ENDED:
        s.state = STOPPING
        s.reason = reason
        s.value = value


def watch_motion(y: Any, w: Any, b: Any, s: Any) -> None:
    """Limits on position, speed and following error. NaN fails every comparison, so it is asked for first."""
    if not abs(y.position) < UNBOUNDED:
        stop(NOT_FINITE, y.position, s)
        return
    if s.started == 0.0:
        s.started = 1.0
        s.origin = y.position
        s.position = y.position
    s.velocity = (y.position - s.position) / b.sample_time
    s.position = y.position
    if y.position < b.low or y.position > b.high:
        stop(POSITION, y.position, s)
    if abs(s.velocity) > b.speed:
        stop(SPEED, s.velocity, s)
    if w.closed != 0.0 and not abs(w.position - y.position) <= b.following:
        stop(FOLLOWING, w.position - y.position, s)


def watch_state(y: Any, b: Any, s: Any) -> None:
    """The rig's status, measured torques and temperature; a sensor that the rig lacks reads NaN."""
    if y.status != 0.0:
        stop(STATUS, y.status, s)
    if abs(y.torque) > MEASURED * b.torque:
        stop(TORQUE, y.torque, s)
    if abs(y.sensor) > MEASURED * b.torque:
        stop(TORQUE, y.sensor, s)
    # Where a temperature is limited, one that cannot be read is too high.
    if b.temperature < UNBOUNDED and not y.temperature <= b.temperature:
        stop(TEMPERATURE, y.temperature, s)


def idle(y: Any, w: Any, n: Any, m: Any, z: Any, p: Any, u: Any) -> float:
    """The loop is open: the controller watches, so that it can be closed at any sample. Returns no torque."""
    follow(y.position, y.position, w.velocity, 0.0, w.torque, n, m, z, p, u)
    m.others = 0.0
    return 0.0


def control(y: Any, w: Any, s: Any, n: Any, m: Any, z: Any, p: Any, u: Any) -> float:
    """The controller's torque, N·m; one that takes over starts where the last command left the axis."""
    u.time = y.time
    if abs(y.temperature) < UNBOUNDED:
        u.temperature = y.temperature
    if w.closed == 0.0:
        return w.torque + idle(y, w, n, m, z, p, u)
    if m.open != 0.0:
        m.applied = s.torque - w.torque
    return w.torque + sample(y.position, w.position, w.velocity, w.acceleration, n, m, z, p, u)


def ramp(b: Any, s: Any) -> None:
    """One sample of the stop."""
    if abs(s.torque) <= b.fall * (1.0 + 1e-9):
        s.torque = 0.0
        s.state = STOPPED
    else:
        s.torque -= math.copysign(b.fall, s.torque)


def guarded(y: Any, w: Any, b: Any, s: Any, n: Any, m: Any, z: Any, p: Any, u: Any) -> float:
    """One sample of the loop: watch, control, and stop if there is reason to. Returns the torque command, N·m."""
    watch_motion(y, w, b, s)
    watch_state(y, b, s)
    if s.state == RUNNING:
        torque = control(y, w, s, n, m, z, p, u)
        if m.fault != 0.0:
            stop(NOT_FINITE, w.velocity, s)
        elif abs(torque) <= b.torque:
            s.torque = torque
            if abs(y.position - s.origin) > b.travel:
                s.state = ENDED
        elif abs(torque) > b.torque:
            stop(TORQUE, torque, s)
        else:
            stop(NOT_FINITE, torque, s)
    if s.state == STOPPING:
        ramp(b, s)
    return s.torque


def guarded_by(functions: Mapping[str, Callable[..., float]]) -> Callable[..., float]:
    """`guarded` with the functions of a controller (`Controller.functions`)."""
    return bound(guarded, {name: functions[name] for name in ("sample", "follow")})
