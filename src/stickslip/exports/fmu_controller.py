"""FMI 2.0 and 3.0 co-simulation: a controller, sampled by itself.

It samples at every multiple of its sample time, at the beginning of the communication step in which that lies, and
holds its torque in between: the master steps the controller, hands the torque on, and then steps the machine.
"""

from __future__ import annotations

from collections.abc import Iterable
from types import SimpleNamespace

import numpy as np

from stickslip.control.controller import Controller
from stickslip.core.spec import Surroundings
from stickslip.exports import c99, c99_controller
from stickslip.exports._analysis import fields_read
from stickslip.exports._fmu import (
    SURROUNDINGS,
    Contents,
    Variable,
    field_variables,
    numbered,
    units_of,
    wholes_of,
)
from stickslip.exports._fmu_run import checked
from stickslip.exports._text import render
from stickslip.exports.controllers import (
    STILL,
    ControllerTarget,
    counts_of,
    golden_samples,
    head_of,
    settings_of,
    trees_of,
    what_it_is,
)
from stickslip.exports.golden import Samples, as_csv, sampled_torques
from stickslip.exports.job import Check, Export

GIVEN: tuple[str, ...] = ("position", "reference", "reference_velocity", "reference_acceleration")
MEANING = ("Measured position", "Reference position", "Reference velocity", "Reference acceleration")
UNITS = ("rad", "rad", "rad/s", "rad/s2")
UNLIMITED = 1e308
"""N·m: stands for no limit, as the files of a unit know no infinite number."""


def variables_of(controller: Controller, linear: bool) -> list[Variable]:
    """Inputs, output, parameters and state."""
    limit = min(controller.torque_limit, UNLIMITED)
    counts = counts_of(controller)
    sizes = {f.name: counts[f"{f.par.per}s_"] for f in controller.state_fields if f.per_element}
    return numbered(
        [
            *(Variable(n, n, "input", unit, meaning, 0.0) for n, unit, meaning in zip(GIVEN, UNITS, MEANING)),
            *surroundings_read(controller),
            Variable("torque", "torque", "output", "N.m", "Torque to hold, in the direction of motion"),
            Variable(
                "torque_limit", "n.torque_limit", "parameter", "N.m", "Largest torque", limit, positive=True
            ),
            *field_variables(controller.fields, controller.values(), controller.state_fields, sizes, ""),
        ],
        linear,
    )


def surroundings_read(controller: Controller) -> Iterable[Variable]:
    """Inputs for what the held friction laws read; position and time are the controller's own."""
    trees = trees_of(controller, ["_sample"])
    read = fields_read(
        t for name, t in trees.items() if name.strip("_") != "unusable"
    )  # it looks at all of them
    for name in ("load", "temperature"):
        if name in read:
            about = c99.SURROUNDINGS[name][0]
            yield Variable(
                name, f"u.{name}", "input", SURROUNDINGS[name], about, Surroundings()._asdict()[name]
            )


def write(
    controller: Controller,
    name: str,
    single: bool = False,
    around: Surroundings = STILL,
    linear: bool = False,
) -> Export:
    """A unit of each version, golden samples, and how to use them."""
    c = c99_controller.write(controller, name, around=around).files
    variables, values = variables_of(controller, linear), controller.values()
    contents = Contents(
        name, "Sampled controller", {f: str(c[f]) for f in (f"{name}.c", f"{name}.h")},
        wholes_of(controller.fields, values), ", ".join(f.name for f in controller.fields if f.par.shares),
        linear=linear,
    )  # fmt: skip
    files, notes = units_of(
        contents, "fmu_controller.c.j2", variables, f"Sampled {what_it_is(controller)} of a servo axis", slope=None,
        sample_time=repr(controller.sample_time), unlimited=repr(UNLIMITED),
    )  # fmt: skip
    readme = render(
        "fmu_controller_readme.md.j2", **head_of(controller, name), variables=variables, files=list(files),
        compiled=not notes,
    )  # fmt: skip
    golden = timed(usable_samples(controller, around), controller.sample_time)
    return Export({**files, "golden_samples.csv": golden, "README.md": readme}, notes)


def usable_samples(controller: Controller, around: Surroundings) -> Samples:
    """Golden samples without inputs that are no numbers, which an importer may not set; within the unit's limit."""
    with_faults = golden_samples(controller, around)
    good = np.isfinite(np.column_stack(with_faults[:4])).all(axis=1)
    samples = Samples(*(column[good] for column in with_faults))
    n, m = SimpleNamespace(**settings_of(controller)), controller.memory()
    z, p, u = controller.state(), controller.parameters, SimpleNamespace(**around._asdict())
    inner = controller.functions["sample"]
    torque = sampled_torques(lambda *row: inner(*row, n, m, z, p, u), u, samples[:4], samples[5:])
    return samples._replace(torque=torque)


def timed(samples: Samples, sample_time: float) -> str:
    """The samples as CSV, with the time of each."""
    head, *rows = as_csv(samples).splitlines()
    return "\n".join([f"time_s,{head}", *(f"{sample_time * k!r},{row}" for k, row in enumerate(rows)), ""])


def check(export: Export, name: str) -> Check:
    """Validate the units in FMPy and play the samples in it, a communication step each."""
    rows = np.genfromtxt(str(export.files["golden_samples.csv"]).splitlines()[1:], delimiter=",")
    names = (*GIVEN, "torque", "load", "temperature")
    time, given = rows[:, 0], dict(zip(names, rows.T[1:]))
    expected, dt = given.pop("torque"), np.full(len(rows), rows[1, 0])
    return checked(export, time, dt, given, {"torque": expected})


CONTROLLER = ControllerTarget(
    write, check, "FMI 2.0 and 3.0 co-simulation unit of a sampled {}", declares_units=True
)
