"""A block of cases of one run: laid out as a batch where it can be, else loop by loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.errors import InputError, ParameterError
from stickslip.simulation import _case, batch
from stickslip.simulation._meter import metrics as read_meter
from stickslip.simulation.closed_loop import REASONS, integrator_for, prepare
from stickslip.study.plan import PlannedRun
from stickslip.sweep.numbers import as_columns, varied
from stickslip.sweep.plan import BLOCK, Sweep

__all__ = ["FLOORS", "Block", "compute", "differ"]

Array = np.ndarray[Any, np.dtype[np.float64]]
LOOSER = 10.0
"""Times the tolerance, at which a case is run again to see whether its metrics are sure."""
SURE = 0.01
"""Part of a metric by which the two may differ."""
FLOORS = {"rad": 1e-8, "s": 1e-6, "Nm": 1e-6, "J": 1e-9}
"""Differences this small count for nothing, by the unit that a metric's name ends with (rad/s: 1e-6)."""


@dataclass(frozen=True)
class Block:
    """What the cases of a block gave.

    Attributes
    ----------
    run, start : int
        Place of the run in the sweep; first case.
    numbers : array, shape (n, names)
        What was drawn.
    metrics : array, shape (n, metrics)
        NaN where there is none.
    flagged : array of bool, shape (n,)
        The metrics are not sure: ten times the tolerance changes one of them by more than 1 %.
    failures : list of str
        Why a case ended early or could not be run, else "".
    """

    run: int
    start: int
    numbers: Array
    metrics: Array
    flagged: np.ndarray[Any, np.dtype[np.bool_]]
    failures: list[str]


def compute(sweep: Sweep, run: int, start: int) -> Block:
    """Run the block of cases that begins with `start`."""
    numbers = sweep.drawn.block(start, min(start + BLOCK, sweep.drawn.cases))
    planned = sweep.runs[run]
    values = sweep.values(planned, numbers)
    found, failures = measured(planned, values, sweep.metrics, len(numbers))
    flagged = np.zeros(len(numbers), dtype=np.bool_)
    if sweep.check:
        rough = replace(
            planned, numerics=replace(planned.numerics, tolerance=LOOSER * planned.numerics.tolerance)
        )
        again, failed = measured(rough, values, sweep.metrics, len(numbers))
        flagged = differ(found, again, sweep.metrics) | np.array([a != b for a, b in zip(failures, failed)])
    return Block(run, start, numbers, found, flagged, failures)


def differ(one: Array, other: Array, names: Sequence[str]) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Where a metric of one differs from the other's by more than 1 %, shape (n,) of two (n, metrics)."""
    floors = np.array([1e-6 if n.endswith("rad_s") else FLOORS.get(n.rsplit("_", 1)[1], 0.0) for n in names])
    none = np.isnan(one) & np.isnan(other)
    close = np.abs(one - other) <= SURE * np.abs(one) + floors
    return ~np.all(close | none, axis=1)


def measured(
    planned: PlannedRun, values: Mapping[str, Array], metrics: Sequence[str], n: int
) -> tuple[Array, list[str]]:
    """Metrics, shape (n, metrics), and failures of every case."""
    many = _as_batch(planned, values)
    if many is None:
        rows = [_alone(planned, {k: v[i].tolist() for k, v in values.items()}, metrics) for i in range(n)]
        return np.array([row for row, _ in rows]).reshape(n, len(metrics)), [why for _, why in rows]
    results = many.run(metrics)
    found = np.column_stack([results.metrics[name] for name in metrics])
    reasons = [_reason(int(code), float(t)) for code, t in zip(results.codes, results.time)]
    return found, reasons


def _reason(code: int, time: float) -> str:
    return "" if code == _case.DONE else f"ended at {time:.6g} s: {REASONS[code][1]}"


def _laid_out(planned: PlannedRun) -> _case.Case:
    n = planned.numerics
    return prepare(
        planned.axis, planned.control, planned.motion, planned.duration,
        tolerance=n.tolerance, slip_rule=planned.slip_rule, output=planned.duration,
    )  # fmt: skip


def _as_batch(planned: PlannedRun, values: Mapping[str, Array]) -> batch.Batch | None:
    """The block as one batch, or None where its cases are run one by one."""
    if planned.numerics.integrator not in ("auto", "exact") or not values:
        return None
    try:
        columns = as_columns(planned, values)
        case = _laid_out(planned)
        return None if batch.refusal(case, list(columns)) else batch.prepare(case, columns)
    except InputError:
        return None  # One of the cases is out of bounds; the others are run.


def _alone(planned: PlannedRun, values: Mapping[str, Any], metrics: Sequence[str]) -> tuple[list[float], str]:
    none = [np.nan] * len(metrics)
    try:
        run = varied(planned, values)
        case = _laid_out(run)
        name, integrate = integrator_for(case, run.numerics.integrator)
    except ParameterError as error:
        return none, str(error)
    outcome = integrate(case, run.numerics.time_step) if name == "fixed" else integrate(case)
    if outcome.code != _case.DONE:
        return none, _reason(outcome.code, outcome.time)
    found = read_meter(outcome.meter, outcome.turns)
    return [found[name] for name in metrics], ""
