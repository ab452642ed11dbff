"""The course of a trial: a motion from rest to rest, the part of it that is judged, and how it gets there and away.

A log is longer than the part of it that is tried, and that part may begin or end in mid-move. A reference that stops
dead saturates the loop, and the error of that stop would be most of what is judged. So the part is cut where it rests.
Where it rests too seldom for that (a sine, a staircase), the axis is brought up to speed before it and braked behind
it, smoothly and not judged. Where the reference jumps, no drive knows a velocity: its reference velocity is 0 there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from stickslip.identify.motion import HOLD, REST, Motion

Array = np.ndarray[Any, np.dtype[np.float64]]

RESTING = 3
"""Points of a motion, at least, in which a rest shows: where it turns there may be one or two."""
MOST_LOST = 0.5
"""Of the way, that is left out at most so that a motion begins and ends at rest."""
GENTLE, USUAL = 0.5, 0.98
"""Part of this quantile of the motion's own acceleration, with which it is brought up to speed and braked."""
SHORTEST, LONGEST = 0.1, 1.0
"""s, that bringing it up to speed, or braking it, takes."""
RAMP = 16
"""Pieces of either."""
JUMP = 0.035
"""s: a way from rest to rest in less is a jump. No position loop follows it."""
SUDDEN, SMALLEST = 20.0, 1e-3
"""Times the speed before and behind it, and part of the motion's span, that a jump has at least."""
LEAP, ELSEWHERE = 5.0, 0.8
"""Times this quantile of the motion's accelerations, that a jump would take."""


@dataclass(frozen=True, eq=False)
class Course:
    """What a setting is tried along.

    Attributes
    ----------
    judged : Motion
        What is judged.
    whole : Motion
        The same from rest to rest.
    run_up, braking : float
        s before and behind what is judged; 0 where it begins or ends at rest.
    jumps : tuple of (float, float)
        Begin and end of each jump of the position, s from the begin of `whole`.
    """

    judged: Motion
    whole: Motion
    run_up: float = 0.0
    braking: float = 0.0
    jumps: tuple[tuple[float, float], ...] = ()

    def sampled(self, sample_time: float) -> Array:
        """Position, velocity and acceleration at every sample, shape (n, 3): from rest at 0, and `HOLD` at rest
        behind it. The position jumps from one sample to the next."""
        out = self.whole.sampled(sample_time)
        for begin, end in self._rows(sample_time):
            middle = (begin + end) // 2
            out[begin:middle, 0], out[middle : end + 1, 0] = out[begin, 0], out[end, 0]
            out[begin : end + 1, 1:] = 0.0
        return out

    def backward(self, reference: Array, sample_time: float) -> Array:
        """The same, its velocity the mean over the sample before: 0 where the position jumps."""
        out = reference.copy()
        out[:, 1] = np.diff(out[:, 0], prepend=out[0, 0]) / sample_time
        for begin, end in self._rows(sample_time):
            out[begin : end + 1, 1] = 0.0
        return out

    def rows_judged(self, samples: int, sample_time: float) -> slice:
        """The rows of `sampled` that are judged, of so many."""
        return slice(
            round(self.run_up / sample_time),
            samples - round(HOLD / sample_time) - round(self.braking / sample_time),
        )

    def _rows(self, sample_time: float) -> list[tuple[int, int]]:
        """The last sample before every jump, and the first one behind it."""
        return [
            (int(begin / sample_time), max(round(end / sample_time), int(begin / sample_time) + 1))
            for begin, end in self.jumps
        ]

    @cached_property
    def highest_jump(self) -> float:
        """rad; 0 where there is none."""
        t = self.whole.time - self.whole.time[0]
        at = (np.interp([begin, end], t, self.whole.position) for begin, end in self.jumps)
        return max((abs(float(end - begin)) for begin, end in at), default=0.0)

    @property
    def said(self) -> str:
        """How it gets to speed and to rest, for people; empty where it begins and ends at rest."""
        if self.run_up and self.braking:
            how = (
                f"begins and ends in motion: brought up to speed over {self.run_up:.2g} s before it and braked over "
                f"{self.braking:.2g} s behind it"
            )
        elif self.run_up:
            how = f"begins in motion: brought up to speed over {self.run_up:.2g} s before it"
        elif self.braking:
            how = f"ends in motion: braked over {self.braking:.2g} s behind it"
        else:
            return ""
        return f"{how}, which is not judged"


def course_of(motion: Motion) -> Course:
    """The course along a motion: its part from rest to rest, or all of it with a smooth begin and end."""
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
    """Whether it is what the axis did, and not what it was told: of a log that has no reference."""
    return motion.source.startswith("position")


def jumps_of(motion: Motion) -> Iterator[tuple[int, int]]:
    """The last point before every jump of the position, and the first one behind it."""
    time, position = motion.time, motion.position
    speed = np.abs(np.diff(position) / np.diff(time))
    least = SMALLEST * float(np.ptp(position))
    bearable = LEAP * float(np.quantile(np.abs(np.diff(motion.velocity) / np.diff(time)), ELSEWHERE))
    around = np.concatenate([[0.0], speed, [0.0]])  # It rests before and behind.
    first = 0
    while first < speed.size:
        for last in range(first + 1, min(first + 3, speed.size) + 1):
            lasts = float(time[last] - time[first])
            quiet = SUDDEN * float(max(around[first], around[last + 1]))
            # From rest to rest in a time takes four times the way over its square at least.
            beyond = max(least, quiet * lasts, 0.25 * bearable * lasts**2)
            if speed[first] > quiet and lasts <= JUMP and abs(position[last] - position[first]) > beyond:
                yield first, last
                first = last
                break
        first += 1


def from_rest_to_rest(motion: Motion) -> Motion:
    """Its part from rest to rest; at an end where that would leave out too much of the way, all of it."""
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
    return Motion(*own, source=f"{motion.source}; of it {span} s behind its begin, from rest to rest")


def resting(motion: Motion) -> Iterator[tuple[int, int]]:
    """First and last point of every rest."""
    still = np.abs(motion.velocity) <= REST * motion.top_speed
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    for first, behind in edges.reshape(-1, 2):
        if behind - first >= RESTING:
            yield int(first), int(behind) - 1


def run_up_to(motion: Motion) -> tuple[Array, Array, Array]:
    """Times, positions and velocities of points that lead from rest into a motion; none where it begins at rest."""
    backwards = Motion(-motion.time[::-1], motion.position[::-1], -motion.velocity[::-1])
    time, position, velocity = braked_from(backwards)
    return -time[::-1], position[::-1], -velocity[::-1]


def braked_from(motion: Motion) -> tuple[Array, Array, Array]:
    """Times, positions and velocities of points that lead from a motion to rest; none where it ends at rest.

    The velocity falls by a cubic that begins with the motion's last acceleration and ends with none.
    """
    if not _moves(motion, -1):
        return np.zeros(0), np.zeros(0), np.zeros(0)
    acceleration = np.diff(motion.velocity) / np.diff(motion.time)
    gentle = GENTLE * float(np.quantile(np.abs(acceleration), USUAL))
    speed = float(motion.velocity[-1])
    longest = max(SHORTEST, min(LONGEST, 0.5 * motion.duration))
    duration = min(max(1.5 * abs(speed) / gentle, SHORTEST), longest) if gentle > 0.0 else longest
    # Beyond three times the speed the cubic would go back before it rests.
    bend = float(np.clip(duration * float(np.mean(acceleration[-3:])), -3.0 * abs(speed), 3.0 * abs(speed)))
    u = np.linspace(0.0, 1.0, RAMP + 1)[1:]
    velocity = speed * (1.0 - 3.0 * u**2 + 2.0 * u**3) + bend * (u - 2.0 * u**2 + u**3)
    way = speed * (u - u**3 + 0.5 * u**4) + bend * (u**2 / 2.0 - 2.0 * u**3 / 3.0 + u**4 / 4.0)
    return motion.time[-1] + duration * u, motion.position[-1] + duration * way, velocity


def _moves(motion: Motion, end: int) -> bool:
    """Whether it moves at its begin (0) or end (-1)."""
    return abs(float(motion.velocity[end])) > REST * motion.top_speed


def _points(motion: Motion) -> tuple[Array, Array, Array]:
    return motion.time, motion.position, motion.velocity


def _way(motion: Motion) -> Array:
    """How far it has gone at every point, rad."""
    return np.concatenate([[0.0], np.cumsum(np.abs(np.diff(motion.position)))])
