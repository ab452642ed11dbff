"""The keys of a machine's file, table by table: what reads a file, writes one and documents it goes by them.

Units, meanings, bounds and defaults are those of the parts that the keys make (`stickslip.machines.described`).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass
from typing import Any, NamedTuple, cast

from stickslip.core.config import Table
from stickslip.core.description import Par
from stickslip.core.errors import ConfigError
from stickslip.machines.contact import Bearings, Drift, Heat
from stickslip.machines.described import default_of, numbers_of
from stickslip.machines.encoder import Encoder
from stickslip.machines.flexible import FlexibleAxis
from stickslip.machines.machine import Machine, Sensor
from stickslip.machines.motor import Amplifier, Converter, Harmonics
from stickslip.machines.two_mass import TwoMassAxis


class Key(NamedTuple):
    """A number in a table of the file.

    Attributes
    ----------
    name : str
    field : str
        Of the part that it makes.
    par : Par
    default : float, int or MISSING
        Infinite for none, MISSING where it must be given.
    """

    name: str
    field: str
    par: Par
    default: Any

    @property
    def listed(self) -> bool:
        """Whether it is a list of numbers."""
        return self.field in WAVES

    @property
    def usual(self) -> str:
        """What it is where it is not given, for people."""
        if self.default is MISSING:
            return "must be given"
        return "none" if self.default == math.inf else f"{self.default:g}"

    def read(self, table: Table) -> Any:
        """Its value in a table, or the default.

        Raises
        ------
        ConfigError
        """
        if self.default is not MISSING and not table.has(self.name):
            return self.default
        if self.listed:
            return _numbers(table, self.name)
        unit = "" if self.par.unit == "-" else self.par.unit
        if self.par.positive:
            return table.positive(self.name, unit)
        value = table.number(self.name, unit, lower=self.par.lower)
        if not self.par.whole:
            return value
        if not value.is_integer():
            raise table.error(self.name, "must be a whole number")
        return int(value)


@dataclass(frozen=True)
class Part:
    """A table of the file.

    Attributes
    ----------
    name : str
        Empty for the keys at the top of the file.
    title : str
    keys : tuple of Key
    more : mapping of str to str
        What else it takes, that is no number, and what that means.
    needed : bool
        Whether a file must have it.
    """

    name: str
    title: str
    keys: tuple[Key, ...]
    more: Mapping[str, str] = dataclasses.field(default_factory=dict[str, str])
    needed: bool = False

    def read(self, table: Table) -> dict[str, Any]:
        """The values of its keys, by field."""
        return {key.field: key.read(table) for key in self.keys}


def _numbers(table: Table, key: str) -> tuple[float, ...]:
    if not table.has(key):
        raise ConfigError(f"{table.label(key)} is missing; give a list of numbers")
    values = cast("list[Any]", table.values[key])
    if not isinstance(table.values[key], list) or not all(_finite(v) for v in values):
        raise table.error(key, "must be a list of finite numbers")
    return tuple(float(v) for v in values)


def _finite(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def keys_of(
    kind: type[Any], fields: Iterable[str] = (), *, named: Mapping[str, str] | None = None,
    needed: Iterable[str] = (), units: Mapping[str, str] | None = None,
) -> tuple[Key, ...]:  # fmt: skip
    """Keys of a part's numbers.

    Parameters
    ----------
    kind : type
        A dataclass whose numbers are described.
    fields : iterable of str
        Those that are meant; all unless given.
    named : mapping of str to str
        What the file calls a field, where that is not its name.
    needed : iterable of str
        Fields that a file must give although they have a default.
    units : mapping of str to str
        Of fields whose unit the part leaves to its owner.
    """
    called, own = named or {}, units or {}
    out: list[Key] = []
    for field in fields or numbers_of(kind):
        par = numbers_of(kind)[field]
        par = dataclasses.replace(par, unit=own.get(field, par.unit))
        default = MISSING if field in needed else default_of(kind, field)
        out.append(Key(called.get(field, field), field, par, default))
    return tuple(out)


WAVES = ("order", "amplitude", "phase")
PEAK = Par(
    "N·m",
    "",
    "what the ripple amounts to at 0.3 rad/s; left out, amplitudes are parts of friction",
    positive=True,
)
FACTOR = Par("-", "", "factor for {} velocity", positive=True, upper=10.0)
LIMITS = {
    "torque": Par("N·m", "", "largest torque", positive=True),
    "temperature": Par("°C", "", "highest temperature", positive=True),
    "following_error": Par("rad", "", "largest distance from the reference", positive=True),
    "stop_time": Par("s", "", "within which a stop takes the torque away", positive=True),
}
LAW = {
    "law": 'friction law (`stickslip laws`), a law\'s file, or `{model = "model.toml"}` of an identification',
    "parameters": "of the law, by name; a list for one value per element (`stickslip law NAME`)",
    "choices": 'option of a choice by name, such as `curve = "stribeck"`',
}

AT_CONTACT = keys_of(Machine, ("flexible_stiffness",), named={"flexible_stiffness": "contact_stiffness"})

PARTS: tuple[Part, ...] = (
    Part(
        "", "The machine",
        keys_of(
            Machine, ("inertia", "sample_time", "delay", "filter", "seed", "start_angle"),
            named={"filter": "velocity_filter"},
        ),
        {"title": "what it is, in a line", "notes": "a list of sentences on its numbers"},
        needed=True,
    ),
    Part(
        "friction", "The whole friction of the axis as its motor feels it, the bearings' included", (), LAW,
        needed=True,
    ),
    Part(
        "flexible",
        "Rotor, shaft and disk with springs between them, instead of a rigid axis; the three add up to the inertia",
        (
            *keys_of(FlexibleAxis, named={"coupling": "coupling_stiffness", "elasticity": "shaft_stiffness"}),
            *AT_CONTACT,
        ),
    ),
    Part(
        "two_mass",
        "Motor and load with a spring between them, in place of [flexible]; both add up to the inertia",
        (*keys_of(TwoMassAxis), *AT_CONTACT),
        {"encoder": 'whose angle is measured, "motor" or "load" (default "motor")'},
    ),
    Part("bearings", "The bearings' part of the friction", keys_of(Bearings)),
    Part(
        "ripple", "What friction varies by over the angle",
        (*keys_of(Harmonics, needed=WAVES), Key("peak_to_peak", "peak_to_peak", PEAK, math.inf)),
    ),
    Part(
        "direction", "Factors on levels and viscous friction",
        tuple(
            Key(sign, sign, dataclasses.replace(FACTOR, meaning=FACTOR.meaning.format(sign)), MISSING)
            for sign in ("positive", "negative")
        ),
    ),
    Part(
        "drift", "Change of friction after the machine was switched on: 1 + change (1 - exp(-(t - begin) / time))",
        keys_of(Drift, needed=("change",)),
    ),
    Part(
        "heat", "How warm the contact gets, and what that does: exp(coefficient (T - reference))",
        keys_of(Heat, needed=("coefficient",)),
    ),
    Part(
        "cogging", "Torque of the motor over the angle: amplitude cos(order angle + phase)",
        keys_of(Harmonics, needed=WAVES, units={"amplitude": "N·m"}),
    ),
    Part(
        "amplifier", "The current amplifier with its motor; left out, 1 N·m/A without delay",
        (*keys_of(Amplifier), *keys_of(Converter, units={"range": "A"})),
    ),
    Part("encoder", "What the position is read with; left out, exactly", keys_of(Encoder)),
    Part(
        "torque_sensor", "The torque sensor at the clutch",
        (*keys_of(Sensor), *keys_of(Converter, units={"range": "N·m"})),
    ),
    Part(
        "limits", "What a rig of the machine keeps to",
        tuple(Key(name, name, par, math.inf) for name, par in LIMITS.items()),
    ),
    Part("models.NAME", "Laws for compensators, identified on the machine", (), LAW),
)  # fmt: skip
"""The tables of a file, in their order."""
BY_NAME: Mapping[str, Part] = {part.name: part for part in PARTS}
