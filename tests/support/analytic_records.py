"""Records of a rigid axis whose motion is a closed form: position, velocity and acceleration are exact."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from stickslip.identification.experiment import Experiment

Array = np.ndarray[Any, np.dtype[np.float64]]
Effect = Callable[[Array, Array, Array, Array], Array]
"""Torque, N·m (N), added as a function of time, position, velocity and acceleration."""

TRUTH = {"inertia": 0.01, "fc": 0.3, "sigma2": 0.02, "offset": 0.05}
FC_BACK = 0.24
"""N·m (N), level of the negative direction where both differ."""
NOISE = 2e-3
"""N·m (N), standard deviation of the measured torque."""


def motion(time: Array) -> tuple[Array, Array, Array]:
    """Return position, velocity and acceleration of two sines, rad, rad/s, rad/s²."""
    parts = ((3.0, 1.5), (0.4, 7.0))
    q = sum((a * np.sin(w * time) for a, w in parts), np.zeros(time.size))
    v = sum((a * w * np.cos(w * time) for a, w in parts), np.zeros(time.size))
    return q, v, sum((-a * w * w * np.sin(w * time) for a, w in parts), np.zeros(time.size))


def record(
    effect: Effect | None = None,
    *,
    seed: int = 3,
    seconds: float = 12.0,
    noise: float = NOISE,
    delay: float = 0.0,
    time: Array | None = None,
    **truth: float,
) -> Experiment:
    """Return a record of the axis of `TRUTH`, with an effect that the plain model does not have.

    Parameters
    ----------
    effect : callable, optional
        Torque in addition to the axis's own.
    seed : int
        Of the noise.
    seconds, noise : float
        s; N·m.
    delay : float
        s by which the torque column lies behind the torque that acted.
    time : array, optional
        s; 1000 rows a second where it is not given.
    **truth : float
        Values other than those of `TRUTH`.
    """
    p = TRUTH | truth
    time = np.arange(0.0, seconds, 1e-3) if time is None else time

    def torque(t: Array) -> Array:
        q, v, a = motion(t)
        own = p["inertia"] * a + p["sigma2"] * v + p["fc"] * np.sign(v) + p["offset"]
        return own if effect is None else own + effect(t, q, v, a)

    rng = np.random.default_rng(seed)
    drive = torque(time - delay) + noise * rng.standard_normal(time.size)
    return Experiment("record", time, motion(time)[0], drive)
