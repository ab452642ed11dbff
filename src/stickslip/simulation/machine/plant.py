"""What a compiled virtual machine reads and writes: its numbers, its sub-steps' matrices, and what changes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stickslip.jit import WIDTH, pointer, record_at, spliced

FINEST = 8
"""Halvings of a sample down to its shortest sub-step."""
LEVELS = FINEST + 2
"""Lengths of sub-steps that have matrices, each half the one before."""
SPRINGS = 4
"""Parts of the contact's stiffness: a matrix for none of it, one part, ... all of it."""

IN_MOTOR, IN_COG, IN_BEARING, IN_ANGLE, GIVEN = range(5)
"""Places behind the states of what acts on a sub-step beside them, and of its columns in the matrix."""
SLOTS = WIDTH
"""Places of a vector of states and what is given with them, of which a machine has at most 13; what is free is 0."""
FIRST, LAST, COLUMNS = SLOTS, SLOTS + 1, SLOTS + 2
"""Columns of a sub-step's matrix: one a slot, and what the contact's torque at both ends takes off the states."""
BLOCK = COLUMNS * SLOTS
"""Numbers of a matrix; the numbers of a column lie side by side."""

MACHINE = np.dtype(
    [
        *((name, np.int64) for name in (
            # How many: linear states, the law's states, harmonics of the contact's ripple and of the cogging.
            "size", "states", "ripples", "cogs",
            # Which linear state: angles (velocities follow them), the motor's torque, the encoder's mounting; 0: none.
            "rotor", "shaft", "disk", "lag", "mode",
            # Halvings of the sample that a sub-step needs at least, and needs where the contact's spring acts.
            "coarsest", "resolving", "unresolved",
            # The same that a sub-step is given at most for its error.
            "finest",
            # The same from which what a step shows tells whether there is an event; terms of a series.
            "watched", "terms",
            # Whole samples, and of the next one shortest sub-steps, by which a command acts late.
            "queued", "delay", "seed",
            # Whether the motion is the located flow of its train; addresses of what moves it over a sample, and of the
            # law's functions, 0 where it has none.
            "located", "mover", "step", "holding",
        )),
        *((name, np.float64) for name in (
            "sample_time", "torque_constant", "current_limit", "command_step", "monitor_step", "current_noise",
            "monitor_noise", "count", "encoder_noise", "mode_share", "max_speed", "sensor_step", "sensor_noise",
            "drift", "drift_time", "drift_begin", "heat_coefficient", "heat_reference", "ambient", "heating",
            "heat_kept", "heat_time", "bearing", "bearing_stiffness", "viscous",
            # N·m/rad of the contact; tolerances a N·m s is; the highest order of ripple and cogging, and
            # rad of it in a sub-step; of a velocity, over a whole sample, by which a solved sub-step may be out of
            # balance, which the torque takes up.
            "stiffness", "weight", "order", "wave", "unbalance",
            # N·m s/rad of a contact that holds at rest, which belong to the linear part while it slides.
            "damping",
        )),
    ]
)  # fmt: skip
"""A machine's fixed numbers, SI units; `stickslip.simulation.machine.layout` fills them in."""

PARABOLA = np.dtype(
    [*((name, np.float64) for name in ("angle", "value", "slope", "bend")), ("known", np.int64)]
)
"""Ripple or cogging near an angle."""

NOW = np.dtype(
    [
        *((name, np.int64) for name in ("tick", "tripped", "level", "spring", "taken", "short")),
        *((name, np.float64) for name in (
            "pending", "warmth", "paused", "friction", "bearing", "scale", "rest", "rate",
        )),
        ("ripple", PARABOLA),
        ("cogging", PARABOLA),
    ]
)  # fmt: skip
"""What changes beside the states: samples so far, whether the drive has switched off, halvings of the next sub-step,
the part of the contact's stiffness that it takes as a spring, sub-steps so far, and those of them that are as short as
they get and still wrong by more than the tolerance; the current on its way, A, the
contact's temperature, °C, and s of pauses; torques of contact and bearings, N·m, what ripple, drift and warmth make of
the contact's; of the sub-step that is tried, the contact's torque at its end beside its spring, N·m, and by how much
that rises with the angle."""
QUEUE = NOW.itemsize // 8
"""Where, behind a `NOW`, the commands lie that act whole samples late, A: a ring, whose oldest is due next."""


CHANNELS = ("time", "position", "motor_torque", "sensor_torque", "temperature", "status")
"""What a sample measures, in the order of `stickslip.rigs.rig.Measurement`."""
SHOWN = np.dtype([(name, np.float64) for name in CHANNELS])
"""The same as a record."""


class Laid(NamedTuple):
    """A machine laid out in arrays of float64, which a call takes at a tenth of the price of structures.

    Attributes
    ----------
    numbers, memory : array
        The bytes of a `MACHINE`; of a `NOW`, with the ring of commands behind it (`QUEUE`).
    waves : array, shape (3 n,)
        Order, amplitude and phase of every harmonic: those of the contact's ripple, then of the cogging.
    matrix : array
        By part of the contact's stiffness and length of the sub-step: `COLUMNS` columns of `SLOTS` numbers; of a
        contact that holds at rest what `stickslip.simulation.machine.held_tables` writes.
    search : array
        What the root finder keeps (`stickslip.simulation.root.ROOT`).
    axis : array, shape (2 SLOTS,)
        The linear states with what is given, and from `SLOTS` on the states after the sub-step that is tried.
    contact : array, shape (3 states,)
        The law's states; after the sub-step that is tried; in its middle.
    parameters, surroundings : array
        Of the law.
    train : array
        Of its located flow (`stickslip.simulation.train.records`); a single 0 where it takes sub-steps. It knows where
        it and the parameters are (`stickslip.simulation.train.layout.seat`).
    """

    numbers: Any
    memory: Any
    waves: Any
    matrix: Any
    search: Any
    axis: Any
    contact: Any
    parameters: Any
    surroundings: Any
    train: Any

    @property
    def machine(self) -> Any:
        """The numbers by name; a view."""
        return self.numbers.view(MACHINE)[0]

    @property
    def now(self) -> Any:
        """What changes, by name; a view."""
        return self.memory[:QUEUE].view(NOW)[0]

    def forget_commands(self) -> None:
        """Drop the commands on their way."""
        self.now["pending"] = 0.0
        self.memory[QUEUE:] = 0.0


class Plant(NamedTuple):
    """What a sample reads and writes: addresses, since arrays in a tuple count references at every access."""

    machine: Any
    now: Any
    waves: Any
    matrix: Any
    search: Any
    axis: Any
    contact: Any
    parameters: Any
    surroundings: Any
    train: Any


@spliced
def plant_at(
    machine: Any, now: Any, waves: Any, matrix: Any, search: Any, axis: Any, contact: Any, parameters: Any,
    surroundings: Any, train: Any,
) -> Plant:  # fmt: skip
    """What lies at these addresses."""
    return Plant(
        record_at(machine, MACHINE), record_at(now, NOW), waves, matrix, search, axis, contact, parameters,
        surroundings, train,
    )  # fmt: skip


@spliced
def plant_of(laid: Laid) -> Plant:
    """The addresses of arrays that outlive the call."""
    return plant_at(
        pointer(laid.numbers, 0), pointer(laid.memory, 0), pointer(laid.waves, 0), pointer(laid.matrix, 0),
        pointer(laid.search, 0), pointer(laid.axis, 0), pointer(laid.contact, 0), pointer(laid.parameters, 0),
        pointer(laid.surroundings, 0), pointer(laid.train, 0),
    )  # fmt: skip
