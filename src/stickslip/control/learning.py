"""The arithmetic of learning from repetition to repetition: low-passes without lag, and what a repetition adds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

__all__ = ["bin_response", "low_pass", "low_pass_response", "relearned", "smoothed"]

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
