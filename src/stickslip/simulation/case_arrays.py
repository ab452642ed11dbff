"""A closed loop laid out in flat arrays: what every kernel of the engine reads.

Kernels share the columns of the rows they write, the codes they end with, and the entries of `Case.numbers`.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from stickslip.control.controller import Controller
from stickslip.core.errors import UnknownName
from stickslip.core.spec import Bristle, Elements, Surroundings
from stickslip.jit import LawPointers, compiled_law, compiled_profile, flat
from stickslip.laws.slip_rule import SLIP_RULE
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.subset import Layout

Array = np.ndarray[Any, np.dtype[np.float64]]

# ---- rows: what a kernel writes at every output time and event ---------------------------------------------------
COLUMNS = (
    "time", "position_reference", "velocity_reference", "position", "velocity", "motor_torque", "friction_torque",
    "compensation_torque", "event",
)  # fmt: skip
UNITS = {
    "position_reference": "rad", "velocity_reference": "rad/s", "position": "rad", "velocity": "rad/s",
    "motor_torque": "N·m", "friction_torque": "N·m", "compensation_torque": "N·m", "event": "-",
}  # fmt: skip

# ---- how a kernel ended ------------------------------------------------------------------------------------------
DONE, DIVERGED, NOT_FINITE, STORM, NO_STEP, ROWS_FULL, TOO_STIFF, TOO_FAST, NO_TORQUE = range(9)

# ---- entries of Case.numbers -------------------------------------------------------------------------------------
(
    INERTIA, KP, KI, KD, KR, TORQUE_LIMIT, DURATION, TOLERANCE, SOURCE, GAIN, FILTER, POSITION_0, VELOCITY_0,
    PLANT_SCALE, COMPENSATOR_SCALE, STIFFNESS, MAX_STEP, POSITION_LIMIT, VELOCITY_LIMIT, METERED, SAMPLE_TIME,
    ENCODER, PLANT_BAND, LOAD, TEMPERATURE, PERTURBATION, NUMBERS,
) = range(27)  # fmt: skip
"""PERTURBATION: see `stickslip.simulation.accuracy`."""
NO_COMPENSATOR, FROM_REFERENCE, FROM_MEASUREMENT = 0.0, 1.0, 2.0

MOTION = np.dtype([(name, np.float64) for name in ("position", "velocity", "acceleration")])
"""What a reference's profile writes, as a record: rad, rad/s, rad/s²."""
AROUND = np.dtype([(name, np.float64) for name in Surroundings._fields])
"""`Surroundings` as a record."""

BOUNDS = (1e6, 1e6)
"""rad and rad/s, which no real axis leaves: a run that does has diverged."""
STORM_EVENTS, STORM_TIME = 4000, 5e-3
"""More switches than this within this time (s) end a run."""


@dataclass(frozen=True)
class Side:
    """A law in the loop, as plant or as compensator: its functions' addresses, parameters and state at rest."""

    model: Model | None
    pointers: LawPointers
    parameters: Array
    state: Array
    modes: np.ndarray[Any, np.dtype[np.bool_]]
    velocity_scale: float

    @functools.cached_property
    def elements(self) -> Elements | Bristle | None:
        """The law as elements or a bristle, or None."""
        if self.model is None or self.model.law.modes is None:
            return None
        return self.model.law.modes(self.model.parameters)

    @property
    def rest_band(self) -> float:
        """Velocity below which the law counts as at rest, rad/s."""
        band = self.model.law.rest_band if self.model else None
        return band(self.model.parameters) if self.model and band else 0.0

    @staticmethod
    def of(model: Model | None) -> Side:
        """Lay out a model; None gives an empty side."""
        if model is None:
            nowhere = LawPointers(*[0] * len(LawPointers._fields))
            return Side(None, nowhere, np.zeros(1), np.zeros(0), np.zeros(0, np.bool_), 0.0)
        law, p = model.law, model.parameters
        scale = law.velocity_scale(p) if law.velocity_scale else 0.0
        return Side(
            model,
            compiled_law(law),
            flat(law.pack(p)),
            np.array(law.pack_state(law.state(p)), dtype=np.float64),
            np.array(law.mode_mask(p), dtype=np.bool_),
            scale,
        )


@dataclass(frozen=True)
class Case:
    """A closed loop in flat arrays.

    Attributes
    ----------
    numbers : array
        Scalars, by the index names of this module.
    plant, compensator : Side
    profile : int
        Address of the reference's profile; ``reference_parameters`` are its parameters.
    breaks : array
        Ascending times that kernels step onto: kinks and zeros of the reference, half and 80 % of the run, its
        end (last).
    grid : array
        Times at which rows are wanted.
    """

    axis: RigidAxis
    controller: Controller
    reference: Reference
    numbers: Array
    plant: Side
    compensator: Side
    profile: int
    reference_parameters: Array
    breaks: Array
    grid: Array


@dataclass(frozen=True)
class Outcome:
    """What an integrator returns.

    Attributes
    ----------
    rows : array, shape (n, len(COLUMNS))
        Ascending in time: the grid, and the events (``event`` = 1; at a jump of the torque, the row before it
        and the row after it at the same time). Nothing after `time`.
    code : int
        DONE, or why the run ended early.
    time : float
        When it ended, s.
    meter, turns : array
        `stickslip.simulation._meter`'s accumulator and turning points; untouched where the case is not metered.
    counts : mapping
        steps, rejected, events.
    control : array or None
        The state in which a sampled controller was left.
    memory : array or None
        The memory of its composition.
    """

    rows: Array
    code: int
    time: float
    meter: Array
    turns: Array
    counts: dict[str, int]
    control: Array | None = None
    memory: Array | None = None


def surroundings(numbers: Array) -> Array:
    """What the contacts of a case depend on, at the start of the run."""
    return np.array(Surroundings(load=numbers[LOAD], temperature=numbers[TEMPERATURE]))


def contact_stiffness(model: Model) -> float:
    """Slope of the torque over a displacement of 1e-9 rad from rest, N·m/rad; at least 1."""
    z = model.law.state(model.parameters)
    torque = model.law.step(1e-9, 1e-9, 1.0, z, model.parameters, Surroundings())
    return max(1.0, abs(torque) / 1e-9) if model.law.state_fields else 1.0


def ruled(model: Model, slip_rule: str | None) -> Model:
    """The model under a run's slip rule, where it has one; without a rule it keeps its own choice.

    Raises
    ------
    UnknownName
        If there is no such rule.
    """
    if slip_rule is None:
        return model
    if slip_rule not in SLIP_RULE.options:
        raise UnknownName("slip rule", slip_rule, SLIP_RULE.options)
    return model.having(slip_rule=slip_rule)


def slip_rules(**models: Model | None) -> dict[str, str]:
    """The slip rule of each model that has one, by the given names: what a record says of them."""
    rules = {name: m.law.option_of("slip_rule") for name, m in models.items() if m is not None}
    return {name: rule for name, rule in rules.items() if rule}


def ruled_in(controller: Controller, slip_rule: str | None) -> Controller:
    """The controller whose friction laws are under a run's slip rule, as `ruled` has it."""
    return controller if slip_rule is None else controller.holding(lambda model: ruled(model, slip_rule))


class StepBudget(NamedTuple):
    """How many steps an integrator may take: at the start, for each second, and for each break of the reference.

    What is beyond the start's comes with the motion, so that a run far stiffer than its motion is long ends soon.
    """

    base: float
    per_second: float
    per_break: float
    most: float = math.inf

    def of(self, case: Case) -> float:
        """Steps for the whole of a case."""
        steps = self.per_second * float(case.numbers[DURATION]) + self.per_break * case.breaks.size
        return min(self.base + steps, self.most)

    def pace(self, case: Case) -> tuple[float, float]:
        """Steps at the start, and for each second of the motion."""
        first = min(self.base, self.most)
        return first, (self.of(case) - first) / float(case.numbers[DURATION])


def lay_out(
    axis: RigidAxis,
    controller: Controller,
    reference: Reference,
    duration: float,
    *,
    tolerance: float,
    grid: Array,
    slip_rule: str | None = None,
    initial: tuple[float, float] = (0.0, 0.0),
    metered: bool = True,
    max_step: float = math.inf,
    limits: tuple[float, float] = BOUNDS,
) -> Case:
    """Lay a closed loop out in flat arrays (compiles its laws and reference if they are not cached)."""
    controller = ruled_in(controller, slip_rule)
    moving = None if controller.sample_time > 0.0 else controller.continuous
    plant = Side.of(ruled(axis.friction, slip_rule))
    assist = Side.of(moving.friction if moving else None)
    numbers = np.zeros(NUMBERS)
    numbers[INERTIA] = axis.inertia
    if moving:
        gains = moving.gains
        numbers[[KP, KI, KD, KR]] = gains.kp, gains.ki, gains.kd, gains.kr
    numbers[TORQUE_LIMIT] = controller.torque_limit
    numbers[DURATION], numbers[TOLERANCE], numbers[MAX_STEP] = duration, tolerance, max_step
    if moving and (form := moving.compensation):
        numbers[SOURCE] = FROM_REFERENCE if form.velocity == "reference" else FROM_MEASUREMENT
        numbers[GAIN], numbers[FILTER] = form.gain, form.corner
    numbers[POSITION_0], numbers[VELOCITY_0] = initial
    numbers[PLANT_SCALE], numbers[COMPENSATOR_SCALE] = plant.velocity_scale, assist.velocity_scale
    numbers[PLANT_BAND] = plant.rest_band
    numbers[LOAD], numbers[TEMPERATURE] = axis.load, axis.temperature
    numbers[STIFFNESS] = contact_stiffness(axis.friction)
    numbers[POSITION_LIMIT], numbers[VELOCITY_LIMIT] = limits
    numbers[METERED] = 1.0 if metered else 0.0
    numbers[SAMPLE_TIME], numbers[ENCODER] = controller.sample_time, controller.encoder_counts
    kind = reference.kind
    breaks = sorted({*reference.breaks(duration), 0.5 * duration, 0.8 * duration})
    return Case(
        axis,
        controller,
        reference,
        numbers,
        plant,
        assist,
        compiled_profile(kind.name, kind.profile, Layout.of(kind.fields, counted=True)),
        flat(kind.pack(reference.parameters)),
        np.array([*breaks, duration]),
        grid,
    )
