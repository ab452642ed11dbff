"""A study or sweep given as a mapping: the content of its TOML file, with objects where the file has tables."""

from __future__ import annotations

import difflib
import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from stickslip.control.block import ControlBlock
from stickslip.control.compensator import Compensator
from stickslip.control.controller import Controller
from stickslip.control.linear import Cascade, Gains
from stickslip.control.written import NameOf, block_table, compensator_table, table_as_given
from stickslip.core.control_spec import PLACES
from stickslip.core.errors import ConfigError, InputError, ModelRemark, suggestion
from stickslip.machines.machine import Machine
from stickslip.machines.rigid import RigidAxis
from stickslip.machines.written import tables_of
from stickslip.models import plugins
from stickslip.models.model import Reference, level_of_caller
from stickslip.studies.plan import BUILT_IN, Study
from stickslip.verbs.identification import IdentificationResult
from stickslip.verbs.laws_given import MODEL, HeldLaws, friction_table, insist_on_home, model_of, model_table
from stickslip.verbs.plain_given import PLAIN, Place, absolute, mapping_at, plain
from stickslip.verbs.recommendation import RecommendationResult

AXIS = "a RigidAxis, what `identify` returned, or a mapping such as {'inertia': 4e-4}"
MACHINE = "a Machine, what `identify` returned, or a mapping such as {'machine': 'thesis-dry'}"
REFERENCE = "a pair (Reference, duration in s), or a mapping with 'kind' and 'duration'"
CONTROLLER = "a Controller, what `recommend` returned, or a mapping such as {'linear': 'PD'}"
STUDY = "a mapping, the path of a study's file, or the name of a study that ships with the package"


# ---- whole files ----------------------------------------------------------------------------------------------


def study_tables(given: Mapping[str, Any], at: Place) -> dict[str, Any]:
    """The content of a study's file.

    Parameters
    ----------
    given : mapping
    at : Place

    Raises
    ------
    InputError
        If something in it is of a wrong kind, or cannot stand in a file; one line that names the key.
    """
    content = mapping_at(given, at, PLAIN)
    laws = HeldLaws.of(content, at)
    out, brought = dict[str, Any](), dict[str, Any]()
    for key, value in content.items():
        here = at.key(key)
        if key == "axis":
            out[key] = _axis(value, here)
            if isinstance(value, (RigidAxis, IdentificationResult)):
                friction = _axis_of(value, here).friction
                brought = {friction.law.name: model_table(friction, here)}
        elif key == "comparisons":
            out[key] = {
                name: _comparison(one, at_one, laws) for name, one, at_one in _family(value, here, PLAIN)
            }
        elif key == "plugins":
            out[key] = _plugins(value, here)
        elif key in FAMILIES:
            read_one, words = FAMILIES[key]
            out[key] = {
                name: read_one(one, at_one, laws) for name, one, at_one in _family(value, here, words)
            }
        else:
            out[key] = _other(key, value, here)
    if brought and "friction" in content:
        said = (
            f"{at.key('axis')}: its friction, {next(iter(brought))}, is left out where friction is given too"
        )
        warnings.warn(said, ModelRemark, stacklevel=level_of_caller(2) or 2)
    elif brought:
        out["friction"] = brought
    if laws.held:
        out["laws"] = {**out.get("laws", {}), **laws.held}
    return out


def _other(key: str, value: Any, at: Place) -> Any:
    """A key that takes no objects; a misspelt one of those that do is called so."""
    try:
        return plain(value, at)
    except InputError:
        if near := difflib.get_close_matches(key, ["axis", *FAMILIES], n=1):
            raise ConfigError(f"{at}: unknown key; did you mean {near[0]!r}?") from None
        raise


def sweep_tables(given: Mapping[str, Any], at: Place) -> dict[str, Any]:
    """As `study_tables`, of a sweep's file."""
    out: dict[str, Any] = {}
    for key, value in mapping_at(given, at, PLAIN).items():
        here = at.key(key)
        if key == "study":
            out[key] = _study(value, here)
        elif key == "model" and isinstance(value, IdentificationResult):
            with here.blamed():
                insist_on_home(value.model.law, here)
                out[key] = dict(value.table().values)
        elif key == "model" and isinstance(value, (str, os.PathLike)):
            out[key] = absolute(cast("str | os.PathLike[str]", value))
        elif key == "model" and not isinstance(value, Mapping):
            raise here.wrong(value, "what `identify` returned, or the path of its model")
        else:
            out[key] = plain(value, here)
    return out


def _study(value: Any, at: Place) -> Any:
    if isinstance(value, Study):
        value = value.source
    if isinstance(value, (str, os.PathLike)):
        path = cast("str | os.PathLike[str]", value)
        if path in BUILT_IN or Path(path).suffix == ".toml" or Path(path).exists():
            return path if path in BUILT_IN else absolute(path)
        remedy = suggestion(os.fspath(path), BUILT_IN, f"give {STUDY}")
        raise ConfigError(f"{at}: unknown study {os.fspath(path)!r}; {remedy}")
    return study_tables(mapping_at(value, at, STUDY), at)


def _family(value: Any, at: Place, words: str) -> Iterator[tuple[str, Any, Place]]:
    """Name, value and place of each of a family; `words` say what each must be."""
    for name, one in mapping_at(value, at, f"a mapping of names, each to {words}").items():
        yield name, one, at.key(name)


def _plugins(value: Any, at: Place) -> Any:
    found = plain(value, at)
    if not isinstance(found, list):
        return found
    return [absolute(v) if isinstance(v, str) else v for v in cast("list[Any]", found)]


def _comparison(value: Any, at: Place, laws: HeldLaws) -> dict[str, Any]:
    """Frictions and controllers of its own may be objects."""
    own: dict[str, Any] = {}
    for key, inside in mapping_at(value, at, PLAIN).items():
        here = at.key(key)
        family = {"friction": "friction", "controller": "controllers"}.get(key)
        if family:
            read_one, words = FAMILIES[family]
            own[key] = {
                name: read_one(one, at_one, laws) for name, one, at_one in _family(inside, here, words)
            }
        else:
            own[key] = plain(inside, here)
    return own


# ---- frictions, axes and machines -----------------------------------------------------------------------------


def _friction(value: Any, at: Place, _: HeldLaws) -> dict[str, Any]:
    return friction_table(value, at)


def _axis_of(value: RigidAxis | IdentificationResult, at: Place) -> RigidAxis:
    with at.blamed():
        return value if isinstance(value, RigidAxis) else value.axis


def _axis(value: Any, at: Place) -> dict[str, Any]:
    if not isinstance(value, (RigidAxis, IdentificationResult)):
        return plain(mapping_at(value, at, AXIS), at)
    axis = _axis_of(value, at)
    usual = RigidAxis(axis.inertia, axis.friction)
    own = {n: getattr(axis, n) for n in ("load", "temperature") if getattr(axis, n) != getattr(usual, n)}
    return plain({"inertia": axis.inertia, **own}, at)


def _machine(value: Any, at: Place, _: HeldLaws) -> dict[str, Any]:
    if isinstance(value, (Machine, IdentificationResult)):
        return {"machine": _machine_content(value, at)}
    table = mapping_at(value, at, MACHINE)
    inside = table.get("machine")
    if isinstance(inside, (Machine, IdentificationResult)):
        table["machine"] = _machine_content(inside, at.key("machine"))
    return plain(table, at)


def _machine_content(value: Machine | IdentificationResult, at: Place) -> dict[str, Any]:
    """What a machine's file says."""
    with at.blamed():
        machine = value if isinstance(value, Machine) else value.machine
        for model in (machine.contact.friction, *machine.models.values()):
            insist_on_home(model.law, at)
        return plain(tables_of(machine), at)


# ---- references --------------------------------------------------------------------------------------------------


def _reference(value: Any, at: Place, _: HeldLaws) -> dict[str, Any]:
    if isinstance(value, (tuple, list)):
        pair = cast("list[Any]", value)
        if len(pair) != 2 or not isinstance(pair[0], Reference):
            raise at.wrong(pair, REFERENCE)
        return {**_motion(pair[0], at), "duration": plain(pair[1], at.key("duration"))}
    table = mapping_at(value, at, REFERENCE)
    kind, file = table.get("kind"), table.get("file")
    if isinstance(kind, Reference):
        table = {**_motion(kind, at.key("kind")), **{k: v for k, v in table.items() if k != "kind"}}
    if isinstance(file, str):
        table["file"] = absolute(file)
    return plain(table, at)


def _motion(reference: Reference, at: Place) -> dict[str, Any]:
    """The keys of a reference's table, all its points too."""
    kind = reference.kind
    if kind.name not in plugins.reference_names() or plugins.reference_kind(kind.name) is not kind:
        raise ConfigError(
            f"{at}: reference {kind.name!r} lives in memory alone, where no file finds it again; give its points, "
            "Reference.table(time, position, velocity)"
        )
    return plain(reference.as_dict(), at)


# ---- controllers -------------------------------------------------------------------------------------------------


def _controller(value: Any, at: Place, laws: HeldLaws) -> dict[str, Any]:
    name_of = laws.namer(at)
    if isinstance(value, RecommendationResult):
        with at.blamed():
            value = value.controller
    if not isinstance(value, Controller):
        return _controller_table(mapping_at(value, at, CONTROLLER), at, name_of)
    with at.blamed():
        value = replace(value, alone=False)  # No file says so: one that needs it is refused.
    for law in value.control_laws:
        insist_on_home(law, at)
    return plain(table_as_given(value, name_of), at)


def _controller_table(table: dict[str, Any], at: Place, name_of: NameOf) -> dict[str, Any]:
    """A controller's table in which gains, a compensator, control laws or friction laws are objects."""
    out: dict[str, Any] = {}
    for key, value in table.items():
        here = at.key(key)
        if key == "gains" and isinstance(value, (Gains, Cascade)):
            out["cascade" if isinstance(value, Cascade) else key] = plain(value._asdict(), here)
        elif key == "compensator" and isinstance(value, Compensator):
            out |= plain(compensator_table(value, name_of), here)
        elif key in PLACES:
            blocks = cast("list[Any]", value) if isinstance(value, (list, tuple)) else [value]
            tables = [_block(b, here, name_of) for b in blocks]
            out[key] = tables if isinstance(value, (list, tuple)) else tables[0]
        elif key == "law" and (model := model_of(value, here)) is not None:
            out[key] = name_of(model)
        else:
            out[key] = plain(value, here, key)
    return out


def _block(value: Any, at: Place, name_of: NameOf) -> Any:
    if isinstance(value, ControlBlock):
        insist_on_home(value.law, at)
        return plain(block_table(value, name_of), at)
    found = dict(cast("Mapping[Any, Any]", value)) if isinstance(value, Mapping) else {}
    if (model := model_of(found.get("friction"), at.key("friction"))) is not None:
        return plain({**found, "friction": name_of(model)}, at)
    return plain(value, at)


FAMILIES: Mapping[str, tuple[Callable[[Any, Place, HeldLaws], dict[str, Any]], str]] = {
    "friction": (_friction, MODEL), "laws": (_friction, MODEL), "machines": (_machine, MACHINE),
    "references": (_reference, REFERENCE), "controllers": (_controller, CONTROLLER),
}  # fmt: skip
"""What reads each of a family of tables, and what each may be."""
