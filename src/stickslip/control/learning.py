"""The arithmetic of learning from repetition to repetition: low-passes without lag, and what a repetition adds."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.control.block import ControlBlock

Array = np.ndarray[Any, np.dtype[np.float64]]
REACH = 5.0
"""Standard deviations after which the weights of a low-pass end."""


def low_pass(corner: float, sample_time: float) -> Array:
    """Weights of a Gaussian low-pass without lag, shape (2 m + 1,), their sum 1.

    Parameters
    ----------
    corner : float
        Where it lets 0.71 through, Hz.
    sample_time : float
        s
    """
    spread = math.sqrt(math.log(2.0)) / (2.0 * math.pi * corner * sample_time)
    half = math.ceil(REACH * spread)
    weights = np.exp(-0.5 * (np.arange(-half, half + 1) / spread) ** 2)
    return weights / weights.sum()


def low_pass_response(weights: Array, turns: Array) -> Array:
    """What symmetric weights let through, shape (n,), at frequencies in turns a sample."""
    half = len(weights) // 2
    waves = np.cos(2.0 * math.pi * np.outer(turns, np.arange(1, half + 1)))
    return weights[half] + 2.0 * waves @ weights[half + 1 :]


def bin_response(turns: Array) -> Array:
    """What [1/4 1/2 1/4] lets through, shape (n,), at waves a bin."""
    return np.cos(math.pi * turns) ** 2


def smoothed(values: Array, weights: Array) -> Array:
    """Values through symmetric weights, shape (n,); the ends are held."""
    half = len(weights) // 2
    return np.convolve(np.pad(values, half, mode="edge"), weights, "valid")


def relearned(
    table: Array, torque: Array, rate: float, advance: int, weights: Array, largest: float
) -> Array:
    """The next table over time: Q (table + L torque, given earlier), within its bound; shape (n,).

    Parameters
    ----------
    table, torque : array, shape (n,)
        What was given ahead, and what the loop gave besides, N·m, sample by sample.
    rate : float
        L.
    advance : int
        Samples.
    weights : array
        Of Q.
    largest : float
        N·m
    """
    earlier = np.concatenate([torque[advance:], np.full(advance, torque[-1])])
    return np.clip(smoothed(table + rate * earlier, weights), -largest, largest)


# ---- tables ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class TimeTable:
    """A feedforward over the time of a repetition.

    Attributes
    ----------
    torque : array, shape (n,)
        N·m, sample by sample.
    step : float
        Of a sample, s.
    rate, advance, weights, largest
        As of `relearned`.
    """

    torque: Array
    step: float
    rate: float
    advance: int
    weights: Array
    largest: float

    def block(self) -> ControlBlock:
        """The block `table_feedforward` that gives it."""
        return ControlBlock(
            "table_feedforward", None, {"over": "time"}, step=self.step, table=self.torque.tolist()
        )

    def after(self, torque: Array) -> TimeTable:
        """The next table, of what the loop gave besides (N·m, shape (n,))."""
        found = relearned(self.torque, torque, self.rate, self.advance, self.weights, self.largest)
        return replace(self, torque=found)


@dataclass(frozen=True, eq=False)
class AngleTable:
    """A feedforward over the reference's angle and direction: `learned_feedforward`'s map, a repetition at a time.

    Attributes
    ----------
    torque : array, shape (2, bins)
        N·m, forward and backward, in equal bins from lower to upper.
    lower, upper : float
        rad
    bin : array of int, shape (n,)
        Of every sample of a repetition.
    side : array, shape (n,)
        Sign of the reference's velocity there; what stands teaches nothing.
    rate : float
        Share of the loop's torque that a repetition takes over.
    largest : float
        Bound, N·m.
    """

    torque: Array
    lower: float
    upper: float
    bin: np.ndarray[Any, np.dtype[np.int64]]
    side: Array
    rate: float
    largest: float

    @classmethod
    def over(cls, angle: Array, velocity: Array, bins: int, rate: float, largest: float) -> AngleTable:
        """An empty table over the range of a motion, angle in rad and velocity in rad/s, shape (n,)."""
        lower, upper = float(np.min(angle)), float(np.max(angle))
        place = np.floor(bins * (angle - lower) / (upper - lower)).astype(np.int64)
        return cls(
            np.zeros((2, bins)), lower, upper, np.minimum(place, bins - 1), np.sign(velocity), rate, largest
        )

    def block(self) -> ControlBlock:
        """The block `table_feedforward` that gives it."""
        forward, backward = self.torque.tolist()
        return ControlBlock(
            "table_feedforward", lower=self.lower, upper=self.upper, forward=forward, backward=backward
        )

    def after(self, torque: Array) -> AngleTable:
        """The next table, of what the loop gave besides (N·m, shape (n,)), through [1/4 1/2 1/4] over the bins."""
        bins = self.torque.shape[1]
        grown = self.torque.copy()
        for row, side in enumerate((1.0, -1.0)):
            at = self.bin[self.side == side]
            total = np.bincount(at, torque[self.side == side], bins)
            grown[row] += self.rate * total / np.maximum(np.bincount(at, minlength=bins), 1)
        padded = np.pad(grown, ((0, 0), (1, 1)), mode="edge")
        found = 0.25 * padded[:, :-2] + 0.5 * padded[:, 1:-1] + 0.25 * padded[:, 2:]
        return replace(self, torque=np.clip(found, -self.largest, self.largest))
