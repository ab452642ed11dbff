"""IEC 61131-3 structured text: a controller as a function block for a PLC or a drive."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from stickslip.control.composition import MEMORY, Settings
from stickslip.control.controller import Controller
from stickslip.export._hoist import hoisted
from stickslip.export._st import Names, functions, number
from stickslip.export._st_names import RESERVED, named_in_st
from stickslip.export._text import ascii_only, first_line, render
from stickslip.export.controllers import (
    STILL,
    ControllerTarget,
    checked_name,
    counts_of,
    golden_samples,
    head_of,
    settings_of,
    trees_of,
)
from stickslip.export.golden import as_csv
from stickslip.export.job import Export
from stickslip.export.st import NOTE
from stickslip.export.st import STRUCTURES as OF_LAWS
from stickslip.spec import Field, Surroundings, fields_of

__all__ = ["CONTROLLER"]

GIVEN = ("position", "reference_position", "reference_velocity", "reference_acceleration")
BLOCK = (
    *GIVEN,
    "load",
    "temperature",
    "restart",
    "elsewhere",
    "held",
    "torque",
    "fault",
    "started",
    *"nmzpu",
)
"""Variables of the function block, which has another name."""
STRUCTURES = {**OF_LAWS, "n": "settings", "m": "memory"}


def write(controller: Controller, name: str, single: bool = False, around: Surroundings = STILL) -> Export:
    """One file with types, functions and the block; golden samples; how to use it."""
    x, counts = named_in_st([checked_name(name)], RESERVED | set(BLOCK))[name], counts_of(controller)
    trees = hoisted(trees_of(controller, ["_sample", "_follow"]))
    structures: dict[str, tuple[Sequence[Field], Mapping[str, Any]]] = {
        "parameters": (controller.fields, controller.values()),
        "settings": (fields_of(Settings), settings_of(controller)),
        "state": (controller.state_fields, {}),
        "memory": (MEMORY, {}),
    }
    fields = [f.name for own, _ in structures.values() for f in own]
    names = Names.of(trees, x, [*fields, *Surroundings._fields])
    word = names.words
    parts = functions(trees, names, STRUCTURES, counts)
    begin = [f"{word[n]} : LREAL := {number(v)};" for n, v in around._asdict().items()]
    values: dict[str, Any] = {
        **head_of(controller, name),
        "x": x,
        "file": f"{name}.st",
        "structures": [
            *((kind, [*declared(own, given, counts, word)]) for kind, (own, given) in structures.items()),
            ("surroundings", begin),
        ],
        "cleared": [
            *cleared("m", MEMORY, counts, word),
            *cleared("z", controller.state_fields, counts, word),
        ],
        "word": word,
        "calls": {
            entry: call(names.functions[f"_{entry}"], [a.arg for a in trees[f"_{entry}"].args.args], word)
            for entry in ("sample", "follow")
        },
        "note": NOTE,
    }
    code = [
        {"about": ascii_only(first_line(doc)) or f"{of.strip('_')}, to full precision near 0", "lines": lines}
        for of, doc, lines in parts
    ]
    files = {
        f"{name}.st": render("st_controller.st.j2", **values, functions=code),
        "golden_samples.csv": as_csv(golden_samples(controller, around)),
        "README.md": render("st_controller_readme.md.j2", **values),
    }
    return Export(files, (NOTE,))


def call(function: str, arguments: Sequence[str], word: Mapping[str, str]) -> str:
    """A call of the sample, or of the one that follows, with the block's variables."""
    structures = [a for a in arguments if a in STRUCTURES]
    numbers = [*GIVEN, "held"][: len(arguments) - len(structures)]
    given = [*numbers, *(word[a] for a in structures)]
    return f"{function}({', '.join(f'{word[a]} := {g}' for a, g in zip(arguments, given, strict=True))})"


def declared(
    fields: Sequence[Field], values: Mapping[str, Any], counts: Mapping[str, int], word: Mapping[str, str]
) -> Iterable[str]:
    """Fields of a structure with their meaning, and their values where there are any."""
    for f in fields:
        start, kind = "", "LREAL"
        if f.per_element:
            kind = f"ARRAY[0..{counts[f'{f.par.per}s_'] - 1}] OF LREAL"
        if values:
            value = values[f.name]
            start = f" := [{', '.join(map(number, value))}]" if f.per_element else f" := {number(value)}"
        yield f"{word[f.name]} : {kind}{start}; (* {ascii_only(f'{f.par.meaning}, {f.par.unit}')} *)"
    if not fields:
        yield "none : LREAL;"


def cleared(
    owner: str, fields: Sequence[Field], counts: Mapping[str, int], word: Mapping[str, str]
) -> Iterable[str]:
    """Statements that put a structure to its start."""
    for f in fields:
        if f.per_element:
            yield from (f"{owner}.{word[f.name]}[{i}] := 0.0;" for i in range(counts[f"{f.par.per}s_"]))
        else:
            yield f"{owner}.{word[f.name]} := 0.0;"


CONTROLLER = ControllerTarget(write)
