"""An axis for testing a setting, as the machine engine runs it: rigid, with an elastically coupled load, or on the
user's machine.

The user's machine defines its inertias and springs (resonances), encoder, amplifier, delay, cogging and ripple.
Friction and total inertia are those of the sampled axis, because these were identified, including bearings and
direction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from stickslip.machines.contact import Contact
from stickslip.machines.encoder import Encoder
from stickslip.machines.flexible import FlexibleAxis
from stickslip.machines.machine import Machine
from stickslip.machines.motor import Amplifier
from stickslip.machines.rigid import RigidAxis
from stickslip.machines.two_mass import TwoMassAxis
from stickslip.simulation.machine.layout import Laid, lay_out_machine
from stickslip.simulation.train.layout import seat


@dataclass(frozen=True)
class Plant(RigidAxis):
    """An axis with further torques and the drive's delay.

    Attributes
    ----------
    offset : float
        Constant torque against positive motion, N·m.
    waves : tuple of (float, float, float)
        Torques over the position, amplitude cos(order x + phase): order (1/rad), amplitude (N·m), phase (rad).
    delay : float
        Delay of the torque as a share of a sample, from 0 to 1.
    bandwidth : float
        Of the current loop, Hz; infinite: no lag.
    backward : bool
        Whether the drive's reference velocity is the mean over the previous sample, delayed by half a sample like the
        measured velocity; else that of the instant.
    flexible : TwoMassAxis or None
        Motor and load connected by a spring; None: a rigid axis.
    machine : Machine or None
        The user's machine, in place of ``delay``, ``bandwidth`` and ``flexible``.
    sampled : mapping of str to float
        Sampled values of the estimates, by name.
    unmodelled : float
        Sampled torque over the position, N·m RMS.
    """

    offset: float = 0.0
    waves: tuple[tuple[float, float, float], ...] = ()
    delay: float = 0.0
    bandwidth: float = math.inf
    backward: bool = False
    flexible: FlexibleAxis | TwoMassAxis | None = None
    machine: Machine | None = None
    sampled: Mapping[str, float] = field(default_factory=dict[str, float])
    unmodelled: float = 0.0

    @cached_property
    def kept(self) -> dict[tuple[float, float], Laid]:
        """Cached layouts, by the drive's sample time and counts: once for all controllers."""
        return {}

    def built(self, sample_time: float, counts: float) -> Machine:
        """Return the machine, sampled every `sample_time` s, with an encoder of `counts` unless it has one."""
        if self.machine is None:
            return Machine(
                "axis", self.inertia, Contact(self.friction), flexible=self.flexible,
                amplifier=Amplifier(1.0, bandwidth=self.bandwidth), delay=self.delay, sample_time=sample_time,
                encoder=Encoder(counts),
            )  # fmt: skip
        known = self.machine.without("bearings", "direction")
        part = self.inertia / known.inertia
        flexible = known.flexible.scaled(part) if known.flexible else None
        return replace(
            known, inertia=self.inertia, flexible=flexible, flexible_stiffness=0.0, models={},
            contact=replace(known.contact, friction=self.friction),
            encoder=replace(known.encoder, max_speed=math.inf),
        )  # fmt: skip


@dataclass(frozen=True)
class WholeMachine(Plant):
    """A machine with its own friction and inertia."""

    @classmethod
    def of(cls, machine: Machine) -> WholeMachine:
        """Return this machine as a plant."""
        return cls(machine.inertia, machine.friction, machine=machine)

    def built(self, sample_time: float, counts: float) -> Machine:
        """Return the machine."""
        assert self.machine is not None
        return self.machine


def laid_out(plant: RigidAxis, sample_time: float, counts: float) -> Laid:
    """Return a machine at rest for this axis, in the form of the machine engine."""
    own = plant if isinstance(plant, Plant) else Plant(plant.inertia, plant.friction)
    drive = (sample_time, counts)
    if drive not in own.kept:
        own.kept[drive] = laid_anew(own, *drive)
    laid = own.kept[drive]
    # A run changes everything except its flows, which are the largest part.
    arrays: dict[str, Any] = {name: x for name, x in laid._asdict().items() if isinstance(x, np.ndarray)}
    copies = {name: x.copy() for name, x in arrays.items()}
    seat(copies["train"], copies["parameters"])
    return laid._replace(**{**copies, "matrix": laid.matrix})


def laid_anew(own: Plant, sample_time: float, counts: float) -> Laid:
    """Return the same for a plant without a cached layout for such a drive."""
    beside = [(0.0, -own.offset, 0.0)] if own.offset != 0.0 else []
    beside += own.waves
    laid = lay_out_machine(own.built(sample_time, counts), located=not beside)
    laid.surroundings[1], laid.surroundings[2] = own.load, own.temperature
    n = laid.machine
    known = laid.waves[: 3 * int(n["ripples"] + n["cogs"])]
    n["cogs"] += len(beside)
    n["order"] = max(float(n["order"]), *(abs(order) for order, _, _ in beside), 0.0)
    return laid._replace(waves=np.concatenate([known, np.array(beside).ravel()]))
