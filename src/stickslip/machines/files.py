"""Reading a machine from the TOML file that describes it; those of the package lie in ``machines/library``."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from stickslip import plugins
from stickslip.arguments import arguments_checked
from stickslip.config import Table, read_toml
from stickslip.errors import ConfigError, UnknownName
from stickslip.machines.contact import Bearings, Contact, Drift, Heat
from stickslip.machines.encoder import Encoder
from stickslip.machines.flexible import FlexibleAxis
from stickslip.machines.machine import Machine, Sensor
from stickslip.machines.motor import Amplifier, Converter, Harmonics
from stickslip.model import Model

LIBRARY = Path(__file__).parent / "library"
"""Where the package's own machines lie."""
LEVEL_SPEED = 0.3
"""rad/s at which the ripple of a contact is given (thesis 4.3.1.1.2 shows it there)."""


def library() -> tuple[str, ...]:
    """Names of the package's own machines."""
    return tuple(sorted(p.stem for p in LIBRARY.glob("*.toml")))


def machine(name: str | os.PathLike[str]) -> Machine:
    """The machine of that name, or of the TOML file at that path.

    Raises
    ------
    UnknownName, ConfigError
        If there is none; a key or value that cannot be used, by name.
    """
    text = os.fspath(name)
    if text in library():
        return _read(LIBRARY / f"{text}.toml")
    if text.endswith(".toml"):
        return _read(Path(text))
    raise UnknownName("machine", text, library())


@arguments_checked
def load_machine(name: str | os.PathLike[str]) -> Machine:
    """The machine of that name (`library`), or of the TOML file at that path.

    Parameters
    ----------
    name : str or path

    Raises
    ------
    UnknownName, ConfigError
        If there is none; a key or value that cannot be used, by name.
    """
    return machine(name)


def _read(path: Path) -> Machine:
    with read_toml(path) as top, top.blamed():
        friction, notes = _friction(top.table("friction")), _notes(top)
        inertia = top.positive("inertia", "kg·m²")
        flexible, stiffness = _flexible(top)
        contact = _contact_of(top, friction)
        return Machine(
            path.stem, inertia, contact, top.text("title", ""), flexible, stiffness, _amplifier_of(top), _cogging(top),
            _encoder(top), _sensor(top), top.number("delay", "samples", 0.0),
            top.number("velocity_filter", "Hz", 0.0, 0.0), top.positive("sample_time", "s", 1e-3),
            int(top.number("seed", "", 0.0, 0.0)), _limits(top), _models(top), notes,
            start_angle=top.number("start_angle", "rad", 0.0),
        )  # fmt: skip


def _notes(top: Table) -> tuple[str, ...]:
    if not top.has("notes"):
        return ()
    values = cast("list[Any]", top.values["notes"])
    if not isinstance(top.values["notes"], list) or not all(isinstance(v, str) for v in values):
        raise top.error("notes", "must be a list of sentences")
    return tuple(str(v) for v in values)


def _friction(table: Table) -> Model:
    with table, table.blamed():
        name = table.text("law")
        law = plugins.law(
            str(table.document.locate(name)) if name.endswith(".py") else name, table.label("law")
        )
        choices = {
            c.name: table.choice(c.name, c.options, c.default) for c in law.choices if table.has(c.name)
        }
        return Model(law, choices, **table.rest())


def _part(top: Table, key: str) -> Table | None:
    return top.table(key) if top.has(key) else None


def _flexible(top: Table) -> tuple[FlexibleAxis | None, float]:
    if (table := _part(top, "flexible")) is None:
        return None, 0.0
    with table, table.blamed():
        axis = FlexibleAxis(
            table.positive("rotor", "kg·m²"), table.positive("shaft", "kg·m²"), table.positive("disk", "kg·m²"),
            table.positive("coupling_stiffness", "N·m/rad"), table.positive("shaft_stiffness", "N·m/rad"),
            table.number("damping", "", 0.0),
        )  # fmt: skip
        return axis, table.number("contact_stiffness", "N·m/rad", 0.0, 0.0)


def _contact_of(top: Table, friction: Model) -> Contact:
    bearings, drift, heat, direction = Bearings(), Drift(), Heat(), (1.0, 1.0)
    if (table := _part(top, "bearings")) is not None:
        with table, table.blamed():
            bearings = Bearings(
                table.number("coulomb", "N·m", 0.0), table.number("viscous", "N·m·s/rad", 0.0),
                table.positive("stiffness", "N·m/rad", 5.0),
            )  # fmt: skip
    if (table := _part(top, "drift")) is not None:
        with table, table.blamed():
            drift = Drift(
                table.number("change", ""), table.positive("time", "s", 1800.0),
                table.number("begin", "s", 0.0, 0.0),
            )  # fmt: skip
    if (table := _part(top, "heat")) is not None:
        with table, table.blamed():
            heat = Heat(
                table.number("coefficient", "1/K"), table.number("reference", "°C", 20.0),
                table.number("ambient", "°C", 20.0), table.number("resistance", "K/W", 0.0),
                table.positive("time", "s", 600.0),
            )  # fmt: skip
    if (table := _part(top, "direction")) is not None:
        with table:
            direction = (table.positive("positive", ""), table.positive("negative", ""))
    plain = Contact(friction, Harmonics(), direction, bearings, drift, heat)
    return replace(plain, ripple=_ripple(top, plain))


def _harmonics(table: Table) -> Harmonics:
    with table.blamed():
        columns = {key: _numbers(table, key) for key in ("order", "amplitude", "phase")}
        return Harmonics(columns["order"], columns["amplitude"], columns["phase"])


def _numbers(table: Table, key: str) -> tuple[float, ...]:
    if not table.has(key):
        raise ConfigError(f"{table.label(key)} is missing; give a list of numbers")
    values = cast("list[Any]", table.values[key])
    if not isinstance(table.values[key], list) or not all(_finite(v) for v in values):
        raise table.error(key, "must be a list of finite numbers")
    return tuple(float(v) for v in values)


def _finite(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _ripple(top: Table, contact: Contact) -> Harmonics:
    """Relative ripple, from its shape and its peak to peak in N·m at `LEVEL_SPEED`."""
    if (table := _part(top, "ripple")) is None:
        return Harmonics()
    with table:
        shape = _harmonics(table)
        peak = table.positive("peak_to_peak", "N·m")
        clutch = contact.clutch()
        level = clutch.law.steady(LEVEL_SPEED, clutch.parameters) if clutch.law.steady else 0.0
        size = shape.peak_to_peak()
        if not (level > 0.0 and size > 0.0):
            raise table.error("peak_to_peak", "needs a law that slides and amplitudes that are not all zero")
        return shape.scaled(peak / (level * size))


def _cogging(top: Table) -> Harmonics:
    if (table := _part(top, "cogging")) is None:
        return Harmonics()
    with table:
        return _harmonics(table)


def _amplifier_of(top: Table) -> Amplifier:
    if (table := _part(top, "amplifier")) is None:
        return Amplifier(1.0)
    with table, table.blamed():
        bits, reach = int(table.number("bits", "", 0.0, 0.0)), table.positive("range", "A", 1.0)
        converter = Converter(bits, reach)
        return Amplifier(
            table.positive("torque_constant", "N·m/A"), _or_infinite(table, "current_limit", "A"),
            _or_infinite(table, "bandwidth", "Hz"), converter, converter, table.number("current_noise", "A", 0.0),
            table.number("monitor_noise", "A", 0.0),
        )  # fmt: skip


def _or_infinite(table: Table, key: str, unit: str) -> float:
    return table.positive(key, unit) if table.has(key) else math.inf


def _encoder(top: Table) -> Encoder:
    if (table := _part(top, "encoder")) is None:
        return Encoder()
    with table, table.blamed():
        return Encoder(
            table.number("counts", "", 0.0), table.number("noise", "rad", 0.0),
            _or_infinite(table, "max_speed", "rad/s"),
            table.number("mode", "Hz", 0.0), table.number("mode_damping", "", 0.02),
            table.number("mode_share", "", 0.0),
        )  # fmt: skip


def _sensor(top: Table) -> Sensor:
    if (table := _part(top, "torque_sensor")) is None:
        return Sensor()
    with table, table.blamed():
        bits, reach = int(table.number("bits", "", 0.0, 0.0)), table.positive("range", "N·m", 1.0)
        return Sensor(table.number("noise", "N·m", 0.0, 0.0), Converter(bits, reach))


def _limits(top: Table) -> dict[str, float]:
    if (table := _part(top, "limits")) is None:
        return {}
    units = {"torque": "N·m", "temperature": "°C", "following_error": "rad", "stop_time": "s"}
    with table:
        return {key: table.positive(key, unit) for key, unit in units.items() if table.has(key)}


def _models(top: Table) -> dict[str, Model]:
    return {name: _friction(table) for name, table in top.tables("models").items()}
