"""The axis that a record moves, as the text of a step calls it: its contact, and the torque that its position makes."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.jit import call_holding, call_step, kernel
from stickslip.subset import Layout

__all__ = ["GIVEN", "NUMBERS", "Plant", "load_of", "outer", "share"]

NUMBERS = Layout(("inertia", "loss", "holds"))
"""What the text of a step reads of the axis. loss is all damping: the back-EMF's and an observer's; holds is 1 where
the contact's torque jumps at rest."""
(
    INERTIA, LOSS, HOLDS, OFFSET, GRAVITY, GRAVITY_ANGLE, DRIVE_GAIN, BACK_EMF, LOAD_MOTOR, LOAD_EXTERNAL, BACKLASH,
    SCALED_BY_LOAD, PERIOD, HARMONICS, PUSH, FOURIER,
) = range(16)  # fmt: skip
# These are its first numbers. PUSH is a torque from outside that no gearing carries (an observer's).
# From FOURIER on: for each harmonic the cosine's and sine's torque, then the cosine's and sine's share of friction.
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


@kernel(inline=True)
def harmonics(n: Any, q: float, first: int) -> float:
    """Sum of the Fourier series that starts at column `first` (0: torque, 2: share of friction)."""
    total = 0.0
    for i in range(int(n[HARMONICS])):
        angle = 2.0 * math.pi * (i + 1) * q / n[PERIOD]
        at = FOURIER + 4 * i + first
        total += n[at] * math.cos(angle) + n[at + 1] * math.sin(angle)
    return total


@kernel(inline=True)
def outer(n: Any, q: float) -> float:
    """Torque that position alone makes, opposing motion in the positive direction: gravity, offset, cogging."""
    torque = n[OFFSET]
    if n[GRAVITY] != 0.0:
        torque += n[GRAVITY] * math.sin(q - n[GRAVITY_ANGLE])
    if n[HARMONICS] > 0.0:
        torque += harmonics(n, q, 0)
    return torque


@kernel(inline=True)
def share(n: Any, q: float) -> float:
    """Factor on friction from the position."""
    return 1.0 + harmonics(n, q, 2) if n[HARMONICS] > 0.0 else 1.0


@kernel(inline=True)
def load_of(n: Any, q: float, v: float, drive: float) -> float:
    """Load on the contact over the load at which its parameters hold: it grows with the torques that meet in it."""
    if n[LOAD_MOTOR] == 0.0 and n[LOAD_EXTERNAL] == 0.0:
        return 1.0
    motor = drive - n[BACK_EMF] * v
    return 1.0 + abs(n[LOAD_MOTOR] * motor + n[LOAD_EXTERNAL] * outer(n, q))
