"""What is believed of an axis, from which compensators are made: a LuGre law's numbers, the inertia, the drive's."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from stickslip.core.errors import ParameterError
from stickslip.core.rebinding import NEGATIVE
from stickslip.models.friction_levels import Levels, levels_of
from stickslip.models.model import Model


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

        Of one with parameters per direction the mean of both.
        """
        forward, backward = (levels_of(self.friction, direction) for direction in (1.0, -1.0))
        mean = (0.5 * (one + other) for one, other in zip(forward, backward, strict=True))
        return {**dict(zip(forward._fields, mean, strict=True)), "sigma0": self.friction.parameters.sigma0}

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
    """The belief by whichever friction law is known: a LuGre law of its levels (`stickslip.models.friction_levels`), of
    both directions where they differ; a GMS law is kept besides.

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
        If the law has no torque at constant velocity, or no friction there.
    """
    law, own = model.law, model.parameters._asdict()
    if law.name == "lugre":
        return Belief(inertia, model, **more)
    if law.steady is None:
        raise ParameterError(
            f"belief: law {law.name!r} has no torque at constant velocity; identify one with a sliding curve"
        )
    ways = tuple(levels_of(model, direction) for direction in ((1.0,) if law.odd else (1.0, -1.0)))
    for way in ways:
        if not (way.fs > 0.0 and way.fc > 0.0):
            raise ParameterError(
                f"belief: law {law.name!r} has no friction at rest to compensate (static {way.fs:.3g} N·m, Coulomb "
                f"{way.fc:.3g} N·m)"
            )
    # The "k" of a Stribeck law is a slope over the velocity and no spring.
    springs = any(f.name == "k" and f.per_element for f in law.fields)
    rest = sum(way.fs for way in ways) / len(ways)
    stiffness = float(sum(own["k"])) if springs else float(own.get("sigma0", rest / BENDS))
    bristle = _bristle(stiffness, *ways)
    return Belief(inertia, bristle, model if law.name == "gms" else None, **more)


def _bristle(stiffness: float, forward: Levels, backward: Levels | None = None) -> Model:
    """A LuGre law of those levels, N·m/rad its stiffness; of both directions where the second has its own."""
    values = forward._asdict()
    if backward in (None, forward):
        return Model("lugre", sigma0=stiffness, sigma1=0.0, **values)
    assert backward is not None
    values |= {name + NEGATIVE: value for name, value in backward._asdict().items()}
    return Model("lugre", {"symmetry": "asymmetric"}, sigma0=stiffness, sigma1=0.0, **values)
