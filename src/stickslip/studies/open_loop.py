"""What a study drives in open loop: friction over velocity, positions under a motor torque."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference


@dataclass(frozen=True)
class Response:
    """Friction over velocity in open loop: laws that answer to the velocity of a reference."""

    name: str
    title: str
    figure: str
    motion: Reference
    duration: float
    models: Mapping[str, Model]


@dataclass(frozen=True)
class Drive:
    """Positions in open loop: axes with different frictions under the same sinusoidal motor torque."""

    name: str
    title: str
    figure: str
    amplitude: float
    """N·m"""
    frequency: float
    """Hz"""
    duration: float
    axes: Mapping[str, RigidAxis]
