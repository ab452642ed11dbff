"""stickslip: friction of servo axes, simulated under control and compensated.

From a log to a compensator: `read`, `doctor`, `identify`, `compare`, `recommend`, `export`. Simulation: `Model`,
`RigidAxis`, `load_machine`, `Machine` and its parts (`Contact`, `TwoMassAxis`, `FlexibleAxis`, `Encoder`, ...),
`Controller`, `Reference`, `simulate`, `respond`, `stability`. Many runs: `study`, `sweep`, `tune`, `learn`. `warm_up`
compiles everything in advance. Each has its own help, `help(stickslip.identify)`.

The public names below are loaded when first used, so that importing the package costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stickslip.cli.warm_up import warm_up
    from stickslip.control.block import ControlBlock
    from stickslip.control.compensator import Feedback, Feedforward
    from stickslip.control.controller import Controller
    from stickslip.control.linear import Cascade, Gains, pd, pid, place, pr
    from stickslip.control.registry import control_law, control_law_names
    from stickslip.core.code_approval import allow_code
    from stickslip.core.control_spec import ControlLaw
    from stickslip.core.errors import InputError, SimulationError, StickslipError
    from stickslip.core.record import Record
    from stickslip.core.spec import Law, Mode, Par
    from stickslip.machines.contact import Bearings, Contact, Drift, Heat
    from stickslip.machines.encoder import Encoder
    from stickslip.machines.files import load_machine
    from stickslip.machines.flexible import FlexibleAxis
    from stickslip.machines.machine import Machine, Sensor
    from stickslip.machines.motor import Amplifier, Converter, Harmonics
    from stickslip.machines.rigid import RigidAxis
    from stickslip.machines.two_mass import TwoMassAxis
    from stickslip.models.model import Model, Reference
    from stickslip.models.plugins import law, law_names
    from stickslip.simulation.closed_loop import simulate
    from stickslip.simulation.prescribed.open_loop import respond
    from stickslip.verbs.compare import compare
    from stickslip.verbs.doctor import doctor
    from stickslip.verbs.export import ExportResult, export
    from stickslip.verbs.identification import IdentificationResult
    from stickslip.verbs.identify import identify
    from stickslip.verbs.learn import LearningResult, learn
    from stickslip.verbs.reading import read
    from stickslip.verbs.recommend import recommend
    from stickslip.verbs.recommendation import RecommendationResult
    from stickslip.verbs.stability import stability
    from stickslip.verbs.study import study
    from stickslip.verbs.sweep import SweepResult, sweep
    from stickslip.verbs.tune import tune

__version__ = "0.1.0"

_HOME = {
    name: module
    for module, names in {
        "core.code_approval": "allow_code",
        "cli.warm_up": "warm_up",
        "control.block": "ControlBlock",
        "control.compensator": "Feedback Feedforward",
        "control.controller": "Controller",
        "control.linear": "Cascade Gains pd pid place pr",
        "control.registry": "control_law control_law_names",
        "core.control_spec": "ControlLaw",
        "core.errors": "InputError SimulationError StickslipError",
        "machines.contact": "Bearings Contact Drift Heat",
        "machines.encoder": "Encoder",
        "machines.files": "load_machine",
        "machines.flexible": "FlexibleAxis",
        "machines.machine": "Machine Sensor",
        "machines.motor": "Amplifier Converter Harmonics",
        "machines.rigid": "RigidAxis",
        "machines.two_mass": "TwoMassAxis",
        "models.model": "Model Reference",
        "models.plugins": "law law_names",
        "core.record": "Record",
        "report.record_figure": "record_figure",
        "simulation.closed_loop": "simulate",
        "simulation.prescribed.open_loop": "respond",
        "core.spec": "Law Mode Par",
        "verbs.compare": "compare",
        "verbs.doctor": "doctor",
        "verbs.export": "ExportResult export",
        "verbs.identification": "IdentificationResult",
        "verbs.identify": "identify",
        "verbs.learn": "LearningResult learn",
        "verbs.reading": "read",
        "verbs.recommend": "recommend",
        "verbs.recommendation": "RecommendationResult",
        "verbs.stability": "stability",
        "verbs.study": "study",
        "verbs.sweep": "SweepResult sweep",
        "verbs.tune": "tune",
    }.items()
    for name in names.split()
}
"""Where the public names are."""

__all__ = [
    "Amplifier",
    "Bearings",
    "Cascade",
    "Contact",
    "ControlBlock",
    "ControlLaw",
    "Controller",
    "Converter",
    "Drift",
    "Encoder",
    "ExportResult",
    "Feedback",
    "Feedforward",
    "FlexibleAxis",
    "Gains",
    "Harmonics",
    "Heat",
    "IdentificationResult",
    "InputError",
    "Law",
    "LearningResult",
    "Machine",
    "Mode",
    "Model",
    "Par",
    "RecommendationResult",
    "Record",
    "Reference",
    "RigidAxis",
    "Sensor",
    "SimulationError",
    "StickslipError",
    "SweepResult",
    "TwoMassAxis",
    "allow_code",
    "compare",
    "control_law",
    "control_law_names",
    "doctor",
    "export",
    "identify",
    "law",
    "law_names",
    "learn",
    "load_machine",
    "pd",
    "pid",
    "place",
    "pr",
    "read",
    "recommend",
    "respond",
    "simulate",
    "stability",
    "study",
    "sweep",
    "tune",
    "warm_up",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'stickslip' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"stickslip.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names, without the helpers of this file and what it imports."""
    return sorted({*(n for n in globals() if n.startswith("__")), *__all__})
