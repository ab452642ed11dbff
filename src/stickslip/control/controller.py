"""The whole control law T_m = T_linear + T_hat (thesis eq. 3.3), with its limits and its sampling."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from stickslip.control.compensator import Compensator
from stickslip.control.linear import Cascade, Gains
from stickslip.errors import ParameterError

if TYPE_CHECKING:
    from stickslip.control_spec import ControlLaw
    from stickslip.model import Model

__all__ = ["Controller", "highest_corner"]

FILTER_ROOM = 0.495  # of the sample rate: just below half of it, where a sampled low-pass ends


def highest_corner(sample_time: float) -> float:
    """Highest corner that a low-pass on samples can have, Hz; infinite in continuous time."""
    return FILTER_ROOM / sample_time if sample_time > 0.0 else math.inf


@dataclass(frozen=True)
class Controller:
    """A linear controller, a compensator, a torque limit and a sample time.

    Attributes
    ----------
    gains : Gains or Cascade
        Of the linear part (`stickslip.control.linear`); a cascade needs a sample time.
    compensator : Compensator or None
    torque_limit : float
        The size of T_m never exceeds it, N·m; infinite for none.
    sample_time : float
        0 acts in continuous time; otherwise the controller acts every `sample_time` s, holds its output, and
        takes the velocity as the difference of two measured positions.
    encoder_counts : float
        Counts per revolution of the encoder that a sampled controller reads; 0 measures exactly.
    velocity_filter : float
        Corner of a first-order low-pass on the velocity that the linear part sees, Hz; 0 for none. Only with a sample
        time.
    """

    gains: Gains | Cascade
    compensator: Compensator | None = None
    torque_limit: float = math.inf
    sample_time: float = 0.0
    encoder_counts: float = 0.0
    velocity_filter: float = 0.0

    @property
    def linear(self) -> Gains:
        """The gains as those of one sum: a cascade's PID (`Cascade.pid`)."""
        return self.gains.pid if isinstance(self.gains, Cascade) else self.gains

    def __post_init__(self) -> None:
        for name, value in self.gains._asdict().items():
            if not math.isfinite(value) or value < 0.0:
                raise ParameterError(f"controller: {name} = {value:g} must be at least 0")
        if math.isnan(self.torque_limit) or self.torque_limit <= 0.0:
            raise ParameterError(
                f"controller: torque_limit = {self.torque_limit:g} N·m must be greater than 0"
            )
        if not math.isfinite(self.sample_time) or self.sample_time < 0.0:
            raise ParameterError(f"controller: sample_time = {self.sample_time:g} s must be at least 0")
        if not math.isfinite(self.encoder_counts) or self.encoder_counts < 0.0:
            raise ParameterError(f"controller: encoder_counts = {self.encoder_counts:g} must be at least 0")
        if self.encoder_counts > 0.0 and self.sample_time == 0.0:
            raise ParameterError(
                "controller: encoder_counts needs a sampled controller; give a sample_time greater than 0"
            )
        if not math.isfinite(self.velocity_filter) or self.velocity_filter < 0.0:
            raise ParameterError(
                f"controller: velocity_filter = {self.velocity_filter:g} Hz must be at least 0"
            )
        for name, given in (
            ("a cascade", isinstance(self.gains, Cascade)),
            ("a velocity_filter", self.velocity_filter > 0.0),
        ):
            if given and self.sample_time == 0.0:
                raise ParameterError(
                    f"controller: {name} needs a sampled controller; give a sample_time greater than 0"
                )
        compensator = self.compensator
        corner = compensator.filter_hz if compensator else None
        if compensator and corner and corner > highest_corner(self.sample_time):
            raise ParameterError(
                f"{compensator.name}: filter_hz = {corner:g} Hz is too high for a sample time of {self.sample_time:g} "
                f"s; give at most {highest_corner(self.sample_time):g} Hz, or none"
            )
        if compensator and self.sample_time == 0.0 and compensator.sampled:
            name = compensator.sampled[0]
            raise ParameterError(
                f"controller: {name} needs a sampled controller; give a sample_time greater than 0"
            )

    # ---- as a `SampledController` says it ------------------------------------------------------------------

    @property
    def frictions(self) -> dict[str, Model]:
        """The friction laws that it holds, by what a record calls them."""
        return {"compensator": self.compensator.model} if self.compensator else {}

    @property
    def control_laws(self) -> tuple[ControlLaw, ...]:
        """The control laws that its user chose: none, these are gains."""
        return ()

    @property
    def feeds_back(self) -> bool:
        """Whether a friction law in it acts on what is measured."""
        return self.compensator is not None and self.compensator.velocity == "measured"

    @property
    def answers_to_acceleration(self) -> bool:
        """Whether the torque depends on the reference's acceleration alone."""
        return self.compensator is not None and self.compensator.inertia_feedforward != 0.0

    def holding(self, change: Callable[[Model], Model]) -> Controller:
        """The controller whose friction law is what `change` makes of it."""
        if self.compensator is None:
            return self
        return replace(self, compensator=replace(self.compensator, model=change(self.compensator.model)))

    def values(self) -> dict[str, float]:
        """The gains of its linear part by name."""
        return dict(self.gains._asdict())

    def as_dict(self) -> dict[str, Any]:
        """Plain data that says everything about it."""
        return {
            **self.described(),
            "sample_time": self.sample_time,
            "torque_limit": self.torque_limit,
            "encoder_counts": self.encoder_counts,
            "velocity_filter": self.velocity_filter,
        }

    def described(self) -> dict[str, Any]:
        """What a record says of it."""
        compensator = self.compensator
        return {"gains": self.values(), **({"compensator": compensator.as_dict()} if compensator else {})}
