"""What is believed of an axis, from which compensators are made: a LuGre law's numbers, the inertia, the drive's."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from stickslip.errors import ParameterError
from stickslip.model import Model


@dataclass(frozen=True)
class Belief:
    """What is believed of an axis.

    Attributes
    ----------
    inertia : float
        kg·m²
    friction : Model
        A LuGre law.
    elements : Model or None
        A GMS law.
    sample_time : float
        s
    torque_limit : float
        N·m
    bandwidth : float
        Of the loop, Hz.
    counts : float
        Of the encoder, per revolution; 0: exact.
    """

    inertia: float
    friction: Model
    elements: Model | None = None
    sample_time: float = 1e-3
    torque_limit: float = math.inf
    bandwidth: float = 10.0
    counts: float = 0.0

    def __post_init__(self) -> None:
        if self.friction.law.name != "lugre":
            raise ParameterError(
                f"belief: friction is a {self.friction.law.name} law; give a LuGre law, whose numbers the others take"
            )

    @functools.cached_property
    def levels(self) -> Mapping[str, float]:
        """fs, fc (N·m), vs (rad/s), sigma2 (N·m·s/rad), delta_s and sigma0 (N·m/rad) of the LuGre law.

        Of another sliding curve than Stribeck's: its level at rest, and the line through two speeds beyond its scale.
        """
        law, p = self.friction.law, self.friction.parameters
        own = {"delta_s": 2.0, **p._asdict()}
        if {"fs", "fc", "vs"} <= own.keys() and law.option_of("viscous") == "linear":
            return own
        assert law.steady is not None
        scale = law.velocity_scale(p) if law.velocity_scale else 0.01
        slow, fast = 5.0 * scale, 50.0 * scale
        rise = max((law.steady(fast, p) - law.steady(slow, p)) / (fast - slow), 0.0)
        return {
            "fs": law.steady(1e-6 * scale, p), "fc": law.steady(slow, p) - rise * slow, "vs": scale, "sigma2": rise,
            "delta_s": 2.0, "sigma0": own["sigma0"],
        }  # fmt: skip

    def number(self, name: str) -> float:
        """One of `levels`."""
        return self.levels[name]

    @property
    def pace(self) -> float:
        """Bandwidth, rad/s."""
        return 2.0 * math.pi * self.bandwidth

    @property
    def flicker(self) -> float:
        """Velocity that one count in a sample looks like, rad/s."""
        return 2.0 * math.pi / self.counts / self.sample_time if self.counts else 0.0

    @property
    def gate(self) -> float:
        """Speed above which an axis surely slides, rad/s: of the Stribeck effect, and above the encoder's flicker."""
        return max(1.5 * self.number("vs"), 0.15 * self.flicker)


BENDS = 1e-3
"""rad, by which a contact is taken to bend before it slides where its law has no springs."""


def believed(model: Model, inertia: float, **more: Any) -> Belief:
    """The belief by whichever friction law is known: a LuGre law of its levels; a GMS law is kept besides.

    Parameters
    ----------
    model : Model
    inertia : float
        kg·m²
    **more
        The other attributes of `Belief`.

    Raises
    ------
    ParameterError
        If the law says nothing of sliding at constant velocity, or has no friction there.
    """
    law, p = model.law, model.parameters
    if law.name == "lugre":
        return Belief(inertia, model, **more)
    if law.steady is None:
        raise ParameterError(
            f"belief: law {law.name!r} has no torque at constant velocity; identify one with a sliding curve"
        )
    scale = float(law.velocity_scale(p)) if law.velocity_scale else 0.01
    rest, slow, fast = (float(law.steady(x * scale, p)) for x in (1e-6, 5.0, 50.0))
    rise = max((fast - slow) / (45.0 * scale), 0.0)
    level = slow - 5.0 * rise * scale
    if not (rest > 0.0 and level > 0.0):
        raise ParameterError(
            f"belief: law {law.name!r} has no friction of {rest:g} N·m at rest to compensate"
        )
    own = p._asdict()
    # The "k" of a Stribeck law is a slope over the velocity and no spring.
    springs = any(f.name == "k" and f.per_element for f in law.fields)
    stiffness = float(sum(own["k"])) if springs else float(own.get("sigma0", rest / BENDS))
    bristle = Model("lugre", sigma0=stiffness, sigma1=0.0, fs=rest, fc=level, vs=scale, sigma2=rise)
    return Belief(inertia, bristle, model if law.name == "gms" else None, **more)
