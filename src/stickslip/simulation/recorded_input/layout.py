"""What a simulation of recorded inputs reads and writes: the drive's numbers, a record's samples, its memory."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stickslip.core.spec import Surroundings
from stickslip.jit import LawPointers, pointer, record_at, spliced
from stickslip.simulation.case_arrays import AROUND
from stickslip.simulation.recorded_input.contact import AXIS, Plant
from stickslip.simulation.recorded_input.step import MOVING
from stickslip.simulation.root import SEARCH

DRIVE = np.dtype(
    [
        (name, np.float64) for name in (
            # HELD, LINEAR or FEEDBACK (`recorded_input.loop`); factor on the signal, or on the controller's output.
            "kind", "signal_gain",
            # The controller: gains, samples over which it takes the velocity, limit of its output, its own period, s,
            # and the encoder's count, rad.
            "kp", "ki", "kd", "kr", "span", "limit", "control_period", "count",
            # A cascade's, where kv is not 0; the corner of the low-pass on the velocity, 1/s.
            "kv", "kvp", "kvi", "feed", "corner",
            # s of the longest step; rad and rad/s at the start.
            "max_step", "start_position", "start_velocity",
            # The observer: N·m/rad, 1/s, rad within which nothing pulls, share of its memory that a sample replaces.
            "spring", "returns", "slack", "forgets",
        )
    ]
)  # fmt: skip
"""What drives the axis: `stickslip.simulation.recorded_input.simulation.Drive` in numbers."""

SAMPLE = np.dtype(
    [(name, np.float64) for name in ("time", "signal", "supply", "position", "damping", "goal", "firm")]
)
"""A row of the record, as `Drive` has it."""

MOVED = np.dtype([(name, np.float64) for name in ("position", "velocity", "drive", "correction")])
"""A row of the result."""

MEMORY = np.dtype(
    [
        (name, np.float64) for name in (
            # A sampled controller's: positions and reference of samples before, rad; rad s; rad; 1 after the first.
            "last", "before_last", "last_reference", "error_sum", "last_error", "started",
            # Of the low-pass, rad/s; a cascade's integral of the velocity error, rad.
            "filtered", "integral",
            # By how much the axis has lagged behind its goal, behind a low-pass, rad/s.
            "behind",
        )
    ]
)  # fmt: skip
"""What is remembered from sample to sample."""

NOW = np.dtype(
    [("moving", MOVING), ("around", AROUND), ("memory", MEMORY), ("first", SEARCH), ("second", SEARCH)]
)
"""What changes beside the law's state: the motion, what the law depends on, what is remembered, and what the root
finder keeps for both stages of a step."""

SAMPLE_SIZE, MOVED_SIZE, MEMORY_SIZE = (len(kind.names or ()) for kind in (SAMPLE, MOVED, MEMORY))
AT_REST: Any = np.zeros(1, NOW)
AT_REST["around"] = tuple(Surroundings())


class Laid(NamedTuple):
    """A run laid out in arrays of float64, which a call takes at a tenth of the price of structures.

    Attributes
    ----------
    axis : array
        The bytes of an `AXIS`, then its harmonics.
    drive, memory : array
        The bytes of a `DRIVE` and a `NOW`.
    parameters : array
        Of the law.
    states : array, shape (3, states)
        The law's state; where a stage begins; where it was tried last.
    signals, out : array, shape (n, numbers)
        Rows of `SAMPLE` and of `MOVED`.
    disturbance : array, shape (n,)
        A torque on the axis, N·m.
    step, holding : int
        Addresses of the law's functions; 0 where it has none.
    """

    axis: Any
    drive: Any
    memory: Any
    parameters: Any
    states: Any
    signals: Any
    out: Any
    disturbance: Any
    step: int
    holding: int


class Run(NamedTuple):
    """What a sample reads and writes: addresses, since arrays in a tuple count references at every access."""

    plant: Plant
    axis: Any
    drive: Any
    memory: Any
    moving: Any
    around: Any
    signals: Any
    out: Any
    disturbance: Any


def laid_out(
    axis: Any, drive: Any, parameters: Any, start: Any, pointers: LawPointers, signals: Any, disturbance: Any
) -> Laid:
    """Lay a run out; `axis` and `drive` are arrays of float64, `start` the law's state at rest."""
    states = np.empty((3, start.size))
    states[:] = start
    return Laid(
        axis, drive, AT_REST.view(np.float64).copy(), parameters, states, signals,
        np.full((len(signals), MOVED_SIZE), np.nan), disturbance, pointers.step, pointers.holding,
    )  # fmt: skip


@spliced
def run_of(laid: Laid) -> Run:
    """The addresses of arrays that outlive the call."""
    size, n = laid.states.shape[1], pointer(laid.axis, 0)
    now = record_at(pointer(laid.memory, 0), NOW)
    plant = Plant(
        laid.step, laid.holding, pointer(laid.parameters, 0), pointer(now.around, 0), pointer(laid.states, 0),
        pointer(laid.states, size), pointer(laid.states, 2 * size), size, n, pointer(now.moving, 0),
        pointer(now.first, 0), pointer(now.second, 0), 0.0,
    )  # fmt: skip
    return Run(
        plant, record_at(n, AXIS), record_at(pointer(laid.drive, 0), DRIVE), now.memory, now.moving, now.around,
        pointer(laid.signals, 0), pointer(laid.out, 0), pointer(laid.disturbance, 0),
    )  # fmt: skip


@spliced
def sample_at(signals: Any, k: int) -> Any:
    """A row of the record by name."""
    return record_at(pointer(signals, k * SAMPLE_SIZE), SAMPLE)


@spliced
def moved_at(out: Any, k: int) -> Any:
    """A row of the result by name."""
    return record_at(pointer(out, k * MOVED_SIZE), MOVED)
