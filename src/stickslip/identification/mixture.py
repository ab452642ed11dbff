"""The mixture over the combinations that the searches found, with widths that scores summed by cluster correct."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.identification.alternatives.disturbance import DISTURBANCE, closed_loop_bias
from stickslip.identification.posterior import FALL_FORM, SPLIT, Family, Posterior, log_sum
from stickslip.identification.rows import SlidingRows
from stickslip.identification.search import Asked, Fit

Array = np.ndarray[Any, np.dtype[np.float64]]

REACH, MOST_SETS = 6.0, 40
"""Log evidence below the best within which a combination enters the mixture; and the greatest number of them."""
FALL_REACH = 9.0
"""Log evidence below the best within which a fall of friction enters the mixture."""
NEGLIGIBLE = 1e-5
"""Part of the largest weight below which members are left out."""
SPEEDS = 6
"""Number of speeds, from the slowest sliding to the fastest, at which the friction curve is passed on."""
STATES = np.linspace(-0.8, 0.8, 7)
"""Borders of speed and acceleration, relative to their largest, between states whose scores are summed."""


@dataclass(frozen=True, eq=False)
class Member:
    """One member of the mixture.

    Attributes
    ----------
    weight : float
    mean, std : array, shape (k,)
    covariance : array, shape (k, k)
    on : frozenset of str
        Alternatives that are present.
    vs, exponent : float
        Parameters of friction's fall; NaN if there is none.
    """

    weight: float
    mean: Array
    std: Array
    covariance: Array
    on: frozenset[str]
    vs: float
    exponent: float


@dataclass(frozen=True, eq=False)
class Readout:
    """The numbers as linear combinations of a posterior's coefficients.

    Attributes
    ----------
    names : tuple of str
    rows : array, shape (k, p)
        Combinations of all coefficients except those of friction's fall.
    way, speed : array, shape (k,)
        Of a steady torque: 1 forward, -1 backward, 0 for other numbers; and its speed. Of friction at rest: 1 and 0.
    """

    names: tuple[str, ...]
    rows: Array
    way: Array
    speed: Array

    @staticmethod
    def of(posterior: Posterior, asked: Asked, speeds: Array) -> Readout:
        """Return the readout of one posterior; steady torques at some speeds are among its numbers."""
        core, level = posterior.core.names, posterior.level
        blocks = {a.name: b for a, b in zip(posterior.alternatives, posterior.blocks, strict=True)}
        unit = np.eye(posterior.count)
        of = {n: unit[k].copy() for k, n in enumerate(core) if n != "uneven"}
        if "late torque" in blocks:
            of["skew"][blocks["late torque"][0]] = level.skew
        drift = blocks["drift"]
        of["drift"] = 2.0 * level.friction * (unit[drift[3]] + unit[drift[5]])
        of["elasticity"] = level.inertia * posterior.rows.period**2 / 12.0 * unit[blocks["elasticity"][0]]
        uneven = unit[core.index("uneven")] if asked.by_direction else np.zeros(posterior.count)
        usual = np.array([float(np.median(np.abs(posterior.rows.velocity)))])
        for a, block in zip(posterior.alternatives, posterior.blocks, strict=True):
            if a.even is not None and not asked.by_direction:
                of["offset"][block] += level.of(a.unit) * a.even(usual, posterior.rows)[0]
        if asked.by_direction:
            for way, sign in (("positive", 1.0), ("negative", -1.0)):
                of[f"fc_{way}"] = of["fc"] + sign * of["offset"]
                of[f"sigma2_{way}"] = of["sigma2"] + sign * uneven
        ways, at = dict.fromkeys(of, 0.0), dict.fromkeys(of, 0.0)
        of["fs"], ways["fs"], at["fs"] = of["fc"].copy(), 1.0, 0.0
        of["fs"][blocks["another curve"][-1]] = level.friction
        curve = np.tile(of["fc"], (speeds.size, 1)) + speeds[:, None] * of["sigma2"]
        for a, block in zip(posterior.alternatives, posterior.blocks, strict=True):
            if a.curve is not None:
                curve[:, block] += level.of(a.unit) * a.curve(speeds, posterior.rows)
        for way, sign in (("forward", 1.0), ("backward", -1.0)):
            for i, v in enumerate(speeds.tolist()):
                name = f"{way}[{i}]"
                of[name], ways[name], at[name] = sign * curve[i] + of["offset"] + v * uneven, sign, v
        return Readout(
            tuple(of),
            np.array([*of.values()]),
            np.array([ways[n] for n in of]),
            np.array([at[n] for n in of]),
        )

    def fall(self, vs: float, exponent: float) -> Array:
        """Return the combinations of the coefficients of friction's fall, shape (k, 2); 0 if there is none."""
        left = np.exp(-((self.speed / vs) ** exponent)) if np.isfinite(vs) else np.zeros(self.speed.size)
        return np.column_stack([self.way * left, np.zeros(left.size)])


@dataclass(frozen=True, eq=False)
class Mixture:
    """A mixture, its best start first.

    Attributes
    ----------
    names : tuple of str
    members : tuple of Member
    speeds : array, shape (m,)
        rad/s (m/s), of the steady torques.
    head : Fit
    posterior : Posterior
        Posterior of the likeliest member's start.
    family : Family
    place : int
        Index of the likeliest member in `family`.
    """

    names: tuple[str, ...]
    members: tuple[Member, ...]
    speeds: Array
    head: Fit
    posterior: Posterior
    family: Family
    place: int


def mix(rows: SlidingRows, fits: Sequence[Fit], asked: Asked) -> Mixture:
    """Mix the combinations within reach of the best of each start, under the mean of all their variances.

    Evidence under different weights is not comparable.
    """
    weight = len(fits) / np.sum([1.0 / f.noise.weight for f in fits], axis=0)
    speeds = np.geomspace(max(rows.slowest, 1e-3 * rows.fastest), rows.fastest, SPEEDS)
    found = list[tuple[Fit, Posterior, Readout, Family, Any]]()
    for f in fits:
        posterior = f.posterior(weight)
        readout = Readout.of(posterior, asked, speeds)
        looked = sorted(
            (x for x in f.looked if f.looked[x] > f.looked[f.on] - REACH), key=lambda x: -f.looked[x]
        )
        falls = np.flatnonzero(f.family.log_evidence > np.max(f.family.log_evidence) - FALL_REACH)
        found += [(f, posterior, readout, posterior.family(on), falls) for on in looked[:MOST_SETS]]
    total = log_sum(np.concatenate([family.log_evidence[falls] for *_, family, falls in found]))
    head, posterior, readout, family, falls = max(found, key=lambda x: float(np.max(x[3].log_evidence[x[4]])))
    place = int(falls[np.argmax(family.log_evidence[falls])])
    response = response_of(head, posterior, readout, family, place)
    factor = inflation(rows, response, weight)
    inertia = posterior.core.names.index("inertia")
    bias = closed_loop_bias(
        response.residual, response.gain[:, inertia], weight, float(family.mean[place][inertia])
    )
    least = np.log(NEGLIGIBLE) + float(family.log_evidence[place]) - total
    members = [
        m for f, p, r, fam, at in found for m in members_of(f, p, r, fam, at, total, least, asked, factor)
    ]
    if asked.levels is None or DISTURBANCE.name in asked.levels:
        members = [x for m in members for x in with_disturbance(m, bias)]
    whole = sum(m.weight for m in members)
    scaled = [replace(m, weight=m.weight / whole) for m in members]
    return Mixture(readout.names, tuple(scaled), speeds, head, posterior, family, place)


def with_disturbance(member: Member, bias: Array) -> tuple[Member, Member]:
    """Return a member without a disturbance and one with it, in which every part of the bias is equally likely."""
    covariance = member.covariance + np.outer(bias, bias) / 12.0
    disturbed = replace(
        member,
        weight=member.weight * DISTURBANCE.odds,
        mean=member.mean + 0.5 * bias,
        std=np.sqrt(np.maximum(np.diag(covariance), 0.0)),
        covariance=covariance,
        on=member.on | {DISTURBANCE.name},
    )
    return replace(member, weight=member.weight * (1.0 - DISTURBANCE.odds)), disturbed


def members_of(
    fit: Fit, posterior: Posterior, readout: Readout, family: Family, places: Any, total: float, least: float,
    asked: Asked, factor: Array,
) -> Iterator[Member]:  # fmt: skip
    """Yield the members of a family whose log weight is at least `least`."""
    names, scale = readout.names, np.outer(factor, factor)
    base = readout.rows @ family.base @ readout.rows.T
    on = frozenset(a.name for a, k in zip(posterior.alternatives, family.on, strict=True) if k)
    # The direction of friction at rest is 1 as well, but its fc already includes the split.
    steady = np.where(readout.speed > 0.0, readout.way, 0.0)
    known = [names.index(n) for n in asked.known if n in names]
    falls = posterior.falls
    for place in places.tolist():
        weight = float(family.log_evidence[place]) - total
        if weight < least:
            continue
        vs, exponent = (
            (float(falls.speed[place - 1]), float(falls.exponent[place - 1])) if place else (np.nan, np.nan)
        )
        fall = readout.fall(vs, exponent)
        mean = readout.rows @ family.mean[place] + fall @ family.fall[place]
        mean[names.index("skew")] += fit.skew
        w = readout.rows @ family.gain[place] - fall
        covariance = scale * (base + w @ family.spread[place] @ w.T)
        for a, block in zip(posterior.alternatives, posterior.blocks, strict=True):
            if a.splits:
                split = SPLIT * (posterior.level.of(a.unit) * family.mean[place][block[0]]) ** 2
                own = names.index(a.splits)
                covariance[own, own] += split
                covariance += split * np.outer(steady, steady) if a.splits == "fc" else 0.0
        rest = names.index("fs")
        covariance[rest, rest] += (FALL_FORM * family.fall[place][0]) ** 2
        covariance[known, :] = 0.0
        covariance[:, known] = 0.0
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        yield Member(float(np.exp(weight)), mean, std, covariance, on, vs, exponent)


class Response(NamedTuple):
    """Response of the likeliest member's numbers to its misfit.

    Attributes
    ----------
    residual : array, shape (n,)
        Torque that the member does not explain.
    columns : array, shape (n, p)
        Columns of its coefficients, those of the fall last.
    gain : array, shape (k, p)
        Change of the numbers with ``columns.T @ (weight * residual)``.
    std : array, shape (k,)
        Standard deviations of the numbers in the posterior.
    """

    residual: Array
    columns: Array
    gain: Array
    std: Array


def response_of(fit: Fit, posterior: Posterior, readout: Readout, family: Family, place: int) -> Response:
    """Return the response of a member's numbers to its misfit."""
    columns, covariance, combined = posterior.matrix, family.base, readout.rows
    if place:
        falls = posterior.falls
        fall = readout.fall(float(falls.speed[place - 1]), float(falls.exponent[place - 1]))
        columns = np.hstack([columns, posterior.fall_matrix[:, 2 * place - 2 : 2 * place]])
        combined = np.hstack([combined, fall])
        g, c = family.gain[place], family.spread[place]
        covariance = np.block([[family.base + g @ c @ g.T, -g @ c], [-c @ g.T, c]])
    gain = combined @ covariance
    std = np.sqrt(np.maximum(np.einsum("kp,kp->k", gain, combined), 1e-300))
    return Response(fit.torque - posterior.predicted(family, place), columns, gain, std)


def inflation(rows: SlidingRows, response: Response, weight: Array) -> Array:
    """Return the ratio of standard deviations from scores summed by stroke or state to the posterior's, shape (k,)."""
    score = (response.columns * (weight * response.residual)[:, None]) @ response.gain.T
    state = np.digitize(rows.velocity / rows.largest[0], STATES) * (STATES.size + 1)
    state = (state + np.digitize(rows.acceleration / rows.largest[1], STATES)) * len(rows.blocks) + rows.block
    factor = np.ones(response.std.size)
    for cluster in (rows.stroke, state):
        groups = np.unique(cluster, return_inverse=True)[1]
        count = int(groups.max()) + 1
        sums = np.zeros((count, score.shape[1]))
        np.add.at(sums, groups, score)
        spread = np.sqrt(np.sum(sums**2, axis=0) * count / max(count - 1, 1))
        factor = np.fmax(factor, spread / response.std)
    return factor
