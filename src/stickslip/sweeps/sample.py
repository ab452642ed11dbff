"""Which cases a sweep runs: a grid, low-discrepancy or Latin points, or draws from what an identification says.

Every block of cases is drawn anew from its number alone, so that no block waits for another and none is kept.
"""

from __future__ import annotations

import functools
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.identification.estimate import Estimate
from stickslip.identification.monte_carlo import spread_values

Array = np.ndarray[Any, np.dtype[np.float64]]
METHODS = ("grid", "sobol", "latin")
LEVEL = "level"
"""The share of every range that a case of a nested sweep is drawn from."""


@dataclass(frozen=True)
class Spread:
    """One number that varies.

    Attributes
    ----------
    name : str
        As in `stickslip.sweeps.numbers`.
    low, high : float
        What it runs over: factors on the study's own value, or values in SI units.
    factor : bool
    points : int
        On a grid.
    values : tuple of float
        Of a grid, if they are listed.
    logarithmic : bool
        Even steps of the logarithm.
    """

    name: str
    low: float
    high: float
    factor: bool = False
    points: int = 0
    values: tuple[float, ...] = ()
    logarithmic: bool = False

    def at(self, u: Array) -> Array:
        """The numbers at places 0 to 1 between low and high."""
        if self.logarithmic:
            return self.low * (self.high / self.low) ** u
        return self.low + u * (self.high - self.low)

    @property
    def grid(self) -> Array:
        """The numbers of a grid."""
        if self.values:
            return np.array(self.values)
        return self.at(np.linspace(0.0, 1.0, self.points) if self.points > 1 else np.array([0.5]))


@dataclass(frozen=True)
class Drawn:
    """The cases of a sweep.

    Attributes
    ----------
    method : str
        One of `METHODS`.
    spreads : tuple of Spread
    estimates, correlation
        Of a model's own parameters, drawn with their intervals besides the spreads.
    cases, seed : int
    nested : bool
        Each case first draws a level between 0 and 1, then every number within that part of its range, around the
        middle: as many cases of little uncertainty as of much.
    """

    method: str
    spreads: tuple[Spread, ...]
    cases: int
    seed: int
    estimates: tuple[Estimate, ...] = ()
    correlation: tuple[tuple[float, ...], ...] = ()
    nested: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """What varies, in order."""
        own = (*(s.name for s in self.spreads), *(number_of(e) for e in self.estimates))
        return (*own, LEVEL) if self.nested else own

    def block(self, start: int, stop: int) -> Array:
        """The numbers of cases start to stop - 1, shape (stop - start, names)."""
        if self.method == "grid":
            grids = [s.grid for s in self.spreads]
            places = np.unravel_index(np.arange(start, stop), [g.size for g in grids])
            return np.column_stack([g[i] for g, i in zip(grids, places)])
        n = len(self.spreads)
        u = self._unit(start, stop)
        if self.nested:
            u[:, :n] = 0.5 + u[:, -1:] * (u[:, :n] - 0.5)
        columns = [s.at(u[:, i]) for i, s in enumerate(self.spreads)]
        if self.estimates:
            from scipy.special import ndtri

            z = ndtri(np.clip(u[:, n : n + len(self.estimates)], 1e-12, 1.0 - 1e-12))
            columns += list(spread_values(self.estimates, np.array(self.correlation), z).T)
        return np.column_stack([*columns, u[:, -1]] if self.nested else columns)

    def _unit(self, start: int, stop: int) -> Array:
        dimensions = len(self.names)
        if self.method == "latin":
            return latin(dimensions, self.cases, self.seed)[start:stop].copy()
        from scipy.stats import qmc

        engine = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(self.seed))
        if start:
            engine.fast_forward(start)
        with warnings.catch_warnings():
            # Numbers of cases that are no power of 2 are the caller's choice.
            warnings.simplefilter("ignore", UserWarning)
            return engine.random(stop - start)


@functools.lru_cache(maxsize=2)
def latin(dimensions: int, cases: int, seed: int) -> Array:
    """A Latin hypercube, shape (cases, dimensions)."""
    from scipy.stats import qmc

    return qmc.LatinHypercube(dimensions, rng=np.random.default_rng(seed)).random(cases)


def number_of(e: Estimate) -> str:
    """The run's number that an estimate is of."""
    return "axis.inertia" if e.name == "inertia" else f"friction.{e.name}"


def widest(spreads: Sequence[Spread]) -> float:
    """The largest part of its middle by which a number varies."""
    middles = [0.5 * (s.low + s.high) for s in spreads]
    return max((abs(s.high - m) / abs(m) for s, m in zip(spreads, middles) if m), default=0.0)


def count_of(spreads: Sequence[Spread]) -> int:
    """Cases of a grid."""
    return math.prod(s.grid.size for s in spreads)
