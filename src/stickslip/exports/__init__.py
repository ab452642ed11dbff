"""A law leaves Python: one file a target. `TARGETS` names them."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from stickslip.core.errors import UnknownName

if TYPE_CHECKING:
    from stickslip.exports.controllers import ControllerTarget
    from stickslip.exports.target import Target

TARGETS = (
    "c99",
    "arduino",
    "python",
    "matlab",
    "st",
    "fmu",
    "fmu-axis",
    "urdf",
    "mujoco",
    "bam",
    "isaac",
    "ros",
    "table",
    "beckhoff",
    "linuxcnc",
    "modelica",
)


def target_named(name: str) -> Target:
    """The target of that name.

    Raises
    ------
    UnknownName
    """
    if name not in TARGETS:
        raise UnknownName("export target", name, TARGETS)
    found: Target = importlib.import_module(f"stickslip.exports.{name.replace('-', '_')}").TARGET
    return found


CONTROLLER_TARGETS = ("c99", "arduino", "python", "matlab", "st", "fmu")
"""Those that carry a controller made of control laws: one file each, ``NAME_controller.py``."""


def controller_target(name: str) -> ControllerTarget:
    """What the target of that name does with a controller made of control laws.

    Raises
    ------
    UnknownName
    """
    if name not in CONTROLLER_TARGETS:
        raise UnknownName("target for a controller", name, CONTROLLER_TARGETS)
    found: ControllerTarget = importlib.import_module(f"stickslip.exports.{name}_controller").CONTROLLER
    return found
