"""What a fixed step reads and writes: the loop's addresses and numbers, its state at one time, its searches."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stickslip.jit import LAW, pointer, record_at, spliced
from stickslip.simulation.case_arrays import AROUND, MOTION
from stickslip.simulation.root import SEARCH

STATE = np.dtype(
    [
        (name, np.float64) for name in (
            # rad, rad/s, the integral of the error, rad s; behind the compensator's filter, rad/s and rad/s²; of the
            # reference, rad and rad/s.
            "position", "velocity", "integral", "filtered", "filter_rate", "reference", "reference_rate",
            # Torques, N·m: of the linear controller, of the compensator with its gain, of the motor, of friction.
            "linear", "compensating", "motor", "friction",
            # The direction of motion, or at rest the one from which the axis came; the one in which it is about to go
            # (0: none); at rest in a band of velocities (Karnopp), the momentum gathered there over the inertia, rad/s.
            "side", "leaving", "gathered",
        )
    ]
)  # fmt: skip
"""The state at one time; the state of the plant's law follows, then the compensator's."""
HEAD = len(STATE.names or ())
STATES = 6
"""Those that a step keeps (`Laid.states`)."""

CASE = np.dtype(
    [
        # Addresses of the reference's profile and of the laws' functions; 0: none.
        ("profile", np.int64),
        ("plant", LAW),
        ("compensator", LAW),
        *((name, np.int64) for name in (
            # How many: states of the plant's law, numbers of a state.
            "plant_states", "size",
            # Whether the run is damped throughout, and whether a feedback is steeper than a step resolves.
            "damped", "steep",
        )),
        *((name, np.float64) for name in (
            # s of a step, and of one that resolves the contact; rad up to break-away; rad/s, the smallest scale of the
            # laws that see the axis's velocity.
            "time_step", "resolved", "travel", "fine",
        )),
    ]
)  # fmt: skip
"""What a run leaves as it is, beside `Case.numbers`."""

NOW = np.dtype([("reference", MOTION), ("around", AROUND)])
"""The reference where it was asked for last, and what the laws depend on."""

PROGRESS = np.dtype(
    [
        # The time reached and the longest next step, s.
        *((name, np.float64) for name in ("time", "cap")),
        # Whether the run is to end; steps, output times met, events, rows written.
        *((name, np.int64) for name in ("asked", "steps", "outputs", "events", "rows")),
    ]
)
"""How far a run has come."""


class Laid(NamedTuple):
    """A loop laid out in arrays of float64, which a call takes at a tenth of the price of structures.

    Attributes
    ----------
    fixed, memory, progress : array
        The bytes of a `CASE`, a `NOW` and a `PROGRESS`.
    numbers : array
        `Case.numbers`.
    plant, compensator, reference : array
        Their parameters.
    states : array, shape (STATES, size)
        A `STATE` and its laws each: where a step begins and ends; what depends on time alone at its end; in its middle;
        where its second stage begins; where the last step began.
    searches : array, shape (2, n)
        What the root finder keeps for a stage's velocity, and for the time of an event in a step.
    """

    fixed: Any
    memory: Any
    progress: Any
    numbers: Any
    plant: Any
    compensator: Any
    reference: Any
    states: Any
    searches: Any

    @property
    def reached(self) -> Any:
        """The progress by name; a view."""
        return self.progress.view(PROGRESS)[0]


class Loop(NamedTuple):
    """What a step reads and writes: addresses, since arrays in a tuple count references at every access."""

    case: Any
    now: Any
    progress: Any
    numbers: Any
    plant: Any
    compensator: Any
    reference: Any
    here: Any
    end: Any
    ahead: Any
    middle: Any
    base: Any
    before: Any
    search: Any
    crossing: Any


@spliced
def loop_of(laid: Laid) -> Loop:
    """The addresses of arrays that outlive the call."""
    size = laid.states.shape[1]
    return Loop(
        record_at(pointer(laid.fixed, 0), CASE), record_at(pointer(laid.memory, 0), NOW),
        record_at(pointer(laid.progress, 0), PROGRESS), pointer(laid.numbers, 0), pointer(laid.plant, 0),
        pointer(laid.compensator, 0), pointer(laid.reference, 0), record_at(pointer(laid.states, 0), STATE),
        record_at(pointer(laid.states, size), STATE), record_at(pointer(laid.states, 2 * size), STATE),
        record_at(pointer(laid.states, 3 * size), STATE), record_at(pointer(laid.states, 4 * size), STATE),
        record_at(pointer(laid.states, 5 * size), STATE), record_at(pointer(laid.searches, 0), SEARCH),
        record_at(pointer(laid.searches, laid.searches.shape[1]), SEARCH),
    )  # fmt: skip
