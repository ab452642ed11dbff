"""Candidates for what to switch on, simulated on the machine as it was identified.

`stickslip.recommend.recommend`, which needs a model only, has a rigid axis: a feedback that it finds safe may
ring on this one. Here are two inertias on a spring, the friction found with its ripple, the delay and the encoder's
resolution, run by the procedure that then runs on the machine itself. Friction is not known to better than a few
percent, so that a candidate must be calm, and is judged, with less and with more than was found.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from stickslip.analyse.tracking import tracking_metrics
from stickslip.control.compensator import COMPENSATORS
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.errors import LimitCrossed
from stickslip.identify.response.drivetrain import FittedDrivetrain
from stickslip.identify.response.nyquist import Fastest
from stickslip.machines.angle import AngleMap
from stickslip.machines.contact import Contact, Drift
from stickslip.machines.encoder import Encoder
from stickslip.machines.machine import Machine
from stickslip.machines.motor import Amplifier, Harmonics
from stickslip.model import Model
from stickslip.recommend.recommend import laws_of
from stickslip.record import Record, encoder_step
from stickslip.rigs.procedures.base import Plan, perform
from stickslip.rigs.procedures.moves import ROOM
from stickslip.rigs.procedures.track import Track
from stickslip.rigs.rig import Rig
from stickslip.rigs.virtual import VirtualRig

MARGIN = 2.0
"""The bandwidth from which on a PD rings, over the one recommended: 6 dB at the mode that rings."""
DAMPING = 1.0
LEVELS = (1.0, 0.97, 1.03)
"""Friction over what was identified, at which a setting must be calm; the mean of the errors' logarithms counts."""
GAINS = (1.0, 0.9, 0.8)
LEADS = (0.5, 1.0, 2.0)
"""In samples."""
ALIKE = 0.98
"""Of the error, that a lead must leave at most to be worth it."""
CALM = 0.05
"""Of the reference's amplitude: motion above 5 Hz, RMS, up to which a run is calm, on the sinusoid and at rest after a
step."""
ELEMENTS = ("k", "alpha", "c")
"""What GMS has besides its sliding curve."""
STIFFEST = 50.0
"""Contact over shaft where the encoder cannot tell it from a rigid one."""
SETTLED = 1e-3
"""s after which the factor on friction holds."""


NOTHING = AngleMap()
Compensation = tuple[Model, str, float, float]
"""Law, structure, gain and lead (s) of a compensator."""


@dataclass(frozen=True)
class Following(Track):
    """`Track` with a controller and a map that are at hand."""

    using: Controller | None = None
    over: AngleMap = NOTHING

    def made(self, rig: Rig) -> Controller:
        """The one that was given."""
        assert self.using is not None
        return self.using

    def angle(self) -> AngleMap:
        """The one that was given."""
        return self.over

    def plan(self, rig: Rig) -> Plan:
        """As `Track`, with what the controller has."""
        assert self.using is not None
        compensator, whole = self.using.compensator, super().plan(rig)
        what = f"{compensator.name} of law {compensator.model.law.name!r}" if compensator else "the PD alone"
        return dataclasses.replace(whole, text=(f"follow {self.reference}, {what}",))

    def options(self) -> dict[str, Any]:
        """Plain data."""
        assert self.using is not None
        used = self.using.compensator
        return {
            "reference": self.reference, "gains": self.using.numbers(),
            "compensator": used
            and {"kind": used.name, "gain": used.gain, "lead": used.lead, **used.model.as_dict()},
            "angle": self.over.as_dict(),
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of the machine.

    Attributes
    ----------
    inertia : float
        kg·m²
    model : Model
        Friction as the encoder sees it.
    angle : AngleMap
    drivetrain : FittedDrivetrain
    stiffness : float
        Before sliding, at the encoder, N·m/rad.
    resolution : float
        Of the position, rad.
    fastest : Fastest
        PD from which on the loop rings.
    """

    inertia: float
    model: Model
    angle: AngleMap
    drivetrain: FittedDrivetrain
    stiffness: float
    resolution: float
    fastest: Fastest

    @property
    def bandwidth(self) -> float:
        """Of the PD recommended, Hz."""
        return self.fastest.bandwidth / MARGIN

    def machine(self, rig: Rig, level: float = 1.0) -> Machine:
        """The machine to simulate, with `level` times the friction; its offset is left out, as in the compensator."""
        axis = self.drivetrain.axis
        stiff = 0.0
        if axis:
            most = STIFFEST * axis.elasticity
            stiff = min(axis.behind(self.stiffness), most)
        beside = self.angle.beside
        turned = Harmonics(beside.order, beside.amplitude, tuple(p + math.pi for p in beside.phase))
        return Machine(
            "identified", self.inertia,
            Contact(self.model, self.angle.ripple, drift=Drift(level - 1.0, SETTLED) if level != 1.0 else Drift()),
            flexible=axis, flexible_stiffness=stiff, amplifier=Amplifier(1.0, rig.limits.torque),
            cogging=turned, encoder=Encoder(2.0 * math.pi / self.resolution if self.resolution > 0.0 else 0.0),
            delay=min(max(self.drivetrain.delay, 0.0), 1.0), sample_time=rig.sample_time,
            limits={"torque": rig.limits.torque, "following_error": rig.limits.following_error},
        )  # fmt: skip


@dataclass(frozen=True)
class Candidate:
    """One setting on the identified machine.

    Attributes
    ----------
    law, kind : str
    gain : float
    lead : float
        s, by which a feedforward looks ahead of the reference.
    errors : tuple of float
        RMS error on the slow sinusoid at `LEVELS`, rad; up to the first at which it is not calm.
    restless : str
        Why it is not calm; empty where it is.
    """

    law: str
    kind: str
    gain: float
    lead: float = 0.0
    errors: tuple[float, ...] = ()
    restless: str = ""

    def compensation(self, model: Model) -> Compensation:
        """With a law."""
        return model, self.kind, self.gain, self.lead

    @property
    def error(self) -> float:
        """Geometric mean of the errors, rad."""
        return math.exp(math.fsum(math.log(e) for e in self.errors) / len(self.errors))


def resolution_of(record: Record) -> float:
    """The least step of the position, rad; 0 where it is continuous."""
    return encoder_step(record["position"][:20000])


def controller_of(
    known: Known, rig: Rig, bandwidth: float, compensation: Compensation | None = None
) -> Controller:
    """The PD, with the compensator or without."""
    gains = place("PD", known.inertia, bandwidth, DAMPING)
    limit = ROOM * rig.limits.torque - known.angle.largest
    if compensation is None:
        return Controller(gains, None, limit, rig.sample_time)
    model, kind, gain, lead = compensation
    return Controller(
        gains, COMPENSATORS[kind](known.angle.on(model), gain, lead=lead), limit, rig.sample_time
    )


def laws_to_try(model: Model, lugre: Model | None) -> dict[str, Model]:
    """The law found, Coulomb with viscous friction, and LuGre with its own springs and the same sliding curve."""
    laws = laws_of(model)
    if lugre is not None:
        own: Any = lugre.parameters
        curve: dict[str, Any] = {
            k: list(cast("tuple[float, ...]", v)) if isinstance(v, tuple) else v
            for k, v in model.parameters._asdict().items()
            if k not in ELEMENTS
        }
        choices = {c: o for c, o in model.law.chosen.items() if c in ("curve", "viscous")}
        laws["lugre"] = Model("lugre", choices, sigma0=own.sigma0, sigma1=own.sigma1, **curve)
    return laws


def candidates_of(known: Known, rig: Rig, laws: Mapping[str, Model]) -> list[Candidate]:
    """Every law both ways at every gain, simulated."""
    plants = [known.machine(rig, level) for level in LEVELS]
    return [
        judged(known, rig, plants, laws[name], Candidate(name, kind, gain))
        for name, kind, gain in itertools.product(laws, COMPENSATORS, GAINS)
    ]


def with_lead(known: Known, rig: Rig, model: Model, chosen: Candidate) -> Candidate:
    """The feedforward with the lead that leaves the least error; none where it is all but alike."""
    if chosen.kind != "feedforward":
        return chosen
    plants = [known.machine(rig, level) for level in LEVELS]
    led = [
        judged(known, rig, plants, model, dataclasses.replace(chosen, lead=n * rig.sample_time))
        for n in LEADS
    ]
    best = chosen_of(led, ALIKE * chosen.error)
    return best if best else chosen


def judged(known: Known, rig: Rig, plants: Sequence[Machine], model: Model, setting: Candidate) -> Candidate:
    """The setting with what it does on every machine, up to the first on which it is not calm."""
    controller = controller_of(known, rig, known.bandwidth, setting.compensation(model))
    errors: list[float] = []
    restless = ""
    for plant in plants:
        error, restless = simulated(plant, controller, known.angle)
        errors.append(error)
        if restless:
            break
    return dataclasses.replace(setting, errors=tuple(errors), restless=restless)


def simulated(plant: Machine, controller: Controller, angle: AngleMap) -> tuple[float, str]:
    """RMS error on the slow sinusoid, rad, and why it is not calm."""
    beside = dataclasses.replace(angle, offset=0.0)
    error = math.inf
    for reference, measure, where in (
        ("low", "position_above_5Hz_rms_rad", "in motion"), ("step", "late_oscillation_rad", "at rest"),
    ):  # fmt: skip
        try:
            done = perform(
                Following(reference=reference, using=controller, over=beside, wait=0.0), VirtualRig(plant)
            )
        except LimitCrossed as stopped:
            return math.inf, str(stopped)
        found = tracking_metrics(done.record)
        if reference == "low":
            error = found["position_rms_rad"]
        amplitude = 0.5 * float(np.ptp(done.record["position_reference"]))
        if found[measure] > CALM * amplitude:
            return error, f"oscillates {where}: {1e3 * found[measure]:.2g} mrad RMS above 5 Hz"
    return error, ""


def chosen_of(candidates: Sequence[Candidate], alone: float) -> Candidate | None:
    """The calm one with the least error, if that is below the linear controller's."""
    calm = [c for c in candidates if not c.restless and c.error < alone]
    return min(calm, key=lambda c: c.error) if calm else None
