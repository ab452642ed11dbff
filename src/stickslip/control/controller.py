"""The whole control law T_m = T_linear + T_hat (thesis eq. 3.3), with its limits and its sampling."""

from __future__ import annotations

import math
from dataclasses import dataclass

from stickslip.control.compensators._base import Compensator
from stickslip.control.linear import Gains
from stickslip.errors import ParameterError

__all__ = ["Controller"]


@dataclass(frozen=True)
class Controller:
    """A linear controller, a compensator, a torque limit and a sample time.

    Attributes
    ----------
    gains : Gains
        Of the linear part (`stickslip.control.linear`).
    compensator : Compensator or None
    torque_limit : float
        The size of T_m never exceeds it, N·m; infinite for none.
    sample_time : float
        0 acts in continuous time; otherwise the controller acts every `sample_time` s, holds its output, and
        takes the velocity as the difference of two measured positions.
    encoder_counts : float
        Counts per revolution of the encoder that a sampled controller reads; 0 measures exactly.
    """

    gains: Gains
    compensator: Compensator | None = None
    torque_limit: float = math.inf
    sample_time: float = 0.0
    encoder_counts: float = 0.0

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
                "controller: an encoder is read by samples; give a sample_time greater than 0"
            )
        helper = self.compensator
        if helper and self.sample_time == 0.0 and (helper.lead > 0.0 or helper.deadband > 0.0):
            name = "lead" if helper.lead > 0.0 else "deadband"
            raise ParameterError(f"controller: a {name} acts on samples; give a sample_time greater than 0")
