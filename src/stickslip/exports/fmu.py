"""FMI 2.0 and 3.0 co-simulation: a contact that is moved, for simulators of whole machines.

Inputs are the velocity at the beginning of a step and its slope over the step (and what else the law reads: position,
load, temperature, applied torque); the output is the friction torque at the step's end. Compiled for Linux where gcc
is installed; the sources are inside for other machines.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stickslip.core.spec import Surroundings
from stickslip.exports._fmu import Variable, contents_of, law_variables, numbered, surroundings_read, units_of
from stickslip.exports._fmu_run import checked
from stickslip.exports._step_error import about_steps
from stickslip.exports._text import render
from stickslip.exports.golden import csv_of, random_steps
from stickslip.exports.job import Check, Export, Job
from stickslip.exports.target import Target

Array = np.ndarray[Any, np.dtype[np.float64]]
HEAD = "time_s,dt_s,velocity_rad_s,acceleration_rad_s2,position_rad,torque_Nm"
SUBSTEPS = (
    "A communication step is one step of the law: shorter ones, the slope of the velocity kept, divide it."
)


class Moved(NamedTuple):
    """Communication steps in order, and what plain Python answers: shape (n,) each, SI units."""

    time: Array
    dt: Array
    velocity: Array
    acceleration: Array
    position: Array
    torque: Array


def variables_of(job: Job) -> list[Variable]:
    """Inputs, output, parameters and state."""
    ports = [
        Variable("velocity", "velocity", "input", "rad/s", "Velocity at the start of a step", 0.0),
        Variable("acceleration", "acceleration", "input", "rad/s2", "Slope of the velocity over a step", 0.0),
        *surroundings_read(job),
        Variable("friction_torque", "friction_torque", "output", "N.m", "Positive against positive velocity"),
    ]
    return numbered([*ports, *law_variables(job)], job.linear)


def write(job: Job) -> Export:
    """A unit of each version, vectors, and how to use them."""
    variables = variables_of(job)
    about = f"Friction torque of a contact: {job.model.law.title}"
    slope = {"of": variables[0].reference, "place": variables[1].place}
    files, notes = units_of(contents_of(job), "fmu_contact.c.j2", variables, about, slope=slope)
    readme = render(
        "fmu_readme.md.j2",
        x=job.name,
        law=job.model.law,
        variables=variables,
        files=list(files),
        compiled=not notes,
        **about_steps(job.model, SUBSTEPS),
    )
    return Export({**files, "golden.csv": csv_of(HEAD, moved(job)), "README.md": readme}, notes)


def moved(job: Job, count: int = 400, seed: int = 1) -> Moved:
    """Random communication steps and the torque of plain Python, from rest."""
    law, p = job.model.law, job.model.parameters
    v0, v1, dt, position = random_steps(count, seed)
    slope = (v1 - v0) / dt
    time = np.concatenate([[0.0], np.cumsum(dt)])[:-1]
    z, torque = law.state(p), np.empty(count)
    for i, row in enumerate(zip(time, dt, v0, slope, position)):
        now, h, v, a, x = map(float, row)
        torque[i] = law.step(v, v + a * h, h, z, p, Surroundings(position=x, time=now + h))
    return Moved(time, dt, v0, slope, position, torque)


def check(job: Job, export: Export) -> Check:
    """Validate the units in FMPy and play the vectors in it."""
    vectors = moved(job)
    inputs = {k: getattr(vectors, k) for k in ("velocity", "acceleration", "position")}
    golden = np.genfromtxt(str(export.files["golden.csv"]).splitlines(), delimiter=",", names=True)
    return checked(export, vectors.time, vectors.dt, inputs, {"friction_torque": golden["torque_Nm"]})


TARGET = Target(
    "fmu",
    "FMI 2.0 and 3.0 co-simulation unit of a contact that is moved",
    write,
    check,
    around="position, load, temperature and applied torque are inputs, time is the simulator's",
    tried="FMPy: every bit; libcosim (FMI 2.0); FMU manipulation toolbox",
)
