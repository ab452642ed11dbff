"""Controllers made of control laws, as their exports need them: functions as trees, counts, words, golden samples."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

from stickslip.control.sampled_controller import SampledController
from stickslip.errors import InputError
from stickslip.export._analysis import merged
from stickslip.export._text import ascii_only
from stickslip.export.golden import Samples, changing, random_motion, sampled_torques
from stickslip.export.job import IDENTIFIER, Check, Export
from stickslip.spec import Surroundings
from stickslip.subset import named

__all__ = [
    "ControllerTarget",
    "checked_name",
    "counts_of",
    "golden_samples",
    "laws_of",
    "settings_of",
    "table_of",
    "trees_of",
]


class ControllerTarget(NamedTuple):
    """What a target does with a controller made of control laws."""

    write: Callable[[SampledController, str, bool], Export]
    """``write(controller, name, single)``; `InputError` where the name is none in the target's language"""
    check: Callable[[Export, str], Check] | None = None
    """``check(export, name)``: run the export in its tool against the golden samples"""


def checked_name(name: str) -> str:
    """The prefix of every name.

    Raises
    ------
    InputError
        If it is no name in most languages.
    """
    if not IDENTIFIER.fullmatch(name):
        raise InputError(
            f"{name!r} is no name in most languages; use letters, digits and _, a letter first (--name)"
        )
    return name


def trees_of(controller: SampledController, public: Sequence[str]) -> dict[str, ast.FunctionDef]:
    """The functions of that name of the composition, and what they call, callees first; ``_`` before a name is kept."""
    found = controller.functions
    return merged(named({name: found[name.strip("_")] for name in public}, controller.layouts))


def counts_of(controller: SampledController) -> dict[str, int]:
    """The numbers of elements by the names that translated functions use (``observer_friction_elements_``)."""
    values = controller.values()
    return {f"{f.par.per}s_": len(values[f.name]) for f in controller.fields if f.per_element}


def settings_of(controller: SampledController) -> dict[str, float]:
    """Numbers of the composition; the samples make the time."""
    return controller.settings._replace(clock=1.0)._asdict()


def laws_of(controller: SampledController) -> list[str]:
    """Its laws, a line each."""
    return [
        ascii_only(f"{part}: {block.law.title}; {', '.join(block.law.source)}")
        for part, block in controller.blocks.items()
    ]


def table_of(controller: SampledController) -> Iterable[Mapping[str, Any]]:
    """Its parameters for a table."""
    values = controller.values()
    for f in controller.fields:
        yield {"name": f.name, "value": values[f.name], "unit": f.par.unit, "meaning": f.par.meaning}


def golden_samples(controller: SampledController, count: int = 400, seed: int = 1) -> Samples:
    """Random samples and the torque of plain Python, from the first sample on, while load and temperature change."""
    stiffness = controller.values().get("loop_kp", 0.0)
    reach = controller.torque_limit / stiffness if stiffness else 1.0
    inputs = random_motion(controller.sample_time, reach, count, seed)
    n, m = SimpleNamespace(**settings_of(controller)), controller.memory()
    z, p, u = controller.state(), controller.parameters, SimpleNamespace(**Surroundings()._asdict())
    sample, change = controller.functions["sample"], changing(Surroundings(), count, seed)
    torque = sampled_torques(lambda *row: sample(*row, n, m, z, p, u), u, inputs, change)
    return Samples(*inputs, torque, *change)
