"""An incremental encoder: counts, jitter, and the elastic mode of its mounting."""

from __future__ import annotations

import math
from dataclasses import dataclass

from stickslip.arguments import insist_on_own
from stickslip.errors import ParameterError


@dataclass(frozen=True)
class Encoder:
    """What the position is read with.

    Attributes
    ----------
    counts : float
        Per revolution, after quadrature; 0 reads exactly.
    noise : float
        Of the reading before it is counted, rad RMS.
    max_speed : float
        rad/s, above which it loses counts: the drive switches off there.
    mode : float
        Frequency of its mounting's mode, Hz; 0 for none.
    mode_damping : float
        Part of critical damping.
    mode_share : float
        How much of the reading the mode carries: (1 - share) theta + share q, with q the position of a mass that
        follows theta through the mode. At resonance the reading is about share / (2 damping) times the shaft's motion.
    """

    counts: float = 0.0
    noise: float = 0.0
    max_speed: float = math.inf
    mode: float = 0.0
    mode_damping: float = 0.02
    mode_share: float = 0.0

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
