"""A law leaves Python: one file a target. `TARGETS` names them."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from stickslip.errors import UnknownName

if TYPE_CHECKING:
    from stickslip.export.target import Target

__all__ = ["TARGETS", "target_named"]

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
    found: Target = importlib.import_module(f"stickslip.export.{name.replace('-', '_')}").TARGET
    return found
