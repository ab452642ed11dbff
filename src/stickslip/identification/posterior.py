"""Gaussian posteriors of every combination of alternatives and falls of friction, from one Gram matrix.

A member of the mixture is one choice of levels of all alternatives, and of the velocity and exponent of friction's
fall. Its evidence, mean and covariance follow from the normal equations (Bayesian linear regression; Bishop 2006, 3.3).
The evidence at another level of one alternative follows from the member's own posterior (Savage-Dickey ratio).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from stickslip.identification.alternatives.alternative import Alternative
from stickslip.identification.rows import SlidingRows
from stickslip.identification.strokes import SlidingRecord

Array = np.ndarray[Any, np.dtype[np.float64]]
On = tuple[int, ...]
"""Level of every alternative."""

EXPONENTS = (2.0, 1.0)
"""Exponents of friction's fall with velocity: Gaussian (Armstrong-Hélouvry 1991) and exponential (Tustin 1947)."""
EXPONENT_ODDS = (0.8, 0.2)
NO_FALL = 0.2
"""Prior probability of no fall within the recorded speeds."""
BEYOND, BEYOND_ODDS = 0.5, 0.02
"""Part of the highest speed above which a fall resembles viscous friction, and the prior odds of a fall there."""
FALL, ASYMMETRY = 0.3, 0.01
"""Mean and standard deviation of the fall's prior, part of Fc; standard deviation of its difference by direction."""
FALL_FORM = 0.03
"""Relative standard deviation of the fall at rest: real friction follows no form exactly."""
WIDE = 10.0
"""Prior standard deviations of the plain model's numbers, relative to their size."""
SPLIT = 0.3
"""Variance between two values of a number, as a part of their squared difference, for a value drawn between them."""


class Level(NamedTuple):
    """Scales of the coefficients: inertia, Fc, misfit at the greatest acceleration, skew of one row."""

    inertia: float
    friction: float
    noise: float
    skew: float

    def of(self, unit: str) -> float:
        """Return the scale of an alternative's unit."""
        return {"inertia": self.inertia, "friction": self.friction, "noise": self.noise, "torque": 1.0}[unit]


@dataclass(frozen=True, eq=False)
class Core:
    """The plain model's columns with their priors.

    Attributes
    ----------
    names : tuple of str
    columns : array, shape (n, k)
    mean, std : array, shape (k,)
    """

    names: tuple[str, ...]
    columns: Array
    mean: Array
    std: Array


@dataclass(frozen=True, eq=False)
class Falls:
    """Columns of friction's fall for several velocities and exponents.

    Attributes
    ----------
    speed, exponent : array, shape (f,)
    alike, unlike : array, shape (n, f)
        The fall in the direction of motion, and its part that differs by direction.
    log_odds : array, shape (f,)
    """

    speed: Array
    exponent: Array
    alike: Array
    unlike: Array
    log_odds: Array


def falls_of(rows: SlidingRows, speeds: Array, exponents: Sequence[float] = EXPONENTS) -> Falls:
    """Return the columns of friction's fall at some velocities, with every exponent."""
    speed, exponent = np.tile(speeds, len(exponents)), np.repeat(np.array(exponents), speeds.size)

    def left(r: SlidingRecord, fall: int) -> Array:
        return np.exp(-((np.abs(r.velocity) / speed[fall]) ** exponent[fall]))

    unlike = np.column_stack([rows.see(lambda r, fall=k: left(r, fall))[:, 0] for k in range(speed.size)])
    share = np.array([w for e, w in zip(EXPONENTS, EXPONENT_ODDS, strict=True) if e in exponents] or [1.0])
    odds = np.repeat(share, speeds.size) if share.size == len(exponents) else np.ones(speed.size)
    odds = odds * np.where(speed > BEYOND * rows.fastest, BEYOND_ODDS, 1.0)
    return Falls(
        speed, exponent, unlike * rows.sign[:, None], unlike, np.log((1.0 - NO_FALL) * odds / odds.sum())
    )


@dataclass(frozen=True, eq=False)
class Family:
    """Members with the same levels of their alternatives: without a fall of friction, then with each fall.

    Attributes
    ----------
    on : tuple of int
    log_evidence : array, shape (1 + f,)
    mean : array, shape (1 + f, p)
        Means of the coefficients, without those of the fall.
    fall : array, shape (1 + f, 2)
        Means of the fall's coefficients.
    base : array, shape (p, p)
        Covariance without a fall.
    gain : array, shape (1 + f, p, 2)
    spread : array, shape (1 + f, 2, 2)
        Covariance of the fall's coefficients C; that of the others is ``base + gain C gain'``.
    """

    on: On
    log_evidence: Array
    mean: Array
    fall: Array
    base: Array
    gain: Array
    spread: Array


class Posterior:
    """All members for one linearisation, one set of weights and one list of alternatives."""

    def __init__(
        self, core: Core, torque: Array, weight: Array, alternatives: Sequence[Alternative],
        columns: Sequence[Array], falls: Falls, level: Level, rows: SlidingRows,
    ) -> None:  # fmt: skip
        self.rows = rows
        self.core, self.alternatives, self.falls, self.level = core, tuple(alternatives), falls, level
        blocks, scaled, place = list[Any](), list[Array](), len(core.names)
        skew = core.names.index("skew")
        for a, c in zip(self.alternatives, columns, strict=True):
            own = core.columns[:, skew : skew + 1] * level.skew if a.unit == "skew" else c * level.of(a.unit)
            scaled.append(own)
            blocks.append(np.arange(place, place + own.shape[1]))
            place += own.shape[1]
        self.blocks, self.count = blocks, place
        self.stds = [
            [a.std(k, b.size) for k in range(len(a.levels))]
            for a, b in zip(self.alternatives, blocks, strict=True)
        ]
        self.matrix = np.hstack([core.columns, *scaled])
        self.fall_matrix = np.stack([falls.alike, falls.unlike], axis=2).reshape(torque.size, -1)
        root = np.sqrt(weight)
        x, f, y = self.matrix * root[:, None], self.fall_matrix * root[:, None], torque * root
        self.gram, self.cross = x.T @ x, x.T @ f
        self.right, self.fall_right, self.power = x.T @ y, f.T @ y, float(y @ y)
        pairs = f.reshape(torque.size, -1, 2)
        self.fall_gram = np.einsum("nfi,nfj->fij", pairs, pairs, optimize=True)
        self.fall_mean = np.array([FALL * level.friction, 0.0])
        self.fall_std = np.array([FALL * level.friction, ASYMMETRY * level.friction])

    def family(self, on: On) -> Family:
        """Compute evidence, mean and covariance of the members at some levels."""
        mean, std = (
            np.zeros(self.count),
            np.concatenate([self.core.std, *(s[k] for s, k in zip(self.stds, on, strict=True))]),
        )
        mean[: self.core.mean.size] = self.core.mean
        odds = sum(a.log_odds(k) for a, k in zip(self.alternatives, on, strict=True))
        scaled = self.gram * np.outer(std, std)
        scaled[np.diag_indices_from(scaled)] += 1.0
        inverse, log_det = _inverse(scaled)
        told = self.gram @ mean
        z = (self.right - told) * std
        x = inverse @ z
        none = self.power + float((told - 2.0 * self.right) @ mean)
        plain = -0.5 * (none - float(z @ x)) - 0.5 * log_det + odds + np.log(NO_FALL)
        # The falls, two columns each, by their Schur complements.
        n = self.falls.speed.size
        s, m = self.fall_std, self.fall_mean
        beside = (self.cross * std[:, None]).reshape(self.count, n, 2)
        w = np.einsum("pq,qk->pk", inverse, (beside * s).reshape(self.count, -1), optimize=True).reshape(
            self.count, n, 2
        )
        schur = (
            self.fall_gram * np.outer(s, s)
            + np.eye(2)
            - np.einsum("pfi,pfj->fij", beside * s, w, optimize=True)
        )
        invert: Any = np.linalg.inv
        spread: Array = invert(schur)
        z_base = z[:, None] - beside @ m
        right = self.fall_right.reshape(n, 2)
        z_fall = (right - (mean @ self.cross).reshape(n, 2) - self.fall_gram @ m) * s
        x_base = inverse @ z_base
        x_fall = np.einsum("fij,fj->fi", spread, z_fall - np.einsum("pfi,pf->fi", w, z_base))
        x_base = x_base - np.einsum("pfi,fi->pf", w, x_fall)
        moved = (
            2.0 * (mean @ self.cross).reshape(n, 2) @ m
            + np.einsum("i,fij,j->f", m, self.fall_gram, m)
            - 2.0 * right @ m
        )
        misfit = none + moved - np.einsum("pf,pf->f", z_base, x_base) - np.sum(z_fall * x_fall, axis=1)
        # Rounding of linearly dependent columns is no evidence.
        sign, log_fall = np.linalg.slogdet(schur)
        log_fall = np.where(sign > 0.0, log_fall, np.inf)
        fallen = -0.5 * misfit - 0.5 * (log_det + log_fall) + odds + self.falls.log_odds
        fallen = np.where(np.isfinite(fallen), fallen, -np.inf)
        zero = np.zeros((1, 2))
        return Family(
            on, np.append(plain, fallen),
            mean + np.vstack([x * std, (x_base * std[:, None]).T]),
            np.vstack([zero, m + x_fall * s]),
            inverse * np.outer(std, std),
            np.concatenate([np.zeros((1, self.count, 2)), (w * std[:, None, None] / s).transpose(1, 0, 2)]),
            np.concatenate([np.zeros((1, 2, 2)), spread * np.outer(s, s)]),
        )  # fmt: skip

    def changes(self, family: Family, places: Any) -> dict[tuple[int, int], Array]:
        """Return the log evidence of some members with each alternative at each other level, shape (members,) each.

        It follows from the members' own posterior of the coefficients, without solving for another member.
        """
        out: dict[tuple[int, int], Array] = {}
        for k, (a, block) in enumerate(zip(self.alternatives, self.blocks, strict=True)):
            now, mean, gain = (
                self.stds[k][family.on[k]],
                family.mean[places][:, block],
                family.gain[places][:, block],
            )
            spread = family.base[np.ix_(block, block)] + gain @ family.spread[places] @ gain.transpose(
                0, 2, 1
            )
            # In standard deviations of the present level, each eigenvalue is at most 1.
            sizes, ways = np.linalg.eigh(spread / np.outer(now, now)) if a.shape is None else (None, None)
            for level in range(len(a.levels)):
                if level == family.on[k]:
                    continue
                then = self.stds[k][level]
                if sizes is not None and ways is not None:
                    change = float((now[0] / then[0]) ** 2) - 1.0
                    along = np.einsum("mij,mi->mj", ways, mean / now)
                    grown = np.maximum(1.0 + change * sizes, 1e-12)
                    log_det = np.sum(np.log(grown), axis=1)
                    square = change * np.sum(along**2 / grown, axis=1)
                else:
                    more = then**-2 - now**-2
                    b = np.eye(block.size) + spread * more
                    log_det = np.linalg.slogdet(b)[1]
                    square = np.einsum("mi,mi->m", more * mean, np.linalg.solve(b, mean[:, :, None])[:, :, 0])
                odds = a.log_odds(level) - a.log_odds(family.on[k]) + float(np.sum(np.log(now / then)))
                out[k, level] = family.log_evidence[places] - 0.5 * log_det - 0.5 * square + odds
        return out

    def predicted(self, family: Family, place: int) -> Array:
        """Return the torque that a member explains, shape (n,)."""
        told = self.matrix @ family.mean[place]
        return (
            told if place == 0 else told + self.fall_matrix[:, 2 * place - 2 : 2 * place] @ family.fall[place]
        )

    def fixed_columns(self, place: int, blocks: Sequence[int]) -> Array:
        """Return the columns of the plain model, some alternatives and a member's fall, shape (n, k)."""
        own = [self.matrix[:, : len(self.core.names)], *(self.matrix[:, self.blocks[k]] for k in blocks)]
        if place:
            own.append(self.fall_matrix[:, 2 * place - 2 : 2 * place])
        return np.hstack(own)


def _inverse(a: Array) -> tuple[Array, float]:
    """Return the inverse and the log determinant of a positive definite matrix."""
    from scipy.linalg import lapack

    solver: Any = lapack
    factor, failed = solver.dpotrf(a, lower=1)
    if failed:
        raise np.linalg.LinAlgError("not positive definite")
    log_det = 2.0 * float(np.sum(np.log(np.diag(factor))))
    half: Array = solver.dpotri(factor, lower=1)[0]
    return np.asarray(np.tril(half) + np.tril(half, -1).T), log_det


def log_sum(x: Array) -> float:
    """Return the logarithm of a sum of exponentials."""
    top = float(np.max(x))
    return top + float(np.log(np.sum(np.exp(x - top))))
