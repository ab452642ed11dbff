"""Beckhoff TwinCAT CNC and ISG kernel: the friction compensation list `frict_comp` (FCT-C25).

At most 20 points of velocity (0.001 °/s, or µm/s) and additive motor current, ascending from 0, interpolated by the
kernel; P-COMP-00041 to 00047 and 00058 of the documentation of TF5200. Written as whole numbers, which versions
before 3.1.3132 and 4.29 need; a scaling factor (P-COMP-00045, 0.1 %) keeps the digits.
"""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError, UnknownName
from stickslip.core.messages import axis_unit, name_setting
from stickslip.exports._points import stiffness, table_form
from stickslip.exports._text import render
from stickslip.exports.job import Check, Export, Job
from stickslip.exports.nearest import Curve, Form, Nearest, carried, curve_of
from stickslip.exports.target import Setting, Target, settings_of
from stickslip.models.model import Model

ENTRIES = 20
UNITS = {"rotary": 180.0 / math.pi * 1000.0, "linear": 1e6}
"""0.001 °/s per rad/s, µm/s per m/s."""
DELAY = {"rotary": 180.0 / math.pi * 1e4, "linear": 1e7}
"""0.0001 ° per rad, 0.1 µm per m."""
LONGEST_DELAY = 10
NOTE = "format checked, not tried on the vendor's hardware"


def write(job: Job) -> Export:
    """The list, and how to use it."""
    found, numbers = listed(job)
    settings = settings_of(TARGET, job.settings)
    notes = (NOTE, *found.notes)
    values: dict[str, Any] = {
        **numbers, "x": job.name, "law": job.model.law, "notes": notes, "scale": settings["torque_per_unit"],
        "lookahead": int(settings["reversal_lookahead"]), "cycles": int(settings["delay_cycles"]),
        "speed_unit": "um/s" if settings["motion"] == "linear" else "0.001 deg/s",
        "delay_unit": "0.1 um" if settings["motion"] == "linear" else "0.0001 deg",
    }  # fmt: skip
    files = {
        f"{job.name}_frict_comp.lis": render("beckhoff.lis.j2", **values),
        "README.md": render("beckhoff_readme.md.j2", **values),
    }
    return Export(files, notes)


def listed(job: Job) -> tuple[Nearest, dict[str, Any]]:
    """The table that the list holds, and the list's numbers."""
    settings = settings_of(TARGET, job.settings)
    motion = str(settings["motion"])
    if motion not in UNITS:
        raise InputError(f"{name_setting('motion', motion)}: choose rotary or linear")
    unit = float(settings["torque_per_unit"])
    found = carried(job, TARGET.name, [form_of(motion, unit, curve_of(job).size)])
    p = found.model.parameters
    scaling = scaling_of(unit, curve_of(job).size)
    rows = [
        (round(v * UNITS[motion]), round(t / unit * 1000.0 / scaling)) for v, t in zip(p.velocity, p.forward)
    ]
    rows[0] = (0, 0)
    return found, {
        "rows": rows,
        "scaling": scaling,
        "delay": delay_of(job, str(settings["position_delay"]), motion),
    }


@functools.lru_cache(maxsize=32)
def form_of(motion: str, unit: float, size: float) -> Form:
    """The table in whole numbers: 0 at rest, then the curve from the smallest velocity on."""
    speed, torque = UNITS[motion], unit * scaling_of(unit, size) / 1000.0

    def finish(values: dict[str, list[float]]) -> dict[str, list[float]]:
        forward = [torque * round(t / torque) for t in values["forward"]]
        velocity = [round(v * speed) / speed for v in values["velocity"]]
        velocity[0] = 1.0 / speed
        kept = [i for i, v in enumerate(velocity) if i == 0 or v > velocity[i - 1]]
        inner = [forward[i] for i in kept]
        # What the kernel makes of it: 0 at rest, the first torque from the smallest velocity on.
        return {
            "velocity": [0.0, *(velocity[i] for i in kept)],
            "forward": [inner[0], *inner],
            "backward": [inner[0], *inner],
        }

    form = table_form(ENTRIES - 1, both_directions=False, finish=finish)
    return replace(form, words=f"a sliding curve in at most {ENTRIES} points, the same in both directions")


def scaling_of(unit: float, size: float) -> int:
    """The largest scaling factor, 0.1 %, that leaves four digits of the largest torque; else the least, 1."""
    largest = size / unit
    return next((s for s in (1000, 100, 10) if largest * 1000.0 / s >= 1e4), 1)


def delay_of(job: Job, given: str, motion: str) -> int:
    """Distance over which the current is built up; "auto" is that over which a contact at rest gives way."""
    if given != "auto":
        try:
            delay = int(given)
        except ValueError:
            raise InputError(
                f"{name_setting('position_delay', given)}: give a whole number, or auto"
            ) from None
        if not 0 <= delay <= LONGEST_DELAY:
            raise InputError(
                f"{name_setting('position_delay', given)}: it lies between 0 and {LONGEST_DELAY} (P-COMP-00043)"
            )
        return delay
    curve = curve_of(job)
    return min(round(curve.rest[0] / stiffness(curve) * DELAY[motion]), LONGEST_DELAY)


def read(text: str, torque_per_unit: float, motion: str = "rotary") -> Model:
    """The table of a list, as the law that the kernel makes of it.

    Parameters
    ----------
    text : str
    torque_per_unit : float
        Torque of one unit of the drive's current, N·m.
    motion : {"rotary", "linear"}

    Raises
    ------
    InputError
        If a number is missing or the points break the kernel's rules.
    """
    if motion not in UNITS:
        raise UnknownName("motion", motion, UNITS)
    if not 0.0 < torque_per_unit < math.inf:
        raise InputError(f"torque_per_unit = {torque_per_unit:g} N·m must be greater than 0")
    numbers: dict[str, float] = {}
    for line in text.splitlines():
        words = line.partition("#")[0].split()
        if len(words) == 2:
            try:
                value = float(words[1])
            except ValueError:
                value = math.nan
            if not math.isfinite(value):
                raise InputError(f"{words[0]} is {words[1]!r}; it must be a finite number")
            numbers[words[0]] = value

    def number(name: str) -> float:
        if f"frict_comp.{name}" not in numbers:
            raise InputError(f"the list has no frict_comp.{name}")
        return numbers[f"frict_comp.{name}"]

    entries, scaling = number("table_entries"), number("scaling_factor")
    count = int(entries)
    if not 2 <= entries <= ENTRIES or count != entries:
        raise InputError(
            f"frict_comp.table_entries is {entries:g}; the kernel takes 2 to {ENTRIES} (P-COMP-00042)"
        )
    rows = [(number(f"table[{i}].in"), number(f"table[{i}].out")) for i in range(count)]
    velocity = [v / UNITS[motion] for v, _ in rows]
    torque = [t * scaling / 1000.0 * torque_per_unit for _, t in rows]
    torque[0] = torque[1]  # it is built up from 0 within the smallest velocity
    values: dict[str, Any] = {"velocity": velocity, "forward": torque, "backward": torque}
    return Model(table_form(2, both_directions=False).law, **values)


def check(job: Job, export: Export) -> Check:
    """Read it back, and compare it with the law at velocities between the points."""
    settings = settings_of(TARGET, job.settings)
    found, _ = listed(job)
    text = str(export.files[f"{job.name}_frict_comp.lis"])
    model = read(text, float(settings["torque_per_unit"]), str(settings["motion"]))
    curve, table = Curve.of(job.model, found.top), Curve(model, found.top)
    draw = np.random.default_rng(1).uniform(1.1 * curve.slowest + 1e-3 * found.top, found.top, 200)
    error = max(abs(table.torque(v) - 0.5 * (curve.torque(v) - curve.torque(-v))) for v in draw)
    passed = error <= 1.02 * found.residual + 1e-9 * found.size
    return Check(
        passed,
        f"read back: at most {error:.3g} {axis_unit('N·m')} off the sliding curve; {NOTE}",
        {"table": error},
    )


TARGET = Target(
    "beckhoff",
    "Beckhoff TwinCAT CNC and ISG kernel, friction compensation list",
    write,
    check,
    forms=(form_of("rotary", 1e-3, 1.0),),
    settings=(
        Setting(
            "torque_per_unit",
            None,
            "torque of one unit of the drive's current, N·m (CANopen and SERCOS: a thousandth of the rated torque)",
            1e-12,
            1e12,
        ),
        Setting("motion", "rotary", "rotary or linear"),
        Setting(
            "position_delay",
            "auto",
            "way over which the current is built up, 0 to 10 of 0.0001 ° (0.1 µm), or auto",
        ),
        Setting(
            "reversal_lookahead", 0.0, "cycles over which the current decays before a reversal", 0.0, 4.0
        ),
        Setting("delay_cycles", 0.0, "delay of the values after a reversal, cycles", 0.0, 248.0),
    ),
    tried="format checked, not tried on the vendor's hardware",
)
