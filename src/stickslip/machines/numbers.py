"""The numbers of a machine by name, read and changed: ``delay``, ``encoder.noise``, ``amplifier.bandwidth``, ...

What a sweep or a tolerance study varies. The inertia of a flexible machine is shared among its masses as it was;
parameters of its friction are those of its law (`Machine.friction`), not named here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

from stickslip.core.errors import UnknownName
from stickslip.machines.machine import Machine
from stickslip.models.model import Model

FIXED = ("sample_time", "spring_factor")
"""Numbers that are not the machine's to vary: its controller is made for them."""
PARTS = ("flexible", "contact.bearings", "contact.drift", "contact.heat", "amplifier", "encoder", "sensor")
"""Where they lie, besides in the machine itself; the contact's are named without it."""


def machine_numbers(machine: Machine) -> dict[str, float]:
    """Every number by name, in the units of `Machine` and its parts."""
    out = _own(machine)
    for path in PARTS:
        part = _at(machine, path)
        if part is not None:
            out |= {f"{path.rpartition('.')[2]}.{k}": v for k, v in _own(part).items()}
    out |= {
        "direction.positive": machine.contact.direction[0],
        "direction.negative": machine.contact.direction[1],
    }
    for name, harmonics in (("ripple", machine.contact.ripple), ("cogging", machine.cogging)):
        for i, size in enumerate(harmonics.amplitude):
            out[f"{name}.amplitude[{i}]"] = size
    return out


def with_numbers(machine: Machine, values: Mapping[str, float]) -> Machine:
    """The machine with other numbers.

    Raises
    ------
    UnknownName
        If it has no such number.
    ParameterError
        If one is out of bounds.
    """
    known = machine_numbers(machine)
    for name, value in values.items():
        if name not in known:
            raise UnknownName(f"number of the machine {machine.name}", name, known)
        machine = _changed(machine, name, float(value))
    return machine


def with_friction(machine: Machine, friction: Model) -> Machine:
    """The machine with another friction."""
    return replace(machine, contact=replace(machine.contact, friction=friction))


def _changed(machine: Machine, name: str, value: float) -> Machine:
    part, _, own = name.rpartition(".")
    if name == "inertia":
        return _with_inertia(machine, value)
    if not part:
        return replace(machine, **{name: int(value) if name == "seed" else value})
    contact = machine.contact
    if part == "direction":
        pair = (value, contact.direction[1]) if own == "positive" else (contact.direction[0], value)
        return replace(machine, contact=replace(contact, direction=pair))
    if part in ("ripple", "cogging"):
        harmonics = contact.ripple if part == "ripple" else machine.cogging
        sizes = list(harmonics.amplitude)
        sizes[int(own[len("amplitude[") : -1])] = value
        harmonics = replace(harmonics, amplitude=tuple(sizes))
        if part == "cogging":
            return replace(machine, cogging=harmonics)
        return replace(machine, contact=replace(contact, ripple=harmonics))
    if hasattr(contact, part):
        return replace(
            machine, contact=replace(contact, **{part: replace(getattr(contact, part), **{own: value})})
        )
    new = replace(getattr(machine, part), **{own: value})
    whole = {"inertia": new.inertia} if part == "flexible" else {}
    return replace(machine, **{part: new}, **whole)


def _with_inertia(machine: Machine, inertia: float) -> Machine:
    if machine.flexible is None:
        return replace(machine, inertia=inertia)
    share = inertia / machine.inertia
    flexible = machine.flexible.scaled(share)
    return replace(machine, inertia=flexible.inertia, flexible=flexible)


def _own(part: Any) -> dict[str, float]:
    """Numbers that are fields of this part itself."""
    values = {f.name: getattr(part, f.name) for f in fields(part) if f.name not in FIXED}
    return {k: float(v) for k, v in values.items() if isinstance(v, (int, float)) and not is_dataclass(v)}


def _at(machine: Machine, path: str) -> Any:
    part: Any = machine
    for name in path.split("."):
        part = getattr(part, name)
    return part
