"""Orders of a torque over the angle, even or odd in the direction; their number is chosen by cross-validation.

Orders are chosen one by one, the one that explains most first (orthogonal matching pursuit, ``pati1993``). Scores of
all orders come from one Fourier transform of the residual over the angle; the chosen ones are fitted exactly.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from stickslip.identification.cogging.noise import memory
from stickslip.identification.cogging.rows import Places, least_squares

Array = np.ndarray[Any, np.dtype[np.float64]]
Integers = np.ndarray[Any, np.dtype[np.intp]]
Part = Literal["even", "odd"]
Term = tuple[Part, float]
PARTS: tuple[Part, Part] = ("even", "odd")

MOST = 60
"""Most orders of both parts together."""
SURE = 10.0
"""Least explained power of an order, variances of the noise, beyond twice the logarithm of the number tried."""
FOLDS, SECTORS = 4, 12
HIGHEST = 1500
RESOLVED = 0.8
"""Highest order, part of the Nyquist order of the places."""
STEADY = 1e-3
"""Acceleration below which the speed is constant, part of the squared speed."""
BENT = 1.2
"""Least ratio between the speeds of a curve."""
WHOLE = 0.25
"""Least range, turns, for orders to be whole numbers per turn; below, they are halves of the range."""
WARMS = 30.0
"""Time after which friction's level may have changed, s."""
ENOUGH = 1.005
"""Ratio to the least error within which fewer orders are chosen."""


@dataclass(frozen=True)
class Orders:
    """Candidate orders: ``base``, ``2 base``, ... up to ``count base``, 1/rad."""

    base: float
    count: int

    @property
    def highest(self) -> float:
        """The highest candidate, 1/rad."""
        return self.base * self.count

    @property
    def whole(self) -> bool:
        """Whether orders are whole numbers per turn."""
        return self.base == 1.0


def grid_of(places: Places, gear: float = 1.0) -> Orders:
    """Return the orders that the places can resolve."""
    way, spacing = float(np.ptp(places.angle)), places.spacing
    nyquist = math.pi / spacing if math.isfinite(spacing) and spacing > 0.0 else 1.0
    base = 1.0 if way > WHOLE * 2.0 * math.pi else math.pi / max(way, 1e-9)
    if gear > 1.0 and way > 1.5 * 2.0 * math.pi:
        base = 1.0 / gear
    return Orders(base, max(1, int(min(HIGHEST / min(base, 1.0), RESOLVED * nyquist / base))))


def columns(places: Places, terms: Sequence[Term], moving: Sequence[str]) -> Array:
    """Return the columns of a fit.

    Constant, direction, velocity and acceleration in motion, further columns of the places, then cosine and sine of
    every term.
    """
    d = places.direction
    out = [np.ones(len(places)), d]
    speed = np.abs(places.velocity)
    kinds = {
        "viscous": places.velocity, "curve": speed * places.velocity, "drift": d * places.time,
        "inertia": places.acceleration,
    }  # fmt: skip
    out += [*(kinds[name] for name in moving), *places.beside.T]
    for part, n in terms:
        # A mean over an angle is smaller than the wave itself.
        sign = (d if part == "odd" else 1.0) * places.damping(n)
        out += [sign * np.cos(n * places.angle), sign * np.sin(n * places.angle)]
    return np.column_stack(out)


def moving_columns(places: Places) -> tuple[str, ...]:
    """Return the names of the columns in motion.

    "viscous" for more than one speed (otherwise friction's level includes it), "curve" for three; "drift" if friction
    was recorded long enough to change; "inertia" if the speed varies.
    """
    speed = np.abs(places.velocity)
    low, second, third, high = np.percentile(
        speed, [10, 40, 60, 90]
    ).tolist()  # of two speeds, both are in the middle
    several, three = high > 1.5 * low, high > BENT * third and second > BENT * low
    swings = float(np.percentile(np.abs(places.acceleration), 90)) > STEADY * float(np.median(speed**2))
    return (
        *(("viscous",) if several else ()),
        *(("curve",) if three else ()),
        *(("drift",) if float(np.ptp(places.time)) > WARMS and several else ()),
        *(("inertia",) if swings else ()),
    )


# ---- the pursuit -----------------------------------------------------------------------------------------------------


class Scores:
    """Explained power of every order in a residual, from sums over a fine grid of the angle."""

    def __init__(self, places: Places, orders: Orders) -> None:
        self.places, self.orders = places, orders
        self.size = 1 << max(10, math.ceil(math.log2(16 * orders.count)))
        self.cell = (
            np.round(places.angle * orders.base * self.size / (2.0 * math.pi)).astype(np.int64) % self.size
        )
        density = np.fft.rfft(np.bincount(self.cell, minlength=self.size))
        k = np.arange(1, orders.count + 1)
        twice = density[2 * k]  # sum of exp(-2i n theta)
        n = float(len(places))
        self.cc, self.ss, self.cs = 0.5 * (n + twice.real), 0.5 * (n - twice.real), -0.5 * twice.imag
        self.det = np.maximum(self.cc * self.ss - self.cs**2, 1e-9 * n * n)

    def __call__(self, residual: Array) -> Array:
        """Return the residual's power that cosine and sine of each order explain, shape (count,)."""
        seen = np.fft.rfft(np.bincount(self.cell, residual, self.size))[1 : self.orders.count + 1]
        c, s = seen.real, -seen.imag
        return (self.ss * c * c - 2.0 * self.cs * c * s + self.cc * s * s) / self.det


def path(places: Places, orders: Orders, moving: Sequence[str], most: int = MOST) -> list[Term]:
    """Return the terms in the order of choice, as long as each explains more than chance."""
    scores = Scores(places, orders)
    basis, _ = np.linalg.qr(columns(places, (), moving))
    residual = places.torque - basis @ (basis.T @ places.torque)
    terms: list[Term] = []
    most = min(most, len(places) // 6)
    tried = 2.0 * math.log(2.0 * orders.count) + SURE
    taken = {"even": np.zeros(orders.count, dtype=bool), "odd": np.zeros(orders.count, dtype=bool)}
    while len(terms) < most:
        power = float(residual @ residual)
        every = {"even": scores(residual), "odd": scores(residual * places.direction)}
        for part, mask in taken.items():
            every[part][mask] = 0.0
        part = PARTS[int(every["odd"].max() > every["even"].max())]
        i = int(np.argmax(every[part]))
        if power <= 0.0 or len(places) / memory(residual, places.stroke) * every[part][i] / power < tried:
            break
        taken[part][i] = True
        term: Term = (part, orders.base * (i + 1))
        own = columns(places, [term], ())[:, -2:]
        for _ in range(2):
            own = own - basis @ (basis.T @ own)
        added, size = np.linalg.qr(own)
        if float(np.min(np.abs(np.diag(size)))) < 1e-3 * math.sqrt(len(places)):
            continue
        terms.append(term)
        basis = np.column_stack([basis, added])
        residual = residual - added @ (added.T @ residual)
    return terms


# ---- how many --------------------------------------------------------------------------------------------------------


def sectors(places: Places) -> Integers:
    """Return the fold of every place: whole sectors of the range, every fourth in one fold."""
    low, way = float(places.angle.min()), float(np.ptp(places.angle))
    turn = min(way, 2.0 * math.pi)
    return (
        np.floor(SECTORS * np.mod(places.angle - low, turn * (1.0 + 1e-9)) / turn).astype(np.intp)
    ) % FOLDS


def interleaved(places: Places) -> Integers:
    """Return the fold of every place: every other one, the same in both directions."""
    return (np.round(places.angle / places.spacing).astype(np.intp)) % 2


Fold = Callable[[Places], Integers]


def left_out(places: Places, orders: Orders, moving: Sequence[str], fold: Fold) -> tuple[Array, int]:
    """Return the RMS on places left out by number of terms, chosen separately in each fold; and the largest number."""
    number = fold(places)
    squares: list[Array] = []
    for f in range(int(number.max()) + 1):
        fitted, out = places.at(number != f), places.at(number == f)
        terms = path(fitted, orders, moving)
        squares.append(growing(fitted, out, terms, moving))
    most = max(len(s) for s in squares)
    padded = np.array([np.concatenate([s, np.full(most - len(s), s[-1])]) for s in squares])
    return np.sqrt(padded.sum(axis=0) / len(places)), most - 1


def growing(fitted: Places, out: Places, terms: Sequence[Term], moving: Sequence[str]) -> Array:
    """Return the sum of squares on `out` with the first 0, 1, 2, ... terms, from one triangular factor."""
    matrix, other = columns(fitted, terms, moving), columns(out, terms, moving)
    q, r = np.linalg.qr(matrix)
    seen = q.T @ fitted.torque
    first = matrix.shape[1] - 2 * len(terms)
    found: list[float] = []
    for k in range(len(terms) + 1):
        m = first + 2 * k
        values = np.linalg.solve(r[:m, :m], seen[:m])
        found.append(float(np.sum((out.torque - other[:, :m] @ values) ** 2)))
    return np.array(found)


def about_motion(
    places: Places, orders: Orders, moving: Sequence[str], fold: Fold, count: int
) -> tuple[float, float]:
    """Return the RMS on places left out without waves, and with the first `count` terms of each fold.

    The terms of the motion are fitted to all places: the others alone would extrapolate them, and the effects of a
    reversal or an acceleration may occur only in the sector left out.
    """
    number, torque, beside = fold(places), places.torque, places.beside.shape[1]
    basis, _ = np.linalg.qr(columns(places, (), moving))
    squares = np.zeros(len(places))
    for f in range(int(number.max()) + 1):
        fitted = places.at(number != f)
        terms = path(fitted, orders, moving, most=count)
        pairs = least_squares(columns(fitted, terms, moving), fitted.torque)[2 + len(moving) + beside :]
        left = torque - columns(places, terms, ())[:, 2 + beside :] @ pairs
        left = left - basis @ (basis.T @ left)
        squares[number == f] = left[number == f] ** 2
    without = torque - basis @ (basis.T @ torque)
    return float(np.sqrt(np.mean(without**2))), float(np.sqrt(np.mean(squares)))


def chosen(errors: Array) -> int:
    """Return the fewest terms whose error is within `ENOUGH` of the least."""
    return int(np.flatnonzero(errors <= ENOUGH * float(errors.min()))[0])
