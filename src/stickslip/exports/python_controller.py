"""Python: a controller as one file without dependencies; its functions are the laws' own."""

from __future__ import annotations

import ast

from stickslip.control.composition import MEMORY, Settings
from stickslip.control.controller import Controller
from stickslip.core.spec import Surroundings, fields_of
from stickslip.exports._text import Code, render
from stickslip.exports.controllers import (
    STILL,
    ControllerTarget,
    counts_of,
    golden_samples,
    head_of,
    settings_of,
    trees_of,
)
from stickslip.exports.golden import as_csv
from stickslip.exports.job import Check, Export
from stickslip.exports.python import alone, assigned, cleared, constant, count_by_constant, indent_docstring

PUBLIC = ("sample", "sample_turns", "follow", "follow_turns")


def write(controller: Controller, name: str, single: bool = False, around: Surroundings = STILL) -> Export:
    """One module, golden samples, and how to use it."""
    counts, trees = counts_of(controller), trees_of(controller, PUBLIC)
    for tree in trees.values():
        count_by_constant(tree, counts)
        indent_docstring(tree)
    common = head_of(controller, name)
    text = render(
        "python_controller.py.j2",
        counts={constant(n): size for n, size in counts.items()},
        parameters=[*assigned(controller.fields, controller.values())],
        settings=[*assigned(fields_of(Settings), settings_of(controller))],
        states=[*cleared(controller.state_fields)],
        memory=[*cleared(MEMORY)],
        around=[f"{n}={value!r}" for n, value in around._asdict().items()],
        functions=[Code(ast.unparse(tree)) for tree in trees.values()],
        **common,
    )
    return Export(
        {
            f"{name}.py": text,
            "golden_samples.csv": as_csv(golden_samples(controller, around)),
            "README.md": render("python_controller_readme.md.j2", **common),
        }
    )


def check(export: Export, name: str) -> Check:
    """Run the file by itself, away from this package, on its golden samples."""
    return alone(export, name, "golden_samples.csv")


CONTROLLER = ControllerTarget(write, check)
