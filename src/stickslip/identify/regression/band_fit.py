"""What certain sliding says in one band of frequencies: linear least squares, averaged over what is not known.

T = J dv/dt + sigma2 v + (Fc + A exp(-|v/vs|^d)) sign(v) + T0 (+ gravity, + cogging): linear but for vs, the exponent d
and the skew between the columns of torque and motion. vs and d (1 or 2: Tustin's and the Gaussian form) are averaged
over (Bayesian model averaging, ``hoeting1999``): a level that the record does not reach is then as uncertain as it
should be. The skew is the one at which the jerk explains nothing more.

The columns, and what no law holds among them, are those of `stickslip.identify.regression.band_system`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.identify.regression.band_system import (
    COULOMB,
    INERTIA,
    JERK,
    OFFSET,
    VISCOUS,
    Candidate,
    System,
)
from stickslip.identify.regression.bent import bent_in, explains, swing_explains
from stickslip.identify.regression.drifting import drift_rows
from stickslip.identify.regression.flexible import MAY_GIVE, Swing, Train, flexible_columns
from stickslip.identify.regression.number import QUANTILE, Number
from stickslip.identify.regression.sliding_rows import Fall, SlidingRows
from stickslip.identify.regression.strokes import memory_of

Array = np.ndarray[Any, np.dtype[np.float64]]

CORE = 5
EACH_WAY = ("fc_positive", "fc_negative", "sigma2_positive", "sigma2_negative")
ROUNDS = 12
SETTLED = 1e-6  # s: the skew's change at which its search ends
FARTHEST, STRIDE = 40.0, 4.0  # times the skew's usual size: as far as it is looked for, and in a step
SHOWN = 0.03  # of Fc: a fall of friction that is one
FORM = 0.003  # of Fc: misfit that is assumed at least
TENSION, FAR = (
    2.0,
    6.0,
)  # standard deviations: viscous friction below 0 at most; above 0, where the bound does nothing
MEMORY = 3.0  # rows over which it is correlated at least
MOVES = 0.35  # of a torque over the position, by which it moves what accelerates where its orders are not told apart


@dataclass(frozen=True, eq=False)
class BandFit:
    """One band's result.

    Attributes
    ----------
    corner : float
        Of the window, Hz.
    numbers : dict of str to Number
        ``inertia``, ``sigma2``, ``fc``, ``offset``, ``skew`` (s by which the torque's column lies behind), ``fs`` (the
        curve's end at rest), ``gravity_sin``, ``gravity_cos``; of friction each way ``uneven`` (half of what sigma2 is
        greater by for v > 0) and the levels and slopes of `EACH_WAY`; where friction may drift, those of
        `stickslip.identify.regression.drifting.DRIFTS`.
    falls : float
        Probability that friction falls by more than `SHOWN` of Fc.
    probability : array, shape (m,)
        Of no fall of friction (the first), and of every one tried.
    tried : tuple of Fall
        Those, one fewer.
    harmonics : array, shape (k, 2)
        Cosine and sine of every order taken in, N·m (N).
    correlation : array, shape (p, p)
        Of inertia, sigma2, fc, offset, gravity's two, those of `EACH_WAY` and a drift's, in the most probable
        candidate.
    misfit : float
        RMS of what is left, N·m (N).
    relative : float
        The same over the RMS of the torque.
    rows, pieces : int
    swing : Swing
        What the second derivatives of acceleration, and where a load swings of torque, say.
    bend : float
        Part of Fc by which friction rises with velocity in another form (`stickslip.identify.regression.bent`).
    swing_bends : bool
        Whether a load that swings may be what bends the torque so.
    flexible : float
        Part of the misfit that a train which gives or swings would leave at least; 1 where it does already.
    """

    corner: float
    numbers: dict[str, Number]
    falls: float
    probability: Array
    tried: tuple[Fall, ...]
    harmonics: Array
    correlation: Array
    misfit: float
    relative: float
    rows: int
    pieces: int
    swing: Swing
    bend: float
    swing_bends: bool
    flexible: float

    @property
    def may_give(self) -> bool:
        """Whether a load behind a spring may be what bends the torque."""
        return self.swing.acceleration != 0.0 or self.flexible <= MAY_GIVE


def fit_band(
    records: Sequence[SlidingRows], tried: Sequence[Fall], *, orders: Sequence[float] = (),
    background: Sequence[float] = (), pendulum: bool = False, skew_size: float = 3e-3, skew: float | None = None,
    start: float = 0.0, blurred: bool = False, each_way: bool = False, drifting: bool = False,
    train: Train = Train.RIGID, known: Mapping[str, float] | None = None,
) -> BandFit:  # fmt: skip
    """Fit the rows of certain sliding that one window shows.

    Parameters
    ----------
    records : sequence of SlidingRows
        Fitted together, each with a column of `falling` for every fall of friction.
    tried : sequence of Fall
        Those.
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
    each_way : bool
        Whether friction has a level and a slope of its own in each direction.
    drifting : bool
        Whether level and slope of friction may change evenly with time.
    train : Train
        What moves.
    known : mapping of str to float, optional
        Values that are not fitted, of `stickslip.identify.regression.band_system.COLUMNS`.
    """
    system = System(records, tried, orders, background, pendulum, skew_size, each_way, drifting, train, known)
    waves = (len(orders), len(background)) if blurred and orders else None
    system.expected = start if skew is None else skew
    at, torque, candidates, weight = settled(system, skew is not None, waves)
    named = combinations(system.core, pendulum, each_way)
    if drifting:
        named |= drift_rows(records, system.core, CORE + 2 * pendulum + each_way)
    out = summed_up(system, torque, candidates, weight, at, tried, len(orders), named)
    if waves is None:
        return out
    most_likely = candidates[int(np.argmax(weight))]
    return replace(out, numbers=out.numbers | {"inertia": beside_waves(out, system, torque, most_likely)})


class Settled(NamedTuple):
    """The skew at which the jerk explains nothing more, s, the torque that acted, the candidates and their weights."""

    skew: float
    torque: Array
    candidates: list[Candidate]
    weight: Array


def settled(system: System, known: bool, waves: tuple[int, int] | None) -> Settled:
    """The search for the skew from where it is expected, for noise and its memory: by turns until nothing moves.

    Parameters
    ----------
    system : System
    known : bool
        Whether the skew is, so that it stays.
    waves : tuple of int, optional
        Orders and background of a torque over the position whose orders the way is too short to distinguish.
    """
    size, at = system.skew_size, system.expected
    torque = system.torque(at)
    candidates, weight = system.candidates(torque, at), np.zeros(0)
    for turn in range(ROUNDS):
        best = min(candidates, key=lambda c: c.cost)
        residual = system.residual(torque, best)
        freedom = max(1, residual.size - best.columns.size - system.small.size)
        system.noise = float(residual @ residual) / freedom + (FORM * system.fc) ** 2
        system.memory = max(memory_of(residual, system.stroke), MEMORY)
        weight = system.weights(candidates)
        if waves is not None:
            system.beside(best, *waves)
        inertia, jerk = (
            sum(w * c.values[i] for w, c in zip(weight, candidates, strict=True)) / system.scale[i]
            for i in (INERTIA, JERK)
        )
        step = float(np.clip(-jerk / inertia, -STRIDE * size, STRIDE * size)) if inertia > 0.0 else 0.0
        if known or turn == ROUNDS - 1 or (turn > 1 and abs(step) < SETTLED):
            break
        farthest = FARTHEST * size
        at = float(np.clip(at + step, system.expected - farthest, system.expected + farthest))
        torque = system.torque(at)
        candidates = system.candidates(torque, at)
    return Settled(at, torque, candidates, weight)


def beside_waves(found: BandFit, system: System, torque: Array, candidate: Candidate) -> Number:
    """The inertia where a torque over the position was found whose orders the way is too short to tell apart.

    The loop answers that torque, so that it accelerates the axis in step with what the motor gives: what of it goes to
    a wrong order passes for inertia.
    """
    waves = slice(system.core - 2 * len(found.harmonics), system.core)
    around = system.residual(torque, candidate) + system.columns[:, waves] @ candidate.values[waves]
    inertia, size = found.numbers["inertia"], float(np.linalg.norm(around)) / system.scale[INERTIA]
    return Number(inertia.value, math.hypot(inertia.std, MOVES * size))


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


def combinations(core: int, pendulum: bool, each_way: bool) -> dict[str, Array]:
    """Every number as a combination of the columns' coefficients, shape (core,) each."""
    unit = np.eye(core)
    named = {"inertia": unit[INERTIA], "sigma2": unit[VISCOUS], "fc": unit[COULOMB], "offset": unit[OFFSET]}
    if pendulum:
        named |= {"gravity_sin": unit[CORE], "gravity_cos": unit[CORE + 1]}
    if each_way:
        uneven = unit[CORE + 2 * pendulum]
        # A constant torque is half of what friction's level is greater by for v > 0.
        ways = (unit[COULOMB] + unit[OFFSET], unit[COULOMB] - unit[OFFSET],
                unit[VISCOUS] + uneven, unit[VISCOUS] - uneven)  # fmt: skip
        named |= {"uneven": uneven, **dict(zip(EACH_WAY, ways, strict=True))}
    return named


def combined(row: Array) -> Callable[[Array, Array], tuple[float, float]]:
    """A combination of values and its variance."""
    n = row.size
    return lambda v, s: (float(row @ v[:n]), float(row @ s[:n, :n] @ row))


def summed_up(
    system: System, torque: Array, candidates: Sequence[Candidate], weight: Array, skew: float,
    tried: Sequence[Fall], orders: int, named: Mapping[str, Array],
) -> BandFit:  # fmt: skip
    """Means over the candidates, their spread among the variances."""
    kept = [(w, c) for w, c in zip(weight, candidates, strict=True) if w > 1e-4]
    total = sum(w for w, _ in kept)
    spread = system.covariances(torque, [c for _, c in kept])
    braking = [
        brakes(c.values / system.scale[c.columns], s) for (_, c), s in zip(kept, spread, strict=True)
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

    def late(v: Array, s: Array) -> tuple[float, float]:
        return skew - v[JERK] / v[INERTIA], s[JERK, JERK] / v[INERTIA] ** 2

    def at_rest(v: Array, s: Array) -> tuple[float, float]:
        if v.size == core:
            return v[COULOMB], s[COULOMB, COULOMB]
        return v[COULOMB] + v[core], s[COULOMB, COULOMB] + s[core, core] + 2.0 * s[COULOMB, core]

    numbers = {name: mean(combined(row)) for name, row in named.items()}
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
    bend, bent = bent_in(system, candidates, weight)
    flexible = left_flexible(system, torque, best)
    swing_bends = bent is not None and swing_explains(system, bent, best, flexible)
    if bent is not None and explains(system, bent, best):
        # What friction rises by passes for inertia where the axis accelerates at speed: that of either form may be it.
        own, other = numbers["inertia"], float(bent.values[INERTIA] / system.scale[INERTIA])
        numbers["inertia"] = Number(other, math.hypot(own.std, (other - own.value) / QUANTILE))
    rows = np.array(list(named.values()))
    joint = rows @ system.covariance(torque, best)[:core, :core] @ rows.T
    # Of a motion that tells two columns hardly apart, rounding leaves a variance below 0: related to nothing then.
    each = np.sqrt(np.where(np.diag(joint) > 0.0, np.diag(joint), np.inf))
    correlation = joint / np.outer(each, each)
    np.fill_diagonal(correlation, 1.0)
    return BandFit(
        system.records[0].window.corner, numbers, float(falls / total), weight,
        tuple(tried[k] for k in system.levels), harmonics, correlation, misfit,
        misfit / max(float(np.sqrt(np.mean(torque**2))), 1e-300), torque.size, int(system.piece[-1]) + 1,
        system.swing_of(best), bend, swing_bends, flexible,
    )  # fmt: skip


def left_flexible(system: System, torque: Array, best: Candidate) -> float:
    """Part of a rigid axis's misfit that a train which gives or swings would leave at least."""
    if system.train is not Train.RIGID:
        return 1.0
    columns, _ = flexible_columns(system.records, system.inertia, Train.SWINGS)
    return math.sqrt(max(system.left_beside(torque, best, columns), 0.0))
