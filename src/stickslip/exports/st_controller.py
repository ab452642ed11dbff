"""IEC 61131-3 structured text: a controller as a function block for a PLC or a drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from stickslip.control.composition import MEMORY, Settings
from stickslip.control.controller import Controller
from stickslip.core.spec import Field, Surroundings, fields_of
from stickslip.exports._hoist import hoisted
from stickslip.exports._st import Names, functions, number
from stickslip.exports._st_names import RESERVED, named_in_st, renamed
from stickslip.exports._text import render
from stickslip.exports.controllers import (
    STILL,
    ControllerTarget,
    checked_name,
    counts_of,
    golden_samples,
    head_of,
    settings_of,
    trees_of,
)
from stickslip.exports.golden import as_csv
from stickslip.exports.job import Export
from stickslip.exports.st import NOTE, about, cleared, declared
from stickslip.exports.st import STRUCTURES as OF_LAWS

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
    files = {
        f"{name}.st": render("st_controller.st.j2", **values, functions=about(parts)),
        "golden_samples.csv": as_csv(golden_samples(controller, around)),
        "README.md": render("st_controller_readme.md.j2", **values),
    }
    return Export(files, (*renamed(name, x), NOTE))


def call(function: str, arguments: Sequence[str], word: Mapping[str, str]) -> str:
    """A call of the sample, or of the one that follows, with the block's variables."""
    structures = [a for a in arguments if a in STRUCTURES]
    numbers = [*GIVEN, "held"][: len(arguments) - len(structures)]
    given = [*numbers, *(word[a] for a in structures)]
    return f"{function}({', '.join(f'{word[a]} := {g}' for a, g in zip(arguments, given, strict=True))})"


CONTROLLER = ControllerTarget(write)
