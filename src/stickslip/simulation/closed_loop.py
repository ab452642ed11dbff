"""One call for a closed loop: `simulate(axis, controller, reference, duration) -> Record`."""

from __future__ import annotations

import importlib
import math
import warnings
from typing import Any, cast

import numpy as np

import stickslip
from stickslip.control.controller import Controller
from stickslip.control.learned import after
from stickslip.core.arguments import arguments_checked
from stickslip.core.errors import InputError, ModelRemark, ParameterError
from stickslip.core.record import Record
from stickslip.core.reprs import Vector
from stickslip.core.resources import insist_on_memory
from stickslip.core.type_rules import is_number
from stickslip.machines.machine import Machine
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Reference
from stickslip.simulation import case_arrays
from stickslip.simulation.case_arrays import COLUMNS, UNITS, Case, Outcome, lay_out, slip_rules
from stickslip.simulation.integrators import insist_on_steps, integrated, reason, without_tolerance
from stickslip.simulation.metrics import metrics

SAMPLE = 100.0
"""Bytes that the schedule of one sample takes while it is made"""
SHORTEST = 1e-9
"""s, of a run: one-sided limits are taken a thousandth of it beside kinks and ends."""


@arguments_checked
def simulate(
    axis: RigidAxis | Machine,
    controller: Controller,
    reference: Reference,
    duration: float,
    *,
    integrator: str = "auto",
    tolerance: float = 1e-9,
    time_step: float = 1e-4,
    slip_rule: str | None = None,
    output: float | Vector = 1e-3,
    initial: tuple[float, float] = (0.0, 0.0),
    metered: bool = True,
    check: bool = False,
) -> Record:
    """Run an axis with friction under a controller along a reference.

    Parameters
    ----------
    axis : RigidAxis or Machine
        A machine (`stickslip.load_machine`) runs with all its imperfections under the controller sampled at the
        machine's rate; ``integrator`` and ``time_step`` are then of no account (`stickslip.simulation.machine.loop`).
    controller : Controller
    reference : Reference
    duration : float
        s
    integrator : {"auto", "exact", "adaptive", "sampled", "fixed"}
        "auto" takes the first that can run the case, and goes on with the next where that one finds no step.
    tolerance : float
        Position error that a well-conditioned run may gather, rad (exact, adaptive and sampled). A machine's sub-steps
        are each within a tenth of that, or a hundred times it where the loop reads an encoder, which is coarser by far.
    time_step : float
        Longest step of the fixed integrator, s; it runs controllers in continuous time.
    slip_rule : {"signed", "literal"}, optional
        The rule from stick to slip of every law in the loop that has one (`stickslip.laws.slip_rule`), in place of its
        own choice; left out, each law keeps the rule that it was made with.
    output : float or array
        Spacing of the record's time grid, s, or its times.
    initial : tuple of float
        Position (rad) and velocity (rad/s) at the start; every law starts at rest, sticking.
    metered : bool
        Whether metrics and energies are accumulated during the run.
    check : bool
        Whether the error of the run is estimated (exact, adaptive and sampled), at about four times its price.

    Returns
    -------
    Record
        The grid and the events; channels as in ``record.units``. ``record.meta["metrics"]`` holds the metrics,
        ``record.meta["energy"]`` the balance: motor work = friction loss + kinetic energy + residual, J;
        ``record.meta["accuracy"]``, if asked for, ``error_rad``, the estimate of the largest error in position,
        ``start_rad``, how far a run ends up that starts 1e-9 rad beside, ``depends_on_start``, whether that is another
        branch of the motion, and ``well_conditioned``, whether the error is at most ten times the tolerance and no
        branch depends on the start (`stickslip.simulation.accuracy`).
        ``record.meta["learned"]`` says what its laws have learned: value, unit and uncertainty (half the interval that
        holds 95 of 100 times; None where a law has no covariance) by name (`stickslip.control.learned`).
        ``record.meta["slip_rules"]`` says by which rule each law ran that has one (``friction``, ``compensator``);
        ``record.meta["refused"]``, where "auto" did not take the first integrator, says why, by integrator: what it
        cannot run, or where it found no step.

    Raises
    ------
    InputError
        If the integrator cannot run the case, or an argument is out of bounds.
    SimulationError
        If the run diverges, leaves the finite numbers or switches without end; it says when and why, and its
        ``record`` holds what was computed.

    Warns
    -----
    ModelRemark
        Where "auto" is left with the fixed integrator, whose steps keep no tolerance.
    """
    _insist_on_tolerance(tolerance)
    if np.size(output) == 0:
        raise ParameterError("simulate: output holds no times; give a spacing or times, s")
    if isinstance(axis, Machine):
        check_machine_run(
            axis, controller, duration, output, integrator, initial=initial, slip_rule=slip_rule
        )
        machine_loop = importlib.import_module("stickslip.simulation.machine.loop")
        return machine_loop.simulate_machine(
            axis, controller, reference, duration,
            output=output, slip_rule=slip_rule, initial=initial, metered=metered, check=check,
            tolerance=tolerance,
        )  # fmt: skip
    case = prepare(
        axis, controller, reference, duration,
        tolerance=tolerance, slip_rule=slip_rule, output=output, initial=initial, metered=metered,
    )  # fmt: skip
    record = run_case(case, integrator, time_step, slip_rule, check=check)
    if said := without_tolerance(record.meta, time_step):
        warnings.warn(f"simulate: {said}", ModelRemark, stacklevel=3)
    return record


def run_case(
    case: Case,
    integrator: str,
    time_step: float,
    slip_rule: str | None,
    *,
    check: bool = False,
    start: bool = False,
) -> Record:
    """Run what `prepare` has laid out; arguments, record and errors as of `simulate`.

    With `start` alone, only the dependence on the start is looked at, where the exact integrator runs the case: that
    costs a tenth of the run.
    """
    ran = integrated(case, integrator, time_step)
    name, outcome, refused = ran
    how: dict[str, Any] = {"integrator": name, "slip_rule": slip_rule}
    if refused:
        how["refused"] = dict(refused)
    if name == "sampled" and (
        why := importlib.import_module("stickslip.simulation.sampled.engine").cannot_locate(case)
    ):
        how["general_step"] = why
    if check and name != "fixed" and outcome.code == case_arrays.DONE:
        found = importlib.import_module("stickslip.simulation.accuracy").estimate(case, name)
        how["accuracy"] = {
            "error_rad": found.error, "well_conditioned": found.well_conditioned,
            "start_rad": found.start, "depends_on_start": found.depends_on_start,
        }  # fmt: skip
    elif start and name == "exact" and outcome.code == case_arrays.DONE:
        accuracy = importlib.import_module("stickslip.simulation.accuracy")
        apart = accuracy.start_apart(case, name)
        how["accuracy"] = {"start_rad": apart, "depends_on_start": accuracy.branches(apart)}
    record = _record(case, outcome, how)
    if outcome.code != case_arrays.DONE:
        kind, why = reason(case, ran)
        raise kind(f"the run ended at {outcome.time:.6g} s: {why}", outcome.time, record)
    return record


def prepare(
    axis: RigidAxis,
    controller: Controller,
    reference: Reference,
    duration: float,
    *,
    tolerance: float = 1e-9,
    slip_rule: str | None = None,
    output: float | Vector = 1e-3,
    initial: tuple[float, float] = (0.0, 0.0),
    metered: bool = True,
) -> Case:
    """Check the arguments of `simulate` and lay the loop out for an integrator's ``run``."""
    _insist_on_tolerance(tolerance)
    check_run(duration, initial, controller.sample_time)
    return lay_out(
        axis, controller, reference, float(duration),
        tolerance=tolerance, grid=_grid(output, duration), slip_rule=slip_rule, initial=initial, metered=metered,
    )  # fmt: skip


def check_machine_run(
    machine: Machine, controller: Controller, duration: float, output: Any,
    integrator: str = "auto", *, initial: tuple[float, float] = (0.0, 0.0), slip_rule: str | None = None,
) -> None:  # fmt: skip
    """Find what is wrong with a run of a machine without running it; compiles its laws.

    Raises
    ------
    InputError
    """
    if integrator != "auto":
        raise InputError(
            f"the {integrator} integrator cannot run a machine, whose samples have an engine of their own; leave "
            "integrator out"
        )
    check_run(duration, initial, machine.sample_time)
    machine_loop = importlib.import_module("stickslip.simulation.machine.loop")
    machine_loop.rows_at(output, machine.sample_time, duration)
    machine_loop.sampled_on(controller, machine, slip_rule)


def check_run(duration: float, initial: tuple[float, float], sample_time: float) -> None:
    """Refuse a duration, a start or a sample time (s; 0 in continuous time) with which nothing can be run.

    Raises
    ------
    ParameterError
    """
    if not (math.isfinite(duration) and duration > 0.0):
        raise ParameterError(f"simulate: duration = {duration:g} s must be greater than 0 and finite")
    if duration < SHORTEST:
        raise ParameterError(
            f"simulate: duration = {duration:g} s is shorter than {SHORTEST:g} s, in which nothing moves; give a "
            "longer one"
        )
    if not all(math.isfinite(x) for x in initial):
        raise ParameterError(f"simulate: initial = {initial} must be two finite numbers")
    if sample_time > 0.0:
        insist_on_steps("sample_time", sample_time, duration)
        samples = duration / sample_time
        insist_on_memory(
            SAMPLE * samples, f"simulate: {samples:.3g} steps of sample_time = {sample_time:g} s",
            "use a longer one or a shorter duration",
        )  # fmt: skip


def _insist_on_tolerance(tolerance: float) -> None:
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        raise ParameterError(f"simulate: tolerance = {tolerance:g} rad must be greater than 0 and finite")


def _grid(output: float | Vector, duration: float) -> Any:
    """The times at which rows are wanted."""
    if is_number(output):
        output = float(cast(float, output))
        if not (math.isfinite(output) and output > 0.0):
            raise ParameterError(f"simulate: output = {output:g} s must be greater than 0 and finite")
        ratio = duration / output * (1.0 + 1e-12)
        count = math.floor(ratio) if math.isfinite(ratio) else ratio
        if count > 50_000_000:
            raise ParameterError(
                f"simulate: duration = {duration:g} s in rows every output = {output:g} s makes {count:.3g} rows; "
                "use a shorter duration or a larger output"
            )
        # Multiples of the spacing, not a running sum, so that the grid is what a person would write down.
        return np.minimum(np.arange(count + 1) * output, duration)
    times = np.asarray(output, dtype=np.float64)
    if times.ndim != 1 or not np.all(np.isfinite(times)) or np.any(times[1:] < times[:-1]):
        raise ParameterError("simulate: output times must be finite and ascend")
    if times.size and (times[0] < 0.0 or times[-1] > duration):
        raise ParameterError(f"simulate: output times must lie within 0 and {duration:g} s")
    return times


def _record(case: Case, outcome: Outcome, how: dict[str, Any]) -> Record:
    rows = outcome.rows
    columns = np.ascontiguousarray(rows.T)
    controller, plant = case.controller, case.plant.model
    assert plant is not None
    meta: dict[str, Any] = {
        "what": "simulation",
        "version": stickslip.__version__,
        **how,
        "slip_rules": slip_rules(friction=plant, **controller.frictions),
        "tolerance": float(case.numbers[case_arrays.TOLERANCE]),
        "duration": float(case.numbers[case_arrays.DURATION]),
        "ended": outcome.time,
        "inertia": case.axis.inertia,
        "friction": plant.as_dict(),
        "reference": case.reference.as_dict(),
        "counts": outcome.counts,
        **controller.described(),
    }
    if outcome.control is not None and (
        learned := after(controller, outcome.control, controller.sample_time)
    ):
        meta["learned"] = learned
    if case.numbers[case_arrays.METERED] and outcome.code == case_arrays.DONE:
        meta["metrics"] = {k: float(v) for k, v in metrics(outcome.meter, outcome.turns).items()}
        meta["energy"] = _energy(case, columns, meta["metrics"])
    channels = {name: columns[i] for i, name in enumerate(COLUMNS) if name != "time"}
    return Record(columns[0], channels, UNITS, meta)


def _energy(case: Case, columns: Any, found: dict[str, float]) -> dict[str, float]:
    """Motor work = friction loss + change of kinetic energy + residual, J."""
    last = columns[COLUMNS.index("velocity"), -1] if columns.shape[1] else 0.0
    first = case.numbers[case_arrays.VELOCITY_0]
    kinetic = 0.5 * case.axis.inertia * float(last * last - first * first)
    work, loss = found["motor_work_J"], found["friction_loss_J"]
    return {"motor_work": work, "friction_loss": loss, "kinetic": kinetic, "residual": work - loss - kinetic}
