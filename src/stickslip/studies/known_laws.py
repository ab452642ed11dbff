"""What an axis gives a study's controllers, such as the friction laws that they may name: those of the study's file,
and those identified on its machines."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

from stickslip.control.files import listed
from stickslip.core.config import Table
from stickslip.core.control_spec import PLACES
from stickslip.core.errors import ConfigError
from stickslip.machines.machine import Machine
from stickslip.models.model import Model


class Design(NamedTuple):
    """What a controller is made for: inertia (kg·m²), sample time (s, 0: none), and the laws that it may name."""

    inertia: float
    sample_time: float
    laws: tuple[tuple[str, Model], ...]


@dataclass(frozen=True)
class KnownLaws:
    """What the names of laws mean, axis by axis.

    Attributes
    ----------
    given : mapping of str to Model
        [laws.NAME] of the file, which come first everywhere.
    machines : mapping of str to Machine
        Whose own models controllers on them hold; other axes hold what all machines agree on.
    """

    given: Mapping[str, Model]
    machines: Mapping[str, Machine]

    @property
    def shared(self) -> dict[str, Model]:
        """What a name means on an axis that has no model of that name itself."""
        found: dict[str, Model] = {}
        for machine in self.machines.values():
            found |= machine.models
        apart = {
            name for machine in self.machines.values() for name, model in machine.models.items()
            if model.as_dict() != found[name].as_dict()
        }  # fmt: skip
        return {name: model for name, model in found.items() if name not in apart} | dict(self.given)

    def on(self, axis: str) -> dict[str, Model]:
        """What the names mean for controllers of an axis."""
        own = self.machines[axis].models if axis in self.machines else dict[str, Model]()
        return {**self.shared, **own, **self.given}

    def named_in(self, table: Table) -> dict[str, Model]:
        """The laws that a table names for an axis of no machine; none where it has no such key."""
        shared, given = self.shared, table.values.get("laws")
        if isinstance(given, list):
            names = [name for name in cast("list[Any]", given) if isinstance(name, str)]
            self.insist_on(names, shared, table.label("laws"))
        return {n: shared[n] for n in table.texts("laws", shared, "laws")} if table.has("laws") else {}

    def insist_on(self, names: Iterable[str], known: Mapping[str, Model], label: str) -> None:
        """Refuse a name that means another law on each of several machines.

        Raises
        ------
        ConfigError
        """
        for name in (name for name in names if name not in known):
            holders = [key for key, one in self.machines.items() if name in one.models]
            if holders:
                raise ConfigError(
                    f"{label}: {name!r} is another law on each of the machines {', '.join(holders)}; give the one that "
                    f"is meant as [laws.{name}]"
                )


def laws_in(table: Table) -> list[str]:
    """The names of friction laws in a controller's table."""
    blocks = [one.values.get("friction") for place in PLACES for one in listed(table, place)]
    return [name for name in (table.values.get("law"), *blocks) if isinstance(name, str)]
