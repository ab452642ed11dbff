"""C99: header and source of a sampled controller.

One definition feeds it: the text of its laws and of their composition, printed by `stickslip.exports._c`. In double
precision and without contraction the code gives the bits of plain Python (tested).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from stickslip.control.composition import MEMORY, Settings
from stickslip.control.controller import Controller
from stickslip.core.spec import Surroundings, fields_of
from stickslip.exports._analysis import Facts, analyse
from stickslip.exports._c import Dialect, functions, head
from stickslip.exports._step_error import PARTS, about_steps
from stickslip.exports._text import first_line, render, summary
from stickslip.exports.c99 import (
    SINGLE_BOUND,
    STRUCTURES,
    checked,
    cleared,
    given,
    initial,
    scale_of,
    structure,
    surroundings,
)
from stickslip.exports.controllers import (
    STILL,
    ControllerTarget,
    checked_name,
    counts_of,
    deviation_functions,
    golden_samples,
    head_of,
    learned_of,
    settings_of,
    trees_of,
)
from stickslip.exports.golden import Samples, as_csv
from stickslip.exports.job import Check, Export

PUBLIC = ("_sample", "_sample_turns", "_follow", "_follow_turns")
NARROW = "float turns, float position, float reference_turns, float reference, "
WIDE = {
    "_sample": "One sample; positions in double precision, so that their difference is rounded and not they.",
    "_follow": "Watch one sample while another controls the axis with `torque`, N·m; positions in double precision.",
}


def write(controller: Controller, name: str, single: bool = False, around: Surroundings = STILL) -> Export:
    """Header, source, golden samples, a program that checks them, and how to use it.

    Parameters
    ----------
    controller : Controller
    name : str
        Prefix of every name in C.
    single : bool
        Single precision.
    around : Surroundings
        What ``u`` holds until somebody sets it.

    Raises
    ------
    InputError
        If `name` is none in C.
    """
    dialect = Dialect(checked_name(name), single, STRUCTURES)
    common = {**code_of(controller, dialect), **numbers_of(controller, dialect, around)}
    samples = golden_samples(controller, around)
    common |= {
        "rows": rows_of(samples),
        "bound": SINGLE_BOUND if single else 0.0,
        "scale": scale_of(samples.torque),
    }
    return Export(
        {
            f"{name}.h": render("c99_controller.h.j2", **common),
            f"{name}.c": render("c99_controller.c.j2", **common),
            f"{name}_check.c": render("c99_controller_check.c.j2", **common),
            "golden_samples.csv": as_csv(samples),
            "README.md": render("c99_controller_readme.md.j2", **common, **step_error_of(controller)),
        }
    )


def check(export: Export, name: str) -> Check:
    """Compile with every compiler at hand, warnings as errors, and run the golden samples."""
    return checked(export, name)


# ---- what the templates are filled with ----------------------------------------------------------------------------


def code_of(controller: Controller, dialect: Dialect) -> dict[str, Any]:
    """Names, structures and functions."""
    # In single precision the ones with whole positions are `wide`.
    told = [f"_{name}" for name in deviation_functions(controller)]
    trees = trees_of(controller, [*(n for n in PUBLIC if n.endswith("_turns") or not dialect.single), *told])
    known, public = analyse(trees), [n for n in (*PUBLIC, *told) if n in trees]
    written = functions(trees, known, dialect, public)
    about = {n: summary(n, doc) for n, doc, _ in written}
    text = "\n".join(line for _, _, lines in written for line in lines)
    x = dialect.prefix
    return {
        **head_of(controller, x),
        "X": x.upper(),
        "real": dialect.real,
        "title": "Sampled controller",
        "structures": list(structures(controller, dialect)),
        "public": [{"about": about[n], "head": head(n, known[n], dialect)} for n in public],
        "wide": list(wide(known, dialect)),
        "functions": [{"about": about[n], "lines": lines} for n, _, lines in written],
        "small": [n for n in ("expm1f", "log1pf") if f"{n}(" in text],
        "extremes": [n for n in ("min", "max") if f"{x}_{n}(" in text],
    }


def numbers_of(controller: Controller, dialect: Dialect, around: Surroundings) -> dict[str, Any]:
    """Values of the structures."""
    values = controller.values()
    return {
        "learned": [*learned_of(controller)],
        "unlimited": math.isinf(controller.torque_limit),
        "counts": {dialect.count(name): size for name, size in counts_of(controller).items()},
        "designed": [*initial(controller.fields, values, dialect)],
        "settings": [*given(fields_of(Settings), settings_of(controller), "n", dialect)],
        "reset": [*cleared(MEMORY, "m", dialect), *cleared(controller.state_fields, "z", dialect)],
        "surroundings": ", ".join(dialect.number(x) for x in around),
    }


def rows_of(samples: Samples) -> list[str]:
    """Golden samples as initializers of C."""
    return [", ".join("(double)NAN" if np.isnan(x) else repr(float(x)) for x in row) for row in zip(*samples)]


def step_error_of(controller: Controller) -> dict[str, Any]:
    """What a README says of the error of a friction law's step, and of how the controller divides it."""
    for part, block in controller.blocks.items():
        parts = int(block.own.get("substeps", 0))
        said = f"The controller divides its sample in the same way, into `p.{part}_substeps` = {parts}."
        if block.friction:
            return about_steps(block.friction, said if parts else "", parts=parts if parts > 1 else PARTS)
    return {"step_errors": []}


def wide(known: Mapping[str, Facts], dialect: Dialect) -> Iterable[Mapping[str, Any]]:
    """In single precision: the functions that take positions in double precision."""
    for name, about in WIDE.items() if dialect.single else ():
        inner = f"{name}_turns"
        own = head(inner, known[inner], dialect)
        own = own.replace(f"{inner}({NARROW}", f"{name}(double position, double reference, ")
        rest = ", ".join(known[inner].arguments[4:])
        yield {"about": first_line(about), "head": own, "call": f"{dialect.prefix}{inner}", "given": rest}


def structures(controller: Controller, dialect: Dialect) -> Iterable[Mapping[str, Any]]:
    """The structures of the header."""
    yield structure("parameters", "Parameters of the laws.", controller.fields, dialect)
    yield structure("state", "What the laws remember.", controller.state_fields, dialect)
    yield surroundings("What friction depends on; the controller writes position and time.", dialect)
    yield structure("settings", "Settings of the controller.", fields_of(Settings), dialect)
    yield structure("memory", "What the laws see, and what the controller remembers.", MEMORY, dialect)


CONTROLLER = ControllerTarget(write, check)
