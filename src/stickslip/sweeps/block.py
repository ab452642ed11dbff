"""A block of cases of one run: laid out as a batch where it can be, else loop by loop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stickslip.machines.machine import Machine
from stickslip.simulation.integrators import integrator_for
from stickslip.sweeps.measured import Array, laid_out, measured
from stickslip.sweeps.metric_check import Flags, checked
from stickslip.sweeps.plan import Sweep


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
        The metrics are not sure (`stickslip.sweeps.metric_check`).
    failures : list of str
        Why a case ended early or could not be run, else "".
    integrators : list of str
        What ran a case: "exact", "adaptive", "sampled", "fixed" or "machine"; "" where it could not be run.
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
    found = measured(planned, values, sweep.metrics, len(numbers))
    if sweep.check:
        found, flagged = checked(planned, values, sweep.metrics, found)
    return Block(
        run, start, sweep.listed(planned, numbers), found.metrics, flagged, found.failures, found.integrators
    )


def integrator_of(sweep: Sweep, run: int) -> tuple[str, str]:
    """What will run the cases of a run, as far as its first one tells, and why not what comes first; "" if it does."""
    planned = sweep.runs[run]
    if isinstance(planned.axis, Machine):
        return "machine", "a machine's samples have an engine of their own"
    choice = integrator_for(laid_out(planned), planned.numerics.integrator)
    return choice.name, "; ".join(choice.refused.values())
