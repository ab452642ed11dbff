"""How friction falls with velocity, as all bands of frequencies together say it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from stickslip.identify.regression.band_fit import BandFit
from stickslip.identify.regression.band_system import USUAL_EXPONENTS
from stickslip.identify.regression.number import Number

Falling = Mapping[float, tuple[float, Number]]
"""By exponent of a fall of friction: how probable it is if there is one, and its velocity, rad/s (m/s)."""


def fall_of(bands: Sequence[BandFit]) -> tuple[float, Falling]:
    """Probability that friction falls within the recorded speeds in every band, and how if it does."""
    out: dict[float, tuple[float, Number]] = {}
    shares = [b.probability[1:] / max(float(b.probability[1:].sum()), 1e-300) for b in bands]
    for exponent in USUAL_EXPONENTS:
        chances: list[float] = []
        places: list[tuple[float, float]] = []
        for b, share in zip(bands, shares, strict=True):
            mine = np.array([fall.exponent == exponent for fall in b.tried])
            weight, place = share[mine], np.log([fall.vs for fall in b.tried if fall.exponent == exponent])
            chances.append(float(weight.sum()))
            if weight.sum() > 0.0:
                weight = weight / weight.sum()
                middle = float(weight @ place)
                places.append((middle, float(weight @ (place - middle) ** 2)))
        out[exponent] = (math.fsum(chances) / len(chances), velocity_of(places))
    return min(b.falls for b in bands), out


def velocity_of(places: Sequence[tuple[float, float]]) -> Number:
    """One velocity from mean and variance of its logarithm in every band; unknown without any."""
    if not places:
        return Number(math.nan, math.inf)
    middle = math.fsum(m for m, _ in places) / len(places)
    variance = math.fsum(v + (m - middle) ** 2 for m, v in places) / len(places)
    return Number(math.exp(middle), math.exp(middle) * math.sqrt(variance))
