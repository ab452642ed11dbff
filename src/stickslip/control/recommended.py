"""``[recommended]`` of a recommended.toml: which compensator, with what, on which loop.

`stickslip rig commission` and `stickslip recommend` write it beside the law; `stickslip rig run track` and
`stickslip export` run it, with no number given again by hand.
"""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from stickslip.config import read_toml
from stickslip.control.compensators._base import Compensator
from stickslip.control.compensators.feedback import Feedback
from stickslip.control.compensators.feedforward import Feedforward
from stickslip.errors import InputError
from stickslip.model import Model

__all__ = ["KINDS", "Recommended", "read_recommended"]

KINDS: dict[str, type[Compensator]] = {"feedforward": Feedforward, "feedback": Feedback}


@dataclass(frozen=True)
class Recommended:
    """What is to be switched on.

    Attributes
    ----------
    compensator : str
        "feedforward" or "feedback".
    gain : float
    bandwidth, damping : float
        Of the PD's poles, Hz and -.
    inertia : float
        That the PD is placed with, kg·m².
    lead : float
        s, by which a feedforward looks ahead of the reference.
    deadband : float
        rad/s, velocities below which the law sees rest.
    filter : float
        Corner of the low-pass on the velocity, Hz; 0: none.
    sample_time : float
        s, for which it was tried; 0: not known.
    machine : str
        On which it was measured; empty where it is a model's.
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

    def table(self) -> dict[str, Any]:
        """Plain data; what is left at its default is left out."""
        usual = {"lead": 0.0, "deadband": 0.0, "filter": 0.0, "sample_time": 0.0, "machine": ""}
        return {k: v for k, v in asdict(self).items() if usual.get(k) != v}

    def on(self, model: Model) -> Compensator:
        """The compensator with its law."""
        return KINDS[self.compensator](model, self.gain, self.filter or None, self.lead, self.deadband)


def read_recommended(path: str | os.PathLike[str]) -> Recommended:
    """Read the table of a recommended.toml.

    Raises
    ------
    InputError
        If the file has none, or its numbers are out of bounds.
    """
    file = Path(path)
    whole = read_toml(file)
    if not whole.has("recommended"):
        raise InputError(
            f"{file} recommends nothing (it has no table [recommended]); give what `stickslip recommend --out` or "
            "`stickslip rig commission` wrote"
        )
    with whole.table("recommended") as given:
        return Recommended(
            given.choice("compensator", KINDS), given.positive("gain", ""), given.positive("bandwidth", "Hz"),
            given.positive("damping", ""), given.positive("inertia", "kg·m²"), given.number("lead", "s", 0.0, 0.0),
            given.number("deadband", "rad/s", 0.0, 0.0), given.number("filter", "Hz", 0.0, 0.0),
            given.number("sample_time", "s", 0.0, 0.0), given.text("machine", ""),
        )  # fmt: skip
