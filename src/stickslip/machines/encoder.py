"""An incremental encoder: counts, jitter, and the elastic mode of its mounting."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from stickslip.core.arguments import constructor_named, insist_on_own
from stickslip.core.description import Par
from stickslip.core.errors import ParameterError
from stickslip.machines.described import described


@constructor_named
@described
@dataclass(frozen=True)
class Encoder:
    """What the position is read with.

    Its mounting may have a mode: the reading is (1 - share) theta + share q, with q the position of a mass that follows
    theta through the mode. At resonance it is about share / (2 damping) times the shaft's motion.
    """

    counts: Annotated[
        float, Par("-", "", "counts per revolution, after quadrature; 0 reads exactly", lower=0.0)
    ] = 0.0
    noise: Annotated[float, Par("rad", "", "RMS noise of the reading before it is counted", lower=0.0)] = 0.0
    max_speed: Annotated[
        float,
        Par("rad/s", "", "speed above which it loses counts: the drive switches off there", positive=True),
    ] = math.inf
    mode: Annotated[float, Par("Hz", "", "frequency of its mounting's mode; 0 for none", lower=0.0)] = 0.0
    mode_damping: Annotated[float, Par("-", "", "part of the mode's critical damping", positive=True)] = 0.02
    mode_share: Annotated[
        float, Par("-", "", "part of the reading that the mode carries", lower=0.0, upper=1.0)
    ] = 0.0

    def __post_init__(self) -> None:
        insist_on_own(self, "encoder")
        for name in ("counts", "noise", "mode"):
            value = getattr(self, name)
            if not (value >= 0.0 and math.isfinite(value)):
                raise ParameterError(f"encoder: {name} = {value:g} must be a finite number of at least 0")
        if not self.max_speed > 0.0:
            raise ParameterError(f"encoder: max_speed = {self.max_speed:g} rad/s must be greater than 0")
        if not 0.0 < self.mode_damping < 1.0:
            raise ParameterError(f"encoder: mode_damping = {self.mode_damping:g} must lie between 0 and 1")
        if not 0.0 <= self.mode_share <= 1.0:
            raise ParameterError(f"encoder: mode_share = {self.mode_share:g} must be from 0 to 1")
