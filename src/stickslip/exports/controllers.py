"""Controllers, as their exports need them: functions as trees, counts, words, golden samples."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.core.errors import InputError
from stickslip.core.messages import axis_unit, name_option
from stickslip.core.spec import Surroundings
from stickslip.exports._analysis import merged
from stickslip.exports.golden import Samples, changing, random_motion, sampled_torques
from stickslip.exports.job import IDENTIFIER, Check, Export
from stickslip.exports.nearest import read_by
from stickslip.subset import named

STILL = Surroundings()
"""Where nothing is said."""


class ControllerTarget(NamedTuple):
    """What a target does with a controller."""

    write: Callable[..., Export]
    """``write(controller, name, single, around)``, where ``around`` holds until somebody sets it; `InputError` where
    the name is none in the target's language"""
    check: Callable[[Export, str], Check] | None = None
    """``check(export, name)``: run the export in its tool against the golden samples"""
    title: str = ""
    """Of its files, {} for what they hold (`what_it_is`), where it is another one than of a law alone"""
    declares_units: bool = False
    """Whether its files declare units: ``write`` then takes ``linear``, whether the axis moves along a line"""


def checked_name(name: str) -> str:
    """The prefix of every name.

    Raises
    ------
    InputError
        If it is no name in most languages.
    """
    if not IDENTIFIER.fullmatch(name):
        raise InputError(
            f"{name!r} is no name in most languages; use letters, digits and _, a letter first ({name_option('name')})"
        )
    return name


def trees_of(controller: Controller, public: Sequence[str]) -> dict[str, ast.FunctionDef]:
    """The functions of that name of the composition, and what they call, callees first; ``_`` before a name is kept.

    Those that tell a deviation of what is learned have the names of `deviation_functions`.
    """
    found = {**controller.functions, **deviation_functions(controller)}
    return merged(named({name: found[name.strip("_")] for name in public}, controller.layouts))


def deviation_functions(controller: Controller) -> dict[str, Callable[..., float]]:
    """The functions that tell a standard deviation of what is learned, ``feedforward_scale_deviation`` by name."""
    return {f"{name}_deviation": function for name, function in controller.deviations.items()}


def learned_of(controller: Controller) -> Iterable[Mapping[str, str]]:
    """What it learns: names, units, meanings, and the functions that tell its deviation ("": none)."""
    told = controller.deviations
    for f in controller.learned_fields:
        deviation = f"{f.name}_deviation" if f.name in told else ""
        yield {
            "name": f.name,
            "unit": axis_unit(f.par.unit),
            "meaning": f.par.meaning,
            "deviation": deviation,
        }


def counts_of(controller: Controller) -> dict[str, int]:
    """The numbers of elements by the names that translated functions use (``observer_friction_elements_``)."""
    values = controller.values()
    return {f"{f.par.per}s_": len(values[f.name]) for f in controller.fields if f.per_element}


def settings_of(controller: Controller) -> dict[str, float]:
    """Numbers of the composition; the samples make the time.

    Raises
    ------
    InputError
        If the controller acts in continuous time.
    """
    if controller.sample_time == 0.0:
        raise InputError(
            "a controller in continuous time cannot be exported; give it a sample_time greater than 0"
        )
    return controller.settings._replace(clock=1.0)._asdict()


def compensates_alone(controller: Controller) -> bool:
    """Whether it has no loop: its torque belongs to that of another controller."""
    return not any(block.law.place == "loop" for block in controller.blocks.values())


def what_it_is(controller: Controller) -> str:
    """A compensator where it has no loop, else a controller."""
    return "compensator" if compensates_alone(controller) else "controller"


def depends_on(controller: Controller) -> str:
    """What the friction laws in it depend on besides velocities, for people."""
    found = [read_by(block.friction) for block in controller.blocks.values() if block.friction]
    return ", ".join(dict.fromkeys(words for words in found if words))


def given_by(controller: Controller) -> str:
    """What its torque is made of, for people."""
    blocks = {part: block for part, block in controller.blocks.items() if block.law.place != "estimator"}
    parts = [_gives(part, block) for part, block in blocks.items()]
    fed = [block.own for block in blocks.values() if block.law.name == "inertia_feedforward"]
    if compensates_alone(controller):
        parts += [] if any(own["offset"] for own in fed) else ["no constant torque"]
        parts += [] if any(own["inertia"] for own in fed) else ["nothing for the inertia"]
    if controller.reference_velocity == "difference":
        parts.append("with the reference velocity formed as the difference of two reference positions")
    limit = controller.torque_limit
    return ", ".join([*parts, *([f"within ±{limit:.6g} {axis_unit('N·m')}"] if math.isfinite(limit) else [])])


def _gives(part: str, block: ControlBlock) -> str:
    """What a law of the controller gives; parameters by their whole names."""
    own = block.own
    if block.law.name in ("friction_feedforward", "friction_feedback"):
        if not own["gain"]:
            return "no friction torque (gain 0)"
        velocity = "reference's" if block.law.place == "feedforward" else "measured"
        return f"{own['gain']:.6g} times the friction law's torque at the {velocity} velocity"
    if block.law.name == "inertia_feedforward":
        offset = f"the constant torque `{part}_offset` = {own['offset']:.6g} {axis_unit('N·m')}"
        inertia = (
            f"`{part}_inertia` = {own['inertia']:.6g} {axis_unit('kg·m²')} times the reference's acceleration"
        )
        return ", ".join(words for words, x in ((offset, own["offset"]), (inertia, own["inertia"])) if x)
    return f"the torque of `{part}` ({block.law.title})"


def at_rest(controller: Controller) -> str:
    """What the reference velocity must be at rest for a friction that is fed forward, for people; empty without one."""
    fed = {
        part: b.own for part, b in controller.blocks.items() if b.friction and b.law.place == "feedforward"
    }
    if not any(own.get("gain", 1.0) for own in fed.values()):
        return ""
    said = (
        f"At rest the reference velocity must be exactly 0: the feedforward takes -1e-9 {axis_unit('rad/s')} "
        "for motion, too, and a "
        "law that jumps at rest then gives the whole friction."
    )
    names = [f"`{part}_deadband`" for part, own in fed.items() if "deadband" in own]
    if not names:
        return said
    option = " (`stickslip export --compensator ff --deadband RAD_PER_S`, in Python `deadband=`)"
    return (
        f"{said} Where it is not, {' and '.join(names)}{option if compensates_alone(controller) else ''} must be set "
        "above the noise of the reference velocity."
    )


def laws_of(controller: Controller) -> list[str]:
    """Its laws, a line each."""
    return [
        "; ".join(
            [f"{part}: {block.law.title}", *([", ".join(block.law.source)] if block.law.source else [])]
        )
        for part, block in controller.blocks.items()
    ]


def table_of(controller: Controller) -> Iterable[Mapping[str, Any]]:
    """Its parameters for a table."""
    values = controller.values()
    for f in controller.fields:
        yield {
            "name": f.name,
            "value": values[f.name],
            "unit": axis_unit(f.par.unit),
            "meaning": f.par.meaning,
        }


def head_of(controller: Controller, name: str) -> dict[str, Any]:
    """What every template begins with: the prefix of its names, the laws, the sample time, the table of parameters.

    Raises
    ------
    InputError
        If `name` is none in most languages.
    """
    return {
        "x": checked_name(name), "laws": laws_of(controller), "sample_time": controller.sample_time,
        "table": [*table_of(controller)], "given": given_by(controller), "alone": compensates_alone(controller),
        "depends": depends_on(controller), "at_rest": at_rest(controller),
    }  # fmt: skip


def golden_samples(
    controller: Controller, around: Surroundings = STILL, count: int = 400, seed: int = 1
) -> Samples:
    """Random samples and the torque of plain Python, from the first one on, about this load and temperature."""
    n, m = SimpleNamespace(**settings_of(controller)), controller.memory()
    stiffness = controller.values().get("loop_kp", 0.0)
    reach = controller.torque_limit / stiffness if stiffness else 1.0
    inputs = random_motion(controller.sample_time, reach, count, seed)
    z, p, u = controller.state(), controller.parameters, SimpleNamespace(**around._asdict())
    sample, change = controller.functions["sample"], changing(around, count, seed)
    torque = sampled_torques(lambda *row: sample(*row, n, m, z, p, u), u, inputs, change)
    return Samples(*inputs, torque, *change)
