"""The sliding curve of any model: its torque at constant velocity, in both directions and at rest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from stickslip.core.spec import Surroundings
from stickslip.models.friction_levels import bends_of, end_of_slope, independent, static_level
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]

SCALES = 100.0
"""Stribeck velocities up to which a sliding curve is compared where nothing else is said."""
USUAL = 1.0
"""rad/s: up to which it is compared where the law does not determine a velocity."""
WAY = 200
"""Steps of 1 mrad after which a law without sliding curve slides as it always will."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Torque of a model at constant velocity, in both directions and at rest.

    Attributes
    ----------
    given : Model
    top : float
        Greatest velocity, rad/s.
    density : int
        How many times closer than usual its velocities lie.
    """

    given: Model
    top: float
    density: int = 1

    @staticmethod
    def of(model: Model, top: float | None = None, density: int = 1) -> Curve:
        """Return the curve up to `top` rad/s; without it, up to 100 times the velocity over which the law changes.

        That may be the width of a smooth sign: of a law that has one, the curve goes up to 1 rad/s at least.
        """
        if top is None:
            bare = independent(model)
            scale = velocity_scale(bare)
            least = USUAL if scale == 0.0 or end_of_slope(bare) > 0.0 else 0.0
            top = max(SCALES * scale, least)
        return Curve(model, top, density)

    @cached_property
    def model(self) -> Model:
        """The model at the surroundings for which its parameters hold."""
        return independent(self.given)

    @cached_property
    def slowest(self) -> float:
        """The velocity up to which the law takes the contact as at rest, or lets it creep, rad/s; mostly 0."""
        law, p = self.model.law, self.model.parameters
        if law.rest_band is not None:
            return law.rest_band(p)
        if law.state_fields or not law.continuous or (scale := slowest_scale(self.model)) == 0.0:
            return 0.0
        slow = scale * np.logspace(-9.0, 0.0, 500)
        torques = np.array([min(self.torque(v), -self.torque(-v)) for v in slow])
        slope = torques / slow
        creeps = slope >= (1.0 - 1e-6) * slope[0]
        return float(slow[creeps][-1]) if slope[0] > 2.0 * slope[-1] else 0.0

    @cached_property
    def sliding(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Whether the law slides at each velocity, not on the slope of a smooth sign; all, where that goes on to half
        of the range."""
        end = end_of_slope(self.model)
        return self.velocity >= (end if end < 0.5 * self.top else 0.0)

    @cached_property
    def velocity(self) -> Array:
        """Velocities above 0, evenly spaced ones and evenly by decades; rad/s, shape (n,)."""
        k = self.density
        both = [np.linspace(0.01 / k, 1.0, 100 * k), np.logspace(-6.0, 0.0, 200 * k, endpoint=False)]
        velocity = self.top * np.sort(np.concatenate(both))
        return velocity[velocity > 1.1 * self.slowest]

    @cached_property
    def width(self) -> Array:
        """The part of the range for which each velocity stands; adds up to 1."""
        bounds = np.concatenate([[0.0], 0.5 * (self.velocity[1:] + self.velocity[:-1]), [self.top]])
        return np.diff(bounds) / self.top

    @cached_property
    def forward(self) -> Array:
        """Torque against positive velocities, N·m, shape (n,)."""
        return np.array([self.torque(v) for v in self.velocity])

    @cached_property
    def backward(self) -> Array:
        """Torque against negative velocities, as a positive number, N·m, shape (n,)."""
        if self.model.law.odd:
            return self.forward
        return np.array([-self.torque(-v) for v in self.velocity])

    @cached_property
    def mean(self) -> Array:
        """Mean of both directions, N·m, shape (n,)."""
        return 0.5 * (self.forward + self.backward)

    @cached_property
    def size(self) -> float:
        """The largest torque, N·m."""
        return float(max(np.abs(self.forward).max(), np.abs(self.backward).max(), *self.rest, 1e-300))

    @cached_property
    def rest(self) -> tuple[float, float]:
        """What the contact withstands at rest in both directions, N·m; of one that creeps, where it lets go."""
        law = self.model.law
        if law.steady is not None or law.holding is not None:
            return static_level(self.model), static_level(self.model, -1.0)
        edge = 1e-9 * self.top
        return self.torque(edge), -self.torque(-edge)

    def torque(self, velocity: float) -> float:
        """Torque at a constant velocity, N·m; of a law without sliding curve, after a long way at it."""
        law, p = self.model.law, self.model.parameters
        if law.steady is not None:
            return law.steady(float(velocity), p)
        z, torque = law.state(p), math.nan
        for _ in range(WAY):
            before = torque
            torque = law.step(float(velocity), float(velocity), 1e-3 / abs(velocity), z, p, Surroundings())
            if abs(torque - before) <= 1e-12 * abs(torque):
                break
        return torque


def velocity_scale(model: Model) -> float:
    """A velocity over which the law's torque changes much, rad/s; 0 where there is none.

    Of a law that does not tell it, the fastest at which its sliding curve bends: a smooth sign bends, too.
    """
    scale = model.law.velocity_scale
    return scale(model.parameters) if scale else bends_of(Curve(model, 1.0).torque).fastest


def slowest_scale(model: Model) -> float:
    """As `velocity_scale`, but the slowest: that of a smooth sign, where the law has one."""
    scale = model.law.velocity_scale
    return scale(model.parameters) if scale else bends_of(Curve(model, 1.0).torque).slowest
