"""Track: follow the thesis's three references with any controller (4.3.1.2, 4.3.2.2)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from stickslip.control import catalogue
from stickslip.control.belief import believed
from stickslip.control.compensator import COMPENSATORS
from stickslip.control.controller import Controller
from stickslip.control.files import read_controller
from stickslip.control.learned import read_learned, told, write_learned
from stickslip.control.linear import LINEAR, Gains, place
from stickslip.control.recommended import read_recommended
from stickslip.core.config import read_toml
from stickslip.core.errors import InputError, UnknownName
from stickslip.core.record import Record
from stickslip.machines.angle import AngleMap
from stickslip.models.model import Model, Reference
from stickslip.rigs.procedures.base import POSITION, Check, Plan, Procedure, Step, Steps
from stickslip.rigs.procedures.moves import ROOM, samples
from stickslip.rigs.rig import Rig, setpoints

REFERENCES = {
    "low": (Reference("sine", amplitude=0.01, frequency=0.4), 5.0),
    "high": (Reference("sine", amplitude=0.5, frequency=0.1), 20.0),
    "step": (Reference("step", amplitude=0.01, tau=0.02), 3.0),
}
"""Thesis eqs. 3.23 and 3.24, and figure 3.17's step; with their durations, s."""
RECOMMENDED = ("linear", "bandwidth", "damping", "inertia", "gain", "filter", "lead", "deadband", "offset",
               "inertia_feedforward")  # fmt: skip
"""Options that a recommendation sets, because it was simulated and measured with these."""
BESIDE_FILE = ("linear", "bandwidth", "damping", "compensator", "model", *RECOMMENDED[4:], "substeps")
"""Options that the file of a controller defines."""
MADE = tuple(name for name in catalogue.CATALOGUE if name != "none")
"""Compensators of the catalogue."""
HIGHEST = 0.1
"""Largest bandwidth, as a share of the sample rate"""


@dataclass(frozen=True)
class Track(Procedure):
    """Options of the procedure.

    ``reference`` is low, high or step; ``linear`` PD, PID or PR with ``bandwidth`` (Hz), ``damping`` and ``inertia``
    (kg·m²) of its placement; ``compensator`` none, feedforward or feedback with ``model``, a model.toml or the name of
    one of the machine's, its ``gain``, ``filter`` (Hz, 0: the machine's), ``lead`` (s, of feedforward), ``deadband``
    (rad/s), ``offset`` (N·m) and ``inertia_feedforward`` (kg·m²); or recommended: all of that from the ``model``, a
    recommended.toml of `stickslip rig commission` (of this machine) or `stickslip recommend`, and none of it given
    beside it; or one of the catalogue (`stickslip.control.catalogue`: dob, ff-dob, ...), whose numbers follow from
    ``inertia``, ``bandwidth`` and the ``model`` (the machine's LuGre law, where none is given). ``substeps`` divide the
    law's step over a sample, whichever compensator it is. What a file knows of the angle (``[angle]``) is compensated
    as well. Instead of all of it ``controller`` may be a TOML file with a table ``[controller]`` that is made of
    control laws (`stickslip.control.files`; ``friction`` in it may name a model of the machine); ``inertia`` is that of
    the axis where the file has no ``[axis]``. ``learned`` is the TOML file in which what the laws learn is kept from
    run to run, with its uncertainty: it is read where it is there, which only that of this machine and of these laws
    may be, and written at the end. ``duration`` in s (0: the reference's own).
    """

    name: ClassVar[str] = "track"
    title: ClassVar[str] = "follow one of the thesis's references (4.3.1.2)"
    signed: ClassVar[tuple[str, ...]] = ("gain", "offset")

    reference: str = "low"
    controller: str = ""
    linear: str = "PD"
    bandwidth: float = 25.0
    damping: float = 1.0
    inertia: float = 3.8623e-4
    compensator: str = "none"
    model: str = ""
    gain: float = 1.0
    filter: float = 0.0
    lead: float = 0.0
    deadband: float = 0.0
    offset: float = 0.0
    inertia_feedforward: float = 0.0
    substeps: int = 1
    learned: str = ""
    duration: float = 0.0
    wait: float = 1.0

    @classmethod
    def with_options(cls, given: Mapping[str, str]) -> Procedure:
        """As `Procedure`; with a recommendation, options that it sets are refused."""
        beside = [name for name in RECOMMENDED if name in given]
        if beside and given.get("compensator") == "recommended":
            raise InputError(beside_recommended(beside[0], given[beside[0]]))
        beside = [name for name in BESIDE_FILE if name in given]
        if beside and given.get("controller"):
            raise InputError(
                f"{beside[0]} = {given[beside[0]]} cannot be combined with controller = {given['controller']}, which "
                "defines it; leave it out, or write it into the file"
            )
        return super().with_options(given)

    @property
    def motion(self) -> tuple[Reference, float]:
        """Return reference and duration, s."""
        if self.reference not in REFERENCES:
            raise UnknownName("reference", self.reference, REFERENCES)
        reference, seconds = REFERENCES[self.reference]
        return reference, self.duration or seconds

    def made(self, rig: Rig) -> Controller:
        """Return the controller, limited to its share of the rig's torque limit.

        Raises
        ------
        InputError
            If a name is unknown, the model is missing, or the file has no controller of control laws.
        """
        if not self.controller:
            return self.catalogued(rig) if self.compensator in MADE else self.compensated(rig)
        found = read_controller(self.controller, self.inertia, models_of(rig), rig.sample_time)
        limit = ROOM * rig.limits.torque
        return dataclasses.replace(found, torque_limit=min(found.torque_limit, limit))

    def catalogued(self, rig: Rig) -> Controller:
        """Return the controller with a compensator of the catalogue, designed for the machine's assumed law.

        Raises
        ------
        InputError
            If no law is known, or the compensator requires another law or does not fit into the loop.
        """
        known = models_of(rig)
        law = self.law(rig) if self.model or "lugre" not in known else known["lugre"]
        belief = believed(
            law, self.inertia, sample_time=rig.sample_time, torque_limit=ROOM * rig.limits.torque,
            bandwidth=self.bandwidth,
        )  # fmt: skip
        if belief.elements is None and "gms" in known and not self.model:
            belief = dataclasses.replace(belief, elements=known["gms"])
        return dataclasses.replace(catalogue.compensated(self.compensator, self.linear, belief), alone=False)

    def compensated(self, rig: Rig) -> Controller:
        """Return the controller with the compensator of the options."""
        if self.compensator == "recommended":
            loop = read_recommended(self.model)
            made = self.recommended(rig.name).compensated(rig)
            # The rig measures with its own encoder, not with that of the simulation.
            return dataclasses.replace(
                made, gains=loop.linear, velocity_filter=loop.velocity_filter,
                torque_limit=min(made.torque_limit, loop.torque_limit), reference_velocity=loop.reference_velocity,
            )  # fmt: skip
        if self.linear not in LINEAR:
            raise UnknownName("linear controller", self.linear, LINEAR)
        if self.bandwidth * rig.sample_time > HIGHEST:
            raise InputError(
                f"bandwidth = {self.bandwidth:g} Hz is more than a tenth of the sample rate "
                f"{1.0 / rig.sample_time:g} Hz: the torque would jump from limit to limit; take a lower one"
            )
        gains: Gains = place(self.linear, self.inertia, self.bandwidth, self.damping)
        limit = ROOM * rig.limits.torque - self.angle().largest
        if self.compensator == "none":
            return Controller(gains, None, limit, rig.sample_time)
        if self.compensator not in COMPENSATORS:
            names = ("none", *COMPENSATORS, "recommended", *MADE)
            raise UnknownName("compensator", self.compensator, names)
        machine: Any = getattr(rig, "machine", None)
        corner = self.filter or (machine.filter if machine is not None else 0.0)
        corner = corner if math.isfinite(corner) else 0.0
        law = self.angle().on(self.law(rig))
        compensator = COMPENSATORS[self.compensator](
            law,
            self.gain,
            corner or None,
            self.lead,
            self.deadband,
            self.offset,
            self.inertia_feedforward,
            self.substeps,
        )
        return Controller(gains, compensator, limit, rig.sample_time)

    def recommended(self, machine: str) -> Track:
        """Return this with the recommendation of the model's file; without a filter if the file has none.

        Raises
        ------
        InputError
            If the file has no recommendation, is for another machine, or an option that it sets is also given.
        """
        usual = {f.name: f.default for f in dataclasses.fields(Track)}
        for name in RECOMMENDED:
            if getattr(self, name) != usual[name]:
                raise InputError(beside_recommended(name, getattr(self, name)))
        if not self.model.endswith(".toml"):
            raise InputError(
                f"model = {self.model!r} has no recommendation; give the recommended.toml of `stickslip rig commission`"
            )
        found = read_recommended(self.model)
        if found.machine and machine_in(found.machine) != machine_in(machine):
            raise InputError(
                f"{self.model} is recommended for {found.machine!r}, and this is {machine!r}: it may oscillate here; "
                f"commission this machine, or give the settings themselves (compensator={found.compensator}, "
                f"gain={found.gain:g}, ...)"
            )
        return dataclasses.replace(
            self, linear="PD", compensator=found.compensator, bandwidth=found.bandwidth or self.bandwidth,
            damping=found.damping or self.damping,
            inertia=found.inertia, gain=found.gain, filter=found.filter or math.inf, lead=found.lead,
            deadband=found.deadband, offset=found.offset, inertia_feedforward=found.inertia_feedforward,
        )  # fmt: skip

    def angle(self) -> AngleMap:
        """Return the torque over the angle in the model's file; none without a compensator."""
        if self.compensator == "none" or not self.model.endswith(".toml"):
            return AngleMap()
        table = read_toml(Path(self.model))
        return AngleMap.of(table.table("angle").values) if table.has("angle") else AngleMap()

    def law(self, rig: Rig) -> Model:
        """Return the compensator's model."""
        known = models_of(rig)
        if self.model in known:
            return known[self.model]
        if self.model.endswith(".toml"):
            return Model.from_file(self.model)
        raise InputError(
            f"model = {self.model!r}: give a model.toml or one of {', '.join(known) or 'none that the machine has'}"
        )

    def samples(self, rig: Rig) -> Any:
        """Return positions, velocities and accelerations of the reference, shape (n, 3)."""
        reference, seconds = self.motion
        t = rig.sample_time * np.arange(samples(rig, seconds))
        return reference.sample(t)

    def plan(self, rig: Rig) -> Plan:
        """Plan the reference."""
        samples = self.samples(rig)
        self.learned_before(self.made(rig), rig)
        words = f"{self.linear} {self.bandwidth:g} Hz"
        if self.controller:
            words = f"by the controller of {self.controller}"
        if self.compensator == "recommended":
            words = f"as {self.model} recommends"
        elif self.compensator != "none":
            words += f" with {self.compensator} {self.model}"
        if self.compensator != "none" and self.substeps != 1:
            words += f", the law in {self.substeps} steps a sample"
        return Plan(
            len(samples) * rig.sample_time + 0.1, float(np.ptp(samples[:, 0])),
            float(np.max(np.abs(samples[:, 1]))), ROOM * rig.limits.torque,
            (f"follow {self.reference} for {len(samples) * rig.sample_time:g} s: {words}",), self.wait,
        )  # fmt: skip

    def steps(self, rig: Rig) -> Steps:
        """Generate the steps, with the current position as zero of the reference."""
        rows = yield Step(setpoints(round(0.05 / rig.sample_time)), pause=self.wait)
        samples = self.samples(rig)
        position = float(rows[-1, POSITION]) + samples[:, 0]
        sent = setpoints(
            len(samples),
            position=position,
            velocity=samples[:, 1],
            acceleration=samples[:, 2],
            torque=self.angle().torque(position),
            closed=1.0,
        )
        controller = self.made(rig)
        learned = self.learned_before(controller, rig)
        yield Step(sent, controller, keep=True, label=self.reference, learned=learned)
        if self.learned:
            write_learned(Path(self.learned), controller, learned, machine_in(rig.name))

    def learned_before(self, controller: Controller, rig: Rig) -> dict[str, Any]:
        """Return the content of the file ``learned``; nothing if it does not exist yet.

        Raises
        ------
        InputError
            If it is of another machine or other laws, or these do not learn.
        """
        if not self.learned:
            return {}
        if not controller.learned(controller.state()):
            raise InputError(f"learned = {self.learned}: no law of this controller learns; leave it out")
        return read_learned(Path(self.learned), controller, machine_in(rig.name))

    def checks(self, record: Record, rig: Rig) -> tuple[Check, ...]:
        """Report error and torque saturation; both are results, so neither can fail."""
        error = record["position_reference"] - record["position"]
        rms, worst = math.sqrt(float(np.mean(error**2))), float(np.max(np.abs(error)))
        cut = float(np.mean(np.abs(record["torque_command"]) >= 0.999 * ROOM * rig.limits.torque))
        return (
            Check(
                "tracking", True,
                f"error {rms:.4g} rad RMS, {worst:.4g} at most; torque at its limit {100 * cut:.3g} %",
            ),
            *(Check("learned", True, line) for line in told(record.meta)),
        )  # fmt: skip


def models_of(rig: Rig) -> dict[str, Model]:
    """Return the assumed laws of a virtual rig's machine, by name."""
    machine: Any = getattr(rig, "machine", None)
    return dict(machine.models) if machine is not None else {}


def machine_in(rig: str) -> str:
    """Return the machine from a rig's name, without the list of imperfections switched off."""
    return rig.partition(" without ")[0]


def beside_recommended(name: str, value: object) -> str:
    """Return the error for an option that the recommendation sets."""
    return (
        f"{name} = {value} cannot be combined with compensator = recommended, which sets it; leave it out, or "
        "give compensator = "
        f"feedforward or feedback with its own {', '.join(RECOMMENDED)}"
    )


PROCEDURE = Track
