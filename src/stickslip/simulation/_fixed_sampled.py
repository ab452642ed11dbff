"""The controller as a drive runs it: every sample time, from a counted position, its output held in between.

Velocity is the difference of the last two measured positions over the sample time; the compensator's velocity
may pass a second-order Butterworth low-pass (bilinear transform, corner prewarped: Oppenheim and Schafer,
Discrete-Time Signal Processing, 7.1); the integral is a sum of trapezoids.
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import call_step, kernel, pointer
from stickslip.simulation._case import (
    ENCODER,
    FILTER,
    FROM_MEASUREMENT,
    FROM_REFERENCE,
    GAIN,
    KD,
    KI,
    KP,
    KR,
    SAMPLE_TIME,
    SOURCE,
    TORQUE_LIMIT,
)

# ---- what the drive remembers from sample to sample; the compensator's state follows ----------------------
STARTED, LAST_POSITION, LAST_ERROR, ERROR_SUM, SEEN, IN_1, IN_2, OUT_1, OUT_2, HELD, COMPENSATION, MEMORY = (
    range(12)
)


@kernel()
def measured_position(position: float, counts: float) -> float:
    """The position in whole counts of the encoder, rad; exact where it has none."""
    if counts <= 0.0:
        return position
    count = 2.0 * math.pi / counts
    return count * math.floor(position / count + 0.5)


@kernel()
def low_passed(m: Any, x: float, corner: float, sample_time: float) -> float:
    """Second-order Butterworth low-pass of the sequence x; corner in rad/s below half the sample rate."""
    g = math.tan(0.5 * min(corner * sample_time, 0.99 * math.pi))
    scale = 1.0 / (1.0 + math.sqrt(2.0) * g + g * g)
    back_1 = 2.0 * (g * g - 1.0) * scale
    back_2 = (1.0 - math.sqrt(2.0) * g + g * g) * scale
    y = g * g * scale * (x + 2.0 * m[IN_1] + m[IN_2]) - back_1 * m[OUT_1] - back_2 * m[OUT_2]
    m[IN_2], m[IN_1] = m[IN_1], x
    m[OUT_2], m[OUT_1] = m[OUT_1], y
    return y


@kernel()
def compensation(n: Any, m: Any, law: int, p: Any, u: Any, seen: float, position: float) -> float:
    """Torque of the compensator's law, which moved from the last velocity to the present one, N·m."""
    if n[FILTER] > 0.0:
        seen = low_passed(m, seen, n[FILTER], n[SAMPLE_TIME])
    last = m[SEEN] if m[STARTED] != 0.0 else seen
    m[SEEN] = seen
    u[0] = position
    # Before the first sample nothing has moved yet.
    elapsed = n[SAMPLE_TIME] if m[STARTED] != 0.0 else 0.0
    return n[GAIN] * call_step(law, last, seen, elapsed, pointer(m, MEMORY), pointer(p, 0), pointer(u, 0))


@kernel()
def sample(
    n: Any, m: Any, law: int, p: Any, u: Any, position: float, wanted: float, wanted_velocity: float
) -> None:
    """One sample of the drive: measure, control, compensate, limit; the output lies in the memory m, N·m."""
    measured = measured_position(position, n[ENCODER])
    velocity = 0.0
    error = wanted - measured
    if m[STARTED] != 0.0:
        velocity = (measured - m[LAST_POSITION]) / n[SAMPLE_TIME]
        m[ERROR_SUM] += 0.5 * n[SAMPLE_TIME] * (m[LAST_ERROR] + error)
    torque = n[KP] * error + n[KR] * wanted_velocity - n[KD] * velocity + n[KI] * m[ERROR_SUM]
    m[COMPENSATION] = 0.0
    if n[SOURCE] == FROM_REFERENCE:
        m[COMPENSATION] = compensation(n, m, law, p, u, wanted_velocity, measured)
    elif n[SOURCE] == FROM_MEASUREMENT:
        m[COMPENSATION] = compensation(n, m, law, p, u, velocity, measured)
    torque += m[COMPENSATION]
    m[HELD] = min(max(torque, -n[TORQUE_LIMIT]), n[TORQUE_LIMIT])
    m[LAST_POSITION], m[LAST_ERROR], m[STARTED] = measured, error, 1.0
