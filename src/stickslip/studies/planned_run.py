"""One closed loop of a study: what it is made of, its name, and the fingerprint of all that its numbers depend on."""

from __future__ import annotations

import functools
import hashlib
import json
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from stickslip.control.controller import Controller
from stickslip.core.errors import ConfigError, InputError, SimulationError
from stickslip.core.record import Record
from stickslip.machines.machine import Machine
from stickslip.machines.numbers import machine_numbers
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Reference
from stickslip.simulation.closed_loop import check_machine_run, prepare, run_case, simulate
from stickslip.simulation.integrators import integrator_for
from stickslip.studies.build import Numerics
from stickslip.studies.provenance import engine_hash, source_hash

OWN = "own"
"""What stands for the slip rule in the name of a run whose laws keep rules of their own."""
INERTIA = "inertia_feedforward"
"""The feedforward that compensates no friction."""
FAMILIES = ("slip_rule", "reference", "friction", "controller")


@dataclass(frozen=True)
class Executed:
    """A run that has been simulated: its record, why it ended early (or nothing), its CPU time in s."""

    record: Record
    failure: str
    seconds: float

    @property
    def metrics(self) -> dict[str, float]:
        """Metrics by name; empty if the run ended early."""
        return dict(self.record.meta.get("metrics", {}))


@dataclass(frozen=True)
class PlannedRun:
    """One closed loop to be run, with the names by which the study calls its parts."""

    slip_rule: str
    reference: str
    friction: str
    controller: str
    axis: RigidAxis | Machine
    control: Controller
    motion: Reference
    duration: float
    numerics: Numerics

    def __getstate__(self) -> dict[str, Any]:
        """Without the fingerprint: another process finds its own, of its own version of the package."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    def key(self) -> str:
        """`slip_rule/reference/friction/controller`."""
        return f"{self.slip_rule}/{self.reference}/{self.friction}/{self.controller}"

    @property
    def names(self) -> Mapping[str, str]:
        """Its name in every family of names, by which `stickslip study --only` finds it."""
        return {family: getattr(self, family) for family in FAMILIES}

    @property
    def compensation(self) -> str:
        """How the controller compensates friction: ``"feedforward"`` on the reference, ``"feedback"`` on what is
        measured (observers, and loops that are not linear), or ``""`` for a linear controller alone."""
        laws = [block.law for block in self.control.blocks.values()]
        if any(law.place == "observer" or (law.place == "loop" and not law.is_linear) for law in laws):
            return "feedback"
        ahead = any(law.place == "feedforward" and law.name != INERTIA for law in laws)
        return "feedforward" if ahead else ""

    @property
    def rule(self) -> str | None:
        """The slip rule that the file gives for the whole run; None where each law keeps its own."""
        return None if self.slip_rule == OWN else self.slip_rule

    @functools.cached_property
    def fingerprint(self) -> str:
        """A hash of everything that determines the run's numbers."""
        return hashlib.sha256(json.dumps(self.content(), sort_keys=True).encode()).hexdigest()

    def content(self) -> dict[str, Any]:
        """What the fingerprint is made of."""
        laws = [self.axis.friction.law, *(m.law for m in self.control.frictions.values())]
        return {
            "slip_rule": self.slip_rule,
            "inertia": self.axis.inertia,
            "friction": self.axis.friction.as_dict(),
            **({"machine": described(self.axis)} if isinstance(self.axis, Machine) else {}),
            "controller": self.control.as_dict(),
            "reference": self.motion.as_dict(),
            "duration": self.duration,
            "numerics": asdict(self.numerics),
            "laws": [source_hash(law.Params.__module__) for law in (*laws, *self.control.control_laws)],
            "engine": engine_hash(),
        }

    def check(self) -> None:
        """Find what is wrong with the run without running it; compiles its laws.

        Raises
        ------
        InputError
        """
        n = self.numerics
        try:
            if isinstance(self.axis, Machine):
                check_machine_run(
                    self.axis, self.control, self.duration, n.output, n.integrator, slip_rule=self.rule
                )
                return
            case = prepare(
                self.axis, self.control, self.motion, self.duration,
                tolerance=n.tolerance, slip_rule=self.rule, output=n.output,
            )  # fmt: skip
            integrator_for(case, n.integrator)
        except InputError as error:
            raise ConfigError(f"run {self.key}: {error}") from None

    def execute(self, check: bool = False) -> Executed:
        """Simulate it, once its `check` passes; a run that ends early gives what was computed until then.

        With `check` the record's meta has the estimate of its error (`stickslip.simulate`); whether the run depends on
        its start it has anyway where the exact integrator runs it.
        """
        n, start, failure = self.numerics, time.thread_time(), ""
        try:
            if isinstance(self.axis, Machine):
                record = simulate(
                    self.axis, self.control, self.motion, self.duration,
                    slip_rule=self.rule, output=n.output, check=check,
                )  # fmt: skip
            else:
                case = prepare(
                    self.axis, self.control, self.motion, self.duration,
                    tolerance=n.tolerance, slip_rule=self.rule, output=n.output,
                )  # fmt: skip
                record = run_case(case, n.integrator, n.time_step, self.rule, check=check, start=True)
        except SimulationError as error:
            if error.record is None:
                raise
            record, failure = error.record, str(error)
        return Executed(record, failure, time.thread_time() - start)


def described(machine: Machine) -> dict[str, Any]:
    """Everything of a machine that a run's numbers depend on."""
    laws = {name: model.as_dict() for name, model in machine.models.items()}
    return {**machine_numbers(machine), **machine.as_dict(), "sample_time": machine.sample_time,
            "converters": repr((machine.amplifier, machine.sensor, machine.cogging, machine.contact.ripple)),
            "models": laws}  # fmt: skip
