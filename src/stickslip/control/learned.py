"""What the laws of a controller have learned: values with their uncertainty, for people, records and files.

A file keeps them with the power off. It says of which machine and laws they are, and is neither read nor overwritten
by others.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

from stickslip.control.controller import Controller
from stickslip.core.config import read_toml
from stickslip.core.errors import InputError
from stickslip.core.whole_files import write_whole

WIDTH = 1.96
"""Standard deviations of half an interval that holds 95 of 100 times."""
SILENT = "no uncertainty given"


@dataclass(frozen=True)
class LearnedValue:
    """A value that a law has learned.

    Attributes
    ----------
    name : str
        Its whole name in the controller.
    meaning, unit : str
    value : float or list of float
    uncertainty : float or None
        Half the interval that holds 95 of 100 times, in the value's unit; None where the law has no covariance, has
        learned nothing yet, or where the value is at its bound. It is that of noise: what the law itself gets wrong is
        not in it.
    """

    name: str
    meaning: str
    unit: str
    value: float | list[float]
    uncertainty: float | None

    @property
    def text(self) -> str:
        """In a line."""
        if isinstance(self.value, list):
            low, high = min(self.value), max(self.value)
            shown = f"{len(self.value)} values from {low:.4g} to {high:.4g}"
        else:
            shown = f"{self.value:.4g}"
        unit = "" if self.unit == "-" else f" {self.unit}"
        if self.uncertainty is None:
            return f"{self.meaning} ({self.name}) = {shown}{unit}; {SILENT}"
        return f"{self.meaning} ({self.name}) = {shown} ± {self.uncertainty:.2g}{unit}"


def learned_values(
    controller: Controller, z: SimpleNamespace, sample_time: float = 0.0
) -> tuple[LearnedValue, ...]:
    """What a controller's laws have learned in the state `z`.

    Parameters
    ----------
    controller : Controller
    z : SimpleNamespace
        As its method ``state`` gives it.
    sample_time : float
        At which it ran, s; 0 for its own.
    """
    values, period = controller.learned(z), sample_time or controller.sample_time
    n, p = controller.settings._replace(sample_time=period), controller.parameters
    spread = {name: deviation(n, z, p) for name, deviation in controller.deviations.items()}
    return tuple(
        LearnedValue(
            f.name, f.par.meaning, f.par.unit, values[f.name],
            WIDTH * spread[f.name] if spread.get(f.name, -1.0) >= 0.0 else None,
        )
        for f in controller.learned_fields
    )  # fmt: skip


def plain(values: Sequence[LearnedValue]) -> dict[str, dict[str, Any]]:
    """What a record says of them by name: meaning, unit, value, uncertainty (None: not told)."""
    return {
        v.name: {"meaning": v.meaning, "unit": v.unit, "value": v.value, "uncertainty": v.uncertainty}
        for v in values
    }


def told(meta: Mapping[str, Any]) -> list[str]:
    """A line for each learned value in a record's meta."""
    return [LearnedValue(name, **v).text for name, v in meta.get("learned", {}).items()]


def after(controller: Controller, state: Any, sample_time: float) -> dict[str, dict[str, Any]]:
    """What `plain` says of a controller after a run that has left this flat `state`."""
    if not controller.learned_fields:
        return {}
    return plain(learned_values(controller, controller.unpacked_state(state.tolist()), sample_time))


# ---- files ---------------------------------------------------------------------------------------------------------


def origin_of(controller: Controller, machine: str) -> dict[str, str]:
    """What says whose learned values they are: the machine, and a hash of the laws with all their parameters."""
    content = {part: block.as_dict() for part, block in controller.blocks.items()}
    text = json.dumps(content, sort_keys=True, default=str)
    return {"machine": machine, "laws": hashlib.sha256(text.encode()).hexdigest()}


def write_learned(path: Path, controller: Controller, learned: Mapping[str, Any], machine: str) -> None:
    """Keep what a controller has `learned` (as its method of that name gives it) on a machine.

    Raises
    ------
    InputError
        If the file is another's, or cannot be written.
    """
    origin = origin_of(controller, machine)
    refuse_others(path, origin)
    shown = learned_values(controller, controller.state(learned))
    uncertain = {v.name: v.uncertainty for v in shown if v.uncertainty is not None}
    write_table(path, {"origin": origin, "learned": dict(learned), "uncertainty": uncertain})


def read_learned(path: Path, controller: Controller, machine: str) -> dict[str, Any]:
    """What `write_learned` has kept, for the method ``state`` of the controller; nothing where there is no file.

    Raises
    ------
    InputError
        If the file is another's.
    """
    refuse_others(path, origin_of(controller, machine))
    if not path.exists():
        return {}
    return dict(read_toml(path).table("learned").values)


def refuse_others(path: Path, origin: Mapping[str, str]) -> None:
    """Refuse a file that is there and is not of the same origin.

    Raises
    ------
    InputError
    """
    if not path.exists():
        return
    found = read_toml(path).values.get("origin")
    kept = cast("dict[str, Any]", found) if isinstance(found, dict) else {}
    for name, own in origin.items():
        if kept.get(name) != own:
            what = f"was learned with other {name}" if name in kept else "holds nothing that was learned"
            raise InputError(f"{path} {what}, and is not overwritten; give another path")


def write_table(path: Path, content: Mapping[str, Any]) -> None:
    """Write a TOML file.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    import tomli_w

    write_whole(path, tomli_w.dumps(content))
