"""The metrics of a run's cases: laid out as a batch where they can be, else loop by loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from stickslip.core.errors import InputError, ParameterError, SimulationError
from stickslip.machines.machine import Machine
from stickslip.machines.rigid import RigidAxis
from stickslip.simulation import case_arrays
from stickslip.simulation.accuracy import LOOSER
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.integrators import (
    NO_STEPS,
    REASONS,
    Integrated,
    integrated,
    integrator_for,
    reason,
)
from stickslip.simulation.machine.loop import FINER, simulate_machine
from stickslip.simulation.many import batch
from stickslip.simulation.metrics import metrics as read_meter
from stickslip.studies.planned_run import PlannedRun
from stickslip.sweeps.numbers import as_columns, varied

Array = np.ndarray[Any, np.dtype[np.float64]]
LONGER = 2.0
"""Times the step of the fixed integrator, with which it runs again where wrong steps are asked for."""


class Measured(NamedTuple):
    """What cases gave: metrics, shape (n, metrics), why each ended early or could not be run, and what ran it."""

    metrics: Array
    failures: list[str]
    integrators: list[str]


def measured(
    planned: PlannedRun,
    values: Mapping[str, Array],
    metrics: Sequence[str],
    n: int,
    perturbation: float = 0.0,
) -> Measured:
    """What every case gives; less exact with a perturbation.

    The exact integrator's steps are then wrong on purpose, the adaptive one's tolerance is ten times wider, the fixed
    one's step twice as long (`stickslip.simulation.accuracy`); a machine's sub-steps are finer.
    """
    many = _as_batch(planned, values)
    if many is None:
        found = Measured(np.full((n, len(metrics)), np.nan), [""] * n, [""] * n)
        left = range(n)
    else:
        many.parameters[:, case_arrays.PERTURBATION] = perturbation
        results = many.run(metrics)
        found = _read(results, metrics)
        goes_on = planned.numerics.integrator == "auto" and perturbation == 0.0
        left = [i for i in range(n) if goes_on and results.codes[i] in NO_STEPS]
    for i in left:
        found.metrics[i], found.failures[i], found.integrators[i] = _alone(
            planned, {k: v[i].tolist() for k, v in values.items()}, metrics, perturbation
        )
    return found


def _read(results: batch.Results, metrics: Sequence[str]) -> Measured:
    """Return what a batch gave, its metrics in this order."""
    found = np.column_stack([results.metrics[name] for name in metrics])
    failures = [_reason(int(code), float(t)) for code, t in zip(results.codes, results.time)]
    return Measured(found, failures, ["exact"] * len(failures))


def _reason(code: int, time: float) -> str:
    return "" if code == case_arrays.DONE else f"ended at {time:.6g} s: {REASONS[code][1]}"


def laid_out(planned: PlannedRun) -> case_arrays.Case:
    """A run of a rigid axis in flat arrays."""
    n = planned.numerics
    assert isinstance(planned.axis, RigidAxis)
    return prepare(
        planned.axis, planned.control, planned.motion, planned.duration,
        tolerance=n.tolerance, slip_rule=planned.rule, output=planned.duration,
    )  # fmt: skip


def _as_batch(planned: PlannedRun, values: Mapping[str, Array]) -> batch.Batch | None:
    """The block as one batch, or None where its cases are run one by one."""
    if isinstance(planned.axis, Machine):
        return None
    if planned.numerics.integrator not in ("auto", "exact") or not values:
        return None
    try:
        columns = as_columns(planned, values)
        case = laid_out(planned)
        return None if batch.refusal(case, list(columns)) else batch.prepare(case, columns)
    except InputError:
        return None  # One of the cases is out of bounds; the others are run.


def _alone(
    planned: PlannedRun, values: Mapping[str, Any], metrics: Sequence[str], perturbation: float = 0.0
) -> tuple[list[float], str, str]:
    """Metrics of one case, why it has none, and what ran it."""
    none = [np.nan] * len(metrics)
    try:
        run = varied(planned, values)
        if isinstance(run.axis, Machine):
            tolerance = run.numerics.tolerance
            return _on_machine(run, run.axis, metrics, FINER * tolerance if perturbation else tolerance)
        case = laid_out(run)
        ran = _integrated(case, run.numerics.integrator, run.numerics.time_step, perturbation)
    except ParameterError as error:
        return none, str(error), ""
    if ran.outcome.code != case_arrays.DONE:
        return none, f"ended at {ran.outcome.time:.6g} s: {reason(case, ran)[1]}", ran.name
    found = read_meter(ran.outcome.meter, ran.outcome.turns)
    return [found[name] for name in metrics], "", ran.name


def _integrated(case: case_arrays.Case, integrator: str, step: float, perturbation: float) -> Integrated:
    """Run a case; less exact, with the first integrator alone, where there is a perturbation."""
    if perturbation == 0.0:
        return integrated(case, integrator, step)
    name = integrator_for(case, integrator).name
    # Only the exact integrator reads the perturbation: without more the others would agree with themselves.
    if name == "exact":
        case.numbers[case_arrays.PERTURBATION] = perturbation
    else:
        case.numbers[case_arrays.TOLERANCE] *= LOOSER.get(name, 1.0)
        step *= LONGER
    return integrated(case, name, step)


def _on_machine(
    run: PlannedRun, machine: Machine, metrics: Sequence[str], tolerance: float
) -> tuple[list[float], str, str]:
    """The same of a machine; its sub-steps keep the tolerance."""
    try:
        record = simulate_machine(
            machine, run.control, run.motion, run.duration,
            output=np.zeros(1), slip_rule=run.rule, tolerance=tolerance,
        )  # fmt: skip
    except SimulationError as error:
        return [np.nan] * len(metrics), f"ended at {error.time:.6g} s: {error}", "machine"
    found = record.meta["metrics"]
    return [found[name] for name in metrics], "", "machine"
