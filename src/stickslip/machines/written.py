"""A machine as the TOML file that `stickslip.machines.files` reads, and a file with every key to begin from."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import MISSING
from pathlib import Path
from typing import Any

from stickslip.core.errors import InputError, ParameterError
from stickslip.core.whole_files import write_whole
from stickslip.machines.contact import Contact
from stickslip.machines.described import numbers_of
from stickslip.machines.encoder import Encoder
from stickslip.machines.keys import PARTS, Part
from stickslip.machines.machine import Machine, Sensor
from stickslip.machines.motor import Amplifier
from stickslip.machines.two_mass import TwoMassAxis
from stickslip.models.tables import written

ALWAYS = ("sample_time",)
"""Written even where they are as usual."""


def tables_of(machine: Machine) -> dict[str, Any]:
    """The content of a machine's file: what is as it is without, is left out.

    Parameters
    ----------
    machine : Machine

    Raises
    ------
    ParameterError
        If its amplifier has two different converters, of which a file has one.
    """
    out: dict[str, Any] = {"title": machine.title} if machine.title else {}
    owners = _owners(machine)
    out |= _values(PARTS[0], machine)
    if machine.notes:
        out["notes"] = list(machine.notes)
    for part in PARTS[1:]:
        if part.name == "friction":
            out["friction"] = written(machine.contact.friction)
        elif part.name == "direction" and machine.contact.direction != (1.0, 1.0):
            out["direction"] = dict(zip(("positive", "negative"), machine.contact.direction))
        elif part.name in owners:
            out[part.name] = _values(part, *owners[part.name])
            if isinstance(machine.flexible, TwoMassAxis) and part.name == "two_mass":
                out["two_mass"]["encoder"] = machine.flexible.encoder
    if machine.limits:
        out["limits"] = dict(machine.limits)
    if machine.models:
        out["models"] = {name: written(model) for name, model in machine.models.items()}
    return out


def _owners(machine: Machine) -> dict[str, tuple[object, ...]]:
    """What a table's keys are fields of, for every table that the machine's file has."""
    contact, amplifier, sensor = machine.contact, machine.amplifier, machine.sensor
    usual = Contact(contact.friction)
    out: dict[str, tuple[object, ...]] = {}
    if machine.flexible:
        out["two_mass" if isinstance(machine.flexible, TwoMassAxis) else "flexible"] = (
            machine.flexible,
            machine,
        )
    for name in ("bearings", "drift", "heat", "ripple"):
        if getattr(contact, name) != getattr(usual, name):
            out[name] = (getattr(contact, name),)
    if machine.cogging.order:
        out["cogging"] = (machine.cogging,)
    if amplifier != Amplifier(1.0):
        if amplifier.command != amplifier.monitor:
            raise ParameterError(
                f"machine: its amplifier's command and monitor have the converters {amplifier.command} and "
                f"{amplifier.monitor}, and a file has one for both; make them equal"
            )
        out["amplifier"] = (amplifier, amplifier.command)
    if machine.encoder != Encoder():
        out["encoder"] = (machine.encoder,)
    if sensor != Sensor():
        out["torque_sensor"] = (sensor, sensor.converter)
    return out


def _values(part: Part, *owners: object) -> dict[str, Any]:
    """The keys of a table whose values are not the usual ones, and those that must be there."""
    out: dict[str, Any] = {}
    owner_of = {field: owner for owner in owners for field in numbers_of(type(owner))}
    for key in part.keys:
        if key.field not in owner_of:
            continue
        value: Any = getattr(owner_of[key.field], key.field)
        if key.default is MISSING or value != key.default or key.name in ALWAYS:
            out[key.name] = [*value] if key.listed else value
    return out


def machine_text(machine: Machine) -> str:
    """The machine's file.

    Raises
    ------
    ParameterError
        If its amplifier has two different converters, of which a file has one.
    """
    import tomli_w

    return tomli_w.dumps(tables_of(machine))


def write_machine(machine: Machine, path: str | os.PathLike[str]) -> Path:
    """Write the file that `stickslip.load_machine` reads; what `Machine.without` left out is not in it.

    Raises
    ------
    InputError
        If the name does not end with .toml, the file cannot be written, or cannot hold the machine.
    """
    target = Path(path)
    if target.suffix != ".toml":
        raise InputError(
            f"{target}: a machine's file is known by its ending; name it {target.stem or 'machine'}.toml"
        )
    return write_whole(target, machine_text(machine))


# ---- a file to begin from ------------------------------------------------------------------------------------------

LAW = {"sigma0": 3.5e4, "sigma1": 0.1, "sigma2": 0.018, "fs": 0.335, "fc": 0.285, "vs": 0.01}
"""The friction of the file to begin from, LuGre's."""
EXAMPLES: Mapping[str, Any] = {
    "title": '"My machine"', "notes": '["Inertia from the data sheet."]', "inertia": "4e-4", "rotor": "1.2e-4",
    "shaft": "1.2e-4", "disk": "1.6e-4", "coupling_stiffness": "17800.0", "shaft_stiffness": "396.0",
    "motor": "1.2e-4", "load": "2.8e-4", "stiffness": "400.0", "encoder": '"load"',
    "order": "[12, 24]", "amplitude": "[0.006, 0.002]", "phase": "[0.0, 0.7]", "peak_to_peak": "0.05",
    "positive": "1.0", "negative": "0.96", "change": "-0.04", "coefficient": "-0.002", "torque_constant": "0.22",
    "current_limit": "6.0", "bandwidth": "1000.0", "range": "12.0", "max_speed": "37.7", "torque": "1.0",
    "temperature": "80.0", "following_error": "1.0", "stop_time": "0.02",
}  # fmt: skip
"""Values of keys without a default there."""


def template() -> str:
    """A file with every key, its unit, meaning and default; what may be left out is a comment."""
    lines = [line for part in PARTS for line in _begun(part)]
    head = "# A machine. `stickslip machine FILE.toml` checks this file; commented keys and tables may be left out."
    return "\n".join([head, *lines]) + "\n"


def _begun(part: Part) -> Iterator[str]:
    """The lines of a table."""
    mark = "" if part.needed else "# "
    if part.name:
        yield f"\n## {part.title}."
        yield f"{mark}[{part.name}]"
    if "law" in part.more:
        law = 'law = "lugre"'
        yield f"{mark}{law:<{30 - len(mark)}}  # {part.more['law']}"
        yield from (f"{mark}{name} = {value:g}" for name, value in LAW.items())
    else:
        yield from (
            f"# {f'{name} = {EXAMPLES[name]}':<28}  # {meaning}" for name, meaning in part.more.items()
        )
    for key in part.keys:
        left = mark if key.default is MISSING else "# "
        unit = "" if key.par.unit == "-" else f"{key.par.unit}, "
        value = EXAMPLES.get(key.name) or key.usual
        told = "" if key.default is MISSING else f" (default {key.usual})"
        yield f"{left}{f'{key.name} = {value}':<{30 - len(left)}}  # {unit}{key.par.meaning}{told}"
