"""Convert a closed loop from the workbench's forms to a file of `stickslip simulate` and to Python, and describe the
forms."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, cast

from stickslip.core.errors import InputError
from stickslip.core.spec import Described, Field
from stickslip.models import plugins

PARTS = {
    "bandwidth_hz": "Hz", "damping": "-", "sample_time": "s", "encoder_counts": "counts a revolution",
    "torque_limit": "N·m", "gain": "-", "lead": "s", "deadband": "rad/s", "filter_hz": "Hz",
}  # fmt: skip
"""Parameters of a controller, with their units."""
OWN = ("gain", "lead", "deadband", "filter_hz")
"""Those of the compensator."""
LINEAR = ("PD", "PID", "PR")
COMPENSATORS = ("feedforward", "feedback")
LONGEST = 120.0
"""Longest run of the workbench, s"""


def descriptions() -> dict[str, Any]:
    """Return laws and references with every parameter: unit, symbol, meaning, bounds, an example."""
    laws = [plugins.law(name) for name in plugins.law_names()]
    kinds = [plugins.reference_kind(name) for name in plugins.reference_names()]
    return {
        "laws": [{**described(law), "example": dict(law.example)} for law in laws],
        "references": [described(kind) for kind in kinds],
        "controller": [{"name": name, "unit": unit} for name, unit in PARTS.items()],
    }


def described(thing: Described) -> dict[str, Any]:
    """Return the parameters of a law or reference for a form."""
    title = str(getattr(thing, "title", "")) or thing.name
    return {"name": thing.name, "title": title, "fields": [field_of(f) for f in thing.fields]}


def field_of(f: Field) -> dict[str, Any]:
    """Return one parameter for a form."""
    finite = {k: v for k, v in (("lower", f.par.lower), ("upper", f.par.upper)) if math.isfinite(v)}
    return {
        "name": f.name, "unit": f.par.unit, "symbol": f.par.symbol, "meaning": f.par.meaning, "list": f.per_element,
        "positive": f.par.positive, "default": f.par.default, **finite,
    }  # fmt: skip


# ---- the case as tables -------------------------------------------------------------------------------------------


def tables_of(case: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of a `stickslip simulate` file.

    Raises
    ------
    InputError
        If a law, reference or number is invalid; other errors are found by the file's own reader.
    """
    friction, believed = part(case, "friction"), part(case, "believed")
    reference, controller = part(case, "reference"), part(case, "controller")
    kinds = plugins.reference_names()
    kind, linear = chosen(reference, "kind", kinds), chosen(controller, "linear", LINEAR)
    duration = numbers_in(case, ("duration",))
    if not 0.0 < duration.get("duration", 0.0) <= LONGEST:
        raise InputError(f"duration must be a number above 0 and at most {LONGEST:g} s")
    numbers = numbers_in(controller, tuple(PARTS))
    out: dict[str, Any] = {
        "axis": numbers_in(part(case, "axis"), ("inertia",)),
        "friction": law_table(friction),
        "reference": {"kind": kind, **values_in(reference, ("kind",)), **duration},
        "controller": {
            "linear": linear,
            "placement": {k: numbers.pop(k) for k in ("bandwidth_hz", "damping") if k in numbers},
        },
    }
    own = {k: numbers.pop(k) for k in OWN if k in numbers}
    out["controller"] |= numbers
    if controller.get("compensator"):
        name = chosen(controller, "compensator", COMPENSATORS)
        out["controller"] |= {"compensator": name, "law": "believed", **own}
        out["laws"] = {"believed": law_table(believed or friction)}
    return out


def part(case: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return a part of the case, which must be a table."""
    found: Any = case.get(name)
    found = {} if found is None else found
    if not isinstance(found, dict):
        raise InputError(f"{name} must be a table of names and values")
    return cast("dict[str, Any]", found)


def chosen(table: Mapping[str, Any], key: str, allowed: Any) -> str:
    """Return one of the allowed words, never a path or file."""
    value = table.get(key)
    if not isinstance(value, str) or value not in allowed:
        raise InputError(f"{key} must be one of {', '.join(allowed)}")
    return value


def law_table(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the law's name and parameters."""
    return {"law": chosen(table, "law", plugins.law_names()), **values_in(table, ("law",))}


def values_in(table: Mapping[str, Any], without: tuple[str, ...]) -> dict[str, Any]:
    """Return numbers and lists of numbers by name."""
    out: dict[str, Any] = {}
    for name, value in table.items():
        if name in without or value is None:
            continue
        if not name.isidentifier():
            raise InputError(f"{name[:40]!r} is not the name of a parameter")
        several: list[Any] = cast("list[Any]", value) if isinstance(value, list) else [value]
        if len(several) > 1000 or not all(is_number(v) for v in several):
            raise InputError(f"{name} must be a finite number, or a list of them")
        out[name] = [float(v) for v in several] if isinstance(value, list) else float(value)
    return out


def numbers_in(table: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, float]:
    """Return the given numbers with these names."""
    found = values_in({name: table.get(name) for name in names}, ())
    if any(isinstance(v, list) for v in found.values()):
        raise InputError(f"{', '.join(names)} must be numbers")
    return found


def is_number(value: object) -> bool:
    """Whether a value is a finite number."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300


# ---- the case as text ---------------------------------------------------------------------------------------------


def toml_of(case: Mapping[str, Any]) -> str:
    """Return a file with which `stickslip simulate` gives the same numbers.

    Raises
    ------
    InputError
    """
    import tomli_w

    return tomli_w.dumps(tables_of(case))


def python_of(case: Mapping[str, Any]) -> str:
    """Return a program that gives the same numbers.

    Raises
    ------
    InputError
    """
    tables = tables_of(case)
    controller, reference = dict(tables["controller"]), dict(tables["reference"])
    duration, poles = reference.pop("duration"), controller["placement"]
    kind, linear = reference.pop("kind"), controller["linear"]
    own = arguments({k: v for k, v in controller.items() if k in OWN})
    rest = {k: v for k, v in controller.items() if k in ("sample_time", "encoder_counts", "torque_limit")}
    compensator = "None"
    if "compensator" in controller:
        compensator = f"ss.{controller['compensator'].title()}({model_text(tables['laws']['believed'])}{own})"
    return f"""\
import stickslip as ss

axis = ss.RigidAxis(inertia={tables["axis"].get("inertia")!r}, friction={model_text(tables["friction"])})
linear = ss.place({linear!r}, inertia=axis.inertia, bandwidth={poles.get("bandwidth_hz")!r}, \
damping={poles.get("damping")!r})
controller = ss.Controller(linear, {compensator}{arguments(rest)})
reference = ss.Reference({kind!r}{arguments(reference)})
record = ss.simulate(axis, controller, reference, duration={duration!r})
for name, value in record.meta["metrics"].items():
    print(name, value)
"""


def model_text(table: Mapping[str, Any]) -> str:
    """Return a model as Python code."""
    return f"ss.Model({table['law']!r}{arguments({k: v for k, v in table.items() if k != 'law'})})"


def arguments(values: Mapping[str, Any]) -> str:
    """Return further arguments of a call as Python code."""
    return "".join(f", {name}={value!r}" for name, value in values.items())
