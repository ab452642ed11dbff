"""The columns of the regression in one band of frequencies, and its solution for every fall of friction.

Friction that no law holds (a curve a little other than assumed, memory after a reversal, friction that lags behind
velocity, a torque over the position) and a train that is not stiff take part as columns whose coefficients are small,
and what they could do to a number is in its variance; so is a misfit that does not average out.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from stickslip.errors import InputError
from stickslip.identify.regression.drifting import MAY_DRIFT, drift_columns, drift_unseen
from stickslip.identify.regression.flexible import STILL, Swing, Train, flexible_columns
from stickslip.identify.regression.rounding import rounded_sums
from stickslip.identify.regression.sliding_rows import Fall, SlidingRows
from stickslip.identify.regression.strokes import PIECE, memory_of, pieces_of, rows_in, stacked, strokes_of

Array = np.ndarray[Any, np.dtype[np.float64]]
Places = np.ndarray[Any, np.dtype[np.int64]]

INERTIA, VISCOUS, COULOMB, OFFSET, JERK = range(5)
COLUMNS = {"inertia": INERTIA, "sigma2": VISCOUS, "fc": COULOMB, "offset": OFFSET}
NONE_PRIOR = 0.5  # probability, before the record, that friction does not fall with velocity
USUAL, OFTEN = (
    0.2,
    0.9,
)  # of the speed exceeded in a tenth of calm rows: a greater vs is less likely, with its square
USUAL_EXPONENTS = {2.0: 0.8, 1.0: 0.2}  # of the fall, and how likely each is before the record
FALL = 0.4  # of Fc: what the fall is expected to be at most, one standard deviation
RISE, DEEPEST = -0.05, 2.0  # of Fc: bounds of A

# Standard deviations of what no law holds, in parts of Fc.
CURVE, AFTER, UNEVEN, LAGGING, AROUND = 0.002, 0.01, 0.03, 0.013, 0.005
UNEVEN_FALL = 0.003  # of the fall of friction, which differs by direction as its level does
# The same where friction has a level and a slope of its own in each direction; and what these slopes make it differ by
# from their mean at the highest speed, in parts of friction there.
EACH_FALL, EACH_SLOPE = 0.05, 0.1
LEANING, LEANS = (
    3,
    0.02,
)  # order of a slow torque over the travel (cables, a load, gravity), and its part of Fc
BLURRED = 0.3  # of the largest order found, that those beside it may have where the way is short
LONGER = 2.0  # times the memory: length of a piece that counts as one observation, at least
HUNDREDTH = 2.326  # standard deviations that a normal number exceeds in one of a hundred cases
FEW = 4  # degrees of freedom, below which a variance refutes nothing
SYSTEMATIC = 0.02  # of the misfit: what may not average out
STIFF, LATE = 0.12, 0.2  # the same for inertia and skew, of an axis that is not stiff
DAMPED_AWAY = 1e-100  # norm of a column
FIRM = 1e8  # times what a record says of a column: weight of a coefficient that is known
LEAST = 1e-14  # of the largest eigenvalue of products: below it there is rounding alone


@dataclass(frozen=True, eq=False)
class Candidate:
    """The fit with one fall of friction (or none): places of its columns, and its solution in columns of norm 1."""

    level: int
    columns: Places
    mixing: Array
    inverse: Array
    values: Array
    small: Array
    cost: float


class Products(NamedTuple):
    """Of the columns without a fall of friction, or with one each, with each other and with the small ones: no torque
    changes them. A first axis counts the falls."""

    levels: tuple[int, ...]
    own: Places
    every: Places
    own_own: Array
    own_small: Array
    every_every: Array


def inverse_of(matrix: Array) -> Array:
    """Of a symmetric positive matrix; what rounding made negative of it counts as hardly there."""
    with contextlib.suppress(np.linalg.LinAlgError):
        inverse: Array = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
        if inverse.diagonal().min() > 0.0:
            return inverse
    sizes, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return np.asarray((vectors / np.maximum(sizes, LEAST * sizes[-1])) @ vectors.T, dtype=np.float64)


def inverses_of(matrices: Array) -> Array:
    """As `inverse_of`, of many, shape (n, p, p)."""
    try:
        inverses: Array = np.asarray(np.linalg.inv(matrices), dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.stack([inverse_of(m) for m in matrices])
    for i in np.flatnonzero(np.diagonal(inverses, axis1=1, axis2=2).min(axis=1) <= 0.0):
        inverses[i] = inverse_of(matrices[i])
    return inverses


def least_squares(columns: Array, target: Array) -> Array:
    """Coefficients of columns of whatever size."""
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.linalg.lstsq(columns / size, target, rcond=1e-9)[0] / size, dtype=np.float64)


def student(freedom: int) -> float:
    """Student's quantile for 95 % over that of the normal distribution (expansion of Cornish and Fisher)."""
    f = max(freedom, 2)
    return 1.0 + 1.2104 / f + 1.4402 / f**2


def refuted_above(freedom: int) -> float:
    """Times a variance of so many degrees of freedom, that the true one exceeds in one of a hundred cases (Wilson and
    Hilferty's quantile of chi-square); infinite for fewer than `FEW`."""
    if freedom < FEW:
        return math.inf
    part = 2.0 / (9.0 * freedom)
    return (1.0 - part - HUNDREDTH * math.sqrt(part)) ** -3


def small_columns(
    records: Sequence[SlidingRows], fc: float, orders: Sequence[float], each_way: bool, drifting: bool = False
) -> tuple[Array, Array]:
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
    if not each_way:
        # About its mean: the constant torque of a law that is the same in both directions holds the mean of both.
        columns.append((speed - float(np.mean(speed))) / top)
        std.append(UNEVEN)
    pull = stacked(records, "fixed")[:, INERTIA]
    pull = pull / max(float(np.sqrt(np.mean(pull**2))), 1e-300)
    for scale in np.geomspace(slow, 0.5 * top, 4)[1:].tolist():
        slowly = np.exp(-speed / scale)
        columns += [pull * slowly, side * np.abs(pull) * slowly]
        # A fall that is not the same in both directions: the constant torque is half the difference of the levels.
        columns.append(slowly)
        std += [LAGGING, LAGGING, EACH_FALL if each_way else UNEVEN_FALL]
    columns.append(drift_unseen(records, drifting))
    std.append(MAY_DRIFT)
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
        self, records: Sequence[SlidingRows], falls: Sequence[Fall], orders: Sequence[float], background:
        Sequence[float], pendulum: bool, skew_size: float, each_way: bool = False, drifting: bool = False,
        train: Train = Train.RIGID, known: Mapping[str, float] | None = None,
    ):  # fmt: skip
        self.records, self.skew_size, self.expected = records, skew_size, 0.0
        self.known = {COLUMNS[name]: value for name, value in (known or {}).items()}
        self.train = train
        self.stroke = strokes_of(records)
        self.shortest = rows_in(PIECE, records)
        core = [stacked(records, "fixed"), stacked(records, "jerk")[:, None]]
        if pendulum:
            angle = stacked(records, "position")
            core.append(np.column_stack([np.sin(angle), np.cos(angle)]))
        if each_way:
            core.append(np.abs(stacked(records, "speed"))[:, None])
        if drifting:
            core.append(drift_columns(records))
        core += [np.concatenate([r.around(o) for r in records]) for o in orders]
        plain = np.column_stack(core)
        self.core = plain.shape[1]
        first = self.torque(0.0)
        start = least_squares(plain[:, :JERK], first)
        self.fc = max(abs(float(start[COULOMB])), 1e-3 * float(np.max(np.abs(first))))
        self.inertia = abs(float(start[INERTIA]))
        self.uneven = JERK + 2 * pendulum + 1 if each_way else -1
        top = float(np.max(np.abs(stacked(records, "speed"))))
        self.uneven_std = EACH_SLOPE * (self.fc / top + abs(float(start[VISCOUS])))
        falling = stacked(records, "falling")
        self.levels = [
            k for k in range(falling.shape[1]) if np.count_nonzero(np.abs(falling[:, k]) > 0.3) >= 5
        ]
        pace = np.abs(stacked(records, "speed"))
        calm = self.inertia * np.abs(plain[:, INERTIA]) < self.fc
        often = float(np.quantile(pace[calm] if np.any(calm) else pace, OFTEN))
        # Levels of friction are told by rows that hardly accelerate: beyond their speeds nothing speaks against a fall.
        speed = np.array([falls[k].vs / Fall.like(1.0, falls[k].exponent).vs for k in self.levels])
        beyond = np.maximum(speed / max(USUAL * often, 1e-300), 1.0)
        before = beyond**-2.0 * np.array([USUAL_EXPONENTS[falls[k].exponent] for k in self.levels])
        self.before = before / max(float(np.sum(before)), 1e-300)
        flexible, give = flexible_columns(records, self.inertia, train)
        small, std = small_columns(records, self.fc, background, each_way, drifting)
        small, self.std = np.column_stack([flexible, small]), np.concatenate([give, std])
        columns = np.column_stack([plain, falling[:, self.levels], small])
        scale = np.linalg.norm(columns, axis=0)
        # A wave that the window damps away is 0: the square of what is left of it would be.
        self.scale = np.where(scale > DAMPED_AWAY, scale, 1.0)
        self.columns = columns / self.scale
        self.products = self.columns.T @ self.columns
        self.small: Places = np.arange(columns.shape[1] - small.shape[1], columns.shape[1])
        self.rounded = rounded_sums(records, self.columns)
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

    @cached_property
    def by_level(self) -> list[Products]:
        """Without a fall of friction, and with every one."""
        return [
            self._products((-1,)),
            *([self._products(tuple(range(len(self.levels))))] if self.levels else []),
        ]

    def _products(self, levels: tuple[int, ...]) -> Products:
        """Those of columns that are as many."""
        core = list(range(self.core))
        own = np.array([[*core, *([self.core + level] if level >= 0 else [])] for level in levels])
        every = np.concatenate([own, np.tile(self.small, (len(levels), 1))], axis=1)
        pairs = ((own, own), (own, np.tile(self.small, (len(levels), 1))), (every, every))
        return Products(levels, own, every, *(self.products[x[:, :, None], y[:, None, :]] for x, y in pairs))

    @property
    def tied(self) -> float:
        """Weight with which the slopes of both directions are held to their mean."""
        return self.noise * self.memory / (self.uneven_std * self.scale[self.uneven]) ** 2

    def candidates(self, torque: Array, skew: float) -> list[Candidate]:
        """The fit without a fall of friction, and with every one."""
        small = self.small
        seen = self.columns.T @ torque
        held = self.noise * self.memory / (self.std * self.scale[small]) ** 2
        inner = inverse_of(self.products[np.ix_(small, small)] + np.diag(held))
        power, seen_small = float(torque @ torque), seen[small]
        alone = inner @ seen_small
        # The skew is known to its usual size before the record is looked at.
        known = self.noise * self.memory / (self.inertia * self.skew_size * self.scale[JERK]) ** 2
        moved = known * self.inertia * (skew - self.expected) * self.scale[JERK]
        out: list[Candidate] = []
        for levels, own, every, own_own, own_small, every_every in self.by_level:
            mixing = inner @ own_small.transpose(0, 2, 1)
            matrix = own_own - own_small @ mixing
            right = seen[own] - seen_small @ mixing
            matrix[:, JERK, JERK] += known
            if self.uneven >= 0:
                matrix[:, self.uneven, self.uneven] += self.tied
            right[:, JERK] += moved
            size = own.shape[1]
            matrix += 1e-11 / size * np.trace(matrix, axis1=1, axis2=2)[:, None, None] * np.eye(size)
            for place, value in self.known.items():
                right[:, place] += FIRM * value * self.scale[place]
                matrix[:, place, place] += FIRM
            inverse = inverses_of(matrix)
            values = (inverse @ right[:, :, None])[:, :, 0]
            coefficients = alone - (mixing @ values[:, :, None])[:, :, 0]
            both = np.concatenate([values, coefficients], axis=1)
            cost = power - 2.0 * np.sum(seen[every] * both, axis=1)
            cost += np.sum(both * (every_every @ both[:, :, None])[:, :, 0], axis=1)
            cost += coefficients**2 @ held
            parts = zip(levels, own, mixing, inverse, values, coefficients, cost.tolist(), strict=True)
            out += [Candidate(*part) for part in parts]
        return out

    def beside(self, c: Candidate, orders: int, background: int) -> None:
        """Let the torque over the position hold a part of the orders found in those beside them."""
        found = slice(self.core - 2 * orders, self.core)
        size = float(np.max(np.abs(c.values[found] / self.scale[found])))
        last = self.std[-2 * background - LEANING :]
        self.std[-2 * background - LEANING :] = np.maximum(last, BLURRED * size)

    def left_beside(self, torque: Array, c: Candidate, columns: Array) -> float:
        """Part of a candidate's cost that is left at least once these columns, shape (n, k), take part freely."""
        places = np.concatenate([c.columns, self.small])
        held = np.zeros(places.size)
        held[c.columns.size :] = self.noise * self.memory / (self.std * self.scale[self.small]) ** 2
        own = columns / np.maximum(np.linalg.norm(columns, axis=0), DAMPED_AWAY)
        shared = self.columns[:, places].T @ own
        inner = inverse_of(self.products[np.ix_(places, places)] + np.diag(held))
        along = own.T @ self.residual(torque, c)
        explained = along @ inverse_of(own.T @ own - shared.T @ inner @ shared) @ along
        return float(1.0 - explained / max(c.cost, 1e-300))

    def residual(self, torque: Array, c: Candidate) -> Array:
        """What a candidate leaves, N·m (N)."""
        return self._residuals(torque, [c])[:, 0]

    def _residuals(self, torque: Array, candidates: Sequence[Candidate]) -> Array:
        """Those of several, shape (n, candidates)."""
        coefficients = np.zeros((self.columns.shape[1], len(candidates)))
        for k, c in enumerate(candidates):
            coefficients[c.columns, k], coefficients[self.small, k] = c.values, c.small
        return torque[:, None] - self.columns @ coefficients

    def swing_of(self, c: Candidate) -> Swing:
        """What a candidate says of a swing, the torque's part 0 where the train gives; `STILL` where it is rigid."""
        if self.train is Train.RIGID:
            return STILL
        found = [float(c.small[i] / self.scale[self.small[i]]) for i in range(self.train.value)]
        acceleration, torque = (*found, 0.0)[:2]
        return Swing(torque, acceleration, float(c.values[INERTIA] / self.scale[INERTIA]))

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
            raise InputError("gross sliding gives no numbers to compute with; check the units of the record")
        weight = np.exp(np.array(logs) - best)
        return weight / weight.sum()

    def covariance(self, torque: Array, c: Candidate) -> Array:
        """Of a candidate's values."""
        return self.covariances(torque, [c])[0]

    def covariances(self, torque: Array, candidates: Sequence[Candidate]) -> list[Array]:
        """Of the values of several, whose sums over pieces are made together."""
        residuals = self._residuals(torque, candidates)
        begins = np.flatnonzero(np.concatenate([[True], np.diff(self.piece) != 0]))
        bounds = pairwise([*begins.tolist(), len(residuals)])
        sums = np.array([residuals[i:j].T @ self.columns[i:j] for i, j in bounds])
        squares = np.sum(residuals * residuals, axis=0).tolist()
        return [self._covariance(c, sums[:, k], squares[k]) for k, c in enumerate(candidates)]

    def _covariance(self, c: Candidate, sums: Array, square: float) -> Array:
        """By the sums of its residual times the columns over pieces, and its square: noise that pieces share, what no
        law holds, the rounding of the torque, and misfit that does not average out."""
        pieces = len(sums)
        # What the small columns explain of the others is taken out of a piece's sum, which is as good as of every row.
        scores = sums[:, c.columns] - sums[:, self.small] @ c.mixing
        count = student(pieces - 1) ** 2 * pieces / max(1, pieces - 1)
        noise = c.inverse @ (scores.T @ scores) @ c.inverse * count
        shrunk = self.products[np.ix_(c.columns, self.small)]
        shrunk = shrunk - c.mixing.T @ self.products[np.ix_(self.small, self.small)]
        moved = c.inverse @ shrunk * (self.std * self.scale[self.small])
        if self.uneven >= 0:
            tied = self.tied * self.uneven_std * self.scale[self.uneven] * c.inverse[:, self.uneven]
            moved = np.column_stack([moved, tied])
        rounded = c.inverse @ (self.rounded[:, c.columns] - self.rounded[:, self.small] @ c.mixing).T
        least, plain = self.noise * self.memory * np.diag(c.inverse), np.diag(noise)
        # Whole pieces tell level and slope of friction: where many of them refute the misfit's say, they decide.
        # Of acceleration, jerk and offset a piece holds too little.
        most = refuted_above(pieces - c.columns.size)
        if math.isfinite(most):
            decided = np.isin(c.columns, (VISCOUS, COULOMB))
            least = np.where(decided, np.minimum(least, most * plain), least)
        noise[np.diag_indices_from(noise)] = np.maximum(plain, least)
        share = np.full(c.columns.size, SYSTEMATIC)
        share[[INERTIA, JERK]] = STIFF, LATE
        coherent = np.diag(share**2 * square * np.diag(c.inverse))
        scale = self.scale[c.columns]
        return (noise + moved @ moved.T + rounded @ rounded.T + coherent) / np.outer(scale, scale)
