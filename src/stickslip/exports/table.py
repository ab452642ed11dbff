"""A table of torque over velocity (CSV), for whatever reads one: a drive, a spreadsheet, a simulator."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import axis_unit
from stickslip.exports._points import table_form
from stickslip.exports._text import render
from stickslip.exports.job import Check, Export, Job
from stickslip.exports.nearest import Curve, Nearest, carried
from stickslip.exports.target import Setting, Target, settings_of
from stickslip.models.model import Model

if TYPE_CHECKING:
    from stickslip.identification.steady_friction.points import SlidingPoints

HEADER = "velocity_rad_s,torque_forward_Nm,torque_backward_Nm"
POINTS = 50


def write(job: Job) -> Export:
    """The table, and how to use it."""
    found = tabulated(job)
    p = found.model.parameters
    rows = [f"{v!r},{a!r},{b!r}" for v, a, b in zip(p.velocity, p.forward, p.backward)]
    values: dict[str, Any] = {
        "x": job.name, "law": job.model.law, "count": len(rows), "top": f"{found.top:g}", "header": HEADER,
        "notes": found.notes,
    }  # fmt: skip
    text = "\n".join([HEADER, *rows]) + "\n"
    return Export({f"{job.name}.csv": text, "README.md": render("table_readme.md.j2", **values)}, found.notes)


def tabulated(job: Job) -> Nearest:
    """The job's sliding curve in points."""
    count = int(settings_of(TARGET, job.settings)["points"])
    return carried(job, TARGET.name, [table_form(count, both_directions=True)])


def model_of(text: str) -> Model:
    """The table as a law of its own, linear between the points.

    Raises
    ------
    InputError
        If it is no such table.
    """
    lines = text.strip().splitlines()
    if not lines or lines[0].strip() != HEADER:
        raise InputError(f"this is no table of this kind: its first line is not {HEADER}")
    try:
        rows = [[float(x) for x in line.split(",")] for line in lines[1:] if line.strip()]
        velocity, forward, backward = (list(column) for column in zip(*rows, strict=True))
    except ValueError:
        raise InputError(
            "a line of the table has not three numbers; every line is velocity, forward, backward"
        ) from None
    values: dict[str, Any] = {"velocity": velocity, "forward": forward, "backward": backward}
    return Model(table_form(2, both_directions=True).law, **values)


def read(text: str) -> SlidingPoints:
    """The points of both directions, as what a sliding curve is fitted to.

    Raises
    ------
    InputError
        If it is no such table.
    """
    from stickslip.identification.steady_friction.points import SlidingPoints

    p = model_of(text).parameters
    velocity, forward, backward = (np.array(column) for column in (p.velocity, p.forward, p.backward))
    return SlidingPoints(np.concatenate([velocity, -velocity]), np.concatenate([forward, -backward]))


def check(job: Job, export: Export) -> Check:
    """Read it back, and compare it with the law at velocities between the points."""
    model, found = model_of(str(export.files[f"{job.name}.csv"])), tabulated(job)
    curve = Curve.of(job.model, found.top)
    draw = np.random.default_rng(1).uniform(1.1 * curve.slowest + 1e-3 * found.top, found.top, 200)
    table = Curve(model, found.top)
    error = max(abs(table.torque(v) - curve.torque(v)) for v in (*draw, *-draw))
    passed = error <= 1.02 * found.residual + 1e-9 * found.size
    return Check(
        passed, f"read back: at most {error:.3g} {axis_unit('N·m')} off the sliding curve", {"table": error}
    )


TARGET = Target(
    "table",
    "Table of torque over velocity (CSV)",
    write,
    check,
    forms=(table_form(POINTS, both_directions=True),),
    settings=(Setting("points", float(POINTS), "at most so many points", 2.0, 10000.0),),
    tried="read back",
)
