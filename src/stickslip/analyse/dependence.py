"""Torque against position and against time while the axis slides; thesis 2.1.5, 2.1.6, figures 4.6, 4.7, 4.29 to 4.32.

Every revolution of every record is a pass: the torque over the angle of the shaft. Passes at different times separate
drift from dependence on position: "the shape of the friction curve is almost kept while the amplitude is changing in
time".
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.analyse.spectrum import channel_of
from stickslip.core.errors import InputError, ParameterError
from stickslip.core.record import Record

Array = np.ndarray[Any, np.dtype[np.float64]]

BINS = 72
"""Bins of a revolution, 5 degrees each, for averaging torques; the thesis filtered its sensor's torque."""
FULL = 0.9
"""Share of the bins that a pass must cover."""
HARMONICS = 4
SAME_VELOCITY = 0.02
"""Largest relative difference of the mean velocities of repeated passes."""


@dataclass(frozen=True, eq=False)
class Pass:
    """The torque over one revolution.

    Attributes
    ----------
    name, channel : str
        Of the record, and of the torque.
    time : float
        s, middle of the pass on the record's clock.
    velocity : float
        Mean, rad/s.
    torque : array, shape (BINS,)
        N·m over the angle, in the direction of motion; NaN in bins without samples.
    """

    name: str
    channel: str
    time: float
    velocity: float
    torque: Array

    @property
    def mean(self) -> float:
        """N·m"""
        return float(np.nanmean(self.torque))

    @property
    def swing(self) -> float:
        """Peak-to-peak value over the angle, N·m."""
        return float(np.nanmax(self.torque) - np.nanmin(self.torque))

    def is_repeat_of(self, other: Pass) -> bool:
        """Whether it is the same channel at the same velocity and direction."""
        same = abs(self.velocity - other.velocity) <= SAME_VELOCITY * abs(other.velocity)
        return same and self.channel == other.channel

    def harmonics(self, count: int = HARMONICS) -> Array:
        """Return the amplitudes of the first harmonics of a revolution, N·m, by least squares."""
        good = np.isfinite(self.torque)
        angle = (np.flatnonzero(good) + 0.5) * 2.0 * math.pi / BINS
        columns = [np.ones_like(angle)]
        for n in range(1, count + 1):
            columns += [np.cos(n * angle), np.sin(n * angle)]
        found = np.linalg.lstsq(np.column_stack(columns), self.torque[good], rcond=None)[0]
        # A mean over a bin of width b flattens harmonic n by sinc(n b / 2).
        flat = np.sinc(np.arange(1, count + 1) / BINS)
        return np.hypot(found[1::2], found[2::2]) / flat


@dataclass(frozen=True, eq=False)
class Dependence:
    """All passes of a channel.

    Attributes
    ----------
    channel : str
    passes : tuple of Pass
        In order of the records, then of time.
    """

    channel: str
    passes: tuple[Pass, ...]

    @property
    def angle(self) -> Array:
        """Centres of the bins, rad."""
        return (np.arange(BINS) + 0.5) * 2.0 * math.pi / BINS

    @property
    def alike(self) -> float:
        """Smallest correlation of a pass with the first: 1 if the shape over the angle is constant."""
        first = self.passes[0].torque
        found = [
            float(np.corrcoef(first[good], p.torque[good])[0, 1])
            for p in self.passes[1:]
            if np.sum(good := np.isfinite(first) & np.isfinite(p.torque)) > 2
        ]
        return min(found, default=math.nan)

    @property
    def drift(self) -> float:
        """Largest range of the means of passes at one velocity and direction, relative to their mean.

        NaN if no velocity is repeated.
        """
        groups: list[list[Pass]] = []
        for p in self.passes:
            group = next((g for g in groups if p.is_repeat_of(g[0])), None)
            if group is None:
                groups.append([p])
            else:
                group.append(p)
        means = [np.array([p.mean for p in group]) for group in groups if len(group) > 1]
        return max((float(np.ptp(m) / abs(np.mean(m))) for m in means), default=math.nan)

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "channel": self.channel, "alike": self.alike, "drift": self.drift,
            "passes": [
                {
                    "record": p.name, "time": p.time, "velocity": p.velocity, "mean": p.mean, "swing": p.swing,
                    "harmonics": p.harmonics().tolist(),
                }
                for p in self.passes
            ],
        }  # fmt: skip

    def lines(self) -> list[str]:
        """Return the lines of the report."""
        rows = [
            f"{p.name}: at {p.time:7.1f} s, {p.velocity:+.4g} rad/s: mean {p.mean:.4f} N·m, "
            f"peak to peak {p.swing:.4f}, harmonics {', '.join(f'{1e3 * a:.1f}' for a in p.harmonics())} mN·m"
            for p in self.passes
        ]
        if len(self.passes) < 2:
            return rows
        change = f"the mean changes by {100 * self.drift:.3g} % at one velocity and direction, "
        kept = f"the shape is constant with a correlation of {self.alike:.3f}"
        return [*rows, f"over the passes {change if math.isfinite(self.drift) else ''}{kept}"]


def dependence(
    records: Mapping[str, Record],
    channel: str = "motor_torque",
    *more: str,
    transient: float = math.radians(20.0),
) -> Dependence:
    """Return the torque over the angle, for every revolution of every record.

    Parameters
    ----------
    records : mapping of str to Record
        By name; each slides in one direction.
    channel : str
        A torque.
    *more : str
        Further torques of the same records; their passes are added.
    transient : float
        Travel to ignore at the start, rad (thesis: 20 degrees).

    Raises
    ------
    ParameterError, InputError
        InputError if no record contains a whole revolution.
    """
    if not (transient >= 0.0 and math.isfinite(transient)):
        raise ParameterError(f"dependence: transient = {transient:g} rad must be 0 or greater")
    passes = tuple(
        p if not more else replace(p, name=f"{p.name}, {one.removesuffix('_torque')}")
        for name, record in records.items()
        for one in (channel, *more)
        for p in _passes(name, record, one, transient)
    )
    if not passes:
        raise InputError(
            f"dependence: no record covers {100 * FULL:g} % of a revolution after the first "
            f"{math.degrees(transient):g} degrees; give longer ones, or less transient"
        )
    return Dependence(channel if not more else "torque", passes)


def _passes(name: str, record: Record, channel: str, transient: float) -> Iterator[Pass]:
    torque, _ = channel_of(record, channel)
    position = record["position"]
    direction = math.copysign(1.0, position[-1] - position[0])
    travel = direction * (position - position[0]) - transient
    turn = np.floor(travel / (2.0 * math.pi) + 1e-12).astype(np.int64)
    for i in range(int(turn.max()) + 1):
        rows = np.flatnonzero((turn == i) & np.isfinite(torque))
        if not rows.size:
            continue
        place = (
            np.floor(np.mod(position[rows], 2.0 * math.pi) / (2.0 * math.pi) * BINS).astype(np.int64) % BINS
        )
        counts = np.bincount(place, minlength=BINS)
        if np.count_nonzero(counts) < FULL * BINS:
            continue
        sums = np.bincount(place, weights=direction * torque[rows], minlength=BINS)
        over = np.divide(sums, counts, out=np.full(BINS, math.nan), where=counts > 0)
        time = record.time[rows]
        speed = (position[rows[-1]] - position[rows[0]]) / (time[-1] - time[0])
        yield Pass(name, channel, float(0.5 * (time[0] + time[-1])), float(speed), over)
