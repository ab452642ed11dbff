"""What is to be exported, and what comes of it."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from stickslip.core.errors import InputError
from stickslip.core.messages import name_option, rendered
from stickslip.exports._text import folded
from stickslip.models.model import Model

IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,40}")


class CannotCarry(InputError):
    """A target has no room for a part of the model; the message names what is lost and what to take instead."""


@dataclass(frozen=True)
class Job:
    """What is to be exported.

    Attributes
    ----------
    model : Model
        The law and its parameters.
    name : str
        Prefix of every name in the target's language.
    single : bool
        Single precision, where the target has the choice.
    nearest : bool
        Where the target cannot carry the model, take the nearest that it can.
    top_speed : float or None
        Greatest velocity of the application, rad/s: up to it sliding curves are compared and tables made. None: 100
        times the velocity over which the law changes: that of its `velocity_scale`, or, of a law that does not tell
        it, the fastest at which its sliding curve bends; at least 1 rad/s where that may be the width of a smooth sign.
    linear : bool
        The axis moves along a line: numbers are in N, m and kg.
    settings : mapping
        Values of the target's own settings by name (`Target.settings`); what is not given has the default.
    """

    model: Model
    name: str
    single: bool = False
    nearest: bool = False
    top_speed: float | None = None
    linear: bool = False
    settings: Mapping[str, str | float] = field(default_factory=dict[str, str | float])

    def __post_init__(self) -> None:
        if not IDENTIFIER.fullmatch(self.name):
            raise InputError(
                f"{self.name!r} is no name in most languages; use letters, digits and _, a letter first "
                f"({name_option('name')})"
            )
        if self.top_speed is not None and not 0.0 < self.top_speed < math.inf:
            raise InputError(f"the top speed is {self.top_speed:g} rad/s; give one greater than 0")


def counts_in(model: Model) -> dict[str, int]:
    """The numbers of elements, of points, ..., by the names that translated functions use (``elements_``)."""
    law, p = model.law, model.parameters
    return {f"{f.par.per}s_": len(getattr(p, f.name)) for f in law.fields if f.per_element}


@dataclass(frozen=True)
class Export:
    """Files by name, and what the user must know about them.

    Attributes
    ----------
    files : mapping of str to str or bytes
    notes : tuple of str
        What the target does not hold, and by how much it differs; each is one printable line.
    """

    files: Mapping[str, str | bytes]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "notes", tuple(map(folded, rendered(self.notes))))


@dataclass(frozen=True)
class Check:
    """What running the export in its target said.

    Attributes
    ----------
    passed : bool or None
        None where the target's tool is not installed.
    text : str
        One line.
    numbers : mapping
        Errors measured.
    """

    passed: bool | None
    text: str
    numbers: Mapping[str, float] = field(default_factory=dict[str, float])
