"""What the contract tries a control law with: its place in a controller, plain and compiled, and motions."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np

from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Surroundings
from stickslip.exports.golden import random_motion
from stickslip.models.model import Model
from stickslip.simulation.compiled_controller import FAULT, Sampled, replay

Array = np.ndarray[Any, np.dtype[np.float64]]
TIME, LIMIT = 1e-3, 1.0
"""Sample time, s, and torque limit, N·m, of the specimens."""
COUNT = 400
FRICTION = Model("lugre", sigma0=3.5e4, sigma1=0.0, sigma2=0.018, fs=0.335, fc=0.285, vs=0.01)
PD: dict[str, Any] = {"kp": 6.099, "kd": 0.097067}


def variants(law: ControlLaw) -> Iterator[ControlLaw]:
    """The law, and the law under every single other option of its choices."""
    yield law
    for choice in law.choices:
        yield from (law.having(**{choice.name: o}) for o in choice.options if o != choice.default)


def block_of(law: ControlLaw) -> ControlBlock:
    """The law with its example, and with a friction law where it needs one."""
    return ControlBlock(law, FRICTION if law.holds_friction else None, **dict(law.example))


def specimen(law: ControlLaw, limit: float = LIMIT, time: float = TIME) -> Controller:
    """A controller with the law in its place."""
    return around(block_of(law), ControlBlock("pd", **PD), limit, time)


def around(block: ControlBlock, loop: ControlBlock, limit: float, time: float) -> Controller:
    """A controller with the block in its place, and the loop where the block is none."""
    places: dict[str, Any] = {"loop": loop, block.law.place: block}
    return Controller(sample_time=time, torque_limit=limit, alone=True, **places)


def motion(time: float = TIME) -> Array:
    """Random samples: reversals, stops, a blocked axis, inputs that are no numbers; shape (COUNT, 4)."""
    return np.column_stack(random_motion(time, LIMIT / PD["kp"], COUNT, 1))


def clean_motion() -> Array:
    """The same without inputs that are no numbers: those of the sample before stand in."""
    rows = motion()
    for i in np.flatnonzero(~np.isfinite(rows).all(axis=1)):
        rows[i] = rows[i - 1]
    return rows


class Plain:
    """A controller in plain Python."""

    def __init__(self, controller: Controller) -> None:
        self.n, self.m = controller.settings, controller.memory()
        self.z, self.p = controller.state(), controller.parameters
        self.u = SimpleNamespace(**Surroundings()._asdict())
        self.functions, self.controller = controller.functions, controller

    def __call__(self, row: Any, torque: float | None = None) -> float:
        """One sample, or one that another controller's torque is watched for, N·m."""
        name, more = ("sample", ()) if torque is None else ("follow", (torque,))
        return self.functions[name](*map(float, row), *more, self.n, self.m, self.z, self.p, self.u)

    def state(self) -> list[float]:
        """What the laws remember."""
        return self.controller.packed_state(self.z)


def torques(controller: Controller, inputs: Array, slow: float | None = None) -> Array:
    """The torques of plain Python, N·m; ``slow`` is the share by which the slow velocity moves in a sample."""
    plain = Plain(controller)
    if slow is not None:
        plain.n = plain.n._replace(slow=slow)
    return np.array([plain(row) for row in inputs])


def replayed(sampled: Sampled, inputs: Array) -> Array:
    """The torques of the compiled controller from its present state on, N·m."""
    out, fault = np.zeros(len(inputs)), np.zeros(len(inputs))
    replay(sampled, np.ascontiguousarray(inputs), np.array(Surroundings()), FAULT, out, fault)
    return out
