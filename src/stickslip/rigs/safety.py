"""The safety of the loop: limits, plausibility of the rig's answers, and the stop, one sample at a time.

`guarded` is one whole sample of the loop: it checks the limits, runs the controller (`stickslip.control.composition`),
and from the sample that detects a reason to stop it ramps the torque to zero. It is written in the scalar subset
(`stickslip.subset`), so every loop runs the same compiled code, and tests run plain Python. Once the ramp has started,
only the number of samples determines the torque: no measurement, setpoint or controller can prolong it.

Checks of an answer, all within `stickslip.rigs.rig.Limits.answer_time` (t):

- Its time increases in every sample, by no more than a sample and t, and not for t at a rate that is a quarter off.
- The position changes within t if a torque acts that must move the axis. If the encoder is coarse, an axis at rest
  shows no change of any reading up to its break-away torque; therefore that torque is declared,
  `stickslip.rigs.rig.Limits.standstill_torque`. Under a torque T beyond the break-away torque F_S the axis would move
  by (T - F_S) t² / 2 J, which is far more than a count. If a driven, sliding axis is at rest from one
  sample to the next, the torque under which it slid replaces the declared one: friction alone stops no inertia within
  a sample.
- Not every reading stays as it is for t while the torque command changes by a tenth of its limit, if the measured
  torque has changed before.
- The measured torque follows the command: averaged over t they differ by no more than a third of the command and a
  twentieth of the limit. The sensor's has its direction while the motor drives the axis. Neither is NaN for t after
  it was measured.

A limit may be crossed before t has passed. Then a measured torque that differs, and an axis whose speed has grown
against the torque for ten samples, are named as the possible cause.

While the loop is open the laws run, so an observer knows the disturbance when it is closed.

Arguments: what is measured ``y`` (`Measurement`) and its setpoint ``w`` (`Setpoint`), the bounds ``b``, the memory of
the safety ``s``, and the controller's settings ``n``, memory ``m``, and laws ``z``, ``p``, ``u``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, NamedTuple

from stickslip.control.composition import follow, sample
from stickslip.core.rebinding import bound
from stickslip.core.spec import Par
from stickslip.rigs.rig import Limits

# States; from STOPPED on no sample follows. ENDED: the segment's travel is reached, which is no fault; the next segment
# goes on.
RUNNING, STOPPING, STOPPED, ENDED = 0.0, 1.0, 2.0, 3.0

# Reasons to stop:
NONE, POSITION, SPEED, TORQUE, TEMPERATURE, FOLLOWING, NOT_FINITE, STATUS, ASKED = (
    0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0,
)  # fmt: skip
CLOCK, STILL, FROZEN, IGNORED, OPPOSED, LOST, AGAINST = 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0
REASONS = (
    "none", "position", "speed", "torque", "temperature", "following error", "not a number", "the rig's fault",
    "asked", "clock", "standstill", "frozen", "torque ignored", "sensor", "reading lost", "against the torque",
)  # fmt: skip
"""Words for the channel ``reason`` of a record."""

MEASURED = 1.25  # of the largest command, that a measured torque may reach: overshoot and noise
UNBOUNDED = 1e300  # means no bound

# Thresholds for the rig's answers; reasons are in the module's docstring.
RATE = 0.25  # of the sample time: lasting deviation of the clock's steps
SLID, SLIDING = 10.0, 0.05  # samples in a row, and of the speed limit: the axis slides
CHANGED = 0.1  # of the torque limit: a command that has changed, or is large enough to be compared
UNLIKE = 1.0 / 3.0  # of the command, and
OFFSET = 0.05  # of the torque limit: a measured torque that does not follow
SENSED = (
    5.0  # of the answer time, that a changing sensor may read against the motor: springs and inertia swing
)


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
    answer: Annotated[float, Par("s", "", "time without a plausible answer")]
    standstill: Annotated[float, Par("N·m", "", "largest torque at which the axis may stand still")]


class Safety(NamedTuple):
    """State of the safety from sample to sample."""

    state: Annotated[float, Par("-", "", "0 running, 1 stopping, 2 stopped, 3 segment ended")]
    reason: Annotated[float, Par("-", "", "why it stops: `REASONS`")]
    torque: Annotated[float, Par("N·m", "", "torque command")]
    started: Annotated[float, Par("-", "", "1 after the first sample")]
    position: Annotated[float, Par("rad", "", "position one sample ago")]
    velocity: Annotated[float, Par("rad/s", "", "difference of the positions over the sample time")]
    origin: Annotated[float, Par("rad", "", "position at the start of the segment")]
    value: Annotated[float, Par("-", "", "the value that crossed its limit")]
    time: Annotated[float, Par("s", "", "the rig's time one sample ago, as it is recorded")]
    begun: Annotated[
        float, Par("-", "", "samples of the segment; others may have passed before its second answer")
    ]
    astray: Annotated[float, Par("s", "", "for how long the clock has run at another rate")]
    driven: Annotated[float, Par("-", "", "samples in a row in which the motor drove a sliding axis")]
    push: Annotated[float, Par("N·m", "", "largest torque of these samples")]
    moving: Annotated[float, Par("N·m", "", "torque that must move the axis, which stands still")]
    still: Annotated[float, Par("s", "", "for how long it stands still under such a torque, with its sign")]
    motor: Annotated[float, Par("N·m", "", "measured torque one sample ago")]
    sensor: Annotated[float, Par("N·m", "", "torque sensor one sample ago")]
    warmth: Annotated[float, Par("°C", "", "temperature one sample ago")]
    alive: Annotated[float, Par("-", "", "1 once the measured torque has changed")]
    same: Annotated[float, Par("s", "", "for how long every reading has been the same")]
    least: Annotated[float, Par("N·m", "", "smallest command of that time")]
    most: Annotated[float, Par("N·m", "", "largest command of that time")]
    commanded: Annotated[float, Par("N·m", "", "mean command")]
    answered: Annotated[float, Par("N·m", "", "mean measured torque")]
    unlike: Annotated[float, Par("s", "", "for how long these have differed")]
    opposed: Annotated[float, Par("s", "", "for how long the sensor has read against the motor")]
    steady: Annotated[float, Par("s", "", "for how long the sensor's torque has been the same")]
    sensing: Annotated[float, Par("-", "", "1 once the sensor's torque has changed")]
    lost: Annotated[float, Par("s", "", "for how long a torque that was measured has been NaN")]
    against: Annotated[float, Par("s", "", "for how long the axis has moved against the torque")]
    turned: Annotated[float, Par("rad/s", "", "its speed when that began")]
    suspect: Annotated[float, Par("-", "", "the possible cause of a limit that is crossed: `REASONS`")]


def bounds(limits: Limits, sample_time: float, travel: float = math.inf) -> Bounds:
    """Return the limits as numbers; the ramp has as many samples as fit into ``stop_time``, at least one."""
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
        min(limits.answer_time, UNBOUNDED),
        min(limits.standstill_torque, UNBOUNDED),
    )


def stop(reason: float, value: float, s: Any) -> None:
    """Start to stop and keep the first reason. A ramp between two segments has none unless something is wrong."""
    if s.state != STOPPED and s.reason == NONE:
        s.state = STOPPING
        s.reason = reason
        s.value = value


def watch_motion(y: Any, w: Any, b: Any, s: Any) -> None:
    """Check position, speed and following error. NaN fails every comparison, so it is tested first."""
    if not abs(y.position) < UNBOUNDED:
        stop(NOT_FINITE, y.position, s)
        return
    s.velocity = (y.position - s.position) / b.sample_time
    if s.started == 0.0:
        s.origin = y.position
        s.velocity = 0.0
    if y.position < b.low or y.position > b.high:
        stop(POSITION, y.position, s)
    if abs(s.velocity) > b.speed:
        stop(SPEED, s.velocity, s)
    if w.closed != 0.0 and not abs(w.position - y.position) <= b.following:
        stop(FOLLOWING, w.position - y.position, s)


def watch_state(y: Any, b: Any, s: Any) -> None:
    """Check status, measured torques and temperature; a missing sensor reads NaN."""
    if y.status != 0.0:
        stop(STATUS, y.status, s)
    if abs(y.torque) > MEASURED * b.torque:
        stop(TORQUE, y.torque, s)
    if abs(y.sensor) > MEASURED * b.torque:
        stop(TORQUE, y.sensor, s)
    # If the temperature is limited, an unreadable one counts as too high.
    if b.temperature < UNBOUNDED and not y.temperature <= b.temperature:
        stop(TEMPERATURE, y.temperature, s)


def leaps(step: float, b: Any, s: Any) -> bool:
    """Whether the clock does not increase, or increases by more than a sample answered in time; allowed after a
    pause."""
    return not step > 0.0 or (step > b.sample_time + b.answer and s.begun > 2.0)


def watch_clock(y: Any, b: Any, s: Any) -> None:
    """Check that the rig's time advances, sample by sample."""
    step = y.time - s.time
    s.begun += 1.0
    if leaps(step, b, s):
        stop(CLOCK, step, s)
    elif abs(step - b.sample_time) <= RATE * b.sample_time:
        s.astray = 0.0
    else:
        s.astray += b.sample_time
        if s.astray > b.answer:
            stop(CLOCK, step, s)


def watch_standstill(y: Any, b: Any, s: Any) -> None:
    """Check that the position changes under a torque that must move the axis."""
    if y.position != s.position:
        s.still = 0.0
        s.moving = b.standstill
        if s.torque * s.velocity > 0.0 and abs(s.velocity) > SLIDING * b.speed:
            s.driven += 1.0
            s.push = max(s.push, abs(s.torque))
        else:
            s.driven = 0.0
            s.push = 0.0
        return
    if s.driven >= SLID:
        s.moving = min(s.push, b.standstill)
    s.driven = 0.0
    s.push = 0.0
    if abs(s.torque) < s.moving:
        s.still = 0.0
    elif s.torque * s.still < 0.0:
        s.still = math.copysign(b.sample_time, s.torque)
    else:
        s.still += math.copysign(b.sample_time, s.torque)
    if abs(s.still) > b.answer:
        stop(STILL, s.torque, s)


def differ(a: float, b: float) -> bool:
    """Whether two readings differ; a missing sensor reads NaN."""
    return a != b and (a == a or b == b)


def watch_readings(y: Any, b: Any, s: Any) -> None:
    """Check that some reading changes while the command does."""
    if abs(y.torque - s.motor) > 0.0:  # two numbers
        s.alive = 1.0
    if abs(y.sensor - s.sensor) > 0.0:
        s.sensing = 1.0
    if (s.alive != 0.0 and y.torque != y.torque) or (s.sensing != 0.0 and y.sensor != y.sensor):
        s.lost += b.sample_time
        if s.lost > b.answer:
            stop(LOST, 0.0 if y.torque != y.torque and s.alive != 0.0 else 1.0, s)
    else:
        s.lost = 0.0
    if (
        y.position != s.position or differ(y.torque, s.motor) or differ(y.sensor, s.sensor)
        or differ(y.temperature, s.warmth)
    ):  # fmt: skip
        s.same = 0.0
        s.least = s.torque
        s.most = s.torque
        return
    s.same += b.sample_time
    s.least = min(s.least, s.torque)
    s.most = max(s.most, s.torque)
    if s.same > b.answer and s.alive != 0.0 and s.most - s.least > CHANGED * b.torque:
        stop(FROZEN, s.same, s)


def watch_torque(y: Any, b: Any, s: Any) -> None:
    """Check that the measured torque follows the command, and the sensor has its direction when the motor drives the
    axis."""
    part = min(1.0, b.sample_time / b.answer)
    s.commanded += part * (s.torque - s.commanded)
    if abs(y.torque) < UNBOUNDED:
        s.answered += part * (y.torque - s.answered)
        command = abs(s.commanded)
        if (
            command > CHANGED * b.torque
            and abs(s.answered - s.commanded) > UNLIKE * command + OFFSET * b.torque
        ):
            s.unlike += b.sample_time
        else:
            s.unlike = 0.0
        if s.unlike > b.answer:
            stop(IGNORED, s.answered, s)
    s.steady = s.steady + b.sample_time if y.sensor == s.sensor else 0.0
    if s.torque * s.velocity > 0.0 and abs(y.sensor) > CHANGED * b.torque:
        if y.sensor * s.torque > 0.0:
            s.opposed = 0.0
        else:
            s.opposed += b.sample_time
            if s.opposed > SENSED * b.answer or min(s.opposed, s.steady) > b.answer:
                stop(OPPOSED, y.sensor, s)


def watch_direction(b: Any, s: Any) -> None:
    """Whether the axis moves with or against the torque."""
    if not s.torque * s.velocity < 0.0:
        s.against = 0.0
    else:
        if s.against == 0.0:
            s.turned = abs(s.velocity)
        s.against += b.sample_time


def suspected(b: Any, s: Any) -> float:
    """Return the possible cause if a limit is crossed now; the sample that crosses it is not evidence."""
    enough = (SLID - 0.5) * b.sample_time
    if s.unlike > enough:
        return IGNORED
    if s.against > enough and abs(s.velocity) > s.turned + SLIDING * b.speed:
        return AGAINST
    return NONE


def watch_answer(y: Any, b: Any, s: Any) -> None:
    """Check the rig's answer to the last command."""
    known = abs(y.position) < UNBOUNDED
    watched = b.answer < UNBOUNDED
    if s.started == 0.0:
        s.moving = b.standstill
        s.driven = 0.0
        s.push = 0.0
        s.still = 0.0
        s.same = 0.0
        s.astray = 0.0
        s.lost = 0.0
        s.against = 0.0
        s.least = s.torque
        s.most = s.torque
    elif watched and known:
        watch_clock(y, b, s)
        watch_standstill(y, b, s)
        watch_readings(y, b, s)
        watch_torque(y, b, s)
        watch_direction(b, s)
    # The times of a record increase, even after a faulty clock has become a reason to stop.
    leapt = watched and s.started != 0.0 and leaps(y.time - s.time, b, s)
    s.time = s.time + b.sample_time if leapt else y.time
    s.started = 1.0
    s.motor = y.torque
    s.sensor = y.sensor
    s.warmth = y.temperature
    if known:
        s.position = y.position


def idle(y: Any, w: Any, n: Any, m: Any, z: Any, p: Any, u: Any) -> float:
    """Run the controller in open loop, so the loop can be closed at any sample; return no torque."""
    follow(y.position, y.position, w.velocity, 0.0, w.torque, n, m, z, p, u)
    m.others = 0.0
    return 0.0


def control(y: Any, w: Any, s: Any, n: Any, m: Any, z: Any, p: Any, u: Any) -> float:
    """Return the controller's torque, N·m; one that takes over starts with the last command."""
    u.time = y.time
    if abs(y.temperature) < UNBOUNDED:
        u.temperature = y.temperature
    if w.closed == 0.0:
        return w.torque + idle(y, w, n, m, z, p, u)
    if m.open != 0.0:
        m.applied = s.torque - w.torque
    return w.torque + sample(y.position, w.position, w.velocity, w.acceleration, n, m, z, p, u)


def ramp(b: Any, s: Any) -> None:
    """Return the torque of one sample of the stop."""
    if abs(s.torque) <= b.fall * (1.0 + 1e-9):
        s.torque = 0.0
        s.state = STOPPED
    else:
        s.torque -= math.copysign(b.fall, s.torque)


def guarded(y: Any, w: Any, b: Any, s: Any, n: Any, m: Any, z: Any, p: Any, u: Any) -> float:
    """Run one sample of the loop: check, control, and stop if there is a reason; return the torque command, N·m."""
    if s.state == RUNNING:
        s.suspect = suspected(b, s)
    watch_motion(y, w, b, s)
    watch_state(y, b, s)
    watch_answer(y, b, s)
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
    """Return `guarded` with the functions of a controller (`Controller.functions`)."""
    return bound(guarded, {name: functions[name] for name in ("sample", "follow")})
