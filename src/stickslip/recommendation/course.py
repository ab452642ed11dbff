"""The motion of a trial, from rest to rest: the evaluated part, with run-up and braking.

Only a part of a log is simulated, which may start or end mid-move. A reference that stops abruptly saturates the loop,
and the error of that stop would dominate. So the part is cut at rests. If it rests too rarely (a sine, a staircase), a
smooth run-up and braking are added and not scored. At jumps of the reference its velocity is undefined and set to 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from stickslip.identification.motion import HOLD, REST, Motion

Array = np.ndarray[Any, np.dtype[np.float64]]

RESTING = 3
"""Fewest points of a rest; a reversal may have one or two points at rest."""
MOST_LOST = 0.5
"""Largest share of the travel to leave out for a start and end at rest."""
GENTLE, USUAL = 0.5, 0.98
"""Acceleration of run-up and braking, as a share of this quantile of the motion's own."""
SHORTEST, LONGEST = 0.1, 1.0
"""Range of the duration of run-up and braking, s."""
RAMP = 16
"""Pieces of run-up and braking."""
JUMP = 0.035
"""s: a faster move from rest to rest is a jump, which no position loop can follow."""
SUDDEN, SMALLEST = 20.0, 1e-3
"""Smallest jump, as a multiple of the speed before and after it, and as a share of the motion's span."""
LEAP, ELSEWHERE = 5.0, 0.8
"""Smallest acceleration of a jump, as a multiple of this quantile of the motion's accelerations."""


@dataclass(frozen=True, eq=False)
class Course:
    """The motion for testing a setting.

    Attributes
    ----------
    judged : Motion
        The evaluated part.
    whole : Motion
        The same, from rest to rest.
    run_up, braking : float
        s before and after the evaluated part; 0 if it starts or ends at rest.
    jumps : tuple of (float, float)
        Start and end of each jump of the position, s from the start of `whole`.
    """

    judged: Motion
    whole: Motion
    run_up: float = 0.0
    braking: float = 0.0
    jumps: tuple[tuple[float, float], ...] = ()

    def sampled(self, sample_time: float) -> Array:
        """Return position, velocity and acceleration at every sample, shape (n, 3): from rest at 0, with `HOLD` at rest
        after it. Jumps of the position take one sample."""
        out = self.whole.sampled(sample_time)
        for begin, end in self._rows(sample_time):
            middle = (begin + end) // 2
            out[begin:middle, 0], out[middle : end + 1, 0] = out[begin, 0], out[end, 0]
            out[begin : end + 1, 1:] = 0.0
        return out

    def backward(self, reference: Array, sample_time: float) -> Array:
        """Return the same with the mean velocity over the previous sample: 0 where the position jumps."""
        out = reference.copy()
        out[:, 1] = np.diff(out[:, 0], prepend=out[0, 0]) / sample_time
        for begin, end in self._rows(sample_time):
            out[begin : end + 1, 1] = 0.0
        return out

    def rows_judged(self, samples: int, sample_time: float) -> slice:
        """Return the evaluated rows of `sampled`."""
        return slice(
            round(self.run_up / sample_time),
            samples - round(HOLD / sample_time) - round(self.braking / sample_time),
        )

    def _rows(self, sample_time: float) -> list[tuple[int, int]]:
        """Return the last sample before every jump and the first one after it."""
        return [
            (int(begin / sample_time), max(round(end / sample_time), int(begin / sample_time) + 1))
            for begin, end in self.jumps
        ]

    @cached_property
    def highest_jump(self) -> float:
        """Largest jump, rad; 0 without jumps."""
        t = self.whole.time - self.whole.time[0]
        at = (np.interp([begin, end], t, self.whole.position) for begin, end in self.jumps)
        return max((abs(float(end - begin)) for begin, end in at), default=0.0)

    @property
    def said(self) -> str:
        """Description of run-up and braking; empty if it starts and ends at rest."""
        if self.run_up and self.braking:
            how = (
                f"starts and ends in motion: a run-up of {self.run_up:.2g} s and a braking of "
                f"{self.braking:.2g} s are added"
            )
        elif self.run_up:
            how = f"starts in motion: a run-up of {self.run_up:.2g} s is added"
        elif self.braking:
            how = f"ends in motion: a braking of {self.braking:.2g} s is added"
        else:
            return ""
        return f"{how} and not scored"


def course_of(motion: Motion) -> Course:
    """Return the course of a motion: its part from rest to rest, or all of it with a smooth start and end."""
    jumping = [] if measured(motion) else list(jumps_of(motion))
    velocity, times = motion.velocity.copy(), motion.time
    for first, last in jumping:
        velocity[first : last + 1] = 0.0
    own = from_rest_to_rest(replace(motion, velocity=velocity))
    before, behind = run_up_to(own), braked_from(own)
    whole = (np.concatenate(parts) for parts in zip(before, _points(own), behind, strict=True))
    time, position, velocity = whole
    velocity[[0, -1]] = 0.0
    begin = float(time[0])
    jumps = ((float(times[first]), float(times[last])) for first, last in jumping)
    return Course(
        own, Motion(time, position, velocity, own.source), float(own.time[0]) - begin,
        float(time[-1] - own.time[-1]),
        tuple((a - begin, b - begin) for a, b in jumps if own.time[0] <= a and b <= own.time[-1]),
    )  # fmt: skip


def measured(motion: Motion) -> bool:
    """Whether it is the measured motion of a log without a reference."""
    return motion.source.startswith("position")


def jumps_of(motion: Motion) -> Iterator[tuple[int, int]]:
    """Return the last point before every jump of the position and the first one after it."""
    time, position = motion.time, motion.position
    speed = np.abs(np.diff(position) / np.diff(time))
    least = SMALLEST * float(np.ptp(position))
    bearable = LEAP * float(np.quantile(np.abs(np.diff(motion.velocity) / np.diff(time)), ELSEWHERE))
    around = np.concatenate([[0.0], speed, [0.0]])  # It rests before and after.
    first = 0
    while first < speed.size:
        for last in range(first + 1, min(first + 3, speed.size) + 1):
            lasts = float(time[last] - time[first])
            quiet = SUDDEN * float(max(around[first], around[last + 1]))
            # A move from rest to rest requires at least four times the distance divided by the time squared.
            beyond = max(least, quiet * lasts, 0.25 * bearable * lasts**2)
            if speed[first] > quiet and lasts <= JUMP and abs(position[last] - position[first]) > beyond:
                yield first, last
                first = last
                break
        first += 1


def from_rest_to_rest(motion: Motion) -> Motion:
    """Return its part from rest to rest; an end stays if that would leave out too much of the travel."""
    size, way = motion.time.size, _way(motion)
    first, last = 0, size - 1
    rests = [(begin + end) // 2 for begin, end in resting(motion)]
    ends: list[tuple[float, bool, int]] = []
    if rests and _moves(motion, 0):
        ends.append((float(way[rests[0]]), True, rests[0]))
    if rests and _moves(motion, -1):
        ends.append((float(way[-1] - way[rests[-1]]), False, rests[-1]))
    left = MOST_LOST * float(way[-1])
    for lost, at_begin, index in sorted(ends):
        if lost <= left:
            left -= lost
            first, last = (index, last) if at_begin else (first, index)
    if (first, last) == (0, size - 1):
        return motion
    kept, begin = slice(first, last + 1), float(motion.time[0])
    span = " to ".join(f"{float(t) - begin:.3g}" for t in motion.time[[first, last]])
    own = (x[kept] for x in _points(motion))
    return Motion(*own, source=f"{motion.source}; from {span} s, rest to rest")


def resting(motion: Motion) -> Iterator[tuple[int, int]]:
    """Return the first and last point of every rest."""
    still = np.abs(motion.velocity) <= REST * motion.top_speed
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    for first, behind in edges.reshape(-1, 2):
        if behind - first >= RESTING:
            yield int(first), int(behind) - 1


def run_up_to(motion: Motion) -> tuple[Array, Array, Array]:
    """Return times, positions and velocities of the run-up to a motion; none if it starts at rest."""
    backwards = Motion(-motion.time[::-1], motion.position[::-1], -motion.velocity[::-1])
    time, position, velocity = braked_from(backwards)
    return -time[::-1], position[::-1], -velocity[::-1]


def braked_from(motion: Motion) -> tuple[Array, Array, Array]:
    """Return times, positions and velocities of the braking after a motion; none if it ends at rest.

    The velocity is a cubic that starts with the motion's last acceleration and ends with zero.
    """
    if not _moves(motion, -1):
        return np.zeros(0), np.zeros(0), np.zeros(0)
    acceleration = np.diff(motion.velocity) / np.diff(motion.time)
    gentle = GENTLE * float(np.quantile(np.abs(acceleration), USUAL))
    speed = float(motion.velocity[-1])
    longest = max(SHORTEST, min(LONGEST, 0.5 * motion.duration))
    duration = min(max(1.5 * abs(speed) / gentle, SHORTEST), longest) if gentle > 0.0 else longest
    # Beyond three times the speed the cubic would reverse before it rests.
    bend = float(np.clip(duration * float(np.mean(acceleration[-3:])), -3.0 * abs(speed), 3.0 * abs(speed)))
    u = np.linspace(0.0, 1.0, RAMP + 1)[1:]
    velocity = speed * (1.0 - 3.0 * u**2 + 2.0 * u**3) + bend * (u - 2.0 * u**2 + u**3)
    way = speed * (u - u**3 + 0.5 * u**4) + bend * (u**2 / 2.0 - 2.0 * u**3 / 3.0 + u**4 / 4.0)
    return motion.time[-1] + duration * u, motion.position[-1] + duration * way, velocity


def _moves(motion: Motion, end: int) -> bool:
    """Whether it moves at its start (0) or end (-1)."""
    return abs(float(motion.velocity[end])) > REST * motion.top_speed


def _points(motion: Motion) -> tuple[Array, Array, Array]:
    return motion.time, motion.position, motion.velocity


def _way(motion: Motion) -> Array:
    """Return the distance travelled at every point, rad."""
    return np.concatenate([[0.0], np.cumsum(np.abs(np.diff(motion.position)))])
