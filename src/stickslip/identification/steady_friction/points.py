"""Points of a sliding curve: friction torque at constant velocities, and break-away torques."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.identification.fit.selection import Indices

Array = np.ndarray[Any, np.dtype[np.float64]]

SAME_VELOCITY = 0.005
"""Greatest relative difference of velocities that are repeats of one."""


@dataclass(frozen=True, eq=False)
class SlidingPoints:
    """Friction torque at constant velocities.

    Attributes
    ----------
    velocity : array, shape (n,)
        rad/s; 0 for a break-away torque, whose sign gives the direction.
    torque : array, shape (n,)
        Torque that keeps the axis moving, N·m: friction and, with `offset`, a constant torque.
    std : array, shape (n,), optional
        Standard deviations relative to each other; equal if None.
    absolute : bool
        Whether they are known in N·m; no point then has a smaller standard deviation.
    unit : (str, str)
        Units of velocity and torque.
    offset : float or None
        Constant torque in `torque` (a weight), N·m; None if it is not known and has to be fitted.
    """

    velocity: Array
    torque: Array
    std: Array | None = None
    unit: tuple[str, str] = ("rad/s", "N·m")
    absolute: bool = False
    offset: float | None = 0.0

    def __post_init__(self) -> None:
        v, t = np.asarray(self.velocity, np.float64), np.asarray(self.torque, np.float64)
        if v.ndim != 1 or v.shape != t.shape or v.size == 0:
            raise InputError(
                f"sliding curve: velocity {v.shape} and torque {t.shape} must be equally long lists"
            )
        if not (np.all(np.isfinite(v)) and np.all(np.isfinite(t))):
            raise InputError(
                "sliding curve: every velocity and torque must be a finite number; leave out the others"
            )
        if self.std is not None and not (self.std.shape == v.shape and np.all(self.std > 0.0)):
            raise InputError("sliding curve: std needs one positive number per point, or leave it out")
        object.__setattr__(self, "velocity", v)
        object.__setattr__(self, "torque", t)

    def __len__(self) -> int:
        return self.velocity.size

    def __add__(self, other: SlidingPoints) -> SlidingPoints:
        """Return these points and others."""
        both = [replace(p, std=np.ones(len(p))) if p.std is None else p for p in (self, other)]
        std = (
            None
            if self.std is None and other.std is None
            else np.concatenate([b.std for b in both if b.std is not None])
        )
        return SlidingPoints(
            np.concatenate([self.velocity, other.velocity]), np.concatenate([self.torque, other.torque]), std,
            self.unit, self.absolute and other.absolute, self.offset,
        )  # fmt: skip

    def only(self, rows: Any) -> SlidingPoints:
        """Return some of the points."""
        return replace(self, velocity=self.velocity[rows], torque=self.torque[rows],
                       std=None if self.std is None else self.std[rows])  # fmt: skip

    def folded(self) -> SlidingPoints:
        """Return the points with negative velocities mirrored, as the thesis averages both directions (4.3.2.1.2)."""
        side = self.side
        return replace(self, velocity=np.abs(self.velocity), torque=side * self.torque)

    @property
    def side(self) -> Array:
        """Direction of every point, +1 or -1."""
        return np.where(self.velocity != 0.0, np.sign(self.velocity), np.where(self.torque < 0.0, -1.0, 1.0))

    @property
    def one_way(self) -> bool:
        """Whether all points belong to one direction of motion."""
        return bool(np.all(self.side == self.side[0]))

    @property
    def weight(self) -> Array:
        """Factor on every residual; 1 in the mean square."""
        if self.std is None:
            return np.ones(len(self))
        return 1.0 / (self.std * math.sqrt(float(np.mean(self.std**-2.0))))

    def repeats(self) -> list[Array]:
        """Return the weighted torques at velocities that occur more than once."""
        order = np.lexsort((self.side, self.velocity))
        v, side, t = self.velocity[order], self.side[order], (self.torque * self.weight)[order]
        new = (np.diff(v) > SAME_VELOCITY * np.abs(v[1:])) | (side[1:] != side[:-1])
        cuts = np.flatnonzero(new) + 1
        return [g for g in np.split(t, cuts) if g.size > 1]

    def speeds(self) -> Indices:
        """Return a label for every point: repeats of a speed share one in either direction; break-aways do not."""
        speed = np.abs(self.velocity)
        order = np.argsort(speed, kind="stable")
        new = np.diff(speed[order]) > SAME_VELOCITY * speed[order][1:]
        label = np.empty(len(self), dtype=np.int64)
        label[order] = np.concatenate([[0], np.cumsum(new | (speed[order][1:] == 0.0))])
        return label
