"""The machine that a model.toml of `stickslip identify` describes.

It has friction, inertia, a pendulum's weight, and motor and load behind a spring where the record told them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, cast

from stickslip.core.config import Table
from stickslip.core.errors import InputError, ParameterError
from stickslip.core.messages import name_file
from stickslip.machines.contact import Contact
from stickslip.machines.machine import Machine
from stickslip.machines.motor import Harmonics
from stickslip.machines.two_inertias import TwoInertias
from stickslip.models.model import Model

NOTE = "As identified from {records}; amplifier and encoder are ideal, a constant torque is not in it."
BEHIND = "Its spring is damped by {damping:g} of critical, which the record does not tell; friction is at the load."


def is_identified(table: Table) -> bool:
    """Whether a file's content is that of a model.toml, and not of a machine."""
    content = table.values
    return "law" in content and ("parameters" in content or "format" in content) and "friction" not in content


def identified_machine(table: Table, name: str) -> Machine:
    """The machine of a model.toml's content.

    Parameters
    ----------
    table : Table
    name : str
        Of the machine.

    Raises
    ------
    InputError
        If it holds no law or no inertia, or its tables are damaged.
    """
    friction, content = Model.from_table(table), table.values
    axis = cast("Mapping[str, Any]", content.get("axis", {}))
    numbers = {key: float(axis.get(key, 0.0)) for key in ("inertia", "gravity", "gravity_angle")}
    if not numbers["inertia"] > 0.0:
        raise InputError(
            f"{table.document.name} holds no inertia (axis.inertia), so that it is no machine; identify the axis with "
            "method axis"
        )
    train = train_in(content, table.document.name)
    flexible = train.axis(numbers["inertia"]) if train else None
    gravity, angle = numbers["gravity"], numbers["gravity_angle"]
    weight = Harmonics((1.0,), (gravity,), (0.5 * math.pi - angle,)) if gravity else Harmonics()
    records = [str(d.get("file", "a record")) for d in content.get("data", [])]
    notes = [NOTE.format(records=", ".join(records) or "a record")]
    if flexible is not None:
        notes.append(BEHIND.format(damping=flexible.damping))
    return Machine(
        name, numbers["inertia"], Contact(friction), title="an identified axis", flexible=flexible,
        cogging=weight, notes=tuple(notes),
    )  # fmt: skip


def train_in(content: Mapping[str, Any], file: str) -> TwoInertias | None:
    """Motor and load of a model.toml's content, where it has them.

    Raises
    ------
    InputError
        If its table is damaged.
    """
    if "drivetrain" not in content:
        return None
    try:
        return TwoInertias.from_dict(content["drivetrain"])
    except KeyError as error:
        raise InputError(
            f"{name_file(file)}: its drivetrain lacks {error}; identify the axis again"
        ) from None
    except (TypeError, ValueError, ParameterError) as error:
        raise InputError(
            f"{name_file(file)}: its drivetrain cannot be read ({error}); identify the axis again"
        ) from None
