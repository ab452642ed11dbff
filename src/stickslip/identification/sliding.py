"""Estimates from gross sliding: a mixture over alternative explanations of a record.

The posterior is a mixture over which alternatives are present, over the velocity and form of friction's fall and over
several starts of the search (Hoeting et al. 1999); the interval of a number is the mixture's. Its covariances are never
below those of scores summed by stroke or by state (Liang and Zeger 1986).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import name_option
from stickslip.core.rebinding import NEGATIVE
from stickslip.identification.alternatives.alternative import Alternative
from stickslip.identification.alternatives.disturbance import DISTURBANCE
from stickslip.identification.experiment import Experiment, insist_on_motion
from stickslip.identification.fit.student import student_quantile
from stickslip.identification.mixture import NEGLIGIBLE, Member, Mixture, mix
from stickslip.identification.posterior import EXPONENT_ODDS, EXPONENTS
from stickslip.identification.rows import LATEST, SlidingRows, sample_rows, sliding_rows
from stickslip.identification.search import Asked, Fit, Start, settle
from stickslip.machines.servo import ServoAxis

Array = np.ndarray[Any, np.dtype[np.float64]]

STARTS = (Start(), Start(widths=(2,)), Start(rows=-1.0))
"""Starts of the search, used in turn until one ends where another did."""
UNTHOUGHT = 1.2
"""Factor on every half-width, for effects that no alternative describes: the only factor here calibrated by coverage on
simulated logs."""
QUANTILE = student_quantile(np.inf)
"""Half-width of a 95 % interval of a normal distribution, standard deviations."""
CELL = 0.6
"""Standard deviation within one velocity of friction's fall, as a part of the step to the next."""
PRESENT = 0.5
"""Probability from which on an alternative counts as present."""


class LateTorque(InputError):
    """The torque's column is delayed too much for sliding to determine the delay."""


@dataclass(frozen=True)
class Number:
    """A number with its 95 % interval."""

    value: float
    lower: float
    upper: float

    @property
    def interval(self) -> tuple[float, float]:
        """The bounds of the interval."""
        return self.lower, self.upper

    @property
    def half(self) -> float:
        """Half of the interval's length."""
        return 0.5 * (self.upper - self.lower)

    @property
    def std(self) -> float:
        """Standard deviation of a normal distribution with an interval of the same width."""
        return self.half / QUANTILE


@dataclass(frozen=True, eq=False)
class SlidingPosterior:
    """Posterior of the parameters that gross sliding determines.

    Attributes
    ----------
    names : tuple of str
        ``inertia``, ``fc``, ``sigma2``, ``offset`` (at the usual speed, if friction differs by direction), ``skew`` (s
        by which the torque's column is delayed relative to the torque that acted), ``fs`` (the curve at rest),
        ``drift`` (growth of friction's level from the first row to the last), ``elasticity`` (torque per second
        derivative of the acceleration: -Jl²/k of a load Jl behind a spring k); of a pendulum ``gravity_sin``,
        ``gravity_cos``; by direction ``fc_positive`` and so on.
        Then the torque of steady motion forward and backward at `speeds`, ``forward[0]``, ..., ``backward[0]``, ...
    members : tuple of Member
    width : float
        Half-width of a member's 95 % interval, in its standard deviations.
    rows : SlidingRows
    fits : tuple of Fit
        End points of the starts, the best first.
    spacing : float
        Half-width of the 95 % interval of log(vs) within one member.
    speeds : array, shape (m,)
        rad/s (m/s)
    beside : array, shape (n,)
        Torque that the likeliest alternatives add in the rows, N·m (N), without those of the friction curve.
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
        """Value and interval of every number, with the velocity ``vs`` of friction's fall if one is likely."""
        mean, std = np.array([m.mean for m in self.members]), np.array([m.std for m in self.members])
        out = {
            n: Number(*quantiles(mean[:, k], self.width * std[:, k], self.weights))
            for k, n in enumerate(self.names)
        }
        falls = np.array([m.vs for m in self.members])
        has = np.isfinite(falls)
        if has.any():
            share, log = self.weights[has] / self.weights[has].sum(), np.log(falls[has])
            out["vs"] = Number(*np.exp(quantiles(log, np.full(log.size, self.spacing), share)).tolist())
        return out

    def interval(self, name: str) -> tuple[float, float]:
        """Return the 95 % interval of a number."""
        return self.numbers[name].interval

    @property
    def law_names(self) -> dict[str, str]:
        """Names of the level and slope of friction in this posterior, by their names in laws."""
        if "fc_negative" not in self.names:
            return {n: n for n in ("fc", "sigma2")}
        ways = (("", "positive"), (NEGATIVE, "negative"))
        return {f"{n}{law}": f"{n}_{own}" for n in ("fc", "sigma2") for law, own in ways}

    @property
    def alternatives(self) -> dict[str, Alternative]:
        """Every alternative that was considered, by its name."""
        return {a.name: a for a in (DISTURBANCE, *(a for f in self.fits for a in f.alternatives))}

    @property
    def falls(self) -> float:
        """Probability that friction falls with velocity within the recorded speeds."""
        return float(sum(m.weight for m in self.members if np.isfinite(m.vs)))

    @property
    def exponents(self) -> dict[float, float]:
        """Probability of every exponent of friction's fall, the likeliest first; the prior if nothing falls."""
        prior = dict(zip(EXPONENTS, EXPONENT_ODDS, strict=True))
        found = {e: float(sum(m.weight for m in self.members if m.exponent == e)) for e in prior}
        whole = sum(found.values())
        share = {e: p / whole for e, p in found.items() if p > 0.0} if whole else prior
        return dict(sorted(share.items(), key=lambda x: -x[1]))

    def given_exponent(self, exponent: float) -> SlidingPosterior:
        """Return the posterior given that friction falls with one exponent or does not fall."""
        members = [m for m in self.members if m.exponent == exponent or np.isnan(m.exponent)]
        whole = sum(m.weight for m in members)
        if not whole:
            return self
        return replace(self, members=tuple(replace(m, weight=m.weight / whole) for m in members))

    def presence(self, name: str) -> float:
        """Return the probability that an alternative is present."""
        return float(sum(m.weight for m in self.members if name in m.on))

    @property
    def stiffness_bound(self) -> float:
        """Least stiffness of a train to a load of half the inertia, N·m/rad (N/m), that the record allows."""
        least = min(self.numbers["elasticity"].lower, -1e-300)
        return (0.5 * self.numbers["inertia"].value) ** 2 / -least

    @property
    def compliance(self) -> str:
        """The likeliest alternative in which motor and load do not move as one; "" if none is likely."""
        likely = [n for n, a in self.alternatives.items() if a.compliant and self.presence(n) > PRESENT]
        return max(likely, key=self.presence, default="")

    def explains(self, number: str) -> tuple[str, float]:
        """Return the alternative that widens a number most, and its part of the variance; "" if none does.

        The part is the relative decrease of the variance without the members that contain the alternative.
        """
        k = self.names.index(number)
        mean, std = np.array([m.mean[k] for m in self.members]), np.array([m.std[k] for m in self.members])

        def variance(w: Array) -> float:
            w = w / w.sum()
            return float(w @ (std**2 + mean**2) - (w @ mean) ** 2)

        whole, best = variance(self.weights), ("", 0.0)
        for name in {n for m in self.members for n in m.on}:
            without = np.array([0.0 if name in m.on else m.weight for m in self.members])
            # Present in all members, it is part of the answer and adds no uncertainty.
            share = 1.0 - variance(without) / whole if without.sum() > NEGLIGIBLE else 0.0
            best = max(best, (name, share), key=lambda x: x[1])
        return best

    @property
    def period(self) -> float:
        """Sample period, s."""
        return self.rows.period

    @property
    def slowest(self) -> float:
        """Speed that 99 % of the rows exceed, rad/s (m/s)."""
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
        """Level of friction at the usual speed, N·m (N), to which other torques are compared."""
        return max(self.numbers["fc"].value + max(self.numbers["sigma2"].value, 0.0) * self.usual_speed, 0.0)

    @cached_property
    def torque(self) -> Array:
        """Torque that acted in the rows, N·m (N), shape (n,)."""
        return self.rows.torque(self.numbers["skew"].value)

    def removable_torque(self, record: int) -> Array:
        """Return the torque of likely alternatives over position and time at every sample of a record, N·m (N)."""
        fit = self.fits[0]
        rows = sample_rows(self.rows, self.rows.sources[record])
        out = np.zeros(self.rows.sources[record].time.size)
        for a, coefficients in zip(
            fit.alternatives, (self.effects[a.name] for a in fit.alternatives), strict=True
        ):
            if a.removable and self.presence(a.name) > PRESENT:
                out += fit.level.of(a.unit) * a.columns(rows) @ coefficients
        return out


def estimate_sliding(
    experiments: Sequence[Experiment], axis: ServoAxis, asked: Asked | None = None,
    starts: Sequence[Start] = STARTS,
) -> SlidingPosterior:  # fmt: skip
    """Estimate inertia, friction, constant torque and delay from gross sliding.

    Parameters
    ----------
    experiments : sequence of Experiment
        With the drive's signal. Fitted together.
    axis : ServoAxis
    asked : Asked, optional
        Known values.
    starts : sequence
        Starts of the search, used in turn until one ends where another did.

    Raises
    ------
    TooLittleSliding
        If no stroke is long enough.
    LateTorque
        If the torque's column is delayed by too many rows.
    InputError
        If nothing moves.
    """
    insist_on_motion(experiments)
    asked = asked or Asked(pendulum=axis.gravity == "pendulum")
    if axis.motion == "linear" and asked.period is None:
        asked = replace(asked, period=np.inf)
    rows = sliding_rows(experiments, axis)
    fits = list[Fit]()
    for start in starts:
        fit = settle(rows, asked, start)
        if any(same_place(fit, f) for f in fits):
            break
        fits.append(fit)
    found = posterior_of(rows, fits, mix(rows, fits, asked))
    if asked.skew is None and abs(found.fits[0].skew) >= (LATEST - 1) * rows.period:
        side = "after" if found.fits[0].skew < 0.0 else "before"
        raise LateTorque(
            f"the torque acted {LATEST - 1} rows or more {side} its row; log torque and motion by one clock, or state "
            f"the delay ({name_option('delay')})"
        )
    return found


def same_place(one: Fit, other: Fit) -> bool:
    """Return whether two starts ended with the same alternatives and, to a thousandth of a row, the same delay."""
    return one.on == other.on and abs(one.skew - other.skew) < 1e-3 * one.level.skew


def posterior_of(rows: SlidingRows, fits: Sequence[Fit], found: Mixture) -> SlidingPosterior:
    """Return the mixture with its likeliest member's coefficients of every alternative."""
    mean, alternatives = found.family.mean[found.place], found.posterior.alternatives
    effects = {a.name: mean[b] for a, b in zip(alternatives, found.posterior.blocks, strict=True)}
    beside, waves = np.zeros(rows.sign.size), list[tuple[float, float]]()
    for a, block, level in zip(alternatives, found.posterior.blocks, found.family.on, strict=True):
        if a.curve is None and a.unit != "skew":
            beside += found.posterior.matrix[:, block] @ mean[block]
        if a.wave_number and level:
            waves.append((a.wave_number, found.posterior.level.friction * float(np.hypot(*mean[block]))))
    strokes = max(float(np.unique(rows.stroke).size) - 1.0, 2.0)
    falls = np.unique(found.head.falls.speed)
    spacing = QUANTILE * CELL * float(np.log(falls[1] / falls[0])) if falls.size > 1 else 1.0
    return SlidingPosterior(
        found.names, found.members, UNTHOUGHT * student_quantile(strokes), rows,
        (found.head, *(f for f in fits if f is not found.head)), spacing, found.speeds, beside, tuple(waves), effects,
    )  # fmt: skip


def quantiles(mean: Array, std: Array, weight: Array) -> tuple[float, float, float]:
    """Return median and bounds of the central 95 % interval of a mixture of normal distributions, by bisection.

    Parameters
    ----------
    mean, std, weight : array, shape (m,)
        `std` in units within which 95 % are contained.
    """
    from scipy.special import ndtr

    std = np.maximum(std, 1e-12 * float(np.max(np.abs(mean))) + 1e-300) / QUANTILE
    out: list[float] = []
    for goal in (0.5, 0.025, 0.975):
        low, high = float(np.min(mean - 8.0 * std)), float(np.max(mean + 8.0 * std))
        for _ in range(60):
            middle = 0.5 * (low + high)
            if float(weight @ ndtr((middle - mean) / std)) < goal:
                low = middle
            else:
                high = middle
        out.append(0.5 * (low + high))
    return out[0], out[1], out[2]
