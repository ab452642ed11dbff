"""stickslip: friction of servo axes, simulated under control and compensated.

The public names below are loaded when first used, so that importing the package costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stickslip.approval import allow_code
    from stickslip.control.block import ControlBlock
    from stickslip.control.compensators.feedback import Feedback
    from stickslip.control.compensators.feedforward import Feedforward
    from stickslip.control.controller import Controller
    from stickslip.control.linear import Cascade, Gains, pd, pid, place, pr
    from stickslip.control.sampled_controller import SampledController
    from stickslip.control_spec import ControlLaw
    from stickslip.errors import InputError, SimulationError, StickslipError
    from stickslip.machines.rigid import RigidAxis
    from stickslip.model import Model, Reference
    from stickslip.plugins import control_law, control_law_names, law, law_names
    from stickslip.record import Record
    from stickslip.simulation.closed_loop import simulate
    from stickslip.simulation.open_loop import respond
    from stickslip.spec import Law, Mode, Par

__version__ = "0.1.0"

_HOME = {
    "Cascade": "control.linear",
    "ControlBlock": "control.block",
    "ControlLaw": "control_spec",
    "Controller": "control.controller",
    "Feedback": "control.compensators.feedback",
    "Feedforward": "control.compensators.feedforward",
    "Gains": "control.linear",
    "InputError": "errors",
    "Law": "spec",
    "Mode": "spec",
    "Model": "model",
    "Par": "spec",
    "Record": "record",
    "Reference": "model",
    "RigidAxis": "machines.rigid",
    "SampledController": "control.sampled_controller",
    "SimulationError": "errors",
    "StickslipError": "errors",
    "allow_code": "approval",
    "control_law": "plugins",
    "control_law_names": "plugins",
    "law": "plugins",
    "law_names": "plugins",
    "pd": "control.linear",
    "pid": "control.linear",
    "place": "control.linear",
    "pr": "control.linear",
    "respond": "simulation.open_loop",
    "simulate": "simulation.closed_loop",
}

__all__ = [
    "Cascade",
    "ControlBlock",
    "ControlLaw",
    "Controller",
    "Feedback",
    "Feedforward",
    "Gains",
    "InputError",
    "Law",
    "Mode",
    "Model",
    "Par",
    "Record",
    "Reference",
    "RigidAxis",
    "SampledController",
    "SimulationError",
    "StickslipError",
    "allow_code",
    "control_law",
    "control_law_names",
    "law",
    "law_names",
    "pd",
    "pid",
    "place",
    "pr",
    "respond",
    "simulate",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'stickslip' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"stickslip.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
