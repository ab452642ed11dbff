"""From tables of a TOML file to models, references and controllers."""

from __future__ import annotations

import csv
import importlib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from stickslip import plugins
from stickslip.config import Table, refuse_endless
from stickslip.control import compensators
from stickslip.control.compensators._base import Compensator
from stickslip.control.controller import Controller
from stickslip.control.linear import LINEAR, Cascade, Gains, place
from stickslip.control.sampled_controller import SampledController
from stickslip.control_spec import ControlLaw
from stickslip.errors import ConfigError, InputError, suggestion
from stickslip.machines.rigid import RigidAxis
from stickslip.model import Model, Reference
from stickslip.simulation.closed_loop import INTEGRATORS
from stickslip.spec import Described, Law
from stickslip.study.blocks import composed, is_composed

__all__ = [
    "Numerics",
    "Placement",
    "axis",
    "controller",
    "law_files",
    "models",
    "numerics",
    "placement",
    "reference",
]

for _name in compensators.COMPENSATORS:
    importlib.import_module(f"{compensators.__name__}.{_name}")


@dataclass(frozen=True)
class Placement:
    """Where the poles of the loop without friction lie."""

    bandwidth: float
    """Natural frequency, Hz"""
    damping: float
    """Damping ratio of the pair"""


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


# ---- friction ------------------------------------------------------------------------------------------------


def law_files(table: Table) -> dict[str, Law | ControlLaw]:
    """The laws and control laws in the files that ``plugins`` lists, by name."""
    found: dict[str, Law | ControlLaw] = {}
    for path in table.files("plugins"):
        with table.blamed():
            named_by = table.label("plugins")
            law = plugins.law_or_control_law(str(path), named_by) if path.suffix == ".py" else None
            if law is None:
                raise ConfigError(
                    f"{table.label('plugins')}: {path.name} is no law's file; its name ends in .py"
                )
            if law.name in found or law.name in (*plugins.law_names(), *plugins.control_law_names()):
                raise ConfigError(
                    f"{table.label('plugins')}: {path.name} defines {law.name!r}, a name taken already"
                )
        found[law.name] = law
    return found


def models(tables: Mapping[str, Table], laws: Mapping[str, Law | ControlLaw]) -> dict[str, Model]:
    """Read named models; one may be ``like`` another of them, with other values or scaled ones.

    Parameters
    ----------
    tables : mapping of str to Table
    laws : mapping of str to Law
        Laws from files, by name; the registered ones are known anyway.
    """
    done: dict[str, Model] = {}
    own = friction_laws(laws)
    for name in tables:
        _resolve(name, tables, own, done, ())
    return {name: done[name] for name in tables}


def friction_laws(laws: Mapping[str, Law | ControlLaw]) -> dict[str, Law]:
    """Those of the laws that are friction laws."""
    return {name: law for name, law in laws.items() if isinstance(law, Law)}


def _resolve(
    name: str,
    tables: Mapping[str, Table],
    laws: Mapping[str, Law],
    done: dict[str, Model],
    chain: tuple[str, ...],
) -> Model:
    if name not in done:
        with tables[name] as table:
            base: Model | None = None
            if table.has("like"):
                like = table.choice(
                    "like", [n for n in tables if n != name], family=".".join(table.path[:-1])
                )
                if like in chain:
                    raise table.error(
                        "like", f"closes a circle ({' -> '.join((*chain, name, like))}); give a law"
                    )
                base = _resolve(like, tables, laws, done, (*chain, name))
            done[name] = model(table, laws, base)
    return done[name]


def model(table: Table, laws: Mapping[str, Law], base: Model | None = None) -> Model:
    """Read a law, its choices and its parameters; `base` fills what the table leaves out."""
    scale: dict[str, Any] = {}
    if table.has("scale"):
        with table.table("scale") as factors:
            scale = {key: factors.number(key, "") for key in factors.values}
    with table.blamed():
        if isinstance(table.values.get("law"), dict):
            with table.table("law") as file:
                base = Model.from_file(file.document.locate(file.text("model")))
        law = base.law if base else _law(table, laws)
        options = {c.name for c in law.choices}
        given = table.rest()
        choices = {k: v for k, v in given.items() if k in options and isinstance(v, str)}
        if "slip_rule" in choices:
            raise table.error("slip_rule", "belongs to the whole run; give it at the top of the file")
        variant = law.having(**choices)
        kept = {
            f.name for f in variant.fields
        }  # another curve leaves the parameters of the former one behind
        inherited: dict[str, Any] = base.parameters._asdict() if base else {}
        values = {k: v for k, v in inherited.items() if k in kept}
        values.update({k: v for k, v in given.items() if k not in choices})
        _refuse_unknown(table, values, variant, options)
        found = Model(law, choices, **values)
        found = found.scaled(**scale) if scale else found
        # A model that a file holds has been remarked upon as it was read.
        return found if base and found.parameters == base.parameters else found.warn(table.label())


def _refuse_unknown(
    table: Table, values: Mapping[str, Any], described: Described, others: Iterable[str] = ()
) -> None:
    """Refuse what is no parameter, before Python takes it for an argument of its own."""
    names = [f.name for f in described.fields]
    for key in values:
        if key not in names:
            remedy = suggestion(key, [*names, *others])
            raise ConfigError(f"{table.label(key)}: {described.name} has no parameter {key!r}; {remedy}")


def _law(table: Table, laws: Mapping[str, Law]) -> Law:
    name = table.text("law")
    if name.endswith(".py"):
        return plugins.law(str(table.document.locate(name)), table.label("law"))
    if name in laws:
        return laws[name]
    return plugins.law(table.choice("law", (*plugins.law_names(), *laws)))


def axis(table: Table, friction: Model) -> RigidAxis:
    """Read the machine."""
    with table, table.blamed():
        return RigidAxis(
            table.positive("inertia", "kg·m²"),
            friction,
            table.number("load", "", 1.0, lower=0.0),
            table.number("temperature", "°C", 20.0),
        )


# ---- references ------------------------------------------------------------------------------------------------


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
        _refuse_unknown(table, given, plugins.reference_kind(kind), ["file"] if kind == "table" else [])
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
    if rows and not _is_number(rows[0][1][0]):
        rows = rows[1:]
    if len(rows) < 2:
        raise table.error("file", "has fewer than two points; give time, position and perhaps velocity")
    width = len(rows[0][1])
    points: list[list[float]] = []
    for line, row in rows:
        numbers = [float(x) if _is_number(x) else math.nan for x in row]
        if width not in (2, 3) or len(row) != width or not all(map(math.isfinite, numbers)):
            raise InputError(
                f"{written} line {line}: {','.join(row)[:60]!r} is not 2 or 3 finite numbers "
                "(time s, position rad, perhaps velocity rad/s)"
            )
        points.append(numbers)
    return [list(column) for column in zip(*points)]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


# ---- controllers ------------------------------------------------------------------------------------------------


def placement(table: Table) -> Placement | None:
    """Read ``placement = {bandwidth_hz, damping}``, if it is there."""
    if not table.has("placement"):
        return None
    with table.table("placement") as poles:
        return Placement(poles.positive("bandwidth_hz", "Hz"), poles.positive("damping", ""))


def controller(
    table: Table,
    inertia: float,
    default: Placement | None,
    laws: Mapping[str, Model],
    files: Mapping[str, Law | ControlLaw],
) -> Controller | SampledController:
    """Read a controller; one made of control laws has a table ``loop`` (`stickslip.study.blocks`).

    Parameters
    ----------
    table : Table
        ``linear`` and ``placement``, or ``gains``, or ``cascade``; ``compensator``, ``law``, ``gain``, ``filter_hz``,
        ``lead``, ``deadband``, ``offset``, ``inertia_feedforward``, ``substeps``;
        ``torque_limit``, ``sample_time``, ``encoder_counts``, ``velocity_filter``.
    inertia : float
        Of the axis, kg·m²: what pole placement reckons with.
    default : Placement or None
        Where the poles lie if the table has no ``placement``.
    laws : mapping of str to Model
        What ``law`` may name.
    files : mapping of str to Law or ControlLaw
        Laws from files, by name.
    """
    if is_composed(table):
        own = {name: law for name, law in files.items() if isinstance(law, ControlLaw)}
        return composed(table, inertia, placement(table) or default, laws, own)
    with table.blamed():
        return Controller(
            _gains(table, inertia, default),
            _compensator(table, laws),
            table.positive("torque_limit", "N·m") if table.has("torque_limit") else math.inf,
            table.number("sample_time", "s", 0.0, lower=0.0),
            table.number("encoder_counts", "counts per revolution", 0.0, lower=0.0),
            table.number("velocity_filter", "Hz", 0.0, lower=0.0),
        )


def _gains(table: Table, inertia: float, default: Placement | None) -> Gains | Cascade:
    own = placement(table)
    if table.has("cascade"):
        for other in ("gains", "linear", "placement"):
            if table.has(other):
                raise ConfigError(
                    f"{table.label()}: cascade and {other} exclude each other; give one of them"
                )
        with table.table("cascade") as given:
            return Cascade(
                given.number("kv", "1/s", lower=0.0), given.number("kvp", "N·m·s/rad", lower=0.0),
                given.number("kvi", "N·m/rad", 0.0, lower=0.0), given.number("feed", "", 1.0, lower=0.0),
            )  # fmt: skip
    if table.has("gains"):
        if table.has("linear") or own:
            raise ConfigError(f"{table.label()}: gains and linear exclude each other; give one of them")
        with table.table("gains") as gains:
            kp = gains.number("kp", "N·m/rad", lower=0.0)
            ki = gains.number("ki", "N·m/(rad·s)", 0.0, lower=0.0)
            kd = gains.number("kd", "N·m·s/rad", 0.0, lower=0.0)
            return Gains(kp, ki, kd, gains.number("kr", "N·m·s/rad", 0.0, lower=0.0))
    kind = table.choice("linear", LINEAR)
    poles = own or default
    if poles is None:
        raise ConfigError(
            f"{table.label('placement')} is missing; give {{bandwidth_hz = ..., damping = ...}}"
        )
    return place(kind, inertia, poles.bandwidth, poles.damping)


def _compensator(table: Table, laws: Mapping[str, Model]) -> Compensator | None:
    kinds = {kind.name: kind for kind in Compensator.__subclasses__()}
    if not table.has("compensator"):
        for key in (
            "law",
            "gain",
            "filter_hz",
            "lead",
            "deadband",
            "offset",
            "inertia_feedforward",
            "substeps",
        ):
            if key in table.values:
                table.choice("compensator", kinds)
        return None
    kind = kinds[table.choice("compensator", kinds)]
    law = laws[table.choice("law", laws, family="laws")]
    gain = table.number("gain", "", 1.0)
    corner = table.positive("filter_hz", "Hz") if table.has("filter_hz") else None
    parts = table.number("substeps", "", 1.0, lower=1.0)
    if not parts.is_integer():
        raise table.error("substeps", "must be a whole number")
    return kind(
        law, gain, corner, table.number("lead", "s", 0.0), table.number("deadband", "rad/s", 0.0),
        table.number("offset", "N·m", 0.0), table.number("inertia_feedforward", "kg·m²", 0.0),
        int(parts),
    )  # fmt: skip
