"""``[recommended]`` of a recommended.toml: which compensator, with what, on which loop.

`stickslip rig commission` and `stickslip recommend` write it beside the law; `stickslip rig run track` and
`stickslip export` run it, with no number given again by hand.
"""

from __future__ import annotations

import math
import os
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any

from stickslip.control.compensator import COMPENSATORS, Compensator
from stickslip.control.controller import Controller
from stickslip.control.files import reference_velocity_in
from stickslip.control.linear import Cascade, Gains, place
from stickslip.control.own_loop import ReferenceVelocity
from stickslip.core.config import Table, read_toml
from stickslip.core.errors import InputError
from stickslip.core.spec import fields_of
from stickslip.models.model import Model


@dataclass(frozen=True)
class Recommended:
    """What is to be switched on.

    Attributes
    ----------
    compensator : str
        "feedforward" or "feedback".
    gain : float
        0: no friction is compensated, inertia and offset alone are fed forward.
    bandwidth, damping : float
        Of the PD's poles, Hz and -.
    inertia : float
        That the PD is placed with, kg·m².
    lead : float
        s, by which a feedforward looks ahead of the reference.
    deadband : float
        rad/s, velocities below which the law sees rest.
    offset : float
        N·m, constant torque against positive motion that is given beside friction's.
    inertia_feedforward : float
        kg·m², times the reference's acceleration: torque that is given too.
    gains : Gains, Cascade or None
        Of the linear loop that it was tried in; None: the PD of bandwidth and damping, which are 0 where gains are
        given.
    velocity_filter : float
        Corner of that loop's low-pass on the velocity, Hz; 0: none.
    filter : float
        Corner of the low-pass on the velocity, Hz; 0: none.
    sample_time : float
        s, for which it was tried; 0: not known.
    machine : str
        On which it was measured; empty where it is a model's.
    torque_limit : float
        N·m, of the drive that it was tried with; infinite where it had none.
    encoder_counts : float
        Counts per revolution of the encoder that it was tried with; 0 measured exactly.
    reference_velocity : {"difference", "instant"} or None
        How the drive forms its reference velocity, where that was stated.
    """

    compensator: str
    gain: float
    bandwidth: float
    damping: float
    inertia: float
    lead: float = 0.0
    deadband: float = 0.0
    filter: float = 0.0
    sample_time: float = 0.0
    machine: str = ""
    offset: float = 0.0
    inertia_feedforward: float = 0.0
    gains: Gains | Cascade | None = None
    velocity_filter: float = 0.0
    torque_limit: float = math.inf
    encoder_counts: float = 0.0
    reference_velocity: ReferenceVelocity | None = None

    @property
    def linear(self) -> Gains | Cascade:
        """The linear loop that it was tried in."""
        return self.gains or place("PD", self.inertia, self.bandwidth, self.damping)

    def table(self) -> dict[str, Any]:
        """Plain data; what is left at its default is left out."""
        usual = {f.name: f.default for f in fields(self) if f.default is not MISSING}
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        if self.gains:
            values |= {"loop": self.gains._asdict(), "gains": None, "bandwidth": None, "damping": None}
        return {k: v for k, v in values.items() if v is not None and usual.get(k) != v}

    def on(self, model: Model) -> Compensator:
        """The compensator with its law."""
        return COMPENSATORS[self.compensator](
            model,
            self.gain,
            self.filter or None,
            self.lead,
            self.deadband,
            self.offset,
            self.inertia_feedforward,
        )

    def controller(self, model: Model) -> Controller:
        """The loop that it was tried in, with the compensator on its law."""
        return Controller(
            self.linear, self.on(model), self.torque_limit, self.sample_time, self.encoder_counts,
            self.velocity_filter, reference_velocity=self.reference_velocity,
        )  # fmt: skip


def read_recommended(path: str | os.PathLike[str]) -> Recommended:
    """Read the table of a recommended.toml.

    Raises
    ------
    InputError
        If the file has none, or its numbers are out of bounds.
    """
    return recommended_in(read_toml(Path(path)))


def recommended_in(whole: Table) -> Recommended:
    """As `read_recommended`, of the content of a file."""
    if not whole.has("recommended"):
        raise InputError(
            f"{whole.document.name} has no table [recommended]; give a file written by "
            "`stickslip recommend --out` or `stickslip rig commission`"
        )
    with whole.table("recommended") as given:
        own = _loop(given) if given.has("loop") else None
        return Recommended(
            given.choice("compensator", COMPENSATORS), given.number("gain", "", lower=0.0),
            0.0 if own else given.positive("bandwidth", "Hz"), 0.0 if own else given.positive("damping", ""),
            given.positive("inertia", "kg·m²"), given.number("lead", "s", 0.0, 0.0),
            given.number("deadband", "rad/s", 0.0, 0.0), given.number("filter", "Hz", 0.0, 0.0),
            given.number("sample_time", "s", 0.0, 0.0), given.text("machine", ""),
            given.number("offset", "N·m", 0.0), given.number("inertia_feedforward", "kg·m²", 0.0, 0.0),
            own, given.number("velocity_filter", "Hz", 0.0, 0.0),
            given.positive("torque_limit", "N·m", math.inf),
            given.number("encoder_counts", "counts per revolution", 0.0, 0.0), reference_velocity_in(given),
        )  # fmt: skip


def _loop(table: Table) -> Gains | Cascade:
    """Gains of a PID, or of a cascade where there is a ``kv``."""
    with table.table("loop") as given:
        if given.has("kv"):
            return Cascade(*(given.number(f.name, f.par.unit, 0.0, 0.0) for f in fields_of(Cascade)))
        return Gains(*(given.number(f.name, f.par.unit, 0.0, 0.0) for f in fields_of(Gains)))
