"""An axis on which a setting is tried, as the machine engine runs it: rigid, with motor and load behind
a spring, or on the machine at hand.

The machine at hand brings what was measured of it: its inertias and springs (resonances), encoder, amplifier, delay,
cogging and ripple. Friction and the whole inertia are the drawn axis's: they are what was identified, bearings and
direction included.
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
    """An axis with what acts beside its friction, and how late the drive's torque acts.

    Attributes
    ----------
    offset : float
        Constant torque against positive motion, N·m.
    waves : tuple of (float, float, float)
        Torques over the position, amplitude cos(order x + phase): order (1/rad), amplitude (N·m), phase (rad).
    delay : float
        Part of a sample by which the torque acts late, from 0 to 1.
    bandwidth : float
        Of the current loop, Hz; infinite follows at once.
    backward : bool
        Whether the drive's reference velocity is the mean over the sample before, half a sample late, as the velocity
        that it measures; else that of the instant.
    flexible : TwoMassAxis or None
        Motor and load behind a spring; None: a rigid axis.
    machine : Machine or None
        The machine at hand, in place of ``delay``, ``bandwidth`` and ``flexible``.
    sampled : mapping of str to float
        Drawn values of the estimates, by name.
    unmodelled : float
        Drawn torque over the position, N·m RMS.
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
        """How it was laid out, by the drive's sample time and counts: once for all controllers that are tried on it."""
        return {}

    def built(self, sample_time: float, counts: float) -> Machine:
        """The machine that it is, sampled every `sample_time` s, with an encoder of `counts` where none is at hand."""
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
    """A machine with its own friction and inertia, as it is."""

    @classmethod
    def of(cls, machine: Machine) -> WholeMachine:
        """The plant that this machine is."""
        return cls(machine.inertia, machine.friction, machine=machine)

    def built(self, sample_time: float, counts: float) -> Machine:
        """The machine."""
        assert self.machine is not None
        return self.machine


def laid_out(plant: RigidAxis, sample_time: float, counts: float) -> Laid:
    """A machine at rest that is this axis, as the machine engine takes it."""
    own = plant if isinstance(plant, Plant) else Plant(plant.inertia, plant.friction)
    drive = (sample_time, counts)
    if drive not in own.kept:
        own.kept[drive] = laid_anew(own, *drive)
    laid = own.kept[drive]
    # A run changes all but its flows, which are most of it.
    arrays: dict[str, Any] = {name: x for name, x in laid._asdict().items() if isinstance(x, np.ndarray)}
    copies = {name: x.copy() for name, x in arrays.items()}
    seat(copies["train"], copies["parameters"])
    return laid._replace(**{**copies, "matrix": laid.matrix})


def laid_anew(own: Plant, sample_time: float, counts: float) -> Laid:
    """The same, for a plant that was not yet laid out for such a drive."""
    beside = [(0.0, -own.offset, 0.0)] if own.offset != 0.0 else []
    beside += own.waves
    laid = lay_out_machine(own.built(sample_time, counts), located=not beside)
    laid.surroundings[1], laid.surroundings[2] = own.load, own.temperature
    n = laid.machine
    known = laid.waves[: 3 * int(n["ripples"] + n["cogs"])]
    n["cogs"] += len(beside)
    n["order"] = max(float(n["order"]), *(abs(order) for order, _, _ in beside), 0.0)
    return laid._replace(waves=np.concatenate([known, np.array(beside).ravel()]))
