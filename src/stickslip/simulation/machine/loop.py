"""A machine with all its imperfections under a sampled controller along a reference: `simulate` of a `Machine`.

The machine moves as `stickslip.simulation.machine.step` has it, the controller acts on what its encoder shows, once a
sample; a controller in continuous time is sampled too. Metrics are of the axis itself, not of what the sensors show:
between the samples its position is the cubic through positions and velocities of their ends, its torques are linear.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any, cast

import numpy as np

import stickslip
from stickslip.control.controller import Controller
from stickslip.control.learned import after
from stickslip.control.sample_time import sampled_by
from stickslip.core.errors import Divergence, InputError
from stickslip.core.record import Record
from stickslip.core.spec import Surroundings
from stickslip.core.type_rules import is_number
from stickslip.jit import compiled_profile, flat
from stickslip.machines.machine import Machine
from stickslip.models.model import Reference
from stickslip.simulation._meter import new_meter, turning_points
from stickslip.simulation._nodes import SIGNALS
from stickslip.simulation.case_arrays import DIVERGED, ruled, ruled_in, slip_rules
from stickslip.simulation.compiled_controller import Sampled, compiled
from stickslip.simulation.integrators import REASONS, calmed
from stickslip.simulation.machine.drive import (
    COLUMNS,
    NO_NUMBER,
    OF_DRIVETRAINS,
    TRIPPED,
    UNITS,
    Loop,
    Output,
    drive,
)
from stickslip.simulation.machine.layout import TOLERANCE, lay_out_machine, stand_at
from stickslip.simulation.machine.plant import FINEST
from stickslip.simulation.metrics import metrics, settle_band_of
from stickslip.simulation.no_torque import no_torque
from stickslip.simulation.train.layout import cannot_locate
from stickslip.subset import Layout

Array = np.ndarray[Any, np.dtype[np.float64]]

FINER = 0.001
"""Of the tolerance, or of the usual one, in the run that one is held against: what is taken in the middle of a sub-step
grows no coarser with a looser tolerance."""
SURE = 1.5
"""Of what two runs lie apart: the finer one has an error too, a tenth to a third of the other's."""
LEAST = 0.01
"""Of the tolerance: what two runs that agree may still have in common."""
USUAL = 1e-9
"""rad, of a run."""
READ, EXACT = 100.0, 0.1
"""Of a run's tolerance, that a sub-step may be wrong by: where the loop reads counts of an encoder, which are coarser
by far; and where it reads the position itself. A contact that creeps before it breaks away makes 1e4 of an error."""
AT = COLUMNS.index("position")
ON_TIME = 1e-6
"""Samples by which output times may lie beside a sample."""


def simulate_machine(
    machine: Machine,
    controller: Controller,
    reference: Reference,
    duration: float,
    *,
    output: float | Array = 1e-3,
    slip_rule: str | None = None,
    initial: tuple[float, float] = (0.0, 0.0),
    metered: bool = True,
    check: bool = False,
    tolerance: float = USUAL,
) -> Record:
    """Run a machine; arguments, record and errors as of `stickslip.simulate`.

    Parameters
    ----------
    output : float or array
        Spacing of the record's rows, s, a whole number of samples; or times of samples.
    check : bool
        Whether the run is repeated at a thousandth of the sub-steps' tolerance, at most of the usual one (the noise is
        the same): ``meta["accuracy"]`` then says by how much both differ at most, ``error_rad``, a hundredth of the
        tolerance at least. Where the shortest sub-steps do not keep that, what sub-steps twice as long change is added.
    tolerance : float
        Of the run, rad. A sub-step may be wrong by `sub_step_tolerance` of it by the end of its sample, which
        ``meta["sub_step_tolerance"]`` says; a located flow's step by a tenth of that.

    Returns
    -------
    Record
        Of a machine with springs, ``motor_position`` and ``load_position`` are its first and last inertia's, and
        ``position`` that at the encoder. ``meta["machine"]`` says which machine ran, and what was switched off;
        ``meta["learned"]`` what the controller has learned (`stickslip.control.learned`); ``meta["general_step"]`` why
        it moved by sub-steps and along no located flow (decision 0033), where it did; there is no energy balance.
    """
    own = machine
    if slip_rule is not None:
        friction = ruled(machine.contact.friction, slip_rule)
        own = replace(machine, contact=replace(machine.contact, friction=friction))
    control, told = sampled_on(controller, machine, slip_rule)
    places = rows_at(output, machine.sample_time, duration)
    asked = (own, control, reference, duration, places, initial)
    local = sub_step_tolerance(machine, tolerance)
    runs = [_run(*asked, local, metered)]
    substeps = int(runs[0].laid.now["taken"])
    if check and runs[0].code == 0:
        finer = FINER * min(local, TOLERANCE)
        runs.append(_run(*asked, finer, False))
        if runs[1].laid.now["short"]:
            runs.append(_run(*asked, finer, False, FINEST - 1))
    meta: dict[str, Any] = {
        "what": "simulation", "version": stickslip.__version__, "integrator": "machine", "slip_rule": slip_rule,
        "slip_rules": slip_rules(friction=own.contact.friction, **told.pop("laws")),
        "tolerance": tolerance, "sub_step_tolerance": local, "duration": duration,
        "ended": runs[0].ended, "inertia": machine.inertia,
        "friction": own.contact.friction.as_dict(), "machine": machine.as_dict(), "reference": reference.as_dict(),
        "sample_time": machine.sample_time, "counts": {"samples": runs[0].samples, "substeps": substeps}, **told,
    }  # fmt: skip
    if not runs[0].laid.machine["located"]:
        meta["general_step"] = cannot_locate(own)
    if learned := after(controller, runs[0].state, machine.sample_time):
        meta["learned"] = learned
    meta |= _results(runs, local, metered)
    columns = np.ascontiguousarray(runs[0].rows.T)
    left_out = ("time", *(() if machine.flexible else OF_DRIVETRAINS))
    channels = {name: columns[i] for i, name in enumerate(COLUMNS) if name not in left_out}
    record = Record(columns[0], channels, {name: UNITS[name] for name in channels}, meta)
    if runs[0].code:
        ended = runs[0].ended
        raise Divergence(
            f"the run ended at {ended:.6g} s: {_why(machine, controller, runs[0])}", ended, record
        )
    return record


def _why(machine: Machine, controller: Controller, ran: _Ran) -> str:
    """Why a run ended early, with what to do."""
    if ran.code == NO_NUMBER:
        return no_torque(controller, ran.memory, ran.ended, machine.sample_time)
    if ran.code == TRIPPED:
        return "the drive switched off: faster than its encoder follows, or no longer a number"
    amplifier = machine.amplifier
    most = min(controller.torque_limit, amplifier.torque_constant * amplifier.current_limit)
    return f"{REASONS[DIVERGED][1]}; {calmed(most, machine.sample_time)}"


def sub_step_tolerance(machine: Machine, tolerance: float) -> float:
    """What a sub-step of a machine may be wrong by in a run that is to be right to `tolerance`, rad."""
    return (READ if machine.encoder.counts else EXACT) * tolerance


def _results(runs: list[_Ran], tolerance: float, metered: bool) -> dict[str, Any]:
    """How far two runs lie apart, where there are two, and the metrics of the first."""
    out: dict[str, Any] = {}
    if len(runs) > 1:
        apart = math.fsum(_apart(one, other) for one, other in itertools.pairwise(runs))
        out["accuracy"] = {"error_rad": max(SURE * apart, LEAST * float(tolerance))}
    if metered and runs[0].code == 0:
        turns = turning_points(runs[0].meter, runs[0].turns)
        out["metrics"] = {k: float(v) for k, v in metrics(runs[0].meter, turns).items()}
    return out


def _apart(one: _Ran, other: _Ran) -> float:
    """Largest distance of two runs, rad; what a repeated run did not come through is not known to be right."""
    if other.code:
        return math.inf
    return float(np.max(np.abs(one.rows[:, AT] - other.rows[:, AT]), initial=0.0))


def sampled_on(
    controller: Controller, machine: Machine, slip_rule: str | None = None
) -> tuple[Sampled, dict[str, Any]]:
    """The controller compiled for a machine's samples, and what a record says of it (``laws``: friction laws in it).

    Raises
    ------
    InputError
        If it is meant for another sample time, or brings an encoder of its own.
    """
    own = sampled_by(controller, machine.sample_time, f"machine {machine.name}")
    own = ruled_in(_filtered_as(own, machine), slip_rule)
    return compiled(own), {**own.described(), "laws": own.frictions}


def _filtered_as(controller: Controller, machine: Machine) -> Controller:
    """The machine's own low-pass, where the compensator brings none: as a rig of this machine has it."""
    if controller.encoder_counts not in (0.0, machine.encoder.counts):
        raise InputError(
            f"controller: encoder_counts = {controller.encoder_counts:g}, the machine {machine.name} has an encoder of "
            f"its own ({machine.encoder.counts:g}); leave it out"
        )
    compensator = controller.compensator
    if compensator is None:
        return controller
    compensator = replace(compensator, filter_hz=compensator.filter_hz or machine.filter or None)
    return replace(controller, compensator=compensator)


def rows_at(
    output: float | Array, sample_time: float, duration: float
) -> np.ndarray[Any, np.dtype[np.int64]]:
    """The samples that are rows of the record.

    Raises
    ------
    InputError
        If a time lies between samples.
    """
    last = math.floor(duration / sample_time * (1.0 + 1e-12))
    if is_number(output):
        output = float(cast(float, output))
        every = max(1, round(output / sample_time))
        times = np.arange(0, last + 1, every)
        if abs(every * sample_time - output) > ON_TIME * sample_time and output > sample_time:
            raise InputError(
                f"simulate: output = {output:g} s is no whole number of the machine's samples of {sample_time:g} s; "
                f"give {every * sample_time:g} s"
            )
        return times
    places = np.asarray(output, dtype=np.float64) / sample_time
    whole = np.rint(places)
    if places.size and float(np.max(np.abs(places - whole))) > ON_TIME:
        raise InputError(
            f"simulate: output times must be those of the machine's samples, {sample_time:g} s apart"
        )
    return np.unique(whole.astype(np.int64))


class _Ran:
    """What a run left."""

    def __init__(self, loop: Loop, output: Output, code: int):
        self.laid, self.state, self.code = loop.laid, loop.control.state, code
        self.memory = loop.control.memory
        self.samples, rows = (int(count) for count in output.counts)
        self.rows, self.meter, self.turns = output.rows[:rows], output.acc, output.turns
        self.ended = self.samples * float(loop.laid.machine["sample_time"])


def _run(
    machine: Machine, control: Sampled, reference: Reference, duration: float,
    places: np.ndarray[Any, np.dtype[np.int64]], initial: tuple[float, float], tolerance: float, metered: bool,
    finest: int = FINEST,
) -> _Ran:  # fmt: skip
    """One run from rest in the contact, whose sub-steps are halved so often at most."""
    laid = lay_out_machine(machine, tolerance)
    laid.machine["finest"] = finest
    stand_at(laid, *initial)
    samples = math.floor(duration / machine.sample_time * (1.0 + 1e-12))
    own = control._replace(memory=control.memory.copy(), state=control.state.copy())
    kind = reference.kind
    profile = compiled_profile(kind.name, kind.profile, Layout.of(kind.fields, counted=True))
    loop = Loop(
        laid, own, profile, flat(kind.pack(reference.parameters)), np.array(Surroundings()), np.zeros(3)
    )
    output = Output(
        places, np.zeros((places.size, len(COLUMNS))),
        new_meter(samples * machine.sample_time, settle_band_of(reference, duration)), np.zeros((4096, 2)),
        np.zeros((SIGNALS, 5)), np.zeros(2, dtype=np.int64), metered,
    )  # fmt: skip
    return _Ran(loop, output, int(drive(loop, samples, output)))
