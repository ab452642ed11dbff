"""A block of cases of one run: laid out as a batch where it can be, else loop by loop."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.errors import InputError, ParameterError, SimulationError
from stickslip.machines.machine import Machine
from stickslip.machines.rigid import RigidAxis
from stickslip.simulation import case_arrays
from stickslip.simulation.accuracy import LOOSER, PERTURBATIONS
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.integrators import (
    INTEGRATORS,
    NO_STEPS,
    REASONS,
    Integrated,
    integrated,
    integrator_for,
    reason,
)
from stickslip.simulation.machine.layout import TOLERANCE
from stickslip.simulation.machine.loop import simulate_machine
from stickslip.simulation.many import batch, simd_batch
from stickslip.simulation.metrics import metrics as read_meter
from stickslip.study.planned_run import PlannedRun
from stickslip.sweep.numbers import as_columns, varied
from stickslip.sweep.plan import BLOCK, Sweep

Array = np.ndarray[Any, np.dtype[np.float64]]
TIGHTER, FINEST = (0.1, 0.01, 0.001), 1e-10
"""Times the tolerance, at which those that are not sure are run again; least tolerance, rad."""
SETTLED, SURE = 0.001, 0.01
"""Parts of a metric: by which wrong steps may change it, and by which it may differ from that at the tolerance before.
The first is a tenth of the 1 % that is wanted: motions without a truth scatter by about that, and would often agree."""
LONGER, SURE_OF_STEPS = 2.0, 0.003
"""Times the step of lanes, at which they run again, and the part of a metric by which the two may differ: a third of
`SURE`, since where an axis switches often two steps can agree by chance."""
FINER = 2
"""Times the sub-steps of a machine, with which it runs again where wrong steps are asked for."""
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
        The metrics are not sure, not even at the tightest tolerance: wrong steps change one of them by more than 0.1 %,
        or a count of reversals by more than one. In lanes: twice the step does, by more than 0.3 %, or a step had more
        switches than were followed.
    failures : list of str
        Why a case ended early or could not be run, else "".
    integrators : list of str
        What ran a case: "exact", "adaptive", "sampled", "fixed", "lanes" or "machine"; "" where it could not be run.
    """

    run: int
    start: int
    numbers: Array
    metrics: Array
    flagged: np.ndarray[Any, np.dtype[np.bool_]]
    failures: list[str]
    integrators: list[str]


class Measured(NamedTuple):
    """What cases gave: metrics, shape (n, metrics), why each ended early or could not be run, and what ran it."""

    metrics: Array
    failures: list[str]
    integrators: list[str]


def compute(sweep: Sweep, run: int, start: int) -> Block:
    """Run the block of cases that begins with `start`."""
    return compute_cases(sweep, run, start, sweep.drawn.block(start, min(start + BLOCK, sweep.drawn.cases)))


def compute_cases(sweep: Sweep, run: int, start: int, numbers: Array) -> Block:
    """Run these cases, shape (n, names), of which `start` is the first one's place."""
    planned = sweep.runs[run]
    values = sweep.values(planned, numbers)
    flagged = np.zeros(len(numbers), dtype=np.bool_)
    if sweep.step > 0.0 and (many := as_lanes(planned, values, sweep.step)) is not None:
        results = many.run(sweep.metrics, device=sweep.device)
        found = _read(results, sweep.metrics, "lanes")
        flagged = results.unresolved > 0
        if sweep.check:
            flagged = flagged | doubtful(many, sweep, found)
    else:
        found = measured(planned, values, sweep.metrics, len(numbers))
        if sweep.check:
            found, flagged = checked(planned, values, sweep.metrics, found)
    return Block(run, start, numbers, found.metrics, flagged, found.failures, found.integrators)


def doubtful(many: simd_batch.Lanes, sweep: Sweep, found: Measured) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Which cases in lanes differ at twice the step."""
    wide = simd_batch.prepare(many.case, many.varied, LONGER * sweep.step)
    again = _read(wide.run(sweep.metrics, device=sweep.device), sweep.metrics, "lanes")
    duration = float(many.case.numbers[case_arrays.DURATION])
    ends = np.array([a != b for a, b in zip(found.failures, again.failures)], dtype=np.bool_)
    return differ(found.metrics, again.metrics, sweep.metrics, duration, SURE_OF_STEPS) | ends


def checked(
    planned: PlannedRun, values: Mapping[str, Array], metrics: Sequence[str], found: Measured
) -> tuple[Measured, np.ndarray[Any, np.dtype[np.bool_]]]:
    """Hold every case against wrong steps, and what differs then at ever tighter tolerances.

    Returns
    -------
    found, flagged
        Of every case at the tightest tolerance that it was run at; whether it differs there, too.
    """
    best = Measured(found.metrics.copy(), list(found.failures), list(found.integrators))
    flagged = np.zeros(len(best.metrics), dtype=np.bool_)

    def again(cases: Any, times: float, perturbation: float = 0.0, integrator: str = "") -> Measured:
        n = planned.numerics
        # The fixed integrator is of second order in its step.
        finer = replace(
            n, tolerance=times * n.tolerance, time_step=math.sqrt(times) * n.time_step,
            integrator=integrator if integrator in INTEGRATORS else n.integrator,
        )  # fmt: skip
        some = {k: v[cases] for k, v in values.items()}
        return measured(replace(planned, numerics=finer), some, metrics, len(cases), perturbation)

    def differs(cases: Any, other: Measured, part: float) -> Any:
        ends = np.array(
            [_when(best.failures[int(i)]) != _when(why) for i, why in zip(cases, other.failures)],
            dtype=np.bool_,
        )
        return differ(best.metrics[cases], other.metrics, metrics, planned.duration, part) | ends

    def perturbed(cases: Any, times: float) -> None:
        for perturbation in PERTURBATIONS:
            # Only the exact integrator can be wrong in two ways.
            some = (
                cases
                if perturbation == PERTURBATIONS[0]
                else cases[[best.integrators[i] == "exact" for i in cases]]
            )
            # What is held against a run is one of the integrator that ran it.
            ran: list[str] = [best.integrators[i] for i in some]
            for name in dict.fromkeys(ran):
                same = some[[best.integrators[i] == name for i in some]]
                flagged[same] |= differs(same, again(same, times, perturbation, name), SETTLED)

    perturbed(np.arange(len(flagged)), 1.0)
    unmoved = np.flatnonzero(~flagged)
    if unmoved.size and planned.control.feeds_back:
        # It acts on the motion itself, which may turn where the tolerance does not see it, wrong steps or not.
        flagged[unmoved] = differs(unmoved, again(unmoved, TIGHTER[0]), SURE)
    for times in TIGHTER:
        cases = np.flatnonzero(flagged)
        if not cases.size or times * planned.numerics.tolerance < FINEST * (1.0 - 1e-9):
            break
        fine = again(cases, times)
        flagged[cases] = differs(cases, fine, SURE)
        best.metrics[cases] = fine.metrics
        for i, why, name in zip(cases, fine.failures, fine.integrators):
            best.failures[i], best.integrators[i] = why, name
        perturbed(cases, times)
    return best, flagged


def differ(
    one: Array, other: Array, names: Sequence[str], duration: float = math.inf, part: float = SURE
) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Where a metric of one differs from the other's, shape (n,) of two (n, metrics).

    By more than a part, or, for reversals, by more than one in `duration` seconds (in the second half, half of that).
    """
    floors = np.array([_floor(name, duration) for name in names])
    none = np.isnan(one) & np.isnan(other)
    close = np.abs(one - other) <= part * np.abs(one) + floors
    return ~np.all(close | none, axis=1)


def _floor(name: str, duration: float) -> float:
    """Difference of a metric that counts for nothing."""
    if "reversals" in name:
        return 1.001 * (2.0 if name.startswith("second_half") else 1.0) / duration
    if name.endswith("rad_s"):
        return 1e-6
    return FLOORS.get(name.rsplit("_", 1)[1], 0.0)


def measured(
    planned: PlannedRun,
    values: Mapping[str, Array],
    metrics: Sequence[str],
    n: int,
    perturbation: float = 0.0,
) -> Measured:
    """What every case gives; less exact with a perturbation.

    The exact integrator's steps are then wrong on purpose, the adaptive one's tolerance is ten times wider, the fixed
    one's step twice as long (`stickslip.simulation.accuracy`).
    """
    many = _as_batch(planned, values)
    if many is None:
        found = Measured(np.full((n, len(metrics)), np.nan), [""] * n, [""] * n)
        left = range(n)
    else:
        many.parameters[:, case_arrays.PERTURBATION] = perturbation
        results = many.run(metrics)
        found = _read(results, metrics, "exact")
        goes_on = planned.numerics.integrator == "auto" and perturbation == 0.0
        left = [i for i in range(n) if goes_on and results.codes[i] in NO_STEPS]
    for i in left:
        found.metrics[i], found.failures[i], found.integrators[i] = _alone(
            planned, {k: v[i].tolist() for k, v in values.items()}, metrics, perturbation
        )
    return found


def _read(results: batch.Results, metrics: Sequence[str], integrator: str) -> Measured:
    found = np.column_stack([results.metrics[name] for name in metrics])
    failures = [_reason(int(code), float(t)) for code, t in zip(results.codes, results.time)]
    return Measured(found, failures, [integrator] * len(failures))


def integrator_of(sweep: Sweep, run: int) -> tuple[str, str]:
    """What will run the cases of a run, as far as its first one tells, and why not what comes first; "" if it does."""
    planned = sweep.runs[run]
    if isinstance(planned.axis, Machine):
        return "machine", "a machine's samples have an engine of their own"
    reasons: list[str] = []
    if sweep.step > 0.0:
        try:
            values = sweep.values(planned, sweep.drawn.block(0, 1))
            simd_batch.prepare(_laid_out(planned), as_columns(planned, values), sweep.step)
        except InputError as error:
            reasons.append(str(error))
        else:
            return "lanes", ""
    choice = integrator_for(_laid_out(planned), planned.numerics.integrator)
    return choice.name, "; ".join([*reasons, *choice.refused.values()])


def as_lanes(planned: PlannedRun, values: Mapping[str, Array], step: float) -> simd_batch.Lanes | None:
    """The block in lanes, or None where they cannot run it."""
    if isinstance(planned.axis, Machine):
        return None
    try:
        return simd_batch.prepare(_laid_out(planned), as_columns(planned, values), step)
    except InputError:
        return None


def _when(failure: str) -> str:
    """What is said of a failure before its reason, whose numbers follow the tolerance."""
    return failure.split(": ")[0]


def _reason(code: int, time: float) -> str:
    return "" if code == case_arrays.DONE else f"ended at {time:.6g} s: {REASONS[code][1]}"


def _laid_out(planned: PlannedRun) -> case_arrays.Case:
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
        case = _laid_out(planned)
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
            return _on_machine(run, run.axis, metrics, FINER * TOLERANCE if perturbation else TOLERANCE)
        case = _laid_out(run)
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
