"""Responses of a sample of a controller at rest to small changes of its states."""

from __future__ import annotations

import copy
import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from stickslip.control.controller import Controller
from stickslip.control.plain import plain_sample
from stickslip.core.errors import InputError
from stickslip.core.spec import Surroundings

Array = np.ndarray[Any, np.dtype[np.float64]]
CARRIED = (
    "position",
    "velocity",
    "slow_velocity",
    "error",
    "applied",
    "commanded",
    "residual",
    "feedforward",
    "others",
)
"""States of the composition that a sample passes to the next; the rest are flags and clocks."""


def suspects(controller: Controller) -> str:
    """Return the laws that are not declared linear, or all of them."""
    names = [
        b.law.name for b in controller.blocks.values() if not b.law.is_linear and not b.law.holds_friction
    ]
    return " and ".join(dict.fromkeys(names or [b.law.name for b in controller.blocks.values()]))


class Sample:
    """One sample of a controller about rest, for small changes of its states and measurements."""

    def __init__(self, controller: Controller) -> None:
        self.n, self.p = controller.settings, controller.parameters
        self.m, self.z = controller.memory(), controller.state()
        self.u = SimpleNamespace(**Surroundings()._asdict())
        self.controller = controller
        for _ in range(3):  # flags of a first sample are set
            self._torque(0.0, self.m, self.z, self.u)
        self.rest = self._flat(self.m, self.z)
        self.size = len(self.rest)
        # A constant torque at rest and the drift of observers are not responses to a change.
        self.unchanged = self._after(np.zeros(self.size + 1))

    def answers(self, change: Array) -> Array:
        """Return the response of the sample to a change, shape (size + 1,): of every state, and of the torque."""
        return self._after(change) - self.unchanged

    def torques(self, angles: Array) -> Array:
        """Return the torques of samples starting from rest, N·m; NaN where the law gives none."""
        m, z, u = _copied(self.m), _copied(self.z), _copied(self.u)
        out = np.full(len(angles), math.nan)
        for i, angle in enumerate(angles.tolist()):
            try:
                out[i] = self._torque(angle, m, z, u)
            except InputError:  # LawError too: it is enough to know that this motion has no torque
                break
        return out

    def _after(self, change: Array) -> Array:
        m, z, u = _copied(self.m), _copied(self.z), _copied(self.u)
        self._set(m, z, self.rest + change[:-1])
        torque = self._torque(float(change[-1]), m, z, u)
        return np.append(self._flat(m, z), torque)

    def _torque(self, position: float, m: Any, z: Any, u: Any) -> float:
        """Return the torque of a sample; `InputError` if the law gives none at rest."""
        sample = self.controller.functions["sample"]
        torque = plain_sample(sample, position, 0.0, 0.0, 0.0, self.n, m, z, self.p, u)
        if m.fault != 0.0:
            raise InputError(
                f"controller: {suspects(self.controller)} gives a torque that is not finite at rest, so "
                "there is no linear loop; make it return a torque there too"
            )
        return torque

    def name_of(self, place: int) -> str:
        """Return the name of a changed state as text."""
        names = [*CARRIED, *_names(self.z)]
        return "the measured angle" if place == self.size else f"its state {names[place]!r}"

    def telling(self, places: Array) -> int:
        """Return the most informative index of a response: a state of a law, else the torque, else a state of the
        composition."""
        found = np.flatnonzero(places)
        own = found[(found >= len(CARRIED)) & (found < self.size)]
        return int((own if own.size else found[::-1])[0])

    def answer_name(self, place: int) -> str:
        """Return the name of an element of a response as text."""
        return "the torque" if place == self.size else [*CARRIED, *_names(self.z)][place]

    def _flat(self, m: Any, z: Any) -> Array:
        return np.array([*(getattr(m, name) for name in CARRIED), *_numbers(z)])

    def _set(self, m: Any, z: Any, values: Array) -> None:
        numbers = iter(values.tolist())
        for name in CARRIED:
            setattr(m, name, next(numbers))
        _fill(z, numbers)


def _copied(part: Any) -> Any:
    """Return a copy of a state; `copy.deepcopy`, which looks for shared objects, takes as long as a sample."""
    out = copy.copy(part)
    for name, value in cast("dict[str, Any]", vars(part)).items():
        if isinstance(value, SimpleNamespace):
            setattr(out, name, _copied(value))
        elif isinstance(value, list):
            setattr(out, name, list(value))  # type: ignore[reportUnknownArgumentType]
    return out


def _numbers(part: Any) -> list[float]:
    """Return the numbers of a state and its parts."""
    out: list[float] = []
    for value in cast("dict[str, Any]", vars(part)).values():
        if isinstance(value, SimpleNamespace):
            out += _numbers(value)
        else:
            out += value if isinstance(value, list) else [value]
    return out


def _names(part: Any, before: str = "") -> list[str]:
    """Return the names of the numbers of `_numbers`."""
    out: list[str] = []
    for name, value in cast("dict[str, Any]", vars(part)).items():
        if isinstance(value, SimpleNamespace):
            out += _names(value, f"{before}{name}.")
        else:
            out += [before + name] * (len(cast("list[float]", value)) if isinstance(value, list) else 1)
    return out


def _fill(part: Any, numbers: Any) -> None:
    """Write numbers into a state, in the order of `_numbers`."""
    for name, value in cast("dict[str, Any]", vars(part)).items():
        if isinstance(value, SimpleNamespace):
            _fill(value, numbers)
        elif isinstance(value, list):
            setattr(part, name, [next(numbers) for _ in value])  # type: ignore[reportUnknownVariableType]
        else:
            setattr(part, name, next(numbers))
