"""The result of `identify --method cogging`: estimates with verdicts, notes, pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.identification.cogging.fitting import Fit
from stickslip.identification.cogging.moving import Motion
from stickslip.identification.cogging.orders import Orders, Term, columns
from stickslip.identification.cogging.remarks import Eccentricity, Lag
from stickslip.identification.cogging.rows import Places
from stickslip.identification.estimate import Estimate, Picture, Trace
from stickslip.machines.position_map import PositionMap

Array = np.ndarray[Any, np.dtype[np.float64]]

ROUND = 0.999 * 2.0 * math.pi
ALIKE = 0.9
"""Ratio of two errors above which neither form is better."""
PERIODS = 8
"""Periods of the strongest order in the picture."""
MANY = 2000
"""Most points of a picture."""


@dataclass(frozen=True)
class Choice:
    """Errors on data left out (every other reference, and whole sectors) of harmonics and of a table."""

    nothing: tuple[float, float]
    harmonics: tuple[float, float]
    table: tuple[float, float]

    @property
    def form(self) -> str:
        """The form chosen by sectors; if harmonics do not predict unseen sectors, by the places between."""
        which = 0 if self.harmonics[1] > ALIKE * self.nothing[1] else 1
        return "table" if self.table[which] < ALIKE * self.harmonics[which] else "harmonics"


def estimates_of(fit: Fit, unit: str, lag: Lag | None, eccentric: Sequence[Eccentricity]) -> list[Estimate]:
    """Return the levels, then the amplitude of every order, then explanations of some of them."""
    names = ["offset", "friction", *fit.moving]
    known = {
        "offset": ("T_0", ""), "friction": ("F_C", ""), "viscous": ("sigma_2", "·s/rad"), "curve": ("F_2", "·s²/rad²"),
        "drift": ("F_t", "/s"), "inertia": ("J", "·s²/rad"), "delay": ("tau", "s"),
    }  # fmt: skip
    out = [
        _estimate(
            n, known[n][1] if n == "delay" else unit + known[n][1], known[n][0], float(fit.values[i]),
            math.sqrt(fit.covariance[i, i]),
        )
        for i, n in enumerate(names)
        if n in known
    ]  # fmt: skip
    for term in sorted(fit.terms, key=lambda x: (x[0], x[1])):
        part, n = term
        pair, spread = fit.pair(term), fit.spread(term)
        size = float(np.hypot(*pair))
        along = pair / size
        std = math.sqrt(float(along @ spread @ along))
        why = ""
        if lag is not None and part == "odd" and n in lag.orders:
            why = f"equals a lag of {1e3 * lag.angle:.3g} mrad with direction: no friction that depends on the position"
        symbol = f"T_{n:g}" if part == "even" else f"F_{n:g}"
        out.append(_estimate(f"{part}[{n:g}]", unit, symbol, size, std, why))
    if lag is not None:
        out.append(_estimate("lag", "rad", "lambda", lag.angle, lag.std))
    out += [
        _estimate(f"eccentricity[{e.order}]", "rad", f"epsilon_{e.order}", e.angle, e.std) for e in eccentric
    ]
    return out


def _estimate(name: str, unit: str, symbol: str, value: float, std: float, why: str = "") -> Estimate:
    low, high = value - 1.96 * std, value + 1.96 * std
    if not why and low <= 0.0 <= high:
        why = "its interval holds 0"
    return Estimate(name, unit, symbol, value, std, low, high, not why, why)


# ---- notes -----------------------------------------------------------------------------------------------------------


def notes_of(
    found: PositionMap, fit: Fit, orders: Orders, choice: Choice, lag: Lag | None, eccentric: Sequence[Eccentricity],
    places: Places,
) -> list[str]:  # fmt: skip
    """Explain the numbers, one sentence each."""
    unit = found.unit
    even = sum(part == "even" for part, _ in fit.terms)
    out = [
        f"{even} orders in both directions alike, {len(fit.terms) - even} with the direction, chosen by the error on "
        f"sectors left out whole: {choice.harmonics[1]:.3g} {unit} RMS (a table {choice.table[1]:.3g}, no map "
        f"{choice.nothing[1]:.3g}); on every other place left out {choice.harmonics[0]:.3g} {unit} RMS (a table "
        f"{choice.table[0]:.3g}, no map {choice.nothing[0]:.3g}): {choice.form} taken."
        if fit.terms or choice.form == "table"
        else f"No order is more than chance: no torque over the angle identified; {choice.nothing[0]:.3g} {unit} RMS "
        "about the levels."
    ]
    out += remarks_of(fit, orders, lag, eccentric)
    out.append(
        f"Orders up to {orders.highest:.4g} a turn were tried; places {1e3 * places.spacing:.3g} mrad apart show order "
        f"n and {2.0 * math.pi / places.spacing:.4g} - n as the same."
        if orders.whole
        else f"Orders are multiples of {orders.base:.4g} a radian up to {orders.highest:.4g}."
    )
    if found.upper - found.lower < ROUND:
        out.append(
            f"The axis was seen from {found.lower:.4g} to {found.upper:.4g} rad, less than a turn: what has orders 1 "
            "and 2 (gravity, unbalance, eccentricity) cannot be distinguished from a trend, and nothing is "
            "known beyond."
        )
    return out


def remarks_of(fit: Fit, orders: Orders, lag: Lag | None, eccentric: Sequence[Eccentricity]) -> list[str]:
    """Report other explanations of orders, one sentence each."""
    out: list[str] = []
    if lag is not None:
        listed = ", ".join(f"{n:g}" for n in lag.orders)
        out.append(
            f"Order {listed} in half the difference of the directions equals a lag of {1e3 * lag.angle:.3g} mrad with "
            "direction (wind-up, play or delay): it is not friction that depends on the position."
        )
    out += [
        f"Sidebands of order {e.carrier:g} at {e.carrier - e.order:g} and {e.carrier + e.order:g} are those of an "
        f"encoder whose angle errs by {1e3 * e.angle:.3g} mrad, {'once' if e.order == 1 else 'twice'} a turn, "
        "not of a torque."
        for e in eccentric
    ]
    low = [n for part, n in fit.terms if part == "even" and orders.whole and n <= 2.0]
    if low:
        out.append(
            f"Order {' and '.join(f'{n:g}' for n in low)} is gravity, unbalance or load as likely as cogging: turn the "
            "axis to another attitude to distinguish them."
        )
    return out


def motion_notes(name: str, unit: str, motion: Motion | None, line: tuple[float, float] | None) -> list[str]:
    """Report a record in motion: its agreement with the map, and a speed controller as the torque's source."""
    out: list[str] = []
    if motion is not None and not motion.visible:
        out.append(
            f"{name}: at {motion.speed:.3g} rad/s the rotor's inertia, not the motor, carries the cogging, and the "
            "samples do not resolve it: the map is neither fitted nor applied there."
        )
    elif motion is not None:
        out.append(
            f"{name}: at {motion.speed:.3g} rad/s the map leaves {motion.with_map:.3g} {unit} RMS on the half that was "
            f"not fitted, no map {motion.without:.3g}; friction {motion.friction:.3g} {unit}, inertia "
            f"{motion.inertia:.3g} {unit}·s²/rad."
        )
    if line is not None:
        out.append(
            f"{name}: the torque is a straight line of the measured velocity of slope {line[0]:.3g} {unit}·s/rad (it "
            f"leaves {100.0 * math.sqrt(line[1]):.2g} %): that is the speed controller, not friction; it says "
            "nothing of the axis."
        )
    return out


# ---- pictures --------------------------------------------------------------------------------------------------------


def pictures_of(places: Places, fit: Fit, found: PositionMap) -> tuple[Picture, ...]:
    """Draw the torque over the angle with the map and its interval, and the orders."""
    if not len(places):
        return ()
    return (_over_angle(places, fit, found), *([_spectrum(fit, found)] if fit.terms else []))


def _over_angle(places: Places, fit: Fit, found: PositionMap) -> Picture:
    low, high = shown_of(places, fit)
    places = places.at((places.angle >= low) & (places.angle <= high))
    angle = np.linspace(low, high, MANY)
    traces: list[Trace] = []
    for d, word, kind in ((1.0, "forward", "points"), (-1.0, "backward", "open points")):
        own = places.at(places.direction == d)
        thin = max(1, len(own) // 400)
        traces.append(Trace(word, own.angle[::thin], own.torque[::thin], kind))
    band = interval_of(fit, angle)
    middle = found.offset + found.beside(angle)
    traces.append(Trace("95 % of the even part", angle, middle - band, "own band", middle + band))
    traces.append(Trace("even part", angle, middle))
    size = float(np.ptp(found.sampled(MANY)))
    return Picture(
        "cogging", "Torque over the angle",
        f"{size:.3g} {found.unit} peak to peak in both directions alike, friction {found.friction:.3g} {found.unit}",
        "angle (rad)", f"torque ({found.unit})" if found.unit != "A" else "current (A)", tuple(traces),
    )  # fmt: skip


def shown_of(places: Places, fit: Fit) -> tuple[float, float]:
    """Return the angles of `PERIODS` periods of the strongest order, in the middle; the whole range if it has fewer."""
    low, high = float(places.angle.min()), float(places.angle.max())
    if not fit.terms:
        return low, high
    _, strongest = max(fit.terms, key=lambda t: float(np.hypot(*fit.pair(t))))
    half = 0.5 * min(high - low, PERIODS * 2.0 * math.pi / strongest)
    return 0.5 * (low + high) - half, 0.5 * (low + high) + half


def interval_of(fit: Fit, angle: Array) -> Array:
    """Return half the 95 % interval of the even part at angles, shape (n,)."""
    zeros = np.zeros(angle.size)
    at = Places(
        angle, zeros, zeros, zeros, zeros, np.zeros(angle.size, dtype=np.intp), zeros, zeros, np.zeros((angle.size, 2))
    )  # fmt: skip
    x = columns(at, fit.terms, ())
    inner = np.zeros((angle.size, fit.values.size))
    inner[:, :2] = x[:, :2]
    inner[:, fit.first :] = x[:, 2:]
    return 1.96 * np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", inner, fit.covariance, inner), 0.0))


def _spectrum(fit: Fit, found: PositionMap) -> Picture:
    def sizes(part: str) -> tuple[Array, Array]:
        own: list[Term] = sorted((t for t in fit.terms if t[0] == part), key=lambda t: t[1])
        return np.array([n for _, n in own]), np.array([float(np.hypot(*fit.pair(t))) for t in own])

    traces = [
        Trace(word, *sizes(part), kind)
        for part, word, kind in (
            ("even", "both directions alike", "points"),
            ("odd", "with the direction", "open points"),
        )
    ]
    largest = max((t for t in fit.terms), key=lambda t: float(np.hypot(*fit.pair(t))))
    return Picture(
        "orders", "Orders of the torque over the angle", f"The largest is order {largest[1]:g}",
        "order (periods a turn)", f"amplitude ({found.unit})", tuple(t for t in traces if t.x.size),
    )  # fmt: skip
