"""A stretch of time as the meter is handed it: five equally spaced nodes of each signal, and what lies between them."""

from __future__ import annotations

from typing import Any

from stickslip.jit import kernel

TRIGGER = 1e-3  # rad/s, Schmitt trigger of the reversals, and standstill
NEARLY = 0.9  # of it; between nodes that are lower no crest passes it

# ---- where the rows of the nodes begin: position error, velocity error, position, velocity, reference velocity, and
# the torques of motor, friction and compensator
SIGNALS = 8
ERROR, ERROR_RATE, AT, SPEED, REFERENCE_SPEED, MOTOR, FRICTION, COMPENSATING = range(0, 5 * SIGNALS, 5)


@kernel(exact=False)
def extremes(nodes: Any, d: float) -> tuple[float, float]:
    """Smallest and largest error over the nodes, spaced d apart, and between them where its slope changes sign."""
    low = nodes[ERROR]
    high = nodes[ERROR]
    for i in range(1, 5):
        low = min(low, nodes[ERROR + i])
        high = max(high, nodes[ERROR + i])
        if nodes[ERROR_RATE + i - 1] * nodes[ERROR_RATE + i] < 0.0:
            between = summit(
                nodes[ERROR + i - 1], nodes[ERROR_RATE + i - 1], nodes[ERROR + i], nodes[ERROR_RATE + i], d
            )  # fmt: skip
            low = min(low, between)
            high = max(high, between)
    return low, high


@kernel(exact=False, inline=True)
def summit(y0: float, d0: float, y1: float, d1: float, d: float) -> float:
    """The cubic through two values and slopes of opposite sign, d apart, where a straight slope vanishes."""
    x = d0 / (d0 - d1)
    y = 1.0 - x
    return y * y * (1.0 + 2.0 * x) * y0 + x * x * (3.0 - 2.0 * x) * y1 + x * y * d * (y * d0 - x * d1)


@kernel(exact=False)
def speed_at(nodes: Any, x: float) -> float:
    """The quartic through the velocities at the five nodes, at x = 0 to 4."""
    d1 = nodes[SPEED + 1] - nodes[SPEED]
    d2 = nodes[SPEED + 2] - 2.0 * nodes[SPEED + 1] + nodes[SPEED]
    d3 = nodes[SPEED + 3] - 3.0 * nodes[SPEED + 2] + 3.0 * nodes[SPEED + 1] - nodes[SPEED]
    d4 = (
        nodes[SPEED + 4]
        - 4.0 * nodes[SPEED + 3]
        + 6.0 * nodes[SPEED + 2]
        - 4.0 * nodes[SPEED + 1]
        + nodes[SPEED]
    )
    rise = d3 + 0.25 * (x - 3.0) * d4
    return nodes[SPEED] + x * (d1 + 0.5 * (x - 1.0) * (d2 + (x - 2.0) / 3.0 * rise))


@kernel(exact=False)
def crest(nodes: Any, i: int) -> float:
    """The velocity at node i, or, where only a crest between the node before and it passes TRIGGER, that crest.

    Else the place of the nodes, which is the step's and not the motion's, would decide whether it counts.
    """
    v = nodes[SPEED + i]
    near = max(abs(v), abs(nodes[SPEED + i - 1]))
    if near > TRIGGER or near < NEARLY * TRIGGER:
        return v
    top = v
    before = nodes[SPEED + i - 1]
    now = speed_at(nodes, i - 0.875)
    for j in range(2, 9):
        after = speed_at(nodes, i - 1.0 + 0.125 * j)
        bend = before - 2.0 * now + after
        if abs(now) > abs(top) and (now - before) * (after - now) <= 0.0 and bend * now < 0.0:
            top = now - (after - before) * (after - before) / (8.0 * bend)
        before, now = now, after
    return top


@kernel(exact=False)
def peak(nodes: Any, so_far: float) -> float:
    """Largest |v| of the quartic through the five nodes, where it may exceed the one so far; else 0.

    Sampled finely and refined by a parabola.
    """
    if (
        1.3
        * max(
            abs(nodes[SPEED]),
            abs(nodes[SPEED + 1]),
            abs(nodes[SPEED + 2]),
            abs(nodes[SPEED + 3]),
            abs(nodes[SPEED + 4]),
        )
        < so_far
    ):
        return 0.0
    top = 0.0
    before, middle = 0.0, 0.0
    for i in range(33):
        now = abs(speed_at(nodes, i / 8.0))
        bend = before - 2.0 * middle + now
        if i > 1 and middle >= before and middle >= now and bend < 0.0:
            top = max(top, middle - (now - before) * (now - before) / (8.0 * bend))
        top = max(top, now)
        before, middle = middle, now
    return top
