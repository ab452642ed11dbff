"""Targets of a torque over the angle (`stickslip.machines.position_map`): tables for firmware, harmonics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from stickslip.core.errors import InputError, UnknownName
from stickslip.core.messages import name_option, name_setting
from stickslip.exports.job import IDENTIFIER, Export
from stickslip.exports.position_tables import c_table, moteus, odrive, vesc
from stickslip.exports.position_waves import linuxcnc_waves, st_function, twincat_pou
from stickslip.machines.position_map import PositionMap

CONSTANT = "torque_constant"


@dataclass(frozen=True)
class MapTarget:
    """What takes a map.

    Attributes
    ----------
    name, title : str
    write : callable
        ``write(map, name) -> Export``.
    unit : str
        The one it takes, "A" or "N·m"; "" for either.
    tried : str
        In what its output was tried.
    """

    name: str
    title: str
    write: Callable[[PositionMap, str], Export]
    unit: str = ""
    tried: str = "format checked, not tried on the vendor's hardware"


MAP_TARGETS: Mapping[str, MapTarget] = {
    t.name: t
    for t in (
        MapTarget("c99", "C, an int16 table with its scale", c_table, tried="gcc"),
        MapTarget("moteus", "moteus, motor.cogging_dq_comp", moteus, "A"),
        MapTarget("odrive", "ODrive firmware 0.5, cogging_map", odrive, "N·m"),
        MapTarget("vesc", "VESC, an int16 table in LispBM", vesc, "A"),
        MapTarget("st", "structured text (IEC 61131-3), harmonics", st_function, tried="read by the norm's grammar"),
        MapTarget("beckhoff", "Beckhoff TwinCAT 3, a POU with harmonics", twincat_pou),
        MapTarget("linuxcnc", "LinuxCNC HAL component, harmonics", linuxcnc_waves, tried="gcc; not on a machine"),
    )
}  # fmt: skip
"""By name."""


def map_target(name: str) -> MapTarget:
    """The target of that name.

    Raises
    ------
    UnknownName
    """
    if name not in MAP_TARGETS:
        raise UnknownName("target for a torque over the angle", name, MAP_TARGETS)
    return MAP_TARGETS[name]


def written(
    found: PositionMap, target: MapTarget, name: str, settings: Mapping[str, str | float] | None = None
) -> Export:
    """A map in the target's format and unit.

    Parameters
    ----------
    found : PositionMap
    target : MapTarget
    name : str
        What names begin with.
    settings : mapping, optional
        ``torque_constant`` in N·m/A, where the target takes the other unit.

    Raises
    ------
    InputError
        If it is needed and not given, or the target cannot hold the map.
    """
    given = dict(settings or {})
    constant = given.pop(CONSTANT, None)
    for other in given:
        raise UnknownName(f"setting of {target.name}", other, (CONSTANT,))
    if not IDENTIFIER.fullmatch(name):
        raise InputError(
            f"{name!r} is no name in most languages; use letters, digits and _, a letter first ({name_option('name')})"
        )
    if not target.unit or target.unit == found.unit:
        return target.write(found, name)
    if constant is None:
        raise InputError(
            f"{target.name} takes {target.unit} and the map is in {found.unit}; give "
            f"{name_setting(CONSTANT, 'VALUE')} (N·m/A)"
        )
    return target.write(_in(found, target.unit, constant), name)


def _in(found: PositionMap, unit: str, constant: str | float) -> PositionMap:
    """The map in a current or a torque."""
    try:
        value = float(constant)
    except ValueError:
        value = 0.0
    if not 0.0 < value < 1e12:
        raise InputError(f"{name_setting(CONSTANT, constant)}: give a number greater than 0 (N·m/A)")
    if found.unit not in ("A", "N·m"):
        raise InputError(f"a map in {found.unit} has no torque constant; give the motor's angle and torque")
    return found.scaled(value if unit == "N·m" else 1.0 / value, unit)
