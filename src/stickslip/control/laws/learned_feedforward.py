"""Learned feedforward: a map over angle and direction that takes over what the loop gives, repetition by repetition.

In every bin of the reference's angle, for each direction, the mean of the torque that is no feedforward is taken down;
after `samples` samples of motion the map takes a share of it over and is smoothed, [1/4 1/2 1/4]. An observer under it
has to see the residual, or it works against the map as against any feedforward. `table_feedforward` gives what was
learnt.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import REST, ControlLaw
from stickslip.core.spec import Kept, Learned, Par

TURN = 2.0 * math.pi  # rad


class Params(NamedTuple):
    """Range, pace, bound, and the map at the start."""

    lower: Annotated[float, Par("rad", "theta_0", "angle where the first bin begins")]
    upper: Annotated[float, Par("rad", "theta_1", "angle where the last bin ends")]
    samples: Annotated[float, Par("-", "N", "samples of a repetition; those at rest do not count", lower=1.0)]
    rate: Annotated[
        float, Par("-", "L", "share of the loop's torque that a repetition takes over", lower=0.0, upper=2.0)
    ]
    largest: Annotated[float, Par("N·m", "", "largest value of the map", positive=True)]
    forward: Annotated[
        tuple[float, ...], Par("N·m", "T_i^+", "map at the start, reference velocity at least 0, one per bin")
    ]
    backward: Annotated[tuple[float, ...], Par("N·m", "T_i^-", "the same for velocities below 0")]


class State(NamedTuple):
    """Internal state."""

    up: Annotated[tuple[float, ...], Learned("N·m", "", "map for velocities of at least 0")]
    down: Annotated[tuple[float, ...], Learned("N·m", "", "map for velocities below 0")]
    up_sum: Annotated[tuple[float, ...], Par("N·m", "", "sum of the loop's torque in a bin, forward")]
    down_sum: Annotated[tuple[float, ...], Par("N·m", "", "the same, backward")]
    up_count: Annotated[tuple[float, ...], Par("-", "", "samples in that sum, forward")]
    down_count: Annotated[tuple[float, ...], Par("-", "", "the same, backward")]
    known: Annotated[float, Kept("-", "", "1 once there is a map")]
    bin: Annotated[float, Par("-", "", "bin of the last sample")]
    side: Annotated[float, Par("-", "", "direction of the last sample: 1, -1, or 0 where it taught nothing")]
    passed: Annotated[float, Par("-", "k", "samples of motion since the repetition began")]


def start(z: Any, p: Any) -> None:
    """The map at the start."""
    for i in range(len(p.forward)):
        z.up[i] = p.forward[i]
        z.down[i] = p.backward[i]
    z.known = 1.0


def take_down(torque: float, z: Any, p: Any) -> None:
    """Add the torque that the last sample gave besides the feedforwards, N·m, to its bin."""
    i = int(z.bin)
    if z.side > 0.0:
        z.up_sum[i] += torque
        z.up_count[i] += 1.0
    if z.side < 0.0:
        z.down_sum[i] += torque
        z.down_count[i] += 1.0
    z.side = 0.0


def take_over(z: Any, p: Any) -> None:
    """Move the map by what was taken down, and begin anew."""
    for i in range(len(p.forward)):
        z.up[i] += p.rate * z.up_sum[i] / max(z.up_count[i], 1.0)
        z.down[i] += p.rate * z.down_sum[i] / max(z.down_count[i], 1.0)
        z.up_sum[i] = 0.0
        z.down_sum[i] = 0.0
        z.up_count[i] = 0.0
        z.down_count[i] = 0.0
    smooth(z, p)


def smooth(z: Any, p: Any) -> None:
    """The map through [1/4 1/2 1/4], its ends repeated, and within its bound."""
    n = len(p.forward)
    before_up = z.up[0]
    before_down = z.down[0]
    for i in range(n):
        after = i + 1
        if after >= n:
            after = i
        up = 0.25 * before_up + 0.5 * z.up[i] + 0.25 * z.up[after]
        down = 0.25 * before_down + 0.5 * z.down[i] + 0.25 * z.down[after]
        before_up = z.up[i]
        before_down = z.down[i]
        z.up[i] = min(max(up, -p.largest), p.largest)
        z.down[i] = min(max(down, -p.largest), p.largest)


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    if z.known == 0.0:
        start(z, p)
    take_down(y.residual, z, p)
    if z.passed >= p.samples:
        take_over(z, p)
        z.passed = 0.0
    if y.rest < REST:
        z.passed += 1.0
    n = float(len(p.forward))
    share = (TURN * y.turns + (y.position - p.lower) + y.error) / (p.upper - p.lower)
    place = min(max(n * share, 0.0), n - 0.5)
    z.bin = math.floor(place)
    if y.reference_velocity > 0.0:
        z.side = 1.0
    if y.reference_velocity < 0.0:
        z.side = -1.0
    middle = min(max(place - 0.5, 0.0), n - 1.0)
    low = int(middle)
    high = low + 1
    if high >= len(p.forward):
        high = low
    part = middle - math.floor(middle)
    if y.reference_velocity < 0.0:
        return (1.0 - part) * z.down[low] + part * z.down[high]
    return (1.0 - part) * z.up[low] + part * z.up[high]


def check(p: Any) -> str:
    """The range has a width, repetitions whole samples, and the share converges: below 2, at 2 it swings for ever."""
    if not p.upper > p.lower:
        return f"upper = {p.upper:g} rad must be greater than lower = {p.lower:g} rad"
    if not p.rate < 2.0:
        return f"rate = {p.rate:g} must be below 2: from there on a map moves by more than its error"
    if not float(p.samples).is_integer():
        return f"samples = {p.samples:g} must be a whole number"
    return ""


CONTROL_LAW = ControlLaw(
    "learned_feedforward", Params, sample, "feedforward",
    title="Learned feedforward",
    equation=r"T = M_{j}(\theta_d, \mathrm{sgn}\,\dot\theta_d),\quad M_{j+1} = Q\,(M_j + L\,\overline{T_m - T_{ff}})",
    source=("bristow2006", "own"),
    example={
        "lower": 0.0, "upper": 0.04, "samples": 100.0, "rate": 0.8, "largest": 1.0, "forward": [0.0] * 8,
        "backward": [0.0] * 8,
    },
    State=State,
    check=check,
    adapts=True,
)  # fmt: skip
