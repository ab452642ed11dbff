"""The short form of a compensator: a friction law with parameters, a gain and a filter on the velocity it sees.

`stickslip.control.composed` gives the control laws that it stands for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from stickslip.core.arguments import constructor_named, insist_on_own
from stickslip.core.errors import ParameterError
from stickslip.core.reprs import making, standard_of
from stickslip.models.model import Model

MOST_SUBSTEPS = 1000


@dataclass(frozen=True, repr=False)
class Compensator:
    """A friction law driven by a velocity.

    Attributes
    ----------
    model : Model
        The law and its parameters.
    gain : float
        Factor on the compensating torque; 1 cancels the whole model.
    filter_hz : float or None
        Corner of a second-order Butterworth low-pass on the velocity, Hz (the 10 Hz of thesis chapter 4).
    lead : float
        Time by which the law looks ahead of the reference, s: its velocity is extended along the last two samples, and
        a reference at rest stays at rest. Only of a feedforward with a sample time.
    deadband : float
        The law sees velocities below it, rad/s, as rest, so that a count of the encoder does not compensate a friction
        that is not there. Only with a sample time.
    offset : float
        Constant torque that acts against positive motion beside friction, N·m: it is given whole, whatever the gain.
        Only with a sample time.
    inertia_feedforward : float
        Inertia whose torque along the reference is given, kg·m² times the reference's acceleration. Only with a sample
        time.
    substeps : int
        Steps of the law into which a sample is divided, the velocity linear in between, 1 to 1000: the error of a step
        falls with them. Only with a sample time.
    """

    model: Model
    gain: float = 1.0
    filter_hz: float | None = None
    lead: float = 0.0
    deadband: float = 0.0
    offset: float = 0.0
    inertia_feedforward: float = 0.0
    substeps: int = 1

    name: ClassVar[str] = ""
    velocity: ClassVar[str] = ""

    def __post_init__(self) -> None:
        insist_on_own(self, self.name)
        if not (self.gain >= 0.0 and math.isfinite(self.gain)):
            raise ParameterError(
                f"{self.name}: gain = {self.gain:g} must be at least 0 and finite; 1 cancels the whole model, and a "
                "negative one would add to the friction"
            )
        if self.filter_hz is not None and not (self.filter_hz > 0.0 and math.isfinite(self.filter_hz)):
            raise ParameterError(f"{self.name}: filter_hz = {self.filter_hz:g} Hz must be greater than 0")
        if not math.isfinite(self.offset):
            raise ParameterError(f"{self.name}: offset = {self.offset:g} N·m must be a finite number")
        for name, value, unit in (
            ("lead", self.lead, "s"), ("deadband", self.deadband, "rad/s"),
            ("inertia_feedforward", self.inertia_feedforward, "kg·m²"),
        ):  # fmt: skip
            if not (value >= 0.0 and math.isfinite(value)):
                raise ParameterError(f"{self.name}: {name} = {value:g} {unit} must be at least 0")
        if not (1 <= self.substeps <= MOST_SUBSTEPS and self.substeps == int(self.substeps)):
            raise ParameterError(
                f"{self.name}: substeps = {self.substeps:g} must be a whole number from 1 to {MOST_SUBSTEPS}"
            )
        if self.lead > 0.0 and self.velocity != "reference":
            raise ParameterError(
                f"{self.name}: lead = {self.lead:g} s needs the reference velocity; leave it out, or use a feedforward"
            )

    def __repr__(self) -> str:
        return making(self, standard_of(Compensator))

    @property
    def sampled(self) -> tuple[str, ...]:
        """The names of what is set and acts on samples only."""
        names = ("lead", "deadband", "offset", "inertia_feedforward")
        set_here = [name for name in names if getattr(self, name) != 0.0]
        return (*set_here, *(["substeps"] if self.substeps != 1 else []))

    def as_dict(self) -> dict[str, Any]:
        """Plain data that says everything about it."""
        numbers = ("gain", "filter_hz", "lead", "deadband", "offset", "inertia_feedforward", "substeps")
        own = {name: getattr(self, name) for name in numbers}
        return {"kind": self.name, **own, **self.model.as_dict()}


@constructor_named
@dataclass(frozen=True, repr=False)
class Feedforward(Compensator):
    """T_hat = gain * law(reference velocity). Its state depends on time alone.

    Attributes
    ----------
    model : Model
        The law and its parameters.
    gain : float
        Factor on the compensating torque; 1 cancels the whole model.
    filter_hz : float or None
        Corner of a second-order Butterworth low-pass on the velocity, Hz.
    lead : float
        Time by which the law looks ahead of the reference, s: its velocity is extended along the last two samples, and
        a reference at rest stays at rest. Only of a feedforward with a sample time.
    deadband : float
        The law sees velocities below it, rad/s, as rest, so that a count of the encoder does not compensate a friction
        that is not there. Only with a sample time.
    offset : float
        Constant torque that acts against positive motion beside friction, N·m: it is given whole, whatever the gain.
        Only with a sample time.
    inertia_feedforward : float
        Inertia whose torque along the reference is given, kg·m² times the reference's acceleration. Only with a sample
        time.
    substeps : int
        Steps of the law into which a sample is divided, the velocity linear in between, 1 to 1000: the error of a step
        falls with them. Only with a sample time.
    """

    name: ClassVar[str] = "feedforward"
    velocity: ClassVar[str] = "reference"


@constructor_named
@dataclass(frozen=True, repr=False)
class Feedback(Compensator):
    """T_hat = gain * law(measured velocity).

    In continuous time the sign of the velocity is the exact limit: it changes where v passes through zero, and
    a feedback that cancels friction repels from there. With a sample time it is what the samples say.

    Attributes
    ----------
    model : Model
        The law and its parameters.
    gain : float
        Factor on the compensating torque; 1 cancels the whole model.
    filter_hz : float or None
        Corner of a second-order Butterworth low-pass on the velocity, Hz.
    lead : float
        0: only a reference can be led.
    deadband : float
        The law sees velocities below it, rad/s, as rest, so that a count of the encoder does not compensate a friction
        that is not there. Only with a sample time.
    offset : float
        Constant torque that acts against positive motion beside friction, N·m: it is given whole, whatever the gain.
        Only with a sample time.
    inertia_feedforward : float
        Inertia whose torque along the reference is given, kg·m² times the reference's acceleration. Only with a sample
        time.
    substeps : int
        Steps of the law into which a sample is divided, the velocity linear in between, 1 to 1000: the error of a step
        falls with them. Only with a sample time.
    """

    name: ClassVar[str] = "feedback"
    velocity: ClassVar[str] = "measured"


COMPENSATORS: dict[str, type[Compensator]] = {kind.name: kind for kind in (Feedforward, Feedback)}
"""By the names that files and the command line use."""
