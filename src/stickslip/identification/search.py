"""The search for what the record supports: weights, orders of cogging, levels of alternatives and the delay, in turn.

From a start (a delay, and the widths that least absolute deviations look at) the weights of all rows, the levels of all
alternatives and the delay of the torque's column are improved in turn until they stay. Levels climb the evidence one
change at a time; every combination that was looked at stays in the mixture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from stickslip.identification.alternatives import usual_alternatives
from stickslip.identification.alternatives.alternative import Alternative
from stickslip.identification.alternatives.cogging import candidates, find_orders, order_of
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

Array = np.ndarray[Any, np.dtype[np.float64]]

ROUNDS = 8
"""Of weights, levels and delay in turn: the last changes nothing that could be seen on most records."""
ORDER_ROUNDS = 3
"""First rounds in which orders of cogging are looked for."""
SLOWEST_FALL, FASTEST_FALL, COARSE, FINE = 10.0**-2.7, 2.0, 16, 21
"""Parts of the highest speed between which friction may fall, and how many of them, at first and finer."""
STEPS = 12
NEAR, FAR = 5.0, 25.0
"""Log evidence within which members tell the next change, and beyond which a fall is looked at no more."""
WORTH = 0.1
"""Log evidence that a change of level must gain."""
DELAY_PRIOR = 0.6
"""Rows by which a torque column usually lies off (one standard deviation): half a row for a command held, or a mean."""
GIVEN = 0.05
"""Rows to which a stated delay is known."""


@dataclass(frozen=True)
class Asked:
    """What is known of an axis before its record is looked at.

    Attributes
    ----------
    pendulum : bool
        Whether gravity turns with the position.
    by_direction : bool
        Whether viscous friction is another one in each direction; the constant torque is then half the difference of
        both levels.
    skew : float or None
        s by which the torque's column lies behind the torque that acted, where it is stated.
    known : mapping
        Values of numbers that are known, by name.
    exponents : tuple of float
        Of friction's fall.
    period : float or None
        rad (m) after which a torque over the position repeats; where None a turn, or no period of a linear axis.
    """

    pendulum: bool = False
    by_direction: bool = False
    skew: float | None = None
    known: Mapping[str, float] = field(default_factory=dict[str, float])
    exponents: tuple[float, ...] = EXPONENTS
    period: float | None = None


@dataclass
class Fit:
    """Where one start ended.

    Attributes
    ----------
    skew : float
        s
    level : Level
    alternatives : list of Alternative
    columns : list of array
        Theirs.
    core : Core
    torque : array, shape (n,)
        At that skew.
    falls : Falls
    on : tuple of int
    looked : dict
        Log evidence of every combination of levels that was looked at.
    family : Family
        That of `on`.
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
        """Its members under some weights."""
        return Posterior(
            self.core, self.torque, weight, self.alternatives, self.columns, self.falls, self.level, self.rows
        )


def settle(rows: SlidingRows, asked: Asked, skew: float, widths: Sequence[int] = ()) -> Fit:
    """Improve weights, orders, levels and delay in turn, from one start.

    Parameters
    ----------
    rows : SlidingRows
    asked : Asked
    skew : float
        s at which the search starts.
    widths : sequence of int
        Widths that the first fit looks at; all where empty.
    """
    begin = asked.skew if asked.skew is not None else skew
    skew = begin
    torque = rows.torque(skew)
    start, residual = first_fit(rows, torque, widths)
    size = float(np.std(torque)) or 1e-300
    pace = float(np.sqrt(np.mean(rows.acceleration**2))) or 1e-300
    level = Level(max(start[0], 1e-3 * size / pace), max(start[1], 0.02 * size), 0.0, rows.period)
    falls = falls_of(rows, rows.fastest * np.geomspace(SLOWEST_FALL, FASTEST_FALL, COARSE), asked.exponents)
    alternatives = [*usual_alternatives(rows), *registry_for(start[:4], (0.0, 0.0))]
    columns = [a.columns(rows) for a in alternatives]
    rates = [a.columns(rows.rates) if a.lags else None for a in alternatives]
    usual, numbers = len(alternatives), candidates(rows, asked.period)
    on: On = (0,) * usual
    moving: Array | float = 0.0
    near: Array | None = None
    for number in range(ROUNDS):
        noise = noise_of(rows, residual, level.inertia, level.friction)
        level = level._replace(noise=noise.accelerating)
        core = core_of(rows, asked, level, skew, moving, size, pace)
        posterior = Posterior(core, torque, noise.weight, alternatives, columns, falls, level, rows)
        on, looked, family = climb(posterior, on, near)
        top = int(np.argmax(family.log_evidence))
        if number == ROUNDS - 1:
            break
        residual = torque - posterior.predicted(family, top)
        if number < ORDER_ROUNDS:
            beside = posterior.fixed_columns(top, range(usual, len(alternatives)))
            known = {a.name for a in alternatives}
            root = np.sqrt(noise.weight)
            for order in find_orders(rows, root, torque, beside, level.friction, numbers.tolist()):
                if (more := order_of(order)).name not in known:
                    alternatives.append(more)
                    columns.append(more.columns(rows))
                    rates.append(more.columns(rows.rates))
                    on = (*on, 0)
        moving = family.mean[top][2] * rows.acceleration
        for block, rate in zip(posterior.blocks, rates, strict=False):
            if rate is not None:
                moving = moving + level.friction * rate @ family.mean[top][block]
        level = level._replace(
            inertia=max(float(family.mean[top][0]), SHRINK * level.inertia),
            friction=max(float(family.mean[top][1]), SHRINK * level.friction),
        )
        skew = moved_skew(posterior, family, top, skew, rows)
        if number == ORDER_ROUNDS - 1:
            if len(alternatives) > usual:
                # What stood for cogging before its orders were known is to be weighed anew beside them.
                on, moving = tuple(int(k >= usual) for k in range(len(alternatives))), 0.0
                skew = begin
            falls, near = finer(rows, posterior, family, asked)
        elif number >= ORDER_ROUNDS:
            near = neighbours(family, falls)
        torque = rows.torque(skew)
    return Fit(skew, level, alternatives, columns, core, torque, falls, on, looked, family, noise, rows)


SHRINK = 0.3
"""Part of its size that inertia or friction may fall to from round to round."""


def core_of(
    rows: SlidingRows,
    asked: Asked,
    level: Level,
    skew: float,
    moving: Array | float,
    size: float,
    pace: float,
) -> Core:
    """The plain model's columns about a skew: what is left of it is one more coefficient.

    Parameters
    ----------
    rows, asked, level
    skew : float
        s of the torque's windows.
    moving : array, shape (n,)
        Time derivative of what the model says beside the inertia's torque: a late torque shifts that too.
    size, pace : float
        Of the torque and of the acceleration.
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
        for name, wave in (("gravity_sin", np.sin), ("gravity_cos", np.cos)):
            named[name] = (rows.see(lambda r, w=wave: w(r.position + r.origin))[:, 0], WIDE * size)
    mean, std = np.zeros(len(named)), np.array([s for _, s in named.values()])
    for k, name in enumerate(named):
        if name in asked.known:
            mean[k], std[k] = asked.known[name], 1e-6 * std[k]
        elif name == "skew":
            mean[k] = -skew if asked.skew is None else asked.skew - skew
            std[k] = std[k] if asked.skew is None else GIVEN * rows.period
    return Core(tuple(named), np.column_stack([c for c, _ in named.values()]), mean, std)


def first_fit(rows: SlidingRows, torque: Array, widths: Sequence[int]) -> tuple[Array, Array]:
    """Inertia, fc, sigma2, offset and three falls by least absolute deviations; and what they leave, N·m (N)."""
    falls = falls_of(rows, np.array([0.01, 0.03, 0.1]) * rows.fastest, EXPONENTS[:1]).alike
    x = np.column_stack([rows.acceleration, rows.sign, rows.velocity, np.ones(torque.size), falls])
    use = np.ones(torque.size) if not widths else np.isin(rows.band + 1.0, widths) + 1e-3
    unit, theta = np.ones(torque.size), np.zeros(x.shape[1])
    for _ in range(ROUNDS):
        scaled = x / unit[:, None]
        norms = np.sqrt(np.sum(scaled**2, axis=0)) + 1e-300
        z = scaled / norms
        theta = np.linalg.solve(z.T @ z + 1e-9 * np.eye(x.shape[1]), z.T @ (torque / unit)) / norms
        left = np.abs(torque - x @ theta)
        unit = np.sqrt(left + 1e-3 * float(np.median(np.abs(torque))) + 1e-300) / use
    return theta, torque - x @ theta


def climb(posterior: Posterior, on: On, near: Array | None) -> tuple[On, dict[On, float], Family]:
    """Change the level that raises the evidence most until none does; every combination seen, with its evidence.

    `near` are the members (0: no fall) that count; all where None.
    """
    looked: dict[On, float] = {}
    family = posterior.family(on)
    for _ in range(STEPS):
        evidence = family.log_evidence if near is None else family.log_evidence[near]
        looked[on] = log_sum(evidence)
        top = float(np.max(evidence))
        places = np.flatnonzero(evidence > top - NEAR)
        places = places if near is None else near[places]
        each = [posterior.changes(family, int(p)) for p in places]
        # Neighbours are worth as much more than this combination as they are for the members looked at.
        mine = log_sum(family.log_evidence[places])
        around = {
            (*on[:k], level, *on[k + 1 :]): looked[on] - mine + log_sum(np.array([e.get((k, level), -np.inf) for e in each]))
            for k, level in each[0]
        }  # fmt: skip
        looked = {**around, **looked}
        new = max(around, key=lambda x: around[x])
        if around[new] <= looked[on] + WORTH:
            break
        on = new
        family = posterior.family(on)
    return on, looked, family


def moved_skew(posterior: Posterior, family: Family, place: int, skew: float, rows: SlidingRows) -> float:
    """The skew a Gauss-Newton step further, s; a row at most."""
    late = next(k for k, a in enumerate(posterior.alternatives) if a.name == "late torque")
    step = float(family.mean[place][posterior.core.names.index("skew")])
    step += posterior.level.skew * float(family.mean[place][posterior.blocks[late][0]])
    most = (LATEST - 4) * rows.period
    return float(np.clip(skew + np.clip(step, -rows.period, rows.period), -most, most))


def finer(
    rows: SlidingRows, posterior: Posterior, family: Family, asked: Asked
) -> tuple[Falls, Array | None]:
    """Finer velocities about those of friction's fall that count."""
    evidence, speeds = family.log_evidence, np.unique(posterior.falls.speed)
    good = np.flatnonzero(evidence[1:] > np.max(evidence) - 2.0 * NEAR)
    if not good.size:
        return posterior.falls, None
    place = np.searchsorted(speeds, posterior.falls.speed[good])
    low, high = speeds[max(place.min() - 2, 0)], speeds[min(place.max() + 2, speeds.size - 1)]
    return falls_of(rows, np.geomspace(low, high, FINE), asked.exponents), None


def neighbours(family: Family, falls: Falls) -> Array:
    """Members that count, and those of the next velocities."""
    good = np.flatnonzero(family.log_evidence > np.max(family.log_evidence) - FAR)
    around = np.concatenate([good - 1, good, good + 1, [0]])
    return np.unique(np.clip(around, 0, falls.speed.size))
