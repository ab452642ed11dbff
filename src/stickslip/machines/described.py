"""Numbers of a machine's parts with unit, meaning and bounds beside the field itself.

The help of the class and the keys of a machine's file (`stickslip.machines.keys`) come from there.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

from stickslip.core.description import Par

T = TypeVar("T")
HEAD = "\n\nAttributes\n----------\n"


@functools.cache
def numbers_of(kind: type[Any]) -> Mapping[str, Par]:
    """The described numbers of a dataclass, by field."""
    hints: dict[str, Any] = get_type_hints(kind, include_extras=True)
    annotated = {name: get_args(hint) for name, hint in hints.items() if get_origin(hint) is Annotated}
    return {name: par for name, (_, *more) in annotated.items() for par in more if isinstance(par, Par)}


def default_of(kind: type[Any], field: str) -> Any:
    """The default of a dataclass's field; `dataclasses.MISSING` where it must be given."""
    return next(f.default for f in dataclasses.fields(kind) if f.name == field)


def described(kind: type[T]) -> type[T]:
    """A dataclass whose docstring names its described numbers, behind the attributes that it names itself."""
    before, _, rest = inspect.cleandoc(kind.__doc__ or "").partition(HEAD)
    named, _, behind = rest.partition("\n\n")
    lines = [
        *([named] if named else []),
        *(_entry(kind, name, par) for name, par in numbers_of(kind).items()),
    ]
    kind.__doc__ = before + HEAD + "\n".join(lines) + "\n" + (f"\n{behind}\n" if behind else "")
    return kind


def _entry(kind: type[Any], name: str, par: Par) -> str:
    typed = "int" if par.whole else "float"
    told = ", ".join([*([] if par.unit == "-" else [par.unit]), *in_words(default_of(kind, name))])
    meaning = par.meaning[:1].upper() + par.meaning[1:]
    return f"{name} : {typed}\n    {meaning}{f' ({told})' if told else ''}."


def in_words(default: Any) -> list[str]:
    """What a number is where it is not given; empty where it must be."""
    if default is dataclasses.MISSING:
        return []
    return ["default none" if default in (math.inf, ()) else f"default {default:g}"]
