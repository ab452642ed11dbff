"""A machine as a file describes it: axis, friction, amplifier, encoder, sensor, and all that spoils the response.

`Machine.without` switches imperfections off, one at a time or several, so that one can ask which of them does what.
`stickslip.machines.files` reads one from its file.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, cast

from stickslip.core.arguments import arguments_checked, constructor_named, insist_on_own
from stickslip.core.description import Par
from stickslip.core.errors import ModelRemark, ParameterError, UnknownName
from stickslip.machines.contact import Bearings, Contact, Drift, Heat
from stickslip.machines.described import described
from stickslip.machines.drivetrain import FREE, Drivetrain, LinearContact
from stickslip.machines.encoder import Encoder
from stickslip.machines.flexible import FlexibleAxis
from stickslip.machines.motor import Amplifier, Converter, Harmonics
from stickslip.machines.two_mass import TwoMassAxis
from stickslip.models.model import Model, level_of_caller

UNITY, NONE, EXACT, EXACTLY = Amplifier(1.0), Harmonics(), Encoder(), Converter()


@constructor_named
@described
@dataclass(frozen=True)
class Sensor:
    """The torque sensor at the clutch.

    Attributes
    ----------
    converter : Converter
        What its signal goes to, N·m.
    """

    noise: Annotated[float, Par("N·m", "", "RMS noise", lower=0.0)] = 0.0
    converter: Converter = EXACTLY

    def __post_init__(self) -> None:
        insist_on_own(self, "sensor")
        if not (self.noise >= 0.0 and math.isfinite(self.noise)):
            raise ParameterError(f"sensor: noise = {self.noise:g} N·m must be a finite number of at least 0")


SILENT = Sensor()
SHORT_DELAY, LONGEST_DELAY = 0.01, 100.0
"""Samples: a delay below may be meant in s; more than any drive has, and than `stability` takes."""


@constructor_named
@described
@dataclass(frozen=True)
class Machine:
    """A virtual machine.

    Attributes
    ----------
    name, title : str
    flexible : FlexibleAxis, TwoMassAxis or None
        None: rigid.
    contact : Contact
        Friction on the last inertia; `flexible_stiffness` is that of its springs there, where its law has them as the
        encoder sees them.
    amplifier : Amplifier
    cogging : Harmonics
        N·m
    encoder : Encoder
    sensor : Sensor
    limits : mapping of str to float
        ``torque``, ``temperature``, ``following_error``, ``stop_time``: what a rig of this machine declares.
    models : mapping of str to Model
        Compensators' models that someone identified on it (the thesis's tables), by name.
    notes : tuple of str
        What the file says about its own numbers.
    switched_off : tuple of str
        Imperfections that `without` left out.
    delay : float
        Samples by which a command acts late, 0 to 100, of which parts count: 0.2 ms at 1 kHz are 0.2.

    Warns
    -----
    ModelRemark
        Where its friction law has a band of velocities at rest (Karnopp), which a machine has not, or its delay is so
        short that it may be in s (`remark`).
    """

    name: str
    inertia: Annotated[float, Par("kg·m²", "J", "inertia of the whole axis", positive=True)]
    contact: Contact
    title: str = ""
    flexible: FlexibleAxis | TwoMassAxis | None = None
    flexible_stiffness: Annotated[
        float,
        Par(
            "N·m/rad",
            "",
            "total stiffness of the contact at the disk, its springs' ratios kept; 0 leaves it as the law has it",
            lower=0.0,
        ),
    ] = 0.0
    amplifier: Amplifier = UNITY
    cogging: Harmonics = NONE
    encoder: Encoder = EXACT
    sensor: Sensor = SILENT
    delay: Annotated[
        float,
        Par(
            "samples", "", "samples by which a command acts late, parts of them too, and not s: s over sample_time",
            lower=0.0, upper=LONGEST_DELAY,
        ),
    ] = 0.0  # fmt: skip
    filter: Annotated[
        float,
        Par(
            "Hz",
            "",
            "corner of the low-pass on the velocity that feedback sees by default; 0 for none",
            lower=0.0,
        ),
    ] = 0.0
    sample_time: Annotated[float, Par("s", "T", "sample time of its controller", positive=True)] = 1e-3
    seed: Annotated[int, Par("-", "", "seed of every noise", lower=0.0, whole=True)] = 0
    limits: Mapping[str, float] = field(default_factory=dict[str, float])
    models: Mapping[str, Model] = field(default_factory=dict[str, Model])
    notes: tuple[str, ...] = ()
    switched_off: tuple[str, ...] = ()
    start_angle: Annotated[
        float,
        Par("rad", "", "angle of the shaft where positions count from: where a run meets ripple and cogging"),
    ] = 0.0

    def __post_init__(self) -> None:
        insist_on_own(self, "machine")
        if not (self.inertia > 0.0 and math.isfinite(self.inertia)):
            raise ParameterError(
                f"machine: inertia = {self.inertia:g} kg·m² must be greater than 0 and finite"
            )
        if self.flexible and abs(self.flexible.inertia / self.inertia - 1.0) > 1e-6:
            raise ParameterError(
                f"machine: the inertias of its train add up to {self.flexible.inertia:g} kg·m², not to inertia = "
                f"{self.inertia:g}; make them agree"
            )
        self._has_springs_to_stiffen()
        if not 0.0 <= self.delay <= LONGEST_DELAY:
            raise ParameterError(
                f"machine: delay = {self.delay:g} must be from 0 to {LONGEST_DELAY:g}, in samples (s over sample_time)"
            )
        if not (self.sample_time > 0.0 and math.isfinite(self.sample_time)):
            raise ParameterError(
                f"machine: sample_time = {self.sample_time:g} s must be greater than 0 and finite"
            )
        if not math.isfinite(self.start_angle):
            raise ParameterError(f"machine: start_angle = {self.start_angle:g} rad must be a finite number")
        self._positive_up_to_its_speed()
        if (words := self.remark) and (level := level_of_caller(4)):
            warnings.warn(f"machine: {words}", ModelRemark, stacklevel=level)

    @property
    def remark(self) -> str:
        """What is seldom meant, or not as its friction law says, in a sentence; "" where there is nothing."""
        return "; ".join(said for said in (self._short_delay, self._band) if said)

    @property
    def _short_delay(self) -> str:
        if not 0.0 < self.delay < SHORT_DELAY:
            return ""
        return (
            f"delay = {self.delay:g} is in samples, so that a command acts {self.delay * self.sample_time:.3g} s late; "
            f"is it in s? Then it is {self.delay / self.sample_time:g} samples (s over sample_time)"
        )

    @property
    def _band(self) -> str:
        law = self.friction.law
        if law.rest_band is None:
            return ""
        band = law.rest_band(self.friction.parameters)
        return (
            f"law {law.name!r} counts what is slower than {band:g} rad/s as at rest; the contact of a machine rests at "
            "0 rad/s alone: within that band it slides with the torque that the law withstands; take 'stribeck_plain', "
            "which has no band, or an ideal axis, which has it"
        )

    def _has_springs_to_stiffen(self) -> None:
        given = (
            f"machine: flexible_stiffness = {self.flexible_stiffness:g} N·m/rad (contact_stiffness in a file)"
        )
        if not (self.flexible_stiffness >= 0.0 and math.isfinite(self.flexible_stiffness)):
            raise ParameterError(f"{given} must be a finite number of at least 0")
        if self.flexible and self.flexible_stiffness > 0.0 and self.contact_stiffness == 0.0:
            raise ParameterError(
                f"{given} is of the contact's springs, and law {self.friction.law.name!r} has none; leave it out"
            )

    def _positive_up_to_its_speed(self) -> None:
        """Friction opposes the motion up to the encoder's speed (beyond 74 rad/s thesis Table 10's does not)."""
        clutch, top = self.clutch, self.encoder.max_speed
        steady, p = clutch.law.steady, clutch.parameters
        if steady is None or not math.isfinite(top):
            return
        for i in range(1, 201):
            for v in (top * i / 200.0, -top * i / 200.0):
                if steady(v, p) * v < 0.0:
                    raise ParameterError(
                        f"machine: friction helps the motion at {v:g} rad/s; lower encoder.max_speed or fix friction"
                    )

    def __hash__(self) -> int:
        return hash((self.name, self.inertia, self.contact, self.seed))  # Its mappings have none.

    @property
    def friction(self) -> Model:
        """The whole friction of the axis as its motor sees it."""
        return self.contact.friction

    @cached_property
    def clutch(self) -> Model:
        """The law at the friction disk, with the springs it has there."""
        return self.contact.clutch(self.spring_factor)

    @property
    def spring_factor(self) -> float:
        """Stiffness at the disk over the printed one."""
        if self.flexible is None or self.flexible_stiffness == 0.0:
            return 1.0
        return self.flexible_stiffness / self.contact_stiffness

    @property
    def contact_stiffness(self) -> float:
        """Total stiffness of the law as written, N·m/rad; 0 where it has no spring."""
        values: dict[str, Any] = self.contact.friction.parameters._asdict()
        springs: Any = values.get("k", values.get("sigma0", 0.0))
        # A single k is the slope of a static law over the velocity, no spring.
        return (
            math.fsum(cast("tuple[float, ...]", springs))
            if isinstance(springs, tuple)
            else float(values.get("sigma0", 0.0))
        )

    @property
    def visible_stiffness(self) -> float:
        """Total pre-sliding stiffness at the encoder, N·m/rad: contact and shaft in series, beside the bearings."""
        own = self.contact_stiffness * self.spring_factor
        seen = self.flexible.visible(own) if self.flexible and own > 0.0 else own
        beside = self.contact.bearings.stiffness if self.contact.bearings.coulomb > 0.0 else 0.0
        return seen + beside

    @property
    def stuck_bearings(self) -> LinearContact:
        """The bearings for small motion: they stick like their spring, and are viscous always."""
        bearings = self.contact.bearings
        return LinearContact(bearings.stiffness if bearings.coulomb > 0.0 else 0.0, bearings.viscous)

    @arguments_checked
    def linear(self, contact: LinearContact = FREE, bearings: LinearContact | None = None) -> Drivetrain:
        """This machine as a linear system: inertias, springs, current loop and encoder, without noise and delay.

        Parameters
        ----------
        contact : LinearContact
            What its friction is for the motion in question (`stickslip.analyse.presliding_loop.describing`); left out,
            the contact slides and its torque is an input (``load``).
        bearings : LinearContact, optional
            What its bearings are (`stuck_bearings`); left out, they slide and are viscous.

        Returns
        -------
        Drivetrain
            ``.state_space()`` gives A, B, C with the names of states and inputs, ``.chain.modes()`` the free modes.
        """
        flexible, encoder = self.flexible, self.encoder
        return Drivetrain(
            flexible.inertias if flexible else (self.inertia,),
            flexible.springs if flexible else (),
            contact,
            flexible.dampers if flexible else (),
            encoder=flexible.encoder_at if flexible else 0,
            encoder_mode=encoder.mode if encoder.mode_share > 0.0 else 0.0,
            encoder_damping=encoder.mode_damping,
            encoder_share=encoder.mode_share,
            amplifier=self.amplifier.bandwidth,
            bearings=bearings or LinearContact(0.0, self.contact.bearings.viscous),
        )

    @arguments_checked
    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the TOML file that `stickslip.load_machine` reads; its name is the machine's there.

        Parameters
        ----------
        path : path
            Ends with .toml. A file that is there is overwritten.

        Raises
        ------
        InputError
            If it does not, the file cannot be written, or the amplifier's two converters differ: a file has one.
        """
        from stickslip.machines.written import write_machine

        return write_machine(self, path)

    @arguments_checked
    def without(self, *names: str) -> Machine:
        """This machine with imperfections switched off.

        Parameters
        ----------
        *names : str
            Of `IMPERFECTIONS`.

        Raises
        ------
        UnknownName
            If there is no such imperfection.
        """
        out = self
        for name in names:
            if name not in IMPERFECTIONS:
                raise UnknownName("imperfection", name, IMPERFECTIONS)
            out = replace(
                IMPERFECTIONS[name](out), switched_off=tuple(dict.fromkeys((*out.switched_off, name)))
            )
        return out

    def as_dict(self) -> dict[str, Any]:
        """What a record says of the machine: plain data."""
        return {
            "name": self.name, "inertia": self.inertia, "friction": self.contact.friction.as_dict(),
            "visible_stiffness": self.visible_stiffness, "seed": self.seed,
            "without": list(self.switched_off),
        }  # fmt: skip


def _contact(**changes: Any) -> Callable[[Machine], Machine]:
    return lambda m: replace(m, contact=replace(m.contact, **changes))


def _amplifier(**changes: Any) -> Callable[[Machine], Machine]:
    return lambda m: replace(m, amplifier=replace(m.amplifier, **changes))


def _exact_converters(m: Machine) -> Machine:
    return replace(
        m, amplifier=replace(m.amplifier, command=Converter(), monitor=Converter()),
        sensor=replace(m.sensor, converter=Converter()),
    )  # fmt: skip


IMPERFECTIONS: Mapping[str, Callable[[Machine], Machine]] = {
    "flexibility": lambda m: replace(m, flexible=None),
    "encoder-mode": lambda m: replace(m, encoder=replace(m.encoder, mode=0.0)),
    "encoder-counts": lambda m: replace(m, encoder=replace(m.encoder, counts=0.0)),
    "encoder-noise": lambda m: replace(m, encoder=replace(m.encoder, noise=0.0)),
    "bearings": _contact(bearings=Bearings()),
    "position": _contact(ripple=Harmonics()),
    "direction": _contact(direction=(1.0, 1.0)),
    "drift": _contact(drift=Drift()),
    "temperature": _contact(heat=Heat()),
    "cogging": lambda m: replace(m, cogging=Harmonics()),
    "bandwidth": _amplifier(bandwidth=math.inf),
    "current-limit": _amplifier(current_limit=math.inf),
    "converters": _exact_converters,
    "current-noise": _amplifier(current_noise=0.0, monitor_noise=0.0),
    "sensor-noise": lambda m: replace(m, sensor=replace(m.sensor, noise=0.0)),
    "delay": lambda m: replace(m, delay=0.0),
    "velocity-filter": lambda m: replace(m, filter=0.0),
}
"""What can be switched off, by name."""
