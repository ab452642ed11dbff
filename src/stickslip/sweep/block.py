"""A block of cases of one run: laid out as a batch where it can be, else loop by loop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from stickslip.errors import InputError
from stickslip.machines.machine import Machine
from stickslip.simulation import case_arrays
from stickslip.simulation.integrators import integrator_for
from stickslip.simulation.many import simd_batch
from stickslip.study.planned_run import PlannedRun
from stickslip.sweep.measured import Array, Measured, laid_out, measured, read_results
from stickslip.sweep.metric_check import Flags, checked, differ
from stickslip.sweep.numbers import as_columns
from stickslip.sweep.plan import Sweep

LONGER, SURE_OF_STEPS = 2.0, 0.003
"""Times the step of lanes, at which they run again, and the part of a metric by which the two may differ: a third of
`stickslip.sweep.metric_check.SURE`, since where an axis switches often two steps can agree by chance."""


@dataclass(frozen=True)
class Block:
    """What the cases of a block gave.

    Attributes
    ----------
    run, start : int
        Place of the run in the sweep; first case.
    numbers : array, shape (n, names)
        What was drawn; NaN where the run has no such number.
    metrics : array, shape (n, metrics)
        NaN where there is none.
    flagged : array of bool, shape (n,)
        The metrics are not sure (`stickslip.sweep.metric_check`). In lanes: twice the step changes one of them by more
        than 0.3 %, or a step had more switches than were followed.
    failures : list of str
        Why a case ended early or could not be run, else "".
    integrators : list of str
        What ran a case: "exact", "adaptive", "sampled", "fixed", "lanes" or "machine"; "" where it could not be run.
    """

    run: int
    start: int
    numbers: Array
    metrics: Array
    flagged: Flags
    failures: list[str]
    integrators: list[str]


def compute(sweep: Sweep, run: int, start: int) -> Block:
    """Run the block of cases that begins with `start`."""
    end = min(start + sweep.size_of(run), sweep.drawn.cases)
    return compute_cases(sweep, run, start, sweep.drawn.block(start, end))


def compute_cases(sweep: Sweep, run: int, start: int, numbers: Array) -> Block:
    """Run these cases, shape (n, names), of which `start` is the first one's place."""
    planned = sweep.runs[run]
    values = sweep.values(planned, numbers)
    flagged = np.zeros(len(numbers), dtype=np.bool_)
    if sweep.step > 0.0 and (many := as_lanes(planned, values, sweep.step)) is not None:
        results = many.run(sweep.metrics, device=sweep.device)
        found = read_results(results, sweep.metrics, "lanes")
        flagged = results.unresolved > 0
        if sweep.check:
            flagged = flagged | doubtful(many, sweep, found)
    else:
        found = measured(planned, values, sweep.metrics, len(numbers))
        if sweep.check:
            found, flagged = checked(planned, values, sweep.metrics, found)
    return Block(
        run, start, sweep.listed(planned, numbers), found.metrics, flagged, found.failures, found.integrators
    )


def doubtful(many: simd_batch.Lanes, sweep: Sweep, found: Measured) -> Flags:
    """Which cases in lanes differ at twice the step."""
    wide = simd_batch.prepare(many.case, many.varied, LONGER * sweep.step)
    again = read_results(wide.run(sweep.metrics, device=sweep.device), sweep.metrics, "lanes")
    duration = float(many.case.numbers[case_arrays.DURATION])
    ends = np.array([a != b for a, b in zip(found.failures, again.failures)], dtype=np.bool_)
    return differ(found.metrics, again.metrics, sweep.metrics, duration, SURE_OF_STEPS) | ends


def integrator_of(sweep: Sweep, run: int) -> tuple[str, str]:
    """What will run the cases of a run, as far as its first one tells, and why not what comes first; "" if it does."""
    planned = sweep.runs[run]
    if isinstance(planned.axis, Machine):
        return "machine", "a machine's samples have an engine of their own"
    reasons: list[str] = []
    if sweep.step > 0.0:
        try:
            values = sweep.values(planned, sweep.drawn.block(0, 1))
            simd_batch.prepare(laid_out(planned), as_columns(planned, values), sweep.step)
        except InputError as error:
            reasons.append(str(error))
        else:
            return "lanes", ""
    choice = integrator_for(laid_out(planned), planned.numerics.integrator)
    return choice.name, "; ".join([*reasons, *choice.refused.values()])


def as_lanes(planned: PlannedRun, values: Mapping[str, Array], step: float) -> simd_batch.Lanes | None:
    """The block in lanes, or None where they cannot run it."""
    if isinstance(planned.axis, Machine):
        return None
    try:
        return simd_batch.prepare(laid_out(planned), as_columns(planned, values), step)
    except InputError:
        return None
