"""FMI 2.0 and 3.0 co-simulation: an axis with friction, J dv/dt = torque - friction torque.

The input is the torque, held over a step; outputs are position, velocity and friction torque. Each step is cut into
equal parts of at most ``max_step``, and each part is a step of `stickslip.simulation.recorded_input.step`, printed in C
from the same text that the package's own engines compile: at equal steps the unit moves as `drive_axis` does (tested).
"""

from __future__ import annotations

import ast
import functools
import inspect
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from stickslip.core.messages import axis_unit
from stickslip.exports._analysis import analyse, fields_read
from stickslip.exports._c import Dialect, functions
from stickslip.exports._fmu import Variable, contents_of, law_variables, numbered, surroundings_read, units_of
from stickslip.exports._fmu_run import checked
from stickslip.exports._step_error import about_steps
from stickslip.exports._text import render, summary
from stickslip.exports.golden import csv_of
from stickslip.exports.job import Check, Export, Job
from stickslip.exports.target import Setting, Target, settings_of
from stickslip.models.friction_levels import static_level
from stickslip.subset import named

Array = np.ndarray[Any, np.dtype[np.float64]]
BOUND = 1e-9
"""Largest error against the package's own motion: rad, rad/s, N·m."""
MAX_STEP = 1e-3
"""Longest part of a step to begin with, s."""
SUBSTEPS = "The sample time is here the length of a part of a step: a smaller `max_step` makes shorter parts."


class Driven(NamedTuple):
    """Communication steps of equal length, and how the package's own axis moves: shape (n,) each."""

    dt: Array
    torque: Array
    position: Array
    velocity: Array


def inertia_of(job: Job) -> float:
    """The inertia of the job, kg·m²."""
    return float(settings_of(TARGET, job.settings)["inertia"])


def variables_of(job: Job) -> list[Variable]:
    """Ports, mechanics, parameters and state."""
    around = [v for v in surroundings_read(job) if v.name not in ("position", "applied")]
    return numbered(
        [
            Variable("torque", "torque", "input", "N.m", "Torque of the drive, held over a step", 0.0),
            *around,
            Variable("position", "motion.position", "output", "rad", "Position of the axis"),
            Variable("velocity", "motion.velocity", "output", "rad/s", "Velocity of the axis"),
            Variable(
                "friction_torque", "friction_torque", "output", "N.m", "Positive against positive velocity"
            ),
            Variable(
                "inertia",
                "axis.inertia",
                "parameter",
                "kg.m2",
                "Inertia of the axis",
                inertia_of(job),
                positive=True,
            ),
            Variable("start_position", "start_position", "parameter", "rad", "Position at the start", 0.0),
            Variable("start_velocity", "start_velocity", "parameter", "rad/s", "Velocity at the start", 0.0),
            Variable(
                "max_step", "max_step", "parameter", "s", "Longest part of a step", MAX_STEP, positive=True
            ),
            *law_variables(job),
        ],
        job.linear,
    )


def write(job: Job) -> Export:
    """A unit of each version, vectors, and how to use them."""
    about = f"Axis with friction: {job.model.law.title}"
    variables = variables_of(job)
    files, notes = units_of(
        contents_of(job),
        "fmu_axis.c.j2",
        variables,
        about,
        slope=None,
        inertia=repr(inertia_of(job)),
        max_step=repr(MAX_STEP),
        **step_code(job.name),
    )
    readme = render(
        "fmu_axis_readme.md.j2",
        x=job.name,
        law=job.model.law,
        variables=variables,
        files=list(files),
        compiled=not notes,
        **about_steps(job.model, SUBSTEPS, held=True),
    )
    return Export(
        {
            **files,
            "golden.csv": csv_of("dt_s,torque_Nm,position_rad,velocity_rad_s", driven(job)),
            "README.md": readme,
        },
        notes,
    )


# ---- the step in C ------------------------------------------------------------------------------------------------


STRUCTURES = {
    "c": "contact", "n": "numbers", "a": "motion", "r": "search", "first": "search", "second": "search"
}  # fmt: skip
"""Types of the step's arguments."""
ABOUT = {
    "n": "What a step reads of the axis.",
    "a": "Motion of the axis.",
    "r": "The search for a velocity.",
}


@functools.lru_cache(maxsize=4)
def step_code(name: str) -> Mapping[str, Any]:
    """Functions and structures of `stickslip.simulation.recorded_input.step` for the template."""
    from stickslip.simulation import root
    from stickslip.simulation.recorded_input import contact, step

    entries = {"_ready": root.ready, "_step_on": step.step_on}
    trees = named(entries, step.LAYOUTS, contact.GIVEN)
    declared = {f"_{each}": declaration(getattr(contact, each).py_func) for each in contact.GIVEN}
    dialect = Dialect(f"{name}_axis", False, STRUCTURES)
    every = {**declared, **trees}
    written = [f for f in functions(every, analyse(every), dialect, ()) if f[0] in trees]
    text = "\n".join(line for _, _, lines in written for line in lines)
    return {
        "rounding": step.ROUNDING,
        "least": step.LEAST,
        "functions": [{"about": summary(name, doc), "lines": lines} for name, doc, lines in written],
        "structures": [
            {"name": STRUCTURES[a], "about": about, "fields": fields_used(trees, a, step.LAYOUTS[a].scalars)}
            for a, about in ABOUT.items()
        ],
        "extremes": [each for each in ("min", "max") if f"{dialect.prefix}_{each}(" in text],
    }


def declaration(function: Callable[..., Any]) -> ast.FunctionDef:
    """What calls of a function that C has of its own must know: its arguments, whether it returns a number."""
    given = list(inspect.signature(function).parameters)
    lines = ["c.written = 0.0"] if given[0] == "c" else []
    if inspect.signature(function).return_annotation != "None":
        lines.append("return " + " + ".join(["0.0", *given[1:]]))
    text = f"def _{function.__name__}({', '.join(given)}):\n" + "".join(f"    {line}\n" for line in lines)
    found = ast.parse(text).body[0]
    assert isinstance(found, ast.FunctionDef)
    return found


def fields_used(trees: Mapping[str, ast.FunctionDef], argument: str, fields: tuple[str, ...]) -> list[str]:
    """The fields of a structure that the functions use, in its order."""
    names = [a for a, kind in STRUCTURES.items() if kind == STRUCTURES[argument]]
    used = fields_read(trees.values(), names)
    return [field for field in fields if field in used]


# ---- its motion -----------------------------------------------------------------------------------------------------


def driven(job: Job, count: int = 400, step: float = 1e-3, seed: int = 1) -> Driven:
    """A random torque, new every 20 steps and often below break-away, and the motion of `drive_axis` under it."""
    from stickslip.simulation.recorded_input.simulation import Drive, Mechanics, drive_axis

    draw = np.random.default_rng(seed)
    law, p = job.model.law, job.model.parameters
    # Of a viscous law, which lets go at once, its torque at a low speed.
    sliding = static_level(job.model) or abs(law.steady(1e-3, p)) if law.steady else 1.0
    level = sliding * draw.choice((-1.0, 1.0), count) * draw.uniform(0.0, 1.6, count)
    torque = np.repeat(level, 20)[:count]
    time: Array = step * np.arange(count + 1, dtype=np.float64)
    drive = Drive(time, np.append(torque, torque[-1]), max_step=MAX_STEP)
    motion = drive_axis(Mechanics(inertia=inertia_of(job)), job.model, drive)
    return Driven(time[1:] - time[:-1], torque, motion[1:, 0], motion[1:, 1])


def check(job: Job, export: Export) -> Check:
    """Validate the units in FMPy and drive them as the package's own axis was driven."""
    golden = np.genfromtxt(str(export.files["golden.csv"]).splitlines(), delimiter=",", names=True)
    still = np.zeros(golden.size)  # the package's axis takes no account of a slow change over time
    expected = {"position": golden["position_rad"], "velocity": golden["velocity_rad_s"]}
    off = f"{axis_unit('rad')} or {axis_unit('rad/s')} off the package's axis"
    return checked(export, still, golden["dt_s"], {"torque": golden["torque_Nm"]}, expected, BOUND, off)


TARGET = Target(
    "fmu-axis",
    "FMI 2.0 and 3.0 co-simulation unit of an axis with friction",
    write,
    check,
    settings=(Setting("inertia", None, "inertia of the axis, kg·m²", lower=1e-15),),
    around="load and temperature are inputs, position and time its own",
    tried="FMPy: the motion of `drive_axis` to the bit; FMU manipulation toolbox",
)
