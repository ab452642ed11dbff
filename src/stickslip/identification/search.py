"""The search for the supported model: weights, orders of cogging, levels of alternatives and the delay, in turn.

From a start (a delay, and the widths used by least absolute deviations) the weights of all rows, the levels of all
alternatives and the delay of the torque's column are improved in turn until they converge. Levels climb the evidence
one change at a time; every combination that was evaluated stays in the mixture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from stickslip.core.errors import InputError, UnknownName
from stickslip.identification.alternatives import usual_alternatives
from stickslip.identification.alternatives.alternative import Alternative
from stickslip.identification.alternatives.cogging import (
    candidates,
    find_orders,
    named_orders,
    order_of,
)
from stickslip.identification.alternatives.load import registry_for
from stickslip.identification.noise import Noise, noise_of
from stickslip.identification.posterior import (
    EXPONENTS,
    WIDE,
    Core,
    Falls,
    Family,
    Level,
    On,
    Posterior,
    falls_of,
    log_sum,
)
from stickslip.identification.rows import LATEST, SlidingRows
from stickslip.identification.strokes import SlidingRecord

Array = np.ndarray[Any, np.dtype[np.float64]]
Places = np.ndarray[Any, np.dtype[np.intp]]

ROUNDS = 8
"""Rounds of weights, levels and delay: on most records the last changes nothing significant."""
ORDER_ROUNDS = 3
"""First rounds, in which orders of cogging are searched."""
SLOWEST_FALL, FASTEST_FALL, COARSE, FINE = 10.0**-2.7, 2.0, 16, 21
"""Velocities of friction's fall, parts of the highest speed: least and greatest, and their number at first and
refined."""
STEPS = 12
NEAR, FAR = 5.0, 25.0
"""Log evidence within which members decide the next change, and beyond which a fall is dropped."""
WORTH = 0.1
"""Log evidence that a change of level must gain."""
DELAY_PRIOR = 0.6
"""Prior standard deviation of the torque's delay, rows: half a row for a held command or a mean."""
ROUNDING = 1e-9
"""Part of the highest speed per row below which an acceleration is rounding."""
FIRST_FALLS = (0.01, 0.03, 0.1)
"""Velocities of friction's fall in the first fit, parts of the highest speed."""
GRAVITY = ("gravity_sin", "gravity_cos")
GIVEN = 1e-4
"""Standard deviation of a stated delay, rows: a larger deviation is not a mere delay."""


class Start(NamedTuple):
    """Starting point of a search.

    Attributes
    ----------
    rows : float
        Delay, rows.
    widths : tuple of int
        Windows used by the first fit; all if empty.
    """

    rows: float = 0.0
    widths: tuple[int, ...] = ()


@dataclass(frozen=True)
class Asked:
    """Known values and choices for the estimate of sliding.

    Attributes
    ----------
    pendulum : bool
        Whether gravity varies with the position.
    by_direction : bool
        Whether viscous friction differs by direction; the constant torque is then half the difference of both levels.
    skew : float or None
        Delay of the torque's column relative to the torque that acted, s, if it is stated.
    known : mapping
        Known values of numbers, by name.
    exponents : tuple of float
        Exponents of friction's fall.
    period : float or None
        Period of a torque over the position, rad (m); None for a turn, or no period for a linear axis.
    """

    pendulum: bool = False
    by_direction: bool = False
    skew: float | None = None
    known: Mapping[str, float] = field(default_factory=dict[str, float])
    exponents: tuple[float, ...] = EXPONENTS
    period: float | None = None
    levels: Mapping[str, int] | None = None


@dataclass
class Fit:
    """End point of one start.

    Attributes
    ----------
    skew : float
        Delay, s.
    level : Level
    alternatives : list of Alternative
    columns : list of array
        Columns of the alternatives.
    core : Core
    torque : array, shape (n,)
        Torque at that delay.
    falls : Falls
    on : tuple of int
    looked : dict
        Log evidence of every combination of levels that was evaluated.
    family : Family
        Family of `on`.
    noise : Noise
    rows : SlidingRows
    """

    skew: float
    level: Level
    alternatives: list[Alternative]
    columns: list[Array]
    core: Core
    torque: Array
    falls: Falls
    on: On
    looked: dict[On, float]
    family: Family
    noise: Noise
    rows: SlidingRows

    def posterior(self, weight: Array) -> Posterior:
        """Return the posterior of its members under given weights."""
        return Posterior(
            self.core, self.torque, weight, self.alternatives, self.columns, self.falls, self.level, self.rows
        )


def settle(rows: SlidingRows, asked: Asked, start: Start) -> Fit:
    """Improve weights, orders, levels and delay in turn, from one start.

    Parameters
    ----------
    rows : SlidingRows
    asked : Asked
    start : Start
    """
    search = Search(rows, asked, start)
    for number in range(ROUNDS - 1):
        search.look()
        search.improve(number)
    return search.look()


class Search:
    """The state of one search, and the steps that improve it.

    Parameters
    ----------
    rows, asked, start
        As in `settle`.
    """

    def __init__(self, rows: SlidingRows, asked: Asked, start: Start) -> None:
        skew = start.rows * rows.period if asked.skew is None else asked.skew
        self.rows, self.asked, self.begin, self.skew = rows, asked, skew, skew
        self.torque = rows.torque(skew)
        around = gravity_columns(rows) if asked.pendulum else None
        plain, gravity, self.residual = first_fit(rows, self.torque, start.widths, around)
        self.size = float(np.std(self.torque)) or 1e-300
        # Constant velocities have no acceleration but rounding.
        least = ROUNDING * rows.fastest / rows.period
        self.pace = max(float(np.sqrt(np.mean(rows.acceleration**2))), least) or 1e-300
        inertia, friction = (
            max(float(plain[0]), 1e-3 * self.size / self.pace),
            max(float(plain[1]), 0.02 * self.size),
        )
        self.level = Level(inertia, friction, 0.0, rows.period)
        speeds: Array = rows.fastest * np.geomspace(SLOWEST_FALL, FASTEST_FALL, COARSE, dtype=np.float64)
        self.falls, self.near = falls_of(rows, speeds, asked.exponents), None
        self.alternatives, self.columns, self.rates = list[Alternative](), list[Array](), list[Array | None]()
        self.on: On = ()
        levels = asked.levels or {}
        usual = usual_alternatives(rows, asked.by_direction)
        # Stated values have no alternatives.
        usual = tuple(
            a
            for a in usual
            if a.splits not in asked.known and not (a.unit == "skew" and asked.skew is not None)
        )
        for alternative in (*usual, *registry_for(plain, gravity), *named_orders(levels)):
            self.add(alternative)
        self.on = place_levels(self.alternatives, levels)
        self.usual, self.numbers = len(self.alternatives), candidates(rows, asked.period).tolist()
        self.moving: Array | float = 0.0
        self.posterior: Posterior
        self.fit: Fit

    def laid_out(self) -> tuple[Posterior, Noise]:
        """Return the posterior and the weights at the present state."""
        noise = noise_of(self.rows, self.residual, self.level.inertia, self.level.friction)
        self.level = self.level._replace(noise=noise.accelerating)
        core = core_of(self.rows, self.asked, self.level, self.skew, self.moving, self.size, self.pace)
        posterior = Posterior(
            core,
            self.torque,
            noise.weight,
            self.alternatives,
            self.columns,
            self.falls,
            self.level,
            self.rows,
        )
        return posterior, noise

    def add(self, alternative: Alternative) -> None:
        """Add one more alternative, absent at first."""
        columns, rates = columns_of(self.rows, alternative)
        self.alternatives.append(alternative)
        self.columns.append(columns)
        self.rates.append(rates)
        self.on = (*self.on, 0)

    def look(self) -> Fit:
        """Update weights and levels at the present state."""
        self.posterior, noise = self.laid_out()
        core = self.posterior.core
        climbed = climb(self.posterior, self.on, self.near) if self.asked.levels is None else None
        self.on, looked, family = climbed or evaluate(self.posterior, self.on)
        self.fit = Fit(
            self.skew, self.level, [*self.alternatives], [*self.columns], core, self.torque, self.falls, self.on,
            looked, family, noise, self.rows,
        )  # fmt: skip
        return self.fit

    def improve(self, number: int) -> None:
        """Update orders of cogging, scales, delay and velocities of friction's fall after round `number`."""
        family = self.fit.family
        top = int(np.argmax(family.log_evidence))
        mean = family.mean[top]
        self.residual = self.torque - self.posterior.predicted(family, top)
        if number < ORDER_ROUNDS and self.asked.levels is None:
            self.add_orders(top)
        self.moving = self.model_rate(mean)
        self.level = self.level._replace(
            inertia=max(float(mean[0]), SHRINK * self.level.inertia),
            friction=max(float(mean[1]), SHRINK * self.level.friction),
        )
        self.skew = moved_skew(self.posterior, family, top, self.skew, self.rows)
        if number == ORDER_ROUNDS - 1:
            self.falls, self.near = finer(self.rows, self.posterior, family, self.asked), None
            if len(self.alternatives) > self.usual:
                # Alternatives that stood for cogging before its orders were known are weighed anew.
                self.on = tuple(int(k >= self.usual) for k in range(len(self.alternatives)))
                self.moving, self.skew = 0.0, self.begin
        elif number >= ORDER_ROUNDS:
            self.near = neighbours(family, self.falls)
        self.torque = self.rows.torque(self.skew)

    def add_orders(self, top: int) -> None:
        """Add the orders of cogging that show in addition to the plain model and the known orders."""
        beside = self.posterior.fixed_columns(top, range(self.usual, len(self.posterior.alternatives)))
        root, known = np.sqrt(self.fit.noise.weight), {a.name for a in self.alternatives}
        for number in find_orders(self.rows, root, self.torque, beside, self.level.friction, self.numbers):
            if (more := order_of(number)).name not in known:
                self.add(more)

    def model_rate(self, mean: Array) -> Array:
        """Return the time derivative of the modelled torque except the inertia's: a delayed torque shifts that too."""
        names = self.fit.core.names
        out = mean[names.index("sigma2")] * self.rows.acceleration
        if self.asked.pendulum:
            out = out + gravity_columns(self.rows.rates) @ mean[[names.index(n) for n in GRAVITY]]
        # Orders that were just added have no coefficients yet.
        for block, rate in zip(self.posterior.blocks, self.rates, strict=False):
            if rate is not None:
                out = out + self.level.friction * rate @ mean[block]
        return np.asarray(out, dtype=np.float64)


def columns_of(rows: SlidingRows, alternative: Alternative) -> tuple[Array, Array | None]:
    """Return an alternative's columns and, if a delay shifts them, their rates; cached for the next start."""
    kept: dict[str, tuple[Array, Array | None]] = rows.kept
    if alternative.name not in kept or alternative.of_model:
        rates = alternative.columns(rows.rates) if alternative.lags else None
        kept[alternative.name] = alternative.columns(rows), rates
    return kept[alternative.name]


SHRINK = 0.3
"""Least ratio of inertia or friction from round to round."""


def core_of(
    rows: SlidingRows,
    asked: Asked,
    level: Level,
    skew: float,
    moving: Array | float,
    size: float,
    pace: float,
) -> Core:
    """Return the plain model's columns at a skew; the remaining skew is one more coefficient.

    Parameters
    ----------
    rows, asked, level
    skew : float
        Skew of the torque's windows, s.
    moving : array, shape (n,)
        Time derivative of the modelled torque except the inertia's: a delayed torque shifts that too.
    size, pace : float
        Scales of the torque and of the acceleration.
    """
    ones = np.ones(rows.sign.size)
    delay = -rows.jerk * level.inertia - moving
    named: dict[str, tuple[Array, float]] = {
        "inertia": (rows.acceleration, WIDE * max(level.inertia, size / pace)),
        "fc": (rows.sign, WIDE * level.friction),
        "sigma2": (rows.velocity, WIDE * level.friction / rows.fastest),
        "offset": (ones, WIDE * level.friction),
        "skew": (delay, DELAY_PRIOR * rows.period),
    }
    if asked.by_direction:
        both = rows.see(lambda r: np.abs(r.velocity))[:, 0]
        named["uneven"] = (both, WIDE * level.friction / rows.fastest)
    if asked.pendulum:
        sine, cosine = gravity_columns(rows).T
        named |= {"gravity_sin": (sine, WIDE * size), "gravity_cos": (cosine, WIDE * size)}
    mean, std = np.zeros(len(named)), np.array([s for _, s in named.values()])
    for k, name in enumerate(named):
        if name in asked.known:
            mean[k], std[k] = asked.known[name], 1e-6 * std[k]
        elif name == "skew":
            mean[k] = -skew if asked.skew is None else asked.skew - skew
            std[k] = std[k] if asked.skew is None else GIVEN * rows.period
    return Core(tuple(named), np.column_stack([c for c, _ in named.values()]), mean, std)


def gravity_columns(rows: SlidingRows) -> Array:
    """Return sine and cosine of the position, shape (n, 2)."""

    def both(record: SlidingRecord) -> Array:
        angle = record.position + record.origin
        return np.column_stack([np.sin(angle), np.cos(angle)])

    return rows.see(both)


def first_fit(
    rows: SlidingRows, torque: Array, widths: Sequence[int], around: Array | None
) -> tuple[Array, tuple[float, float], Array]:
    """Fit a plain model with three falls of friction by least absolute deviations.

    Returns
    -------
    array, shape (4,)
        Inertia, fc, sigma2 and offset.
    tuple of float
        Sine and cosine of gravity, whose columns are `around`; 0 without these.
    array, shape (n,)
        Residual torque, N·m (N).
    """
    falls = falls_of(rows, np.array(FIRST_FALLS) * rows.fastest, EXPONENTS[:1]).alike
    beside = np.zeros((torque.size, 0)) if around is None else around
    x = np.column_stack([rows.acceleration, rows.sign, rows.velocity, np.ones(torque.size), beside, falls])
    use = np.ones(torque.size) if not widths else np.isin(rows.band + 1.0, widths) + 1e-3
    unit = np.ones(torque.size)
    theta: Array = np.zeros(x.shape[1])
    for _ in range(ROUNDS):
        scaled = x / unit[:, None]
        norms = np.sqrt(np.sum(scaled**2, axis=0)) + 1e-300
        z = scaled / norms
        solver: Any = np.linalg.solve
        theta = np.asarray(solver(z.T @ z + 1e-9 * np.eye(x.shape[1]), z.T @ (torque / unit)) / norms)
        left = np.abs(torque - x @ theta)
        unit = np.sqrt(left + 1e-3 * float(np.median(np.abs(torque))) + 1e-300) / use
    gravity = (0.0, 0.0) if around is None else (float(theta[4]), float(theta[5]))
    return theta[:4], gravity, torque - x @ theta


def climb(posterior: Posterior, on: On, near: Places | None) -> tuple[On, dict[On, float], Family]:
    """Change the level that raises the evidence most until none does; return every combination with its evidence.

    `near` are the members (0: no fall) that count; all if None.
    """
    looked: dict[On, float] = {}
    family = posterior.family(on)
    for _ in range(STEPS):
        counts = np.arange(family.log_evidence.size) if near is None else near
        evidence = family.log_evidence[counts]
        looked[on] = log_sum(evidence)
        places = counts[evidence > np.max(evidence) - NEAR]
        changed = posterior.changes(family, places)
        # Neighbours gain as much over this combination as they do for the evaluated members.
        beyond = looked[on] - log_sum(family.log_evidence[places])
        around = {(*on[:k], level, *on[k + 1 :]): beyond + log_sum(e) for (k, level), e in changed.items()}
        looked = {**around, **looked}
        new = max(around, key=lambda x: around[x])
        if around[new] <= looked[on] + WORTH:
            break
        on = new
        family = posterior.family(on)
    return on, looked, family


def place_levels(alternatives: Sequence[Alternative], levels: Mapping[str, int]) -> On:
    """Return the level of every alternative in their order, 0 for those that are not named.

    Raises
    ------
    InputError
        If no alternative has such a name, or it has no such level.
    """
    known = {a.name: a for a in alternatives}
    for name, level in levels.items():
        if name not in known:
            raise UnknownName("alternative", name, known)
        if not 0 <= level < len(known[name].levels):
            raise InputError(f"{name}: level {level}; it has 0 to {len(known[name].levels) - 1}")
    return tuple(levels.get(a.name, 0) for a in alternatives)


def evaluate(posterior: Posterior, on: On) -> tuple[On, dict[On, float], Family]:
    """Evaluate known levels in place of `climb`."""
    family = posterior.family(on)
    return on, {on: log_sum(family.log_evidence)}, family


def moved_skew(posterior: Posterior, family: Family, place: int, skew: float, rows: SlidingRows) -> float:
    """Return the skew after a Gauss-Newton step of at most one row, s."""
    step = float(family.mean[place][posterior.core.names.index("skew")])
    for a, block in zip(posterior.alternatives, posterior.blocks, strict=True):
        if a.unit == "skew":
            step += posterior.level.skew * float(family.mean[place][block[0]])
    most = LATEST * rows.period
    return float(np.clip(skew + np.clip(step, -rows.period, rows.period), -most, most))


def finer(rows: SlidingRows, posterior: Posterior, family: Family, asked: Asked) -> Falls:
    """Refine the velocities about those of friction's fall that count."""
    evidence, speeds = family.log_evidence, np.unique(posterior.falls.speed)
    good = np.flatnonzero(evidence[1:] > np.max(evidence) - 2.0 * NEAR)
    if not good.size:
        return posterior.falls
    place = np.searchsorted(speeds, posterior.falls.speed[good])
    low, high = speeds[max(place.min() - 2, 0)], speeds[min(place.max() + 2, speeds.size - 1)]
    return falls_of(rows, np.geomspace(low, high, FINE), asked.exponents)


def neighbours(family: Family, falls: Falls) -> Places:
    """Return the members that count, and those at adjacent velocities."""
    good = np.flatnonzero(family.log_evidence > np.max(family.log_evidence) - FAR)
    around = np.concatenate([good - 1, good, good + 1, [0]])
    return np.unique(np.clip(around, 0, falls.speed.size))
