"""Other explanations of orders: a lag with direction, an eccentric encoder, gravity, orders beyond the sampling."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.identification.cogging.fitting import Fit

Array = np.ndarray[Any, np.dtype[np.float64]]

SAME = 0.7
"""Least share of an order's power that the explanation must account for."""
SEEN = 4.0
"""Standard deviations by which sidebands must exceed zero."""


@dataclass(frozen=True)
class Lag:
    """The lag of the even part with the direction.

    `angle` is in rad; `orders` are the orders of half the difference that it explains.
    """

    angle: float
    std: float
    orders: tuple[float, ...]


def lag_of(fit: Fit) -> Lag | None:
    """Estimate the lag from the largest order in both parts: ``E(theta - lag d)`` is ``E - lag d dE/dtheta``."""
    both = [n for part, n in fit.terms if part == "odd" and ("even", n) in fit.terms]
    if not both:
        return None
    lead = max(both, key=lambda n: n * float(np.hypot(*fit.pair(("even", n)))))
    angle, share, std = _lag(fit, lead)
    if share < SAME or abs(angle) < SEEN * std:
        return None
    explained = tuple(n for n in both if _left(fit, n, angle) < 1.0 - SAME)
    return Lag(angle, std, explained) if lead in explained else None


def _derivative(pair: Array, order: float) -> Array:
    return order * np.array([pair[1], -pair[0]])


def _lag(fit: Fit, order: float) -> tuple[float, float, float]:
    """Return the lag, the share of the odd part's power that it explains, and its standard deviation."""
    slope, odd = _derivative(fit.pair(("even", order)), order), fit.pair(("odd", order))
    size = float(slope @ slope)
    angle = -float(slope @ odd) / size
    share = (angle**2 * size) / float(odd @ odd)
    return angle, share, math.sqrt(float(np.trace(fit.spread(("odd", order)))) / 2.0 / size)


def _left(fit: Fit, order: float, angle: float) -> float:
    """Return the share of the odd part's power that a lag does not explain."""
    odd = fit.pair(("odd", order))
    rest = odd + angle * _derivative(fit.pair(("even", order)), order)
    return float(rest @ rest) / float(odd @ odd)


@dataclass(frozen=True)
class Eccentricity:
    """An encoder error of `order` periods per turn, rad: it creates equal sidebands on both sides of every order."""

    order: int
    angle: float
    std: float
    phase: float
    carrier: float


def eccentricities(fit: Fit) -> list[Eccentricity]:
    """Estimate angle errors of order 1 and 2 from the sidebands of the largest order.

    If ``theta + e cos(k theta + p)`` is measured, an order n of complex amplitude A has sidebands ``i n e A exp(+-i p)
    / 2`` at n + k and n - k; a torque whose size varies over the turn has sidebands without the factor i.
    """
    even = [n for part, n in fit.terms if part == "even"]
    if not even:
        return []
    lead = max(even, key=lambda n: n * float(np.hypot(*fit.pair(("even", n)))))
    found: list[Eccentricity] = []
    for k in (1, 2):
        if lead <= 2 * k or ("even", lead + k) not in fit.terms or ("even", lead - k) not in fit.terms:
            continue
        carrier = _complex(fit.pair(("even", lead)))
        above = _complex(fit.pair(("even", lead + k))) / (0.5j * lead * carrier)
        below = np.conj(_complex(fit.pair(("even", lead - k))) / (0.5j * lead * carrier))
        both = 0.5 * (above + below)
        std = math.sqrt(float(np.trace(fit.spread(("even", lead + k)))) / 2.0) / (0.5 * lead * abs(carrier))
        apart = 0.25 * abs(above - below) ** 2
        if abs(both) ** 2 > SAME / (1.0 - SAME) * apart and abs(both) > SEEN * std:
            found.append(Eccentricity(k, abs(both), std / math.sqrt(2.0), float(np.angle(both)), lead))
    return found


def _complex(pair: Array) -> complex:
    """Return A cos(n theta + p) as A exp(i p)."""
    return complex(pair[0], -pair[1])
