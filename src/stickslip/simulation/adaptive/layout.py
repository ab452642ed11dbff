"""What the adaptive integrator reads and writes: the loop's addresses and sizes, its state, what it remembers."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.jit import LAW, pointer, record_at, spliced
from stickslip.simulation.case_arrays import AROUND, MOTION, Case, surroundings

STATE = np.dtype(
    [(name, np.float64) for name in ("position", "velocity", "integral", "filtered", "filter_rate")]
)
"""The head of the state vector: rad, rad/s, the integral of the error, rad s, the velocity behind the compensator's
filter, rad/s, and its rate, rad/s²; the states of the plant's law follow, then the compensator's."""
HEAD = len(STATE.names or ())

CASE = np.dtype(
    [
        # Addresses of the reference's profile and of the laws' functions; 0: none.
        ("profile", np.int64),
        ("plant", LAW),
        ("compensator", LAW),
        # How many: states of the plant's law, of both laws, of the whole loop.
        *((name, np.int64) for name in ("plant_states", "law_states", "states")),
    ]
)
"""What a run leaves as it is, beside `Case.numbers`."""

NOW = np.dtype(
    [
        *((name, np.float64) for name in (
            # What only switches beside the laws' own modes (see `stickslip.simulation.adaptive.hybrid`).
            "motion", "sign", "filtered_sign", "reference_sign", "saturated",
            # N·m; the demand is the motor's torque before its limit.
            "motor_torque", "friction_torque", "compensation_torque", "demand",
            # The time for which the reference was taken, s, and the velocity that everyone sees, rad/s: 0 while held.
            "reference_time", "seen_velocity",
        )),
        ("reference", MOTION),
        ("around", AROUND),
    ]
)  # fmt: skip
"""What changes beside the state vector."""

EVENTS = np.dtype([(name, np.float64) for name in ("kink", "filter_kink", "release", "limit")])
"""Values of the events beside the laws' modes, after those in the array of event values."""

STEP = np.dtype(
    [
        # s; the next step's too, and how far the Chebyshev steps went.
        *((name, np.float64) for name in ("length", "next", "reach")),
        # The largest event value at the end; the rate of a decay that limits the steps, 1/s (0: none, Dormand-Prince
        # steps); 1 where the dense output is of fourth order (Dormand-Prince), 0 where it is cubic.
        *((name, np.float64) for name in ("value", "decay", "fourth")),
        # Whether it ends the interval between two breaks, whether an event is due at its end, whether it may be taken,
        # and whether its error is so far below the tolerance that stability alone limits it.
        *((name, np.int64) for name in ("final", "event", "taken", "smooth")),
        # Chebyshev steps that have relied on the rate of decay.
        ("relied", np.int64),
    ]
)
"""What a step that was tried leaves behind."""

PROGRESS = np.dtype(
    [
        # Steps taken and rejected, events, rows written, output times met.
        *((name, np.int64) for name in ("steps", "rejected", "events", "rows", "outputs")),
        # The time reached, s; how many steps there may be at the start, and for each second of the motion.
        *((name, np.float64) for name in ("time", "first_steps", "step_rate")),
    ]
)
"""How far a run has come, and how far it may go."""

STAGES, SCRATCH = 7, 7
"""Rows of the rates: the stages of a Dormand-Prince step, then one for events and output."""


class Laid(NamedTuple):
    """A loop laid out in arrays of float64, which a call takes at a tenth of the price of structures.

    Attributes
    ----------
    fixed, memory, progress, tried : array
        The bytes of a `CASE`, a `NOW`, a `PROGRESS` and a `STEP`.
    numbers : array
        `Case.numbers`.
    plant, compensator, reference : array
        Their parameters.
    modes : array, shape (law states,)
        1 where a law's state is a mode.
    tolerance : array, shape (states,)
        Error of a state that a step may make.
    due : array
        Event values: one for each of the laws' states, then `EVENTS`.
    y, end, error, middle, direction : array, shape (states,)
        The state vector; after the step that is tried; that step's error; a stage inside it; the direction of the
        motion that decays fastest, of length 1 in tolerances.
    rates : array
        Time derivatives of the state vector, row after row (`STAGES`, `SCRATCH`).
    """

    fixed: Any
    memory: Any
    progress: Any
    tried: Any
    numbers: Any
    plant: Any
    compensator: Any
    reference: Any
    modes: Any
    tolerance: Any
    due: Any
    y: Any
    end: Any
    error: Any
    middle: Any
    direction: Any
    rates: Any

    @property
    def reached(self) -> Any:
        """The progress by name; a view."""
        return self.progress.view(PROGRESS)[0]


class Loop(NamedTuple):
    """What a step reads and writes: addresses, since arrays in a tuple count references at every access."""

    case: Any
    now: Any
    progress: Any
    step: Any
    numbers: Any
    plant: Any
    compensator: Any
    reference: Any
    modes: Any
    tolerance: Any
    due: Any
    y: Any
    end: Any
    error: Any
    middle: Any
    direction: Any
    rates: Any


def laid_out(case: Case, tolerance: Any, start: tuple[float, float]) -> Laid:
    """Lay a loop out at rest in its contacts, at a position, rad, and a velocity, rad/s."""
    plant, compensator = case.plant, case.compensator
    y = np.concatenate([start, np.zeros(HEAD - len(start)), plant.state, compensator.state])
    fixed = np.zeros(1, CASE)
    fixed["profile"], fixed["plant"], fixed["compensator"] = (
        case.profile,
        plant.pointers,
        compensator.pointers,
    )
    fixed["plant_states"], fixed["law_states"], fixed["states"] = plant.state.size, y.size - HEAD, y.size
    now = np.zeros(1, NOW)
    now["reference_time"], now["around"] = math.nan, tuple(surroundings(case.numbers))
    progress, tried, n = np.zeros(1, PROGRESS), np.zeros(1, STEP), y.size
    modes = np.concatenate([plant.modes, compensator.modes]).astype(np.float64)
    due = np.zeros(n - HEAD + len(EVENTS.names or ()))
    return Laid(
        fixed.view(np.float64), now.view(np.float64), progress.view(np.float64), tried.view(np.float64), case.numbers,
        plant.parameters, compensator.parameters, case.reference_parameters, modes, tolerance, due, y, np.zeros(n),
        np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((STAGES + 1) * n),
    )  # fmt: skip


@spliced
def loop_of(laid: Laid) -> Loop:
    """The addresses of arrays that outlive the call."""
    return Loop(
        record_at(pointer(laid.fixed, 0), CASE), record_at(pointer(laid.memory, 0), NOW),
        record_at(pointer(laid.progress, 0), PROGRESS), record_at(pointer(laid.tried, 0), STEP),
        pointer(laid.numbers, 0), pointer(laid.plant, 0), pointer(laid.compensator, 0), pointer(laid.reference, 0),
        pointer(laid.modes, 0), pointer(laid.tolerance, 0), pointer(laid.due, 0), pointer(laid.y, 0),
        pointer(laid.end, 0), pointer(laid.error, 0), pointer(laid.middle, 0), pointer(laid.direction, 0),
        pointer(laid.rates, 0),
    )  # fmt: skip


@spliced
def named(y: Any) -> Any:
    """The head of a state vector, or of its rates, by name."""
    return record_at(y, STATE)


@spliced
def due_in(loop: Loop) -> Any:
    """The values of the events beside the laws' modes, by name."""
    return record_at(pointer(loop.due, loop.case.law_states), EVENTS)
