"""The map of stability held against the virtual rig: the loop at rest, a push, and whether it comes to rest again.

The map is linear, about rest, at the size of one count. The rig has all that the map leaves out: the laws themselves,
quantisation, noise, ripple, cogging. A push too small to make the contact slip starts the motion; what is left of it
in the end, over what the linear controller alone leaves, is the verdict.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.analyse.machine_axis import axis_of
from stickslip.analyse.presliding_loop import Drive, Loop, Poles
from stickslip.analyse.stability import with_law
from stickslip.analyse.stability_result import Map, SafeGain
from stickslip.control.compensator import Feedback
from stickslip.control.controller import Controller
from stickslip.control.linear import Gains
from stickslip.core.errors import RigError
from stickslip.core.record import Record
from stickslip.machines.machine import Machine
from stickslip.models.model import Model
from stickslip.rigs.loop import Loop as RigLoop
from stickslip.rigs.rig import setpoints
from stickslip.rigs.virtual import VirtualRig

FILTERS = (4.0, 10.0, 25.0, 60.0, 150.0, 0.0)
"""Hz; 0 for none."""
GAINS = (0.2, 0.4, 0.6, 0.8, 1.0, 1.2)
OPEN = 300.0
"""Hz, where pictures show what has no filter."""
FINE = np.append(np.geomspace(3.0, 200.0, 12), OPEN)
FINE_GAINS = np.linspace(0.1, 1.3, 13)
ROUNDS = 6
"""Times that the laws are taken anew at the frequency of the motion that they make."""
PUSH, PUSHED = 0.004, 0.005
"""N·m and s."""
REST, WATCHED = 3.0, 0.5
"""s after the push, and the last of them that are watched."""
SLOWEST = 1.0
"""Hz, at which the laws are taken for a motion that only creeps."""
RESTLESS = 5.0
"""Times the motion with the linear controller alone, and counts of the encoder, from which a loop is not at rest."""


class Judged:
    """A setting with what the poles (``growth``, 1/s) and the rig (``calm``) say of it."""

    growth: float
    calm: bool

    @property
    def stable(self) -> bool:
        """Whether the poles say so."""
        return self.growth < 0.0

    @property
    def agrees(self) -> bool:
        """Whether the simulation does what the poles say."""
        return self.stable == self.calm


@dataclass(frozen=True)
class Point(Judged):
    """One setting.

    Attributes
    ----------
    law : str
    filter_hz, gain : float
    growth, frequency : float
        Of the least stable pole, 1/s and Hz.
    moved : float
        What the encoder shows in the end: RMS about its mean, or its way from where it stood before the push, rad.
    calm : bool
        Whether that is rest.
    """

    law: str
    filter_hz: float
    gain: float
    growth: float
    frequency: float
    moved: float
    calm: bool


@dataclass(frozen=True, eq=False)
class Confirmed:
    """Poles and simulations of a grid, and of the recommended settings.

    Attributes
    ----------
    machine : str
    alone : float
        Motion with the linear controller alone, rad.
    points : tuple of Point
    advised : tuple of Point
        The recommended filter and gain of each law that has one.
    maps : tuple of Map
        The poles of each law over `FINE_GAINS` and `FINE`.
    """

    machine: str
    alone: float
    points: tuple[Point, ...]
    advised: tuple[Point, ...]
    maps: tuple[Map, ...] = ()

    def of(self, law: str) -> tuple[Point, ...]:
        """The points of a law."""
        return tuple(p for p in self.points if p.law == law)

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "machine": self.machine, "alone": self.alone, "points": [vars(p) for p in self.points],
            "advised": [vars(p) for p in self.advised],
        }  # fmt: skip

    def lines(self) -> Iterator[str]:
        """What people read."""
        yield ""
        yield (
            f"on the virtual {self.machine}, pushed at rest; the linear controller alone leaves "
            f"{1e6 * self.alone:.1f} µrad, from {RESTLESS:g} times that a loop is restless:"
        )
        for law in dict.fromkeys(p.law for p in self.points):
            some = self.of(law)
            agreed = sum(p.agrees for p in some)
            said = [p for p in some if not p.agrees]
            words = ", ".join(f"{p.gain:g} with {sieve(p.filter_hz)}" for p in said[:4])
            more = f" (others: gain {words}{', ...' if len(said) > 4 else ''})" if said else ""
            yield f"{law:<10}{agreed} of {len(some)} settings do what the poles say{more}"
        for p in self.advised:
            rest = "calm" if p.calm else "restless"
            yield f"{p.law:<10}recommended gain {p.gain:g} with {sieve(p.filter_hz)}: {rest}, {1e6 * p.moved:.1f} µrad"


def sieve(filter_hz: float) -> str:
    """A filter in words."""
    return f"{filter_hz:g} Hz" if filter_hz else "no filter"


def confirmed(
    machine: Machine, gains: Gains, models: Mapping[str, Model], advice: Mapping[str, SafeGain | None],
    filters: Sequence[float] = FILTERS, values: Sequence[float] = GAINS, drawn: bool = False,
) -> Confirmed:  # fmt: skip
    """Simulate a grid of filters and gains, and the recommended settings.

    Parameters
    ----------
    machine : Machine
        With the imperfections that it has.
    gains : Gains
        Of the linear controller.
    models : mapping of str to Model
        Of the compensators.
    advice : mapping of str to SafeGain or None
    filters, values : sequence of float
        Hz (0 for none), and gains.
    drawn : bool
        Whether the maps for a picture are computed too.
    """
    alone = moved(machine, Controller(gains, None, VirtualRig(machine).limits.torque, machine.sample_time))
    count = 2.0 * math.pi / machine.encoder.counts if machine.encoder.counts > 0.0 else 0.0
    most = RESTLESS * max(alone, count)
    grid = [(name, f, g) for name in models for f in filters for g in values]
    points = [point(machine, gains, name, models[name], f, g, most) for name, f, g in grid]
    advised = [
        point(machine, gains, name, models[name], r.filter_hz, r.gain, most)
        for name, r in advice.items()
        if r
    ]
    maps = tuple(_background(machine, gains, name, model, most) for name, model in models.items() if drawn)
    return Confirmed(machine.name, alone, tuple(points), tuple(advised), maps)


def point(
    machine: Machine, gains: Gains, name: str, model: Model, filter_hz: float, gain: float, most: float
) -> Point:
    """One setting: its poles, and what it does."""
    poles = poles_at(machine, gains, model, filter_hz, gain, most)
    compensator = Feedback(model, gain, filter_hz or None)
    found = moved(
        machine, Controller(gains, compensator, VirtualRig(machine).limits.torque, machine.sample_time)
    )
    return Point(name, filter_hz, gain, poles.growth, poles.frequency, found, found < most)


def poles_at(
    machine: Machine, gains: Gains, model: Model, filter_hz: float, gain: float, most: float
) -> Poles:
    """Least stable pole for motion of `most` rad RMS, with the laws as they are at its own frequency.

    A loop that grows at one count may end below what counts as unrest, in a cycle that nobody sees.
    """
    axis = axis_of(machine, math.sqrt(2.0) * most)
    drive = Drive(gains, filter_hz=filter_hz, sample_time=machine.sample_time, delay=machine.delay)
    found = poles = Poles(1.0, 0.0, axis.ringing)
    for _ in range(ROUNDS):
        drivetrain, there = with_law(axis, drive, model, axis.amplitude, max(poles.frequency, SLOWEST))
        found = Loop(drivetrain, replace(there, gain=gain)).poles()
        # Half-way on a logarithmic scale, so that it settles.
        between = math.sqrt(max(found.frequency, SLOWEST) * max(poles.frequency, SLOWEST))
        poles = replace(found, frequency=between)
    return found


def _background(machine: Machine, gains: Gains, name: str, model: Model, most: float) -> Map:
    """Poles over a finer grid; the last column, at `OPEN` Hz, is that without a filter."""
    growth, frequency = np.empty((FINE_GAINS.size, FINE.size)), np.empty((FINE_GAINS.size, FINE.size))
    for j, corner in enumerate(FINE.tolist()):
        for i, gain in enumerate(FINE_GAINS.tolist()):
            found = poles_at(machine, gains, model, 0.0 if corner == OPEN else corner, gain, most)
            growth[i, j], frequency[i, j] = found.growth, found.frequency
    return Map(name, growth, frequency)


def moved(machine: Machine, controller: Controller | None) -> float:
    """Motion at the end of a push and a rest, rad; without a controller the axis is left to itself."""
    dt = machine.sample_time
    before, after = round(0.2 / dt), round(REST / dt)
    torque = np.zeros(before + after)
    torque[before : before + round(PUSHED / dt)] = PUSH
    with RigLoop(VirtualRig(machine)) as loop:
        try:
            loop.run(setpoints(torque.size, torque=torque, closed=1.0), controller)
        except RigError:
            return math.inf
        record: Record = loop.record()
    position = record["position"][record["closed"] > 0.0]
    end = position[-round(WATCHED / dt) :]
    return max(float(np.std(end)), abs(float(np.mean(end)) - float(np.mean(position[: before // 2]))))
