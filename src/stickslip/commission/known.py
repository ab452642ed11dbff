"""The machine as it was identified, to choose on it what to switch on.

Two inertias on a spring, the friction found with its ripple, the delay and the encoder's resolution.

Friction is not known to better than a few percent, so that a setting is tried with less and with more than was found.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, cast

from stickslip.core.record import Record, encoder_step
from stickslip.identification.response.drivetrain import FittedDrivetrain
from stickslip.identification.response.nyquist import Fastest
from stickslip.machines.angle import AngleMap
from stickslip.machines.contact import Contact, Drift
from stickslip.machines.encoder import Encoder
from stickslip.machines.machine import LONGEST_DELAY, Machine
from stickslip.machines.motor import Amplifier
from stickslip.models.model import Model
from stickslip.recommendation.candidate_run import Drive
from stickslip.recommendation.plant import WholeMachine
from stickslip.recommendation.question import laws_of
from stickslip.recommendation.recommend import recommend_on
from stickslip.recommendation.recommendation import Recommendation
from stickslip.rigs.procedures.moves import ROOM
from stickslip.rigs.procedures.track import REFERENCES
from stickslip.rigs.rig import Rig

MARGIN = 2.0
"""The bandwidth from which on a PD rings, over the one recommended: 6 dB at the mode that rings."""
DAMPING = 1.0
LEVELS = (1.0, 0.97, 1.03)
"""Friction over what was identified, with which a setting must be safe."""
GAINS = (0.8, 0.9, 1.0)
ELEMENTS = ("k", "alpha", "c")
"""What GMS has besides its sliding curve."""
STIFFEST = 50.0
"""Contact over shaft where the encoder cannot tell it from a rigid one."""
SETTLED = 1e-3
"""s after which the factor on friction holds."""


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
        """The machine to simulate, with `level` times the friction; the torque over the angle beside friction is left
        out, which is compensated apart."""
        axis = self.drivetrain.axis
        stiff = 0.0
        if axis:
            most = STIFFEST * axis.stiffness
            stiff = min(axis.behind(self.stiffness), most)
        return Machine(
            "identified", self.inertia,
            Contact(self.model, self.angle.ripple, drift=Drift(level - 1.0, SETTLED) if level != 1.0 else Drift()),
            flexible=axis, flexible_stiffness=stiff, amplifier=Amplifier(1.0, rig.limits.torque),
            encoder=Encoder(2.0 * math.pi / self.resolution if self.resolution > 0.0 else 0.0),
            delay=min(max(self.drivetrain.delay, 0.0), LONGEST_DELAY), sample_time=rig.sample_time,
        )  # fmt: skip

    def drive(self, rig: Rig, bandwidth: float) -> Drive:
        """The PD of this bandwidth on the rig, along the slow sinusoid."""
        slow, _ = REFERENCES["low"]
        machine = self.machine(rig)
        return Drive(
            bandwidth, DAMPING, rig.sample_time, machine.encoder.counts,
            ROOM * rig.limits.torque - self.angle.largest, slow.parameters.amplitude, slow.parameters.frequency,
            machine=machine,
        )  # fmt: skip

    def recommendation(self, rig: Rig, laws: dict[str, Model]) -> Recommendation:
        """What to switch on, on this machine with friction at `LEVELS`.

        Raises
        ------
        InputError
            If the PD alone cannot be simulated.
        """
        plants = [WholeMachine.of(self.machine(rig, level)) for level in LEVELS]
        rippled = {name: self.angle.on(model) for name, model in laws.items()}
        return recommend_on(plants, self.drive(rig, self.bandwidth), rippled, self.inertia, GAINS)


def resolution_of(record: Record) -> float:
    """The least step of the position, rad; 0 where it is continuous."""
    return encoder_step(record["position"][:20000])


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
