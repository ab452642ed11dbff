"""The numbers of a run by name: read, varied in one run, or laid out as columns of a batch.

``axis.inertia``, ``friction.NAME``, ``law.NAME`` (of the compensator's law), ``reference.NAME`` and, of the controller,
``controller.gain``, ``filter_hz``, ``bandwidth_hz``, ``damping``, ``kp``, ``ki``, ``kd``, ``kr``, ``torque_limit``,
``sample_time``; of one made of control laws its numbers by whole names (``controller.observer_corner``). An element of
a list is ``friction.k[0]``. ``axis.inertia`` and ``machine.inertia`` both name the inertia of whatever axis the run
has. The machine varies under the controller as it was designed: gains follow ``bandwidth_hz`` and ``damping``, not
the inertia.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.control.controller import Controller
from stickslip.control.linear import Gains, place
from stickslip.core.errors import UnknownName
from stickslip.machines.machine import Machine
from stickslip.machines.numbers import machine_numbers, with_friction, with_numbers
from stickslip.models.model import Model, Reference
from stickslip.studies.planned_run import PlannedRun

Array = np.ndarray[Any, np.dtype[np.float64]]
FAMILIES = ("axis", "machine", "friction", "law", "controller", "reference")
POLES = ("bandwidth_hz", "damping")
INERTIA = ("axis.inertia", "machine.inertia")
"""The names of a run's inertia: of a rigid axis, and of a machine with imperfections."""
ELEMENT = re.compile(r"(.+)\[(\d+)\]")


def parts(name: str) -> tuple[str, str, int | None]:
    """Family, name, and element if one is meant."""
    family, _, rest = name.partition(".")
    if family == "machine":
        return family, rest, None  # its elements are numbers of their own: ripple.amplitude[0]
    match = ELEMENT.fullmatch(rest)
    return (family, match[1], int(match[2])) if match else (family, rest, None)


def own_name(run: PlannedRun, name: str) -> str:
    """The name by which the run has a number: an inertia is that of its axis, by whichever name it is called."""
    return INERTIA[isinstance(run.axis, Machine)] if name in INERTIA else name


def poles(gains: Gains, inertia: float) -> tuple[str, float, float]:
    """Kind, bandwidth (Hz) and damping ratio that `stickslip.control.linear.place` makes such gains of."""
    if gains.ki > 0.0:
        w = (gains.ki / inertia) ** (1.0 / 3.0)
        return "PID", w / (2.0 * math.pi), 0.5 * (gains.kd / (inertia * w) - 1.0)
    w = math.sqrt(gains.kp / inertia)
    return ("PD" if gains.kr > 0.0 else "PR"), w / (2.0 * math.pi), 0.5 * gains.kd / (inertia * w)


def known(run: PlannedRun) -> dict[str, Any]:
    """Every number of a run, by name; those of lists as tuples."""
    control = run.control
    found: dict[str, Any] = {}
    if isinstance(run.axis, Machine):
        found |= {f"machine.{k}": v for k, v in machine_numbers(run.axis).items()}
    else:
        found["axis.inertia"] = run.axis.inertia
    found |= {f"friction.{k}": v for k, v in run.axis.friction.parameters._asdict().items()}
    if control.is_short and (helper := control.compensator):
        found |= {f"law.{k}": v for k, v in helper.model.parameters._asdict().items()}
        found |= {"controller.gain": helper.gain, "controller.filter_hz": helper.filter_hz or math.inf}
    if gains := _placeable(control):
        _, found["controller.bandwidth_hz"], found["controller.damping"] = poles(gains, run.axis.inertia)
    found |= {f"controller.{k}": v for k, v in control.numbers().items()}
    found["controller.torque_limit"] = run.control.torque_limit
    found["controller.sample_time"] = run.control.sample_time
    return found | {f"reference.{k}": v for k, v in run.motion.parameters._asdict().items()}


def _placeable(control: Controller) -> Gains | None:
    """The gains of a loop that bandwidth and damping can place; None of another."""
    gains, block = control.gains, control.blocks.get("loop")
    if gains is None and block and block.law.placed and block.law.continuous:
        gains = block.law.continuous(block.parameters)
    return gains if isinstance(gains, Gains) and gains.kp > 0.0 else None


def belongs(run: PlannedRun, name: str) -> bool:
    """Whether the run has that number; a controller without compensator has no ``law.fs``."""
    family, rest, element = parts(own_name(run, name))
    value = known(run).get(f"{family}.{rest}")
    if element is not None:
        return isinstance(value, tuple) and element < len(value)  # type: ignore[arg-type]
    return value is not None


def value_of(run: PlannedRun, name: str) -> Any:
    """The number as the study has it, or a tuple.

    Raises
    ------
    UnknownName
    """
    family, rest, element = parts(own_name(run, name))
    names = known(run)
    if f"{family}.{rest}" not in names or not belongs(run, name):
        raise UnknownName(f"number of run {run.key}", name, names)
    value = names[f"{family}.{rest}"]
    return value if element is None else value[element]


# ---- one run -----------------------------------------------------------------------------------------------


def varied(run: PlannedRun, values: Mapping[str, Any]) -> PlannedRun:
    """The run with other numbers.

    Raises
    ------
    InputError
        If a number is out of bounds.
    """
    sorted_: dict[str, dict[str, Any]] = {family: {} for family in FAMILIES}
    for name, value in values.items():
        family, rest, element = parts(own_name(run, name))
        if element is not None:
            whole = list(sorted_[family].get(rest, value_of(run, f"{family}.{rest}")))
            whole[element] = value
            value = whole
        sorted_[family][rest] = value
    motion = run.motion
    if sorted_["reference"]:
        motion = Reference(motion.kind, **{**motion.parameters._asdict(), **sorted_["reference"]})
    friction = with_values(run.axis.friction, sorted_["friction"])
    if isinstance(run.axis, Machine):
        axis = with_friction(with_numbers(run.axis, sorted_["machine"]), friction)
    else:
        inertia = float(sorted_["axis"].get("inertia", run.axis.inertia))
        axis = replace(run.axis, inertia=inertia, friction=friction)
    return replace(
        run, axis=axis, motion=motion, control=_control(run, sorted_["controller"], sorted_["law"])
    )


def with_values(model: Model, values: Mapping[str, Any]) -> Model:
    """The model with other parameters."""
    return Model(model.law, **{**model.parameters._asdict(), **values}) if values else model


def _control(run: PlannedRun, settings: Mapping[str, Any], law: Mapping[str, Any]) -> Controller:
    """The controller with other numbers, and other parameters of the compensator's law."""
    control = run.control
    both: dict[str, Any] = {k: float(settings[k]) for k in ("torque_limit", "sample_time") if k in settings}
    helper = control.compensator
    if helper and control.is_short:
        hz = float(settings.get("filter_hz", helper.filter_hz or math.inf))
        helper = replace(
            helper, model=with_values(helper.model, law), gain=float(settings.get("gain", helper.gain)),
            filter_hz=hz if math.isfinite(hz) else None,
        )  # fmt: skip
        both["compensator"] = helper
    return replace(control.with_numbers({**_placed(control, run.axis.inertia, settings), **settings}), **both)


def _placed(control: Controller, inertia: float, settings: Mapping[str, Any]) -> dict[str, float]:
    """The gains of the loop by bandwidth and damping, under the names that the controller has for them."""
    before = _placeable(control) if any(name in settings for name in POLES) else None
    if before is None:
        return {}
    kind, *own = poles(before, inertia)
    bandwidth, damping = (float(settings.get(name, usual)) for name, usual in zip(POLES, own))
    placed = control.blocks["loop"].law.placed
    gains = (
        placed(inertia, bandwidth, damping) if placed else place(kind, inertia, bandwidth, damping)._asdict()
    )
    return {name if control.is_short else f"loop_{name}": value for name, value in gains.items()}


# ---- columns of a batch ------------------------------------------------------------------------------------


def as_columns(run: PlannedRun, values: Mapping[str, Array]) -> dict[str, Array]:
    """The values as `stickslip.simulation.many.batch` names them; it says itself which it cannot vary.

    Parameters
    ----------
    run : PlannedRun
    values : mapping of str to array, shape (n,) or (n, elements)
    """
    out: dict[str, Array] = {}
    settings: dict[str, Array] = {}
    if not run.control.is_short and run.control.sample_time == 0.0:
        out, values = _of_blocks(run, values)
    for name, column in values.items():
        family, rest, element = parts(name)
        if family in ("friction", "law"):
            whole = f"{family}.{rest}"
            if element is not None:
                base = out.get(whole, np.tile(value_of(run, whole), (len(column), 1)))
                base[:, element] = column
                column = base
            out[whole] = column
        elif name in INERTIA:
            out["inertia"] = column
        elif family == "controller" and rest in (*POLES, *Gains._fields):
            settings[rest] = column
        else:
            out["gain" if name == "controller.gain" else name] = column
    if settings and run.control.is_short:
        rows = zip(*settings.values())
        gains = [_control(run, dict(zip(settings, map(float, row))), {}).linear for row in rows]
        out |= {field: np.array([getattr(g, field) for g in gains]) for field in Gains._fields}
    return out


def _of_blocks(run: PlannedRun, values: Mapping[str, Array]) -> tuple[dict[str, Array], dict[str, Array]]:
    """The columns of a controller made of control laws, in continuous time, and the values that are not its own."""
    family = "controller."
    own = {k: v for k, v in values.items() if k.startswith(family) and parts(k)[2] is None}
    rest = {k: v for k, v in values.items() if k not in own}
    rows = zip(*(column.tolist() for column in own.values()))
    names = [name.removeprefix(family) for name in own]
    made = [_control(run, dict(zip(names, row)), {}).continuous for row in rows]
    if not made:
        return {}, rest
    out = {field: np.array([getattr(c.gains, field) for c in made]) for field in Gains._fields}
    if made[0].compensation:
        out["gain"] = np.array([c.compensation.gain for c in made if c.compensation])
    for held in (name.split("_friction_", 1)[1] for name in names if "_friction_" in name):
        out[f"law.{held}"] = np.array([getattr(c.friction.parameters, held) for c in made if c.friction])
    return out, rest
