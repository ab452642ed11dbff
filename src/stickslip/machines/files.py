"""Reading a machine from the TOML file that describes it; those of the package lie in ``machines/library``.

A model.toml of `stickslip identify` is one too (`stickslip.machines.identified`).

`stickslip.machines.keys` has the keys of such a file, `stickslip.machines.written` writes one.
"""

from __future__ import annotations

import os
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from stickslip.core.arguments import arguments_checked
from stickslip.core.config import Table, read_toml
from stickslip.core.errors import ModelRemark, UnknownName
from stickslip.machines.contact import Bearings, Contact, Drift, Heat
from stickslip.machines.encoder import Encoder
from stickslip.machines.flexible import FlexibleAxis
from stickslip.machines.identified import identified_machine, is_identified
from stickslip.machines.keys import BY_NAME
from stickslip.machines.machine import Machine, Sensor
from stickslip.machines.motor import Amplifier, Converter, Harmonics
from stickslip.machines.two_mass import ENCODERS, TwoMassAxis
from stickslip.models import plugins
from stickslip.models.model import Model
from stickslip.models.tables import model

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
    path = file_of(name)
    return machine_in(read_toml(path), path.stem)


def file_of(name: str | os.PathLike[str]) -> Path:
    """The file of the machine of that name, or at that path.

    Raises
    ------
    UnknownName
        If there is no machine of that name.
    """
    text = os.fspath(name)
    if text in library():
        return LIBRARY / f"{text}.toml"
    if text.endswith(".toml"):
        return Path(text)
    raise UnknownName("machine", text, library())


@arguments_checked
def load_machine(name: str | os.PathLike[str]) -> Machine:
    """The machine of that name (`library`), or of the TOML file at that path: a machine's, or a model.toml of
    `identify`.

    Parameters
    ----------
    name : str or path

    Raises
    ------
    UnknownName, ConfigError
        If there is none; a key or value that cannot be used, by name.
    """
    return machine(name)


def machine_in(content: Table, name: str) -> Machine:
    """The machine of that name whose file has this content.

    Raises
    ------
    ConfigError
        A key or value that cannot be used, by name.
    """
    if is_identified(content):
        return identified_machine(content, name)
    with content as top, top.blamed():
        friction, notes = _friction(top.table("friction")), _notes(top)
        own = BY_NAME[""].read(top)
        flexible, stiffness = _train(top)
        contact = _contact_of(top, friction)
        cogging = _part(top, "cogging")
        made = Machine(
            name, contact=contact, title=top.text("title", ""), flexible=flexible, flexible_stiffness=stiffness,
            amplifier=_amplifier_of(top), cogging=Harmonics(**cogging) if cogging else Harmonics(),
            encoder=Encoder(**_part(top, "encoder")), sensor=_sensor(top), limits=_limits(top), models=_models(top),
            notes=notes, **own,
        )  # fmt: skip
    if made.remark:
        warnings.warn(f"{top.label()}: {made.remark}", ModelRemark, stacklevel=2)
    return made


def _notes(top: Table) -> tuple[str, ...]:
    if not top.has("notes"):
        return ()
    values = cast("list[Any]", top.values["notes"])
    if not isinstance(top.values["notes"], list) or not all(isinstance(v, str) for v in values):
        raise top.error("notes", "must be a list of sentences")
    return tuple(str(v) for v in values)


def _friction(table: Table) -> Model:
    if isinstance(table.values.get("law"), dict):  # the model of an identification, by its file
        with table:
            return model(table, {})
    with table, table.blamed():
        name = table.text("law")
        law = plugins.law(
            str(table.document.locate(name)) if name.endswith(".py") else name, table.label("law")
        )
        choices = {
            c.name: table.choice(c.name, c.options, c.default) for c in law.choices if table.has(c.name)
        }
        return Model(law, choices, **table.rest())


def _part(top: Table, name: str) -> dict[str, Any]:
    """The numbers of a table, by the fields of what they make; empty where the file has no such table."""
    if not top.has(name):
        return {}
    with top.table(name) as table:
        return BY_NAME[name].read(table)


def _train(top: Table) -> tuple[FlexibleAxis | TwoMassAxis | None, float]:
    """The inertias and springs of an axis that is not rigid, and the contact's stiffness."""
    if not top.has("two_mass"):
        own = _part(top, "flexible")
        stiffness = own.pop("flexible_stiffness", 0.0)
        return (FlexibleAxis(**own) if own else None), stiffness
    if top.has("flexible"):
        raise top.error("two_mass", "and flexible exclude each other; give one of them")
    with top.table("two_mass") as table:
        own = BY_NAME["two_mass"].read(table)
        stiffness = own.pop("flexible_stiffness")
        encoder: Any = table.choice("encoder", ENCODERS, ENCODERS[0])
        return TwoMassAxis(**own, encoder=encoder), stiffness


def _contact_of(top: Table, friction: Model) -> Contact:
    bearings, drift, heat = (_part(top, name) for name in ("bearings", "drift", "heat"))
    factors = _part(top, "direction")
    direction = (factors["positive"], factors["negative"]) if factors else (1.0, 1.0)
    plain = Contact(friction, Harmonics(), direction, Bearings(**bearings), Drift(**drift), Heat(**heat))
    return replace(plain, ripple=_ripple(top, plain))


def _ripple(top: Table, contact: Contact) -> Harmonics:
    """Relative ripple; of one with its peak to peak in N·m at `LEVEL_SPEED`, from its shape."""
    if not top.has("ripple"):
        return Harmonics()
    own = _part(top, "ripple")
    peak = own.pop("peak_to_peak")
    shape = Harmonics(**own)
    if not top.table("ripple").has("peak_to_peak"):
        return shape
    clutch = contact.clutch()
    level = clutch.law.steady(LEVEL_SPEED, clutch.parameters) if clutch.law.steady else 0.0
    size = shape.peak_to_peak()
    if not (level > 0.0 and size > 0.0):
        raise top.table("ripple").error(
            "peak_to_peak", "needs a law that slides and amplitudes that are not all zero"
        )
    return shape.scaled(peak / (level * size))


def _amplifier_of(top: Table) -> Amplifier:
    if not (own := _part(top, "amplifier")):
        return Amplifier(1.0)
    converter = _converter(own)
    return Amplifier(command=converter, monitor=converter, **own)


def _sensor(top: Table) -> Sensor:
    own = _part(top, "torque_sensor")
    return Sensor(converter=_converter(own), **own) if own else Sensor()


def _converter(own: dict[str, Any]) -> Converter:
    """Takes its numbers out of those of a table; the range of an exact one is of no account."""
    bits, reach = own.pop("bits"), own.pop("range")
    return Converter(bits, reach) if bits else Converter()


def _limits(top: Table) -> dict[str, float]:
    found = _part(top, "limits")
    return {name: value for name, value in found.items() if name in top.values["limits"]}


def _models(top: Table) -> dict[str, Model]:
    return {name: _friction(table) for name, table in top.tables("models").items()}
