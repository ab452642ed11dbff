"""Settings of a controller chosen for a machine that is not quite what was believed.

The cases of a sweep stand for what is uncertain. A setting is as good as a percentile of the sweep's first metric over
them; differential evolution looks for the best one within its ranges. Every setting tried is kept: with the second
metric, they show what the first one costs.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.studies.planned_run import PlannedRun
from stickslip.sweeps.measured import measured
from stickslip.sweeps.numbers import belongs, own_name, value_of
from stickslip.sweeps.plan import Sweep
from stickslip.sweeps.ranges import admitted
from stickslip.sweeps.sample import Spread

Array = np.ndarray[Any, np.dtype[np.float64]]
POPULATION, GENERATIONS = 6, 12
MOST_CASES = 4096
AT_END = 0.01
"""Part of a range from whose end on a setting counts as at it: the search comes no nearer to a bound."""
FAILED = 1e30
"""What counts for a setting with which more cases fail than the percentile leaves out."""


@dataclass(frozen=True)
class Tuned:
    """What a search found for one run.

    Attributes
    ----------
    run : PlannedRun
    names : tuple of str
        The numbers chosen.
    before, after : array, shape (names,)
        As the study has them (NaN where it has none); the best found.
    scores_before, scores_after : array, shape (metrics,)
        Percentiles of the sweep's metrics.
    tried, scores : array, shape (n, names), (n, metrics)
        Every setting, and its percentiles.
    measured : tuple of str
        The sweep's metrics.
    percentile : float
        %, of the cases, whose metrics are the scores.
    at_bounds : mapping
        The settings that stop at an end of their range, and that end: the best may lie beyond.
    """

    run: PlannedRun
    names: tuple[str, ...]
    before: Array
    after: Array
    scores_before: Array
    scores_after: Array
    tried: Array
    scores: Array
    measured: tuple[str, ...] = ()
    percentile: float = math.nan
    at_bounds: Mapping[str, float] = field(default_factory=dict[str, float])

    @property
    def settings(self) -> dict[str, float]:
        """The best setting, by name."""
        return dict(zip(self.names, self.after.tolist()))

    @property
    def metrics(self) -> dict[str, float]:
        """Its percentiles, by metric."""
        return dict(zip(self.measured, self.scores_after.tolist()))

    def as_dict(self) -> dict[str, Any]:
        """Plain data, without the settings tried."""
        return {
            "run": self.run.key, "settings": self.settings, "before": dict(zip(self.names, self.before.tolist())),
            "metrics": self.metrics, "metrics_before": dict(zip(self.measured, self.scores_before.tolist())),
            "tried": len(self.tried), "at_bounds": dict(self.at_bounds),
        }  # fmt: skip

    def __str__(self) -> str:
        lines = [f"{self.run.key}: {len(self.tried)} settings tried"]
        for name, before, after in zip(self.names, self.before, self.after, strict=True):
            lines.append(f"    {name:<32}{before:>12.5g} -> {after:<12.5g}")
        for name, before, after in zip(self.measured, self.scores_before, self.scores_after, strict=True):
            share = f" {self.percentile:g} % of the cases below"
            lines.append(f"    {name:<32}{before:>12.5g} -> {after:<12.5g}{share}")
        for name, bound in self.at_bounds.items():
            lines.append(
                f"    {name} stops at the end of its range, {bound:.5g}: the best may lie beyond; widen the range if "
                "the machine allows it"
            )
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"<Tuned: {self}>"


def tune(sweep: Sweep, run: PlannedRun, progress: Callable[[int, int], None] | None = None) -> Tuned:
    """Choose the numbers of ``sweep.tuned`` for a run.

    Parameters
    ----------
    sweep : Sweep
    run : PlannedRun
        One of the sweep's.
    progress : callable, optional
        ``progress(settings tried, about how many)``.

    Raises
    ------
    InputError
        If nothing is to be chosen, there are too many cases, or no setting lets enough cases run to their end.
    """
    spreads = tuple(s for s in sweep.tuned if belongs(run, s.name))
    if not spreads:
        raise InputError(
            f'run {run.key} has none of the numbers to tune; give [tune."controller.bandwidth_hz"]'
        )
    if sweep.drawn.cases > MOST_CASES:
        raise InputError(
            f"cases = {sweep.drawn.cases} are too many for every setting; give {MOST_CASES} at most"
        )
    uncertain = sweep.values(run, sweep.drawn.block(0, sweep.drawn.cases))
    bases = [value_of(run, s.name) if s.factor else 1.0 for s in spreads]
    tried, scores = list[Array](), list[Array]()
    about = POPULATION * len(spreads) * (GENERATIONS + 1)

    def score(numbers: Array) -> Array:
        settings = {own_name(run, s.name): np.full(sweep.drawn.cases, x) for s, x in zip(spreads, numbers)}
        found = measured(run, uncertain | settings, sweep.metrics, sweep.drawn.cases)
        return percentiles(found.metrics, sweep.percentile)

    def objective(u: Array) -> float:
        places = zip(spreads, bases, u)
        numbers = np.array([admitted(run, s.name, b * float(s.at(np.asarray(x)))) for s, b, x in places])
        tried.append(numbers)
        scores.append(score(numbers))
        if progress:
            progress(len(tried), max(about, len(tried)))
        return _finite(float(scores[-1][0]))

    optimize: Any = importlib.import_module("scipy.optimize")
    optimize.differential_evolution(
        objective, [(0.0, 1.0)] * len(spreads), popsize=POPULATION, maxiter=GENERATIONS, tol=1e-3, polish=False,
        init="sobol", rng=np.random.default_rng(sweep.drawn.seed),
    )  # fmt: skip
    every = np.array(scores)
    best = int(np.argmin([_finite(x) for x in every[:, 0]]))
    if not math.isfinite(every[best, 0]):
        raise InputError(f"run {run.key}: with no setting do enough cases run to their end; widen the ranges")
    before = np.array([float(value_of(run, s.name)) for s in spreads])
    as_it_was = measured(run, uncertain, sweep.metrics, sweep.drawn.cases).metrics
    return Tuned(
        run, tuple(s.name for s in spreads), before, tried[best], percentiles(as_it_was, sweep.percentile), every[best],
        np.array(tried), every, tuple(sweep.metrics), sweep.percentile, at_bounds(run, spreads, bases, tried[best]),
    )  # fmt: skip


def at_bounds(
    run: PlannedRun, spreads: Sequence[Spread], bases: Sequence[float], found: Array
) -> dict[str, float]:
    """Which of the numbers lie at an end of their range, and that end."""
    out: dict[str, float] = {}
    for s, base, number in zip(spreads, bases, found.tolist()):
        low, high = (admitted(run, s.name, base * float(s.at(np.asarray(u)))) for u in (0.0, 1.0))
        near_low, near_high = (
            admitted(run, s.name, base * float(s.at(np.asarray(u)))) for u in (AT_END, 1.0 - AT_END)
        )
        if abs(number - low) <= abs(near_low - low):
            out[s.name] = low
        elif abs(number - high) <= abs(near_high - high):
            out[s.name] = high
    return out


def _finite(value: float) -> float:
    return value if math.isfinite(value) else FAILED


def percentiles(found: Array, percentile: float) -> Array:
    """A percentile of each metric over the cases, shape (metrics,); a failed case is worse than any other."""
    ordered = np.sort(np.where(np.isnan(found), math.inf, found), axis=0)
    return ordered[math.ceil(percentile / 100.0 * len(ordered)) - 1]


def front(scores: Array) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Which settings no other one beats in both of the first two metrics, in order of the first, shape (n,)."""
    order = np.lexsort((scores[:, 1], scores[:, 0]))
    kept: list[int] = []
    least = math.inf
    for i in order:
        if scores[i, 1] < least:
            kept.append(int(i))
            least = float(scores[i, 1])
    return np.array(kept, dtype=np.int64)
