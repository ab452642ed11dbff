"""What gross sliding says of an axis: a mixture over every reason to doubt it.

The posterior is a mixture over which alternatives are present, over the velocity and form of friction's fall and over
several starts of the search (Hoeting et al. 1999); the interval of a number is the mixture's. Its covariances are never
below those of scores summed by stroke or by state (Liang and Zeger 1986).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from stickslip.identification.alternatives.alternative import Alternative
from stickslip.identification.posterior import FALL_FORM, SPLIT, Family, Posterior, log_sum
from stickslip.identification.rows import SlidingRows, sample_rows, sliding_rows
from stickslip.identification.search import Asked, Fit, settle
from stickslip.identify.experiment import Experiment, insist_on_motion
from stickslip.identify.fit.student import student_quantile
from stickslip.machines.servo import ServoAxis

Array = np.ndarray[Any, np.dtype[np.float64]]

STARTS: tuple[tuple[float, tuple[int, ...]], ...] = ((0.0, ()), (0.0, (2,)), (-1.0, ()))
"""Rows of skew, and widths of the first fit, from which the search starts."""
REACH, MOST_SETS = 6.0, 40
"""Log evidence below the best within which a combination is in the mixture; and how many of them at most."""
FALL_REACH = 9.0
"""The same for friction's fall."""
NEGLIGIBLE = 1e-5
"""Of the largest weight: members below are left out."""
UNTHOUGHT = 1.2
"""Factor on every half-width, for what no alternative describes: the one number here that was chosen by coverage (155
simulated logs of the prototype)."""
QUANTILE = student_quantile(np.inf)
"""Standard deviations on either side of 95 % of a normal distribution."""
SPEEDS = 6
"""Speeds, from the slowest sliding to the fastest, at which the friction curve is handed on."""
PRESENT = 0.5
"""Probability from which on an alternative counts as there."""


@dataclass(frozen=True)
class Number:
    """A number with its 95 % interval."""

    value: float
    lower: float
    upper: float

    @property
    def interval(self) -> tuple[float, float]:
        """Its ends."""
        return self.lower, self.upper

    @property
    def half(self) -> float:
        """Half of the interval's length."""
        return 0.5 * (self.upper - self.lower)

    @property
    def std(self) -> float:
        """Standard deviation of a normal distribution with an interval as wide."""
        return self.half / QUANTILE


@dataclass(frozen=True, eq=False)
class Member:
    """One member of the mixture.

    Attributes
    ----------
    weight : float
    mean, std : array, shape (k,)
    covariance : array, shape (k, k)
    on : mapping of str to int
        Alternatives that are present, with their levels.
    vs, exponent : float
        Of friction's fall; not a number where there is none.
    """

    weight: float
    mean: Array
    std: Array
    covariance: Array
    on: Mapping[str, int]
    vs: float
    exponent: float


class Functionals(NamedTuple):
    """Numbers as combinations of coefficients: rows of shape (k, p), and (k, 2) for those of friction's fall."""

    names: tuple[str, ...]
    rows: Array
    fall: Array


@dataclass(frozen=True, eq=False)
class SlidingPosterior:
    """What gross sliding says.

    Attributes
    ----------
    names : tuple of str
        ``inertia``, ``fc``, ``sigma2``, ``offset``, ``skew`` (s by which the torque's column lies behind the torque that
        acted), ``fs`` (the curve's end at rest), ``drift`` (growth of friction's level from the first row to the last);
        of a pendulum ``gravity_sin``, ``gravity_cos``; by direction ``fc_positive`` and so on. Then the torque of
        steady motion forward and backward at `speeds`, ``forward[0]``, ..., ``backward[0]``, ...
    members : tuple of Member
    width : float
        Standard deviations, in those of the members, on either side of 95 % of one member.
    rows : SlidingRows
    fits : tuple of Fit
        Where the starts ended, the best first.
    spacing : float
        Half of the 95 % interval of log(vs) within one member.
    speeds : array, shape (m,)
        rad/s (m/s)
    beside : array, shape (n,)
        Torque that the likeliest alternatives add in the rows, N·m (N), but those of the friction curve.
    waves : tuple of (float, float)
        Wave number, rad⁻¹ (m⁻¹), and amplitude, N·m (N), of every torque found to repeat over the position.
    effects : mapping of str to array
        Coefficients of the likeliest alternatives, by their names.
    """

    names: tuple[str, ...]
    members: tuple[Member, ...]
    width: float
    rows: SlidingRows
    fits: tuple[Fit, ...]
    spacing: float
    speeds: Array
    beside: Array
    waves: tuple[tuple[float, float], ...]
    effects: Mapping[str, Array]

    @cached_property
    def weights(self) -> Array:
        """Weights of the members, shape (m,)."""
        return np.array([m.weight for m in self.members])

    @cached_property
    def numbers(self) -> dict[str, Number]:
        """Value and interval of every number, the velocity ``vs`` of friction's fall among them where one is likely."""
        mean, std = np.array([m.mean for m in self.members]), np.array([m.std for m in self.members])
        out = {
            n: Number(float(self.weights @ mean[:, k]), *quantiles(mean[:, k], self.width * std[:, k], self.weights))
            for k, n in enumerate(self.names)
        }  # fmt: skip
        falls = np.array([m.vs for m in self.members])
        has = np.isfinite(falls)
        if has.any():
            share, log = self.weights[has] / self.weights[has].sum(), np.log(falls[has])
            ends = np.exp(quantiles(log, np.full(log.size, self.spacing), share))
            out["vs"] = Number(float(np.exp(share @ log)), float(ends[0]), float(ends[1]))
        return out

    def interval(self, name: str) -> tuple[float, float]:
        """95 % interval of a number."""
        return self.numbers[name].interval

    @property
    def alternatives(self) -> dict[str, Alternative]:
        """Every alternative that was weighed, by its name."""
        return {a.name: a for f in self.fits for a in f.alternatives}

    @property
    def falls(self) -> float:
        """Probability that friction falls with velocity within the recorded speeds."""
        return float(sum(m.weight for m in self.members if np.isfinite(m.vs)))

    def presence(self, name: str) -> float:
        """Probability that an alternative is present."""
        return float(sum(m.weight for m in self.members if name in m.on))

    def explains(self, number: str) -> tuple[str, float]:
        """The alternative that widens a number most, and its part of the variance; "" where none does.

        Between members: by how much the variance falls where the alternative is absent.
        """
        k = self.names.index(number)
        mean, std = np.array([m.mean[k] for m in self.members]), np.array([m.std[k] for m in self.members])

        def variance(w: Array) -> float:
            w = w / w.sum()
            return float(w @ (std**2 + mean**2) - (w @ mean) ** 2)

        whole, best = variance(self.weights), ("", 0.0)
        for name in {n for m in self.members for n in m.on}:
            without = np.array([0.0 if name in m.on else m.weight for m in self.members])
            # Present in all members, it is part of the answer and not a doubt.
            share = 1.0 - variance(without) / whole if without.sum() > NEGLIGIBLE else 0.0
            best = max(best, (name, share), key=lambda x: x[1])
        return best

    @property
    def period(self) -> float:
        """From row to row, s."""
        return self.rows.period

    @property
    def slowest(self) -> float:
        """Speed that 1 % of the rows stay below, rad/s (m/s)."""
        return self.rows.slowest

    @property
    def fastest(self) -> float:
        """Highest speed of the rows, rad/s (m/s)."""
        return float(np.max(np.abs(self.rows.velocity)))

    @property
    def usual_speed(self) -> float:
        """Median speed of the rows, rad/s (m/s)."""
        return float(np.median(np.abs(self.rows.velocity)))

    @property
    def friction(self) -> float:
        """Level of friction that other torques are compared with, N·m (N): at the usual speed."""
        return max(self.numbers["fc"].value + max(self.numbers["sigma2"].value, 0.0) * self.usual_speed, 0.0)

    @cached_property
    def torque(self) -> Array:
        """Torque that acted in the rows, N·m (N), shape (n,)."""
        return self.rows.torque(self.numbers["skew"].value)

    def removable_torque(self, record: int) -> Array:
        """Torque over position and time that likely alternatives add at every sample of a record, N·m (N), shape (n,)."""
        fit = self.fits[0]
        rows = sample_rows(self.rows, self.rows.records[record])
        out = np.zeros(self.rows.records[record].time.size)
        for a, coefficients in zip(
            fit.alternatives, (self.effects[a.name] for a in fit.alternatives), strict=True
        ):
            if a.removable and self.presence(a.name) > PRESENT:
                out += fit.level.of(a.unit) * a.columns(rows) @ coefficients
        return out


def estimate_sliding(
    experiments: Sequence[Experiment], axis: ServoAxis, asked: Asked | None = None,
    starts: Sequence[tuple[float, tuple[int, ...]]] = STARTS,
) -> SlidingPosterior:  # fmt: skip
    """Estimate inertia, friction, constant torque and delay from gross sliding.

    Parameters
    ----------
    experiments : sequence of Experiment
        With the drive's signal. Fitted together.
    axis : ServoAxis
    asked : Asked, optional
        What is known.
    starts : sequence
        Rows of skew, and widths of the first fit, from which the search starts.

    Raises
    ------
    TooLittleSliding
        If no stroke is long enough.
    InputError
        If nothing moves.
    """
    insist_on_motion(experiments)
    asked = asked or Asked(pendulum=axis.gravity == "pendulum")
    if axis.motion == "linear" and asked.period is None:
        asked = replace(asked, period=np.inf)
    rows = sliding_rows(experiments, axis)
    fits = [settle(rows, asked, skew * rows.period, widths) for skew, widths in starts]
    return mixture(rows, fits, asked)


def mixture(rows: SlidingRows, fits: Sequence[Fit], asked: Asked) -> SlidingPosterior:
    """Every combination within reach of the best of each start, under the same weights."""
    weight = len(fits) / np.sum([1.0 / f.noise.weight for f in fits], axis=0)
    found = list[tuple[float, Fit, Posterior, Family, int]]()
    for f in fits:
        posterior = f.posterior(weight)
        sets = sorted(
            (x for x in f.looked if f.looked[x] > f.looked[f.on] - REACH), key=lambda x: -f.looked[x]
        )
        falls = np.flatnonzero(f.family.log_evidence > np.max(f.family.log_evidence) - FALL_REACH)
        for on in sets[:MOST_SETS]:
            family = posterior.family(on)
            found += [(float(family.log_evidence[p]), f, posterior, family, int(p)) for p in falls]
    evidence = np.array([x[0] for x in found])
    share = np.exp(evidence - log_sum(evidence))
    kept = [(float(w), x) for w, x in zip(share, found, strict=True) if w > NEGLIGIBLE * share.max()]
    total = sum(w for w, _ in kept)
    _, (_, head, posterior, family, place) = max(kept, key=lambda k: k[0])
    speeds = np.geomspace(max(rows.slowest, 1e-3 * rows.fastest), rows.fastest, SPEEDS)
    factor = inflation(rows, head, posterior, family, place, weight, asked, speeds)
    members = tuple(_member(w / total, *x[1:], asked, factor, speeds) for w, x in kept)
    strokes = max(float(np.unique(rows.stroke).size) - 1.0, 2.0)
    falls = np.unique(head.falls.speed)
    spacing = QUANTILE * 0.6 * float(np.log(falls[1] / falls[0])) if falls.size > 1 else 1.0
    effects = {
        a.name: family.mean[place][b] for a, b in zip(posterior.alternatives, posterior.blocks, strict=True)
    }
    named = functionals(posterior, asked, speeds, np.nan, np.nan).names
    return SlidingPosterior(
        named, members, UNTHOUGHT * student_quantile(strokes), rows,
        (head, *(f for f in fits if f is not head)), spacing, speeds, _beside(posterior, family, place),
        _waves(posterior, family, place), effects,
    )  # fmt: skip


def _beside(posterior: Posterior, family: Family, place: int) -> Array:
    """Torque of all alternatives but those of the friction curve and of the delay, shape (n,)."""
    out = np.zeros(posterior.matrix.shape[0])
    for a, block in zip(posterior.alternatives, posterior.blocks, strict=True):
        if a.curve is None and a.unit != "skew":
            out += posterior.matrix[:, block] @ family.mean[place][block]
    return out


def _waves(posterior: Posterior, family: Family, place: int) -> tuple[tuple[float, float], ...]:
    """Wave numbers and amplitudes of the orders of cogging that are present."""
    out = list[tuple[float, float]]()
    for a, block, level in zip(posterior.alternatives, posterior.blocks, family.on, strict=True):
        if a.wave_number and level:
            out.append(
                (a.wave_number, posterior.level.friction * float(np.hypot(*family.mean[place][block])))
            )
    return tuple(out)


def functionals(posterior: Posterior, asked: Asked, speeds: Array, vs: float, exponent: float) -> Functionals:
    """The numbers as combinations of a member's coefficients; `vs` is not a number where friction does not fall."""
    core, level = posterior.core.names, posterior.level
    blocks = {a.name: b for a, b in zip(posterior.alternatives, posterior.blocks, strict=True)}
    unit = np.eye(posterior.count)
    of = {n: unit[k].copy() for k, n in enumerate(core) if n != "uneven"}
    of["skew"][blocks["late torque"][0]] = level.skew
    of["fs"] = of["fc"].copy()
    of["fs"][blocks["another curve"][-1]] = level.friction
    drift = blocks["drift"]
    of["drift"] = 2.0 * level.friction * (unit[drift[3]] + unit[drift[5]])
    fall = {"fs": 1.0}
    uneven = unit[core.index("uneven")] if asked.by_direction else np.zeros(posterior.count)
    if asked.by_direction:
        for way, sign in (("positive", 1.0), ("negative", -1.0)):
            of[f"fc_{way}"] = of["fc"] + sign * of["offset"]
            of[f"sigma2_{way}"] = of["sigma2"] + sign * uneven
    curve = np.tile(of["fc"], (speeds.size, 1)) + speeds[:, None] * of["sigma2"]
    for a, block in zip(posterior.alternatives, posterior.blocks, strict=True):
        if a.curve is not None:
            curve[:, block] += level.of(a.unit) * a.curve(speeds, posterior.rows)
    left = np.exp(-((speeds / vs) ** exponent)) if np.isfinite(vs) else np.zeros(speeds.size)
    for way, sign in (("forward", 1.0), ("backward", -1.0)):
        for i, v in enumerate(speeds):
            of[f"{way}[{i}]"] = sign * curve[i] + of["offset"] + v * uneven
            fall[f"{way}[{i}]"] = sign * float(left[i])
    falls = np.array([[fall.get(n, 0.0), 0.0] for n in of]) if np.isfinite(vs) else np.zeros((len(of), 2))
    return Functionals(tuple(of), np.array(list(of.values())), falls)


def _fall_of(posterior: Posterior, place: int) -> tuple[float, float]:
    """Velocity and exponent of a member's fall; not numbers where there is none."""
    falls = posterior.falls
    return (float(falls.speed[place - 1]), float(falls.exponent[place - 1])) if place else (np.nan, np.nan)


def _member(
    weight: float,
    fit: Fit,
    posterior: Posterior,
    family: Family,
    place: int,
    asked: Asked,
    factor: Array,
    speeds: Array,
) -> Member:
    vs, exponent = _fall_of(posterior, place)
    f = functionals(posterior, asked, speeds, vs, exponent)
    mean, covariance = family.of_numbers(place, f.rows, f.fall)
    mean[f.names.index("skew")] += fit.skew
    covariance = covariance * np.outer(factor, factor)
    more = np.zeros(mean.size)
    steady = np.array(
        [1.0 if n.startswith("forward") else -1.0 if n.startswith("backward") else 0.0 for n in f.names]
    )
    for a, block in zip(posterior.alternatives, posterior.blocks, strict=True):
        if a.splits:
            split = SPLIT * (posterior.level.of(a.unit) * family.mean[place][block[0]]) ** 2
            more[f.names.index(a.splits)] += split
            if a.splits == "fc":
                covariance = covariance + split * np.outer(steady, steady)
    if place:
        more[f.names.index("fs")] += (FALL_FORM * family.fall[place][0]) ** 2
    for name in asked.known:
        if name in f.names:
            more[f.names.index(name)] = 0.0
    covariance = covariance + np.diag(more)
    on = {a.name: k for a, k in zip(posterior.alternatives, family.on, strict=True) if k}
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return Member(weight, mean, std, covariance, on, vs, exponent)


def inflation(
    rows: SlidingRows, fit: Fit, posterior: Posterior, family: Family, place: int, weight: Array, asked: Asked,
    speeds: Array,
) -> Array:  # fmt: skip
    """By how much standard deviations from scores summed by stroke, or by state, exceed the posterior's, shape (k,)."""
    columns, covariance = posterior.matrix, family.base
    f = functionals(posterior, asked, speeds, *_fall_of(posterior, place))
    combined = f.rows
    if place:
        columns = np.hstack([columns, posterior.fall_matrix[:, 2 * place - 2 : 2 * place]])
        combined = np.hstack([f.rows, f.fall])
        g, c = family.gain[place], family.spread[place]
        covariance = np.block([[family.base + g @ c @ g.T, -g @ c], [-c @ g.T, c]])
    residual = fit.torque - posterior.predicted(family, place)
    own = combined @ covariance
    plain = np.sqrt(np.maximum(np.einsum("kp,kp->k", own, combined), 1e-300))
    score = (columns * (weight * residual)[:, None]) @ own.T
    state = np.digitize(rows.velocity / rows.largest[0], STATE_SPEEDS) * 8
    state = state + np.digitize(rows.acceleration / rows.largest[1], STATE_ACCELERATIONS) + 64 * rows.block
    factor = np.ones(len(f.names))
    for cluster in (rows.stroke, state):
        groups = np.unique(cluster, return_inverse=True)[1]
        count = int(groups.max()) + 1
        sums = np.zeros((count, score.shape[1]))
        np.add.at(sums, groups, score)
        factor = np.fmax(factor, np.sqrt(np.sum(sums**2, axis=0) * count / max(count - 1, 1)) / plain)
    return factor


STATE_SPEEDS, STATE_ACCELERATIONS = np.linspace(-0.9, 0.9, 7), np.linspace(-0.7, 0.7, 7)
"""Borders of the states whose scores are summed, in parts of the largest."""


def quantiles(mean: Array, std: Array, weight: Array, part: float = 0.025) -> tuple[float, float]:
    """Ends of the central interval of a mixture of normal distributions of 95 % half-widths `std`, by bisection.

    Parameters
    ----------
    mean, std, weight : array, shape (m,)
        `std` in units in which 95 % lie within it.
    """
    from scipy.special import ndtr

    std = np.maximum(std, 1e-12 * float(np.max(np.abs(mean))) + 1e-300) / QUANTILE
    out: list[float] = []
    for goal in (part, 1.0 - part):
        low, high = float(np.min(mean - 8.0 * std)), float(np.max(mean + 8.0 * std))
        for _ in range(60):
            middle = 0.5 * (low + high)
            if float(weight @ ndtr((middle - mean) / std)) < goal:
                low = middle
            else:
                high = middle
        out.append(0.5 * (low + high))
    return out[0], out[1]
