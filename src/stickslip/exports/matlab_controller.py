"""MATLAB and Octave: functions of a controller, tried in Octave."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from stickslip.control.composition import MEMORY, Settings
from stickslip.control.controller import Controller
from stickslip.core.spec import Field, Surroundings, fields_of
from stickslip.exports._matlab import functions, local, safe, with_helpers
from stickslip.exports._text import first_line, render, summary
from stickslip.exports.controllers import (
    STILL,
    ControllerTarget,
    counts_of,
    golden_samples,
    head_of,
    settings_of,
    trees_of,
)
from stickslip.exports.golden import Samples
from stickslip.exports.job import Export
from stickslip.exports.matlab import BOUND, comment, in_octave, meaning_of

PUBLIC = ("sample", "follow")


def write(controller: Controller, name: str, single: bool = False, around: Surroundings = STILL) -> Export:
    """One file a function, golden samples and a script that checks them."""
    values, counts = controller.values(), counts_of(controller)
    sizes = [f"    p.{count.strip('_')} = {size};" for count, size in counts.items()]
    settings, surroundings = settings_of(controller), around._asdict()
    files = {
        "parameters": given("p", "Parameters of the laws.", controller.fields, values, sizes),
        "settings": given("n", "What the controller keeps to.", fields_of(Settings), settings),
        "reset": reset(controller, counts),
        "surroundings": [
            "function u = @()", "    % What friction depends on; set load and temperature where you measure them.",
            *(f"    u.{n} = {value!r};" for n, value in surroundings.items()), "end",
        ],
        "golden": golden(golden_samples(controller, around)),
        **{entry: entry_of(controller, entry) for entry in PUBLIC},
    }  # fmt: skip
    common = {**head_of(controller, name), "bound": repr(BOUND)}
    return Export(
        {
            **{
                f"{name}_{part}.m": "\n".join([*lines, ""]).replace("@", f"{name}_{part}", 1)
                for part, lines in files.items()
            },
            f"{name}_check.m": render("matlab_controller_check.m.j2", **common),
            "README.md": render("matlab_controller_readme.md.j2", **common),
        }
    )


def entry_of(controller: Controller, entry: str) -> list[str]:
    """A public function with the local ones that it calls; every one hands memory, state and surroundings back."""
    *inner, (_, about, lines) = functions(trees_of(controller, [entry]))
    arguments = lines[0].partition(f"{local(entry)}(")[2]
    out = [
        f"function [torque_, m, z, u] = @({arguments}",
        comment(f"{first_line(about)} SI units."),
        *lines[1:],
        "",
    ]
    for name, doc, code in inner:
        out += [code[0], comment(summary(name, doc)), *code[1:], ""]
    return with_helpers(out)


def given(
    owner: str, about: str, fields: Sequence[Field], values: Mapping[str, Any], more: Sequence[str] = ()
) -> list[str]:
    """A function that gives a structure with its values."""
    lines = [f"function {owner} = @()", f"    % {about}", f"    {owner} = struct();"]
    for f in fields:
        value = values[f.name]
        shown = f"[{', '.join(map(repr, value))}]" if f.per_element else number(value)
        lines.append(f"    {owner}.{safe(f.name)} = {shown};  % {meaning_of(f)}")
    return [*lines, *more, "end"]


def number(value: float) -> str:
    """A number as MATLAB writes it."""
    return "Inf" if value == math.inf else repr(float(value))


def reset(controller: Controller, counts: Mapping[str, int]) -> list[str]:
    """A function that gives memory and state at the start."""
    lines = [
        "function [m, z] = @()",
        "    % The controller before its first sample.",
        "    m = struct();",
        "    z = struct();",
    ]
    for owner, fields in (("m", MEMORY), ("z", controller.state_fields)):
        for f in fields:
            zero = f"zeros(1, {counts[f'{f.par.per}s_']})" if f.per_element else "0.0"
            lines.append(f"    {owner}.{safe(f.name)} = {zero};")
    return [*lines, "end"]


def golden(samples: Samples) -> list[str]:
    """The samples as a function: not every reader of CSV files knows what is no number."""

    def rows() -> Iterable[str]:
        for row in zip(*samples):
            yield "        " + ", ".join("NaN" if math.isnan(x) else repr(float(x)) for x in row)

    about = "    % Position, reference, its velocity and acceleration, torque, load, temperature."
    return ["function rows = @()", about, "    rows = [", *rows(), "    ];", "end"]


CONTROLLER = ControllerTarget(write, in_octave)
