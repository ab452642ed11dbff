"""A record on an even grid, and its strokes: the intervals of gross sliding in one direction."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.record import encoder_step
from stickslip.identification.experiment import Experiment
from stickslip.identification.regression.inverse import uniform, white_noise
from stickslip.identification.windows import LEAST_SAMPLES, apply_at, unblurred_weights, window_weights
from stickslip.machines.servo import ServoAxis

Array = np.ndarray[Any, np.dtype[np.float64]]
Rows = np.ndarray[Any, np.dtype[np.int64]]

NARROWEST = 0.02
"""Half of the narrowest window, s. It passes the bandwidth of a servo's position loop, some tens of hertz."""
NOISE_SHARE = 2e-3
"""Power of the position's noise as a part of the acceleration's power: it biases the inertia by as much."""
WIDEN = 1.15
"""Ratio of one window tried to the next, until noise is that small."""
MOST_OF_RECORD = 0.05
"""Greatest half window as a part of the record: at least ten windows fit in it."""
CERTAIN = 6.0
"""Velocity, in standard deviations of its noise, from which on its sign is certain."""
CREEP = 0.003
"""Part of the highest speed below which a contact may still creep: the slope of a bristle through zero."""


class TooLittleSliding(InputError):
    """Too little sliding in one direction for any window."""


@dataclass(frozen=True, eq=False)
class SlidingRecord:
    """One experiment on an even grid, with its smooth motion and its strokes.

    Attributes
    ----------
    time, position, drive : array, shape (n,)
        s; rad (m) relative to `origin`; torque of the drive's signal, N·m (N), before `loss`.
    loss : float
        Loss of the drive's torque per velocity, N·m·s/rad.
    origin : float
        Position of the first sample, rad (m).
    velocity, acceleration : array, shape (n,)
        rad/s (m/s), rad/s² (m/s²), of the motion itself.
    stroke : array of int, shape (n,)
        Number of every sample's stroke; -1 outside strokes.
    since, until : array, shape (n,)
        Distance from the stroke's start and to its end, rad (m).
    fastest : float
        Speed that 0.5 % of the samples exceed, rad/s (m/s).
    torque_step : float
        Rounding step of the drive's column, N·m (N); 0 if no rounding shows.
    """

    time: Array
    position: Array
    drive: Array
    loss: float
    origin: float
    velocity: Array
    acceleration: Array
    stroke: Rows
    since: Array
    until: Array
    fastest: float
    torque_step: float

    @property
    def period(self) -> float:
        """Sample period, s."""
        return float((self.time[-1] - self.time[0]) / (self.time.size - 1))

    @property
    def sign(self) -> Array:
        """Direction of motion."""
        return np.sign(self.velocity)

    @cached_property
    def strokes(self) -> list[tuple[int, int]]:
        """First sample of every stroke and the one after its last."""
        edges = np.flatnonzero(np.diff(self.stroke, prepend=-1, append=-1))
        return [(i, j) for i, j in itertools.pairwise(edges.tolist()) if self.stroke[i] >= 0]


def narrowest_half(experiment: Experiment) -> float:
    """Return half of the narrowest window in which the position's noise hardly affects the acceleration, s.

    Raises
    ------
    TooLittleSliding
        If it is too long for the record.
    """
    t, q, _, rate = uniform(experiment)
    noise = math.sqrt(white_noise(q, rate) * rate / 2.0)
    half = max(LEAST_SAMPLES / rate, NARROWEST)
    while half <= MOST_OF_RECORD * float(t[-1] - t[0]):
        weights = window_weights(half, 1.0 / rate, (2,))
        m = weights.shape[1] // 2
        if 2 * m + 1 >= q.size:
            break
        stride = max(1, m // 2)
        centres: Rows = np.arange(m, q.size - m, stride, dtype=np.int64)
        acceleration = apply_at(q - q[0], centres, weights)
        if (noise * float(np.linalg.norm(weights))) ** 2 <= NOISE_SHARE * float(np.var(acceleration)):
            return half
        half *= WIDEN
    raise TooLittleSliding(
        f"{experiment.name}: the record lasts {t[-1] - t[0]:.3g} s, too short for windows of {2.0 * half:.2g} s, which "
        "its noise or its rate asks for; record longer or faster motion, a finer position, or rows more often"
    )


def sliding_record(
    experiment: Experiment, axis: ServoAxis, half: float, first_stroke: int = 0
) -> SlidingRecord:
    """Resample an experiment on an even grid and find its strokes.

    Parameters
    ----------
    experiment : Experiment
    axis : ServoAxis
    half : float
        Half of the narrowest window, s.
    first_stroke : int
        Number of its first stroke.
    """
    t, q, u, rate = uniform(experiment)
    gain, loss = axis.drive_gains(experiment.quantity)
    supply = 1.0 if experiment.supply is None else np.interp(t, experiment.time, experiment.supply)
    used = np.interp(t, experiment.time, experiment.rows.astype(np.float64)) > 0.5
    period = 1.0 / rate
    weights = unblurred_weights(max(LEAST_SAMPLES * period, 0.5 * half), period)
    m = weights.shape[1] // 2
    inner: Rows = np.arange(m, q.size - m, dtype=np.int64)
    moved = q - q[0]
    v, a = np.zeros(q.size), np.zeros(q.size)
    v[inner], a[inner] = apply_at(moved, inner, weights).T
    fastest = float(np.quantile(np.abs(v[inner]), 0.995))
    noise = max(math.sqrt(white_noise(q, rate) * rate / 2.0), encoder_step(q) / math.sqrt(12.0))
    slow = max(CREEP * fastest, CERTAIN * noise * float(np.linalg.norm(weights[0])))
    direction = np.where((np.abs(v) > slow) & used, np.sign(v), 0.0)
    stroke = np.full(q.size, -1, dtype=np.int64)
    since, until = np.zeros(q.size), np.zeros(q.size)
    edges = np.flatnonzero(np.diff(direction, prepend=0.0, append=0.0) != 0.0)
    number = first_stroke
    for i, j in itertools.pairwise(edges.tolist()):
        if direction[i] != 0.0 and j - i > 2:
            stroke[i:j] = number
            since[i:j], until[i:j] = np.abs(moved[i:j] - moved[i]), np.abs(moved[i:j] - moved[j - 1])
            number += 1
    step = gain * float(np.median(supply)) * encoder_step(experiment.signal())
    return SlidingRecord(
        t, moved, gain * supply * u, loss, float(q[0]), v, a, stroke, since, until, fastest, step
    )
