"""The axis that a record moves, as the text of a step calls it: its contact, and the torque that its position makes."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.jit import call_holding, call_step, kernel, record_at, spliced
from stickslip.subset import Layout

NUMBERS = Layout(("inertia", "loss", "holds"))
"""What the text of a step reads of the axis. loss is all damping: the back-EMF's and an observer's; holds is 1 where
the contact's torque jumps at rest."""
AXIS = np.dtype(
    [
        (name, np.float64) for name in (
            *NUMBERS.scalars,
            # Torque against positive motion, of a pendulum, N·m, which hangs at an angle, rad.
            "offset", "gravity", "gravity_angle",
            # Torque per unit of the drive's signal; N·m·s/rad lost in the drive; load per torque of drive and outside,
            # 1/(N·m); rad; whether friction is scaled by the load.
            "drive_gain", "back_emf", "load_motor", "load_external", "backlash", "scaled_by_load",
            # rad after which torque and friction repeat, and how many harmonics they have.
            "period", "harmonics",
            # Torque from outside that no gearing carries (an observer's), N·m.
            "push",
        )
    ]
)  # fmt: skip
"""All numbers of the axis, `Mechanics` in a record; for each harmonic follow the cosine's and sine's torque, then the
cosine's and sine's share of friction."""
FOURIER = len(AXIS.names or ())
GIVEN = ("start", "tried", "go_on", "keep", "withheld", "outer")
"""What the text of a step calls; C has its own."""


class Plant(NamedTuple):
    """A law and its state, where a stage begins and where it was tried last; and what else the text of a step takes.

    All but the whole numbers are addresses: arrays in a tuple would count references at every access, which took
    half of a step's time.
    """

    step: int
    holding: int
    parameters: Any
    surroundings: Any
    state: Any
    base: Any
    trial: Any
    states: int
    numbers: Any
    motion: Any
    first: Any
    second: Any
    band: float
    """velocity up to which the axis counts as at rest, rad/s, where a step asks for it"""


# ---- the contact ------------------------------------------------------------------------------------------


@kernel(inline=True)
def start(c: Plant) -> None:
    """A stage begins where the step does."""
    for i in range(c.states):
        c.base[i] = c.state[i]


@kernel(inline=True)
def tried(c: Plant, v: float, h: float) -> float:
    """Torque after h at constant velocity from where the stage begins."""
    for i in range(c.states):
        c.trial[i] = c.base[i]
    return call_step(c.step, v, v, h, c.trial, c.parameters, c.surroundings)


@kernel(inline=True)
def go_on(c: Plant) -> None:
    """The next stage begins where the contact was tried last."""
    for i in range(c.states):
        c.base[i] = c.trial[i]


@kernel(inline=True)
def keep(c: Plant) -> None:
    """The step ends where the contact was tried last."""
    for i in range(c.states):
        c.state[i] = c.trial[i]


@kernel(inline=True)
def withheld(c: Plant, side: float) -> float:
    """The torque that the contact withstands at rest, N·m, where a stage begins."""
    return call_holding(c.holding, side, c.base, c.parameters, c.surroundings)


# ---- what its position makes ------------------------------------------------------------------------------


@spliced
def axis_of(n: Any) -> Any:
    """The numbers of an axis by name."""
    return record_at(n, AXIS)


@kernel(inline=True)
def harmonics(n: Any, q: float, first: int) -> float:
    """Sum of the Fourier series that starts at column `first` (0: torque, 2: share of friction)."""
    total, axis = 0.0, axis_of(n)
    for i in range(int(axis.harmonics)):
        angle = 2.0 * math.pi * (i + 1) * q / axis.period
        at = FOURIER + 4 * i + first
        total += n[at] * math.cos(angle) + n[at + 1] * math.sin(angle)
    return total


@kernel(inline=True)
def outer(n: Any, q: float) -> float:
    """Torque that position alone makes, opposing motion in the positive direction: gravity, offset, cogging."""
    axis = axis_of(n)
    torque = axis.offset
    if axis.gravity != 0.0:
        torque += axis.gravity * math.sin(q - axis.gravity_angle)
    if axis.harmonics > 0.0:
        torque += harmonics(n, q, 0)
    return torque


@kernel(inline=True)
def share(n: Any, q: float) -> float:
    """Factor on friction from the position."""
    return 1.0 + harmonics(n, q, 2) if axis_of(n).harmonics > 0.0 else 1.0


@kernel(inline=True)
def load_of(n: Any, q: float, v: float, drive: float) -> float:
    """Load on the contact over the load at which its parameters hold: it grows with the torques that meet in it."""
    axis = axis_of(n)
    if axis.load_motor == 0.0 and axis.load_external == 0.0:
        return 1.0
    motor = drive - axis.back_emf * v
    return 1.0 + abs(axis.load_motor * motor + axis.load_external * outer(n, q))
