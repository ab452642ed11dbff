"""Numbers of certain sliding not identified although their intervals are narrow, and an inertia that is beside them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from stickslip.identify.regression.band_fit import BandFit
from stickslip.identify.regression.number import QUANTILE, Number
from stickslip.identify.regression.regression import UNSURE, Regression

TOO_LONG = 1.3
"""Lag of the torque's column, in radians at the corner of the narrowest band, up to which its second derivative stands
for it: of logs of two programs with filters of 1.5 to 20 ms all 8 inertias with up to 1.1 held, none of three from 1.6
on (3 to 21 % too low)."""
SMOOTHED = "the torque column is smoothed by about {lag:.2g} ms, longer than sliding can allow for; log it unfiltered"
LATE = {"fc": 0.3, "sigma2": 0.15}
"""Part of the highest speed that the velocity of friction's fall may reach, for the level and the slope behind it: of
74 slopes beside a slower fall 66 hold, of 16 beside others three."""
LATE_FALL = (
    "friction still falls at speeds near the highest recorded, so that fall, level and slope are not distinguished; "
    "record faster moves"
)
SURE_ALONE = 0.06
"""Part of the inertia that its half-width may be where friction drowns in what accelerates: of another program's logs
the 4 that are as sure hold, of 4 unsure by 8 to 12 % two."""


def smoothed_by(bands: Sequence[BandFit]) -> float:
    """Time, s, by which a filter in the torque's column lags, where that is too long for every band; else 0."""
    swing, corner = bands[-1].swing.torque, bands[-1].corner
    lag = math.sqrt(2.0 * max(swing, 0.0))
    return lag if 2.0 * math.pi * corner * lag > TOO_LONG else 0.0


def falls_late(name: str, vs: Number, fastest: float) -> bool:
    """Whether friction's fall may reach to speeds at which level or slope, by `name`, should show alone."""
    return name in LATE and vs.interval[1] > LATE[name] * fastest


def inertia_alone(found: Regression) -> bool:
    """Whether the inertia is told although friction is too small beside the torque that accelerates to be believed."""
    inertia = found.numbers["inertia"]
    sure = QUANTILE * inertia.std <= SURE_ALONE * inertia.value and found.confirmed("inertia")
    return sure and found.unsure_share > UNSURE
