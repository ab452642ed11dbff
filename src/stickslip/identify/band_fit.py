"""What certain sliding says in one band of frequencies: linear least squares, averaged over what is not known.

T = J dv/dt + sigma2 v + (Fc + A exp(-(v/vs)²)) sign(v) + T0 (+ gravity, + cogging): linear but for vs and for the skew
between the columns of torque and motion. vs is averaged over (Bayesian model averaging, ``hoeting1999``): a level
that the record does not reach is then as uncertain as it should be. The skew is the one at which the jerk explains
nothing more.

Friction that no law holds (a curve a little other than assumed, memory after a reversal, friction that lags behind
velocity, a torque over the position) takes part as columns whose coefficients are small, and what they could do to a
number is in its variance; so is a misfit that does not average out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.identify.sliding_rows import SlidingRows

__all__ = ["BandFit", "Number", "fit_band", "memory_of", "pieces_of", "rows_in", "stacked", "strokes_of"]

Array = np.ndarray[Any, np.dtype[np.float64]]
Places = np.ndarray[Any, np.dtype[np.int64]]

INERTIA, VISCOUS, COULOMB, OFFSET, JERK = range(5)
CORE = 5
ROUNDS = 12
SETTLED = 1e-6  # s: the skew's change at which its search ends
FARTHEST, STRIDE = 40.0, 4.0  # times the skew's usual size: as far as it is looked for, and in a step
NONE_PRIOR = 0.5  # probability, before the record, that friction does not fall with velocity
SHOWN = 0.03  # of Fc: a fall of friction that is one
USUAL, OFTEN = (
    0.2,
    0.9,
)  # of the speed exceeded in a tenth of calm rows: a greater vs is less likely, with its square
FALL = 0.4  # of Fc: what the fall is expected to be at most, one standard deviation
RISE, DEEPEST = -0.05, 2.0  # of Fc: bounds of A
MOST_LAGS = 300
FADED = 0.05  # correlation that counts as none

# Standard deviations of what no law holds, in parts of Fc.
CURVE, AFTER, UNEVEN, LAGGING, AROUND = 0.002, 0.01, 0.03, 0.013, 0.005
LEANING, LEANS = (
    3,
    0.02,
)  # order of a slow torque over the travel (cables, a load, gravity), and its part of Fc
BLURRED = 0.3  # of the largest order found, that those beside it may have where the way is short
FORM = 0.003  # of Fc: misfit that is assumed at least
TENSION, FAR = (
    2.0,
    6.0,
)  # standard deviations: viscous friction below 0 at most; above 0, where the bound does nothing
MEMORY = 3.0  # rows over which it is correlated at least
PIECE, LONGER = (
    0.25,
    2.0,
)  # s, and times the memory: length of a piece that counts as one observation, at least
SYSTEMATIC = 0.02  # of the misfit: what may not average out
STIFF, LATE = 0.15, 0.2  # the same for inertia and skew, of an axis that is not stiff


@dataclass(frozen=True, slots=True)
class Number:
    """A value and its standard deviation."""

    value: float
    std: float


@dataclass(frozen=True, eq=False)
class BandFit:
    """One band's result.

    Attributes
    ----------
    corner : float
        Of the window, Hz.
    numbers : dict of str to Number
        ``inertia``, ``sigma2``, ``fc``, ``offset``, ``skew`` (s by which the torque's column lies behind), ``fs`` (the
        curve's end at rest), ``gravity_sin``, ``gravity_cos``.
    falls : float
        Probability that friction falls by more than `SHOWN` of Fc.
    probability : array, shape (m,)
        Of no fall of friction (the first), and of every vs tried.
    stribeck : array, shape (m,)
        Those vs, rad/s (m/s); the first is 0.
    harmonics : array, shape (k, 2)
        Cosine and sine of every order taken in, N·m (N).
    correlation : array, shape (p, p)
        Of inertia, sigma2, fc, offset and gravity's two, in the most probable candidate.
    misfit : float
        RMS of what is left, N·m (N).
    relative : float
        The same over the RMS of the torque.
    rows, pieces : int
    """

    corner: float
    numbers: dict[str, Number]
    falls: float
    probability: Array
    stribeck: Array
    harmonics: Array
    correlation: Array
    misfit: float
    relative: float
    rows: int
    pieces: int


@dataclass(frozen=True, eq=False)
class Candidate:
    """The fit with one vs (or none): places of its columns, and its solution in columns of norm 1."""

    level: int
    columns: Places
    mixing: Array
    inverse: Array
    values: Array
    small: Array
    cost: float


def stacked(records: Sequence[SlidingRows], name: str) -> Array:
    """One attribute of the rows of all records."""
    return np.concatenate([getattr(r, name) for r in records])


def strokes_of(records: Sequence[SlidingRows]) -> Places:
    """The stretch of sliding of every row, counted through all records."""
    first = np.cumsum([0, *(int(r.stroke[-1]) + 1 for r in records[:-1])])
    return np.concatenate([r.stroke + f for r, f in zip(records, first, strict=True)])


def pieces_of(stroke: Places, rows: int) -> Places:
    """The strokes cut into pieces of so many rows: what counts as one observation."""
    begins = np.flatnonzero(np.concatenate([[True], np.diff(stroke) != 0]))
    within = np.arange(stroke.size) - np.repeat(begins, np.diff([*begins.tolist(), stroke.size]))
    return np.cumsum(within % max(1, rows) == 0) - 1


def rows_in(seconds: float, records: Sequence[SlidingRows]) -> int:
    """Rows of the densest record in so many seconds."""
    return max(1, round(seconds / min(r.spacing for r in records)))


def memory_of(residual: Array, stroke: Places) -> float:
    """Rows over which a residual is correlated within a stroke: what the variance of a mean is greater by."""
    power, total = float(residual @ residual), 1.0
    if power <= 0.0:
        return total
    for lag in range(1, min(MOST_LAGS, residual.size - 1)):
        same = stroke[lag:] == stroke[:-lag]
        share = float(np.sum((residual[lag:] * residual[:-lag])[same])) / power
        if share < FADED:
            break
        total += 2.0 * share
    return total


def inverse_of(matrix: Array) -> Array:
    """Of a symmetric positive matrix."""
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def least_squares(columns: Array, target: Array) -> Array:
    """Coefficients of columns of whatever size."""
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.linalg.lstsq(columns / size, target, rcond=1e-9)[0] / size, dtype=np.float64)


def student(freedom: int) -> float:
    """Student's quantile for 95 % over that of the normal distribution (expansion of Cornish and Fisher)."""
    f = max(freedom, 2)
    return 1.0 + 1.2104 / f + 1.4402 / f**2


def small_columns(records: Sequence[SlidingRows], fc: float, orders: Sequence[float]) -> tuple[Array, Array]:
    """Columns of what no law holds, shape (n, k), and the standard deviation of each coefficient."""
    v, gone = stacked(records, "speed"), stacked(records, "gone")
    side, speed = np.sign(v), np.abs(v)
    top = float(speed.max())
    slow = max(float(np.quantile(speed, 0.01)), 1e-3 * top)
    knots = np.geomspace(slow, top, 6)
    along = np.log(np.clip(speed, slow, top))
    columns = [side * np.interp(along, np.log(knots), hat) for hat in np.eye(knots.size)]
    std = [CURVE] * knots.size
    near, usual = float(np.quantile(gone, 0.02)), float(np.quantile(gone, 0.5))
    for way in np.geomspace(max(near, 1e-12), max(usual, 1e-11), 3).tolist():
        columns.append(side * np.exp(-gone / way))
        std.append(AFTER)
    # About its mean: the constant torque of a law that is the same in both directions holds the mean of both.
    columns.append((speed - float(np.mean(speed))) / top)
    std.append(UNEVEN)
    pull = stacked(records, "fixed")[:, INERTIA]
    pull = pull / max(float(np.sqrt(np.mean(pull**2))), 1e-300)
    for scale in np.geomspace(slow, 0.5 * top, 4)[1:].tolist():
        slowly = np.exp(-speed / scale)
        columns += [pull * slowly, side * np.abs(pull) * slowly]
        std += [LAGGING] * 2
    for order in orders:
        columns += list(np.concatenate([r.around(order) for r in records]).T)
        std += [AROUND] * 2
    along = stacked(records, "position")
    middle, reach = 0.5 * (along.max() + along.min()), max(0.5 * float(np.ptp(along)), 1e-300)
    leaning: Array = np.asarray(
        np.polynomial.legendre.legvander((along - middle) / reach, LEANING), dtype=np.float64
    )
    columns += list(leaning.T[1:])
    std += [LEANS] * LEANING
    return np.column_stack(columns), fc * np.array(std)


class System:
    """The columns of one band, and their products; only the torque changes with the skew."""

    def __init__(
        self, records: Sequence[SlidingRows], stribeck: Sequence[float], orders: Sequence[float], background:
        Sequence[float], pendulum: bool, skew_size: float,
    ):  # fmt: skip
        self.records, self.skew_size, self.expected = records, skew_size, 0.0
        self.stroke = strokes_of(records)
        self.shortest = rows_in(PIECE, records)
        core = [stacked(records, "fixed"), stacked(records, "jerk")[:, None]]
        if pendulum:
            angle = stacked(records, "position")
            core.append(np.column_stack([np.sin(angle), np.cos(angle)]))
        core += [np.concatenate([r.around(o) for r in records]) for o in orders]
        plain = np.column_stack(core)
        self.core = plain.shape[1]
        first = self.torque(0.0)
        start = least_squares(plain[:, :JERK], first)
        self.fc = max(abs(float(start[COULOMB])), 1e-3 * float(np.max(np.abs(first))))
        self.inertia = abs(float(start[INERTIA]))
        falling = stacked(records, "falling")
        self.levels = [
            k for k in range(falling.shape[1]) if np.count_nonzero(np.abs(falling[:, k]) > 0.3) >= 5
        ]
        pace = np.abs(stacked(records, "speed"))
        calm = self.inertia * np.abs(plain[:, INERTIA]) < self.fc
        often = float(np.quantile(pace[calm] if np.any(calm) else pace, OFTEN))
        # Levels of friction are told by rows that hardly accelerate: beyond their speeds nothing speaks against a fall.
        speed = np.array([stribeck[k] for k in self.levels])
        beyond = np.maximum(speed / max(USUAL * often, 1e-300), 1.0)
        self.before = beyond**-2.0 / max(float(np.sum(beyond**-2.0)), 1e-300)
        small, self.std = small_columns(records, self.fc, background)
        columns = np.column_stack([plain, falling[:, self.levels], small])
        scale = np.linalg.norm(columns, axis=0)
        self.scale = np.where(scale > 0.0, scale, 1.0)
        self.columns = columns / self.scale
        self.products = self.columns.T @ self.columns
        self.small: Places = np.arange(columns.shape[1] - small.shape[1], columns.shape[1])
        residual = first - plain[:, :JERK] @ start
        self.noise = float(residual @ residual) / first.size
        self.memory = memory_of(residual, self.stroke)

    @property
    def piece(self) -> Places:
        """The piece of every row: so long that what one leaves says little of the next."""
        return pieces_of(self.stroke, max(self.shortest, round(LONGER * self.memory)))

    def torque(self, skew: float) -> Array:
        """The torque that acted, N·m (N)."""
        return np.concatenate([r.torque(skew) for r in self.records])

    def candidates(self, torque: Array, skew: float) -> list[Candidate]:
        """The fit without a fall of friction, and with one at every vs."""
        products, small = self.products, self.small
        seen = self.columns.T @ torque
        held = np.diag(self.noise * self.memory / (self.std * self.scale[small]) ** 2)
        inner = inverse_of(products[np.ix_(small, small)] + held)
        power = float(torque @ torque)
        out: list[Candidate] = []
        for level in range(-1, len(self.levels)):
            own = np.array([*range(self.core), *([self.core + level] if level >= 0 else [])])
            mixing = inner @ products[np.ix_(small, own)]
            matrix = products[np.ix_(own, own)] - products[np.ix_(own, small)] @ mixing
            right = seen[own] - mixing.T @ seen[small]
            # The skew is known to its usual size before the record is looked at.
            known = self.noise * self.memory / (self.inertia * self.skew_size * self.scale[JERK]) ** 2
            matrix[JERK, JERK] += known
            right[JERK] += known * self.inertia * (skew - self.expected) * self.scale[JERK]
            inverse = inverse_of(matrix + 1e-11 * np.trace(matrix) / own.size * np.eye(own.size))
            values = inverse @ right
            coefficients = inner @ seen[small] - mixing @ values
            every, both = np.concatenate([own, small]), np.concatenate([values, coefficients])
            cost = (
                power - 2.0 * float(seen[every] @ both) + float(both @ products[np.ix_(every, every)] @ both)
            )
            cost += float(coefficients @ held @ coefficients)
            out.append(Candidate(level, own, mixing, inverse, values, coefficients, cost))
        return out

    def beside(self, c: Candidate, orders: int, background: int) -> None:
        """Let the torque over the position hold a part of the orders found in those beside them."""
        found = slice(self.core - 2 * orders, self.core)
        size = float(np.max(np.abs(c.values[found] / self.scale[found])))
        last = self.std[-2 * background - LEANING :]
        self.std[-2 * background - LEANING :] = np.maximum(last, BLURRED * size)

    def residual(self, torque: Array, c: Candidate) -> Array:
        """What a candidate leaves, N·m (N)."""
        return torque - self.columns[:, np.concatenate([c.columns, self.small])] @ np.concatenate(
            [c.values, c.small]
        )

    def weights(self, candidates: Sequence[Candidate]) -> Array:
        """Probability of every candidate after the record."""
        unit = self.noise * self.memory
        logs: list[float] = []
        for c in candidates:
            log = -0.5 * c.cost / unit
            # Viscous friction brakes: a level that falls all the way up is a fall, not a negative slope.
            slope = c.values[VISCOUS] / max(math.sqrt(unit * abs(c.inverse[VISCOUS, VISCOUS])), 1e-300)
            log += math.log(max(0.5 * math.erfc(-slope / math.sqrt(2.0)), 1e-12))
            if c.level < 0:
                logs.append(log + math.log(NONE_PRIOR))
                continue
            last = self.scale[c.columns[-1]]
            fall, fc = c.values[-1] / last, c.values[COULOMB] / self.scale[COULOMB]
            own, before = unit * abs(c.inverse[-1, -1]) / last**2, (FALL * self.fc) ** 2
            log += -0.5 * math.log1p(before / own) - 0.5 * fall * fall / (before + own)
            log += math.log(max((1.0 - NONE_PRIOR) * float(self.before[c.level]), 1e-300))
            logs.append(log if fc > 0.0 and RISE * fc <= fall <= DEEPEST * fc else -math.inf)
        best = max(logs)
        if not math.isfinite(best):
            raise InputError(
                "certain sliding gives no numbers to compute with; check the units of the record"
            )
        weight = np.exp(np.array(logs) - best)
        return weight / weight.sum()

    def covariance(self, torque: Array, c: Candidate) -> Array:
        """Of a candidate's values: noise that pieces share, what no law holds, and misfit that does not average out."""
        residual = self.residual(torque, c)
        own = self.columns[:, c.columns] - self.columns[:, self.small] @ c.mixing
        begins = np.flatnonzero(np.concatenate([[True], np.diff(self.piece) != 0]))
        scores = np.add.reduceat(own * residual[:, None], begins, axis=0)
        count = student(begins.size - 1) ** 2 * begins.size / max(1, begins.size - 1)
        noise = c.inverse @ (scores.T @ scores) @ c.inverse * count
        shrunk = self.products[np.ix_(c.columns, self.small)]
        shrunk = shrunk - c.mixing.T @ self.products[np.ix_(self.small, self.small)]
        moved = c.inverse @ shrunk * (self.std * self.scale[self.small])
        least, plain = self.noise * self.memory * np.diag(c.inverse), np.diag(noise)
        noise[np.diag_indices_from(noise)] = np.maximum(plain, least)
        share = np.full(c.columns.size, SYSTEMATIC)
        share[[INERTIA, JERK]] = STIFF, LATE
        coherent = np.diag(share**2 * float(residual @ residual) * np.diag(c.inverse))
        scale = self.scale[c.columns]
        return (noise + moved @ moved.T + coherent) / np.outer(scale, scale)


def fit_band(
    records: Sequence[SlidingRows], stribeck: Sequence[float], *, orders: Sequence[float] = (),
    background: Sequence[float] = (), pendulum: bool = False, skew_size: float = 3e-3, skew: float | None = None,
    start: float = 0.0, blurred: bool = False,
) -> BandFit:  # fmt: skip
    """Fit the rows of certain sliding that one window shows.

    Parameters
    ----------
    records : sequence of SlidingRows
        Fitted together, each with a column of `falling` for every vs.
    stribeck : sequence of float
        Those vs, rad/s (m/s).
    orders, background : sequence of float
        Cycles a radian (m) of a torque over the position: free ones, and such that are small.
    pendulum : bool
        Whether gravity turns with the angle.
    skew_size : float
        s: one standard deviation of the skew before the record.
    skew : float, optional
        s, where it is known.
    start : float
        s: where the search for the skew begins, and what it is expected to be.
    blurred : bool
        Whether the way is too short to tell orders apart: what is near those found is then not small.
    """
    system = System(records, stribeck, orders, background, pendulum, skew_size)
    at = start if skew is None else skew
    system.expected = at
    torque = system.torque(at)
    candidates = system.candidates(torque, at)
    weight = np.zeros(0)
    for turn in range(ROUNDS):
        best = min(candidates, key=lambda c: c.cost)
        residual = system.residual(torque, best)
        freedom = max(1, residual.size - best.columns.size - system.small.size)
        system.noise = float(residual @ residual) / freedom + (FORM * system.fc) ** 2
        system.memory = max(memory_of(residual, system.stroke), MEMORY)
        weight = system.weights(candidates)
        if blurred and orders:
            system.beside(best, len(orders), len(background))
        inertia, jerk = (
            sum(w * c.values[i] for w, c in zip(weight, candidates, strict=True)) / system.scale[i]
            for i in (INERTIA, JERK)
        )
        step = (
            float(np.clip(-jerk / inertia, -STRIDE * skew_size, STRIDE * skew_size)) if inertia > 0.0 else 0.0
        )
        if skew is not None or turn == ROUNDS - 1 or (turn > 1 and abs(step) < SETTLED):
            break
        at = float(
            np.clip(at + step, system.expected - FARTHEST * skew_size, system.expected + FARTHEST * skew_size)
        )
        torque = system.torque(at)
        candidates = system.candidates(torque, at)
    return summed_up(system, torque, candidates, weight, at, stribeck, len(orders), pendulum)


def brakes(values: Array, covariance: Array) -> tuple[Array, Array]:
    """Values and covariance once viscous friction is known to brake: the normal distribution cut off at 0.

    Where it lies below 0 by more than `TENSION` standard deviations, these are too small.
    """
    mean, variance = float(values[VISCOUS]), float(covariance[VISCOUS, VISCOUS])
    if variance <= 0.0 or not math.isfinite(variance):
        return values, covariance
    wider = max(1.0, mean * mean / (TENSION * TENSION * variance)) if mean < 0.0 else 1.0
    covariance, variance = wider * covariance, wider * variance
    std = math.sqrt(variance)
    beyond = -mean / std
    if beyond < -FAR:
        return values, covariance
    density = math.exp(-0.5 * beyond * beyond) / math.sqrt(2.0 * math.pi)
    rate = density / max(0.5 * math.erfc(beyond / math.sqrt(2.0)), 1e-300)
    along = covariance[:, VISCOUS] / variance
    left = variance * max(1.0 + beyond * rate - rate * rate, 0.0)
    moved = values + along * std * rate
    return moved, covariance - np.outer(along, along) * (variance - left)


def element(i: int) -> Callable[[Array, Array], tuple[float, float]]:
    """Picks a value and its variance."""
    return lambda v, s: (v[i], s[i, i])


def summed_up(
    system: System, torque: Array, candidates: Sequence[Candidate], weight: Array, skew: float,
    stribeck: Sequence[float], orders: int, pendulum: bool,
) -> BandFit:  # fmt: skip
    """Means over the candidates, their spread among the variances."""
    kept = [(w, c) for w, c in zip(weight, candidates, strict=True) if w > 1e-4]
    total = sum(w for w, _ in kept)
    braking = [
        brakes(c.values / system.scale[c.columns], system.covariance(torque, c)) for _, c in kept
    ]  # fmt: skip
    values, spreads = [v for v, _ in braking], [s for _, s in braking]

    def mean(of: Callable[[Array, Array], tuple[float, float]]) -> Number:
        pairs = [of(v, s) for v, s in zip(values, spreads, strict=True)]
        middle = sum(w * x for (w, _), (x, _) in zip(kept, pairs, strict=True)) / total
        variance = (
            sum(w * (s + (x - middle) ** 2) for (w, _), (x, s) in zip(kept, pairs, strict=True)) / total
        )
        return Number(float(middle), math.sqrt(max(float(variance), 0.0)))

    core = system.core
    named = {"inertia": INERTIA, "sigma2": VISCOUS, "fc": COULOMB, "offset": OFFSET}
    if pendulum:
        named |= {"gravity_sin": CORE, "gravity_cos": CORE + 1}

    def late(v: Array, s: Array) -> tuple[float, float]:
        return skew - v[JERK] / v[INERTIA], s[JERK, JERK] / v[INERTIA] ** 2

    def at_rest(v: Array, s: Array) -> tuple[float, float]:
        if v.size == core:
            return v[COULOMB], s[COULOMB, COULOMB]
        return v[COULOMB] + v[core], s[COULOMB, COULOMB] + s[core, core] + 2.0 * s[COULOMB, core]

    numbers = {name: mean(element(i)) for name, i in named.items()}
    numbers |= {"skew": mean(late), "fs": mean(at_rest)}
    farthest = FARTHEST * system.skew_size
    found = numbers["skew"]
    numbers["skew"] = Number(float(np.clip(found.value, skew - farthest, skew + farthest)), found.std)
    falls = sum(
        w for (w, _), v in zip(kept, values, strict=True) if v.size > core and v[core] > SHOWN * v[COULOMB]
    )
    best = candidates[int(np.argmax(weight))]
    residual = system.residual(torque, best)
    first = core - 2 * orders
    harmonics = np.array([sum(w * v[i] for (w, _), v in zip(kept, values, strict=True)) / total
                          for i in range(first, core)]).reshape(orders, 2)  # fmt: skip
    misfit = float(np.sqrt(np.mean(residual**2)))
    places = list(named.values())
    joint = system.covariance(torque, best)[np.ix_(places, places)]
    each = np.sqrt(np.diag(joint))
    return BandFit(
        system.records[0].window.corner, numbers, float(falls / total), weight,
        np.array([0.0, *(stribeck[k] for k in system.levels)]), harmonics, joint / np.outer(each, each), misfit,
        misfit / max(float(np.sqrt(np.mean(torque**2))), 1e-300), torque.size, int(system.piece[-1]) + 1,
    )  # fmt: skip
