"""From tables of a TOML file to models, references and controllers."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from stickslip.control.controller import Controller
from stickslip.control.files import Placement, composed, placement
from stickslip.control.registry import law_files
from stickslip.core.arguments import says_number
from stickslip.core.config import Table, refuse_endless
from stickslip.core.control_spec import ControlLaw
from stickslip.core.errors import InputError
from stickslip.core.spec import Law
from stickslip.machines.files import machine, machine_in
from stickslip.machines.machine import IMPERFECTIONS, Machine
from stickslip.machines.rigid import RigidAxis
from stickslip.models import plugins
from stickslip.models.model import Model, Reference
from stickslip.models.tables import friction_laws, model, models, refuse_unknown
from stickslip.simulation.integrators import INTEGRATORS

__all__ = [
    "Numerics",
    "Placement",
    "axis",
    "controller",
    "friction_laws",
    "law_files",
    "model",
    "models",
    "motion",
    "numerics",
    "placement",
    "reference",
]


@dataclass(frozen=True)
class Numerics:
    """How a run is integrated and what its record keeps."""

    integrator: str = "auto"
    tolerance: float = 1e-9
    """rad"""
    time_step: float = 1e-4
    """s, of the fixed integrator"""
    output: float = 1e-3
    """Spacing of the record, s"""


def numerics(table: Table, base: Numerics) -> Numerics:
    """Read integrator, tolerance, time_step and output; `base` fills what the table leaves out."""
    return Numerics(
        table.choice("integrator", ("auto", *INTEGRATORS), base.integrator),
        table.positive("tolerance", "rad", base.tolerance),
        table.positive("time_step", "s", base.time_step),
        table.positive("output", "s", base.output),
    )


# ---- machine --------------------------------------------------------------------------------------------------


def axis(table: Table, friction: Model) -> RigidAxis:
    """Read the machine."""
    with table, table.blamed():
        return RigidAxis(
            table.positive("inertia", "kg·m²"),
            friction,
            table.number("load", "", 1.0, lower=0.0),
            table.number("temperature", "°C", 20.0),
        )


def design_inertia(table: Table) -> float:
    """The inertia that a study's file places gains with, kg·m²; 0 where it leaves that to each axis."""
    return table.positive("design_inertia", "kg·m²") if table.has("design_inertia") else 0.0


def sample_time_of(axis: RigidAxis | Machine) -> float:
    """The sample time that the axis gives its controllers, s; 0 where it leaves it to them."""
    return axis.sample_time if isinstance(axis, Machine) else 0.0


def machine_of(table: Table) -> dict[str, Machine]:
    """The machines of a table by what to append to its name: the whole one, with all its imperfections; less those of
    ``without``, with those of ``only`` alone, or one for each of ``each_alone``, alone."""
    with table, table.blamed():
        found = _whole_machine(table)
        ways = [key for key in ("without", "only", "each_alone") if table.has(key)]
        if len(ways) > 1:
            raise table.error(ways[1], f"and {ways[0]} exclude each other; give one of them")
        if table.has("start_angle"):
            found = replace(found, start_angle=table.number("start_angle", "rad"))
        if not ways:
            return {"": found}
        whole = ways[0] == "only" and table.values["only"] == []  # without any
        named: list[str] = [] if whole else list(table.texts(ways[0], IMPERFECTIONS))
        if ways[0] == "without":
            return {"": found.without(*named)}
        if ways[0] == "only":
            return {"": found.without(*(n for n in IMPERFECTIONS if n not in named))}
        return {f"-{n}": found.without(*(other for other in IMPERFECTIONS if other != n)) for n in named}


def _whole_machine(table: Table) -> Machine:
    """What ``machine`` is: a name of the library, a file, or a table with the content of one."""
    if isinstance(table.values.get("machine"), dict):
        return machine_in(table.table("machine"), table.path[-1])
    name = table.text("machine")
    return machine(str(table.document.locate(name)) if name.endswith(".toml") else name)


def machines(tables: Mapping[str, Table]) -> dict[str, Machine]:
    """Every machine of a study by name."""
    return {
        f"{name}{more}": found for name, table in tables.items() for more, found in machine_of(table).items()
    }


# ---- references ------------------------------------------------------------------------------------------------


def motion(table: Table) -> tuple[Reference, float]:
    """Read a table as a reference and its ``duration``, s."""
    with table:
        duration = table.positive("duration", "s")
        return reference(table), duration


def reference(table: Table) -> Reference:
    """Read what is left of the table as a reference: kind and parameters, or the file of a table of points."""
    kind = table.choice("kind", plugins.reference_names())
    with table.blamed():
        if kind == "table" and table.has("file"):
            return Reference.table(*_points(table, table.text("file")))
        given = table.rest()
        if (
            kind == "table"
            and {"time", "position"} == set(given)
            and all(isinstance(v, list) for v in given.values())
        ):
            return Reference.table(given["time"], given["position"])
        refuse_unknown(table, given, plugins.reference_kind(kind), ["file"] if kind == "table" else [])
        return Reference(kind, **given)


def _points(table: Table, written: str) -> list[list[float]]:
    """Columns of a CSV file: time (s), position (rad) and perhaps velocity (rad/s); one line of names may lead."""
    path = table.document.locate(written)
    refuse_endless(path)
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [
                (i, row) for i, row in enumerate(csv.reader(file), 1) if row and not row[0].startswith("#")
            ]
    except (OSError, ValueError, csv.Error) as error:  # ValueError: not UTF-8, or a NUL in the path
        reason = getattr(error, "strerror", None) or str(error)
        raise table.error("file", f"cannot be read ({reason}); give a CSV file") from None
    if rows and not says_number(rows[0][1][0]):
        rows = rows[1:]
    if len(rows) < 2:
        raise table.error("file", "has fewer than two points; give time, position and perhaps velocity")
    width = len(rows[0][1])
    points: list[list[float]] = []
    for line, row in rows:
        numbers = [float(x) if says_number(x) else math.nan for x in row]
        if width not in (2, 3) or len(row) != width or not all(map(math.isfinite, numbers)):
            raise InputError(
                f"{written} line {line}: {','.join(row)[:60]!r} is not 2 or 3 finite numbers "
                "(time s, position rad, perhaps velocity rad/s)"
            )
        points.append(numbers)
    return [list(column) for column in zip(*points)]


# ---- controllers ------------------------------------------------------------------------------------------------


def controller(
    table: Table,
    inertia: float,
    default: Placement | None,
    laws: Mapping[str, Model],
    files: Mapping[str, Law | ControlLaw],
    sample_time: float = 0.0,
) -> Controller:
    """Read a controller, of control laws or in its short form (`stickslip.control.files`).

    Parameters
    ----------
    table : Table
    inertia : float
        Of the axis, kg·m²: used for pole placement.
    default : Placement or None
        Where the poles lie if the table has no ``placement``.
    laws : mapping of str to Model
        What ``law`` may name.
    files : mapping of str to Law or ControlLaw
        Laws from files, by name.
    sample_time : float
        Of the axis that it is for, s, where the table gives none (`sample_time_of`).
    """
    own = {name: law for name, law in files.items() if isinstance(law, ControlLaw)}
    return composed(table, inertia, placement(table) or default, laws, own, sample_time)
