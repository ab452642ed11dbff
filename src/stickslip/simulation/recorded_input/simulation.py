"""An axis with any law, driven by a recorded signal: the simulation behind output-error identification.

`drive_axis` runs one axis over the times of a record, which may be irregular. What drives it is data: a recorded
torque, current or voltage (held or linear between samples), or a recorded reference through a sampled controller
(`Loop`). The step is L-stable and of second order (`stickslip.simulation.recorded_input.step`), so that a fit may try
any stiffness; a step of it costs about 0.3 us.
"""

from __future__ import annotations

import ast
import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from stickslip.core.errors import InputError, ParameterError, UnknownName
from stickslip.core.spec import Law, Surroundings
from stickslip.jit import compiled_law, flat
from stickslip.models.model import Model
from stickslip.simulation.recorded_input import loop
from stickslip.simulation.recorded_input.contact import AXIS
from stickslip.simulation.recorded_input.layout import DRIVE, MOVED, SAMPLE, laid_out
from stickslip.subset import law_layouts, lower

Array = np.ndarray[Any, np.dtype[np.float64]]

COLUMNS = MOVED.names or ()
WHILE_IT_RUNS = {"loss": 0.0, "holds": 0.0, "push": 0.0}
"""Numbers of the axis that the kernel sets."""
KINDS = {"held": loop.HELD, "linear": loop.LINEAR, "feedback": loop.FEEDBACK}


def packed(kind: np.dtype[Any], values: Mapping[str, Any]) -> Array:
    """A record of numbers as an array."""
    return np.array([values[name] for name in kind.names or ()], dtype=np.float64)


@dataclass(frozen=True)
class Harmonics:
    """What repeats with the position: torque (cogging, an unbalanced mass) and the share of friction.

    Each is a Fourier series: per harmonic the coefficients of cosine and sine; thesis 2.1.6.
    """

    period: float = 2.0 * math.pi
    """rad (or m) after which it repeats"""
    torque: tuple[tuple[float, float], ...] = ()
    """N·m per harmonic, against positive motion"""
    friction: tuple[tuple[float, float], ...] = ()
    """Share of friction per harmonic: friction is multiplied by 1 + the sum"""


@dataclass(frozen=True)
class Mechanics:
    """The axis but for its friction, all seen where the position is measured (rotary: rad, linear: m).

    M dv/dt = drive_gain u - back_emf v - offset - gravity sin(q - gravity_angle) - cogging - friction
    """

    inertia: float
    """kg·m² (kg)"""
    offset: float = 0.0
    """Constant torque against positive motion, N·m: a hanging weight, a bias of the drive"""
    gravity: float = 0.0
    """Of a pendulum: m g l, N·m"""
    gravity_angle: float = 0.0
    """Position at which the pendulum hangs, rad"""
    drive_gain: float = 1.0
    """Torque per unit of the drive's signal: N·m/V, N·m/A, 1"""
    back_emf: float = 0.0
    """Torque lost per velocity in the drive, N·m·s/rad (kt ke / R of a motor under voltage)"""
    load_motor: float = 0.0
    """Load on the contact per drive torque, 1/(N·m): load = 1 + |load_motor T_drive + load_external T_outer|"""
    load_external: float = 0.0
    """Load on the contact per torque from outside (gravity, offset), 1/(N·m); it adds to the drive's, which holds it"""
    backlash: float = 0.0
    """Play between the moved mass and where its position is measured, rad"""
    harmonics: Harmonics = field(default_factory=Harmonics)

    def numbers(self, scaled_by_load: bool) -> Array:
        """Laid out for the kernel: an `AXIS` and its harmonics."""
        series = self.harmonics
        count = max(len(series.torque), len(series.friction))
        given = vars(self) | {"scaled_by_load": scaled_by_load, "period": series.period, "harmonics": count}
        n = packed(AXIS, given | WHILE_IT_RUNS)
        if count == 0:
            return n
        coefficients = np.zeros((count, 4))
        coefficients[: len(series.torque), :2] = np.array(series.torque).reshape(-1, 2)
        coefficients[: len(series.friction), 2:] = np.array(series.friction).reshape(-1, 2)
        return np.concatenate([n, coefficients.ravel()])


@dataclass(frozen=True)
class Loop:
    """A sampled linear controller: u = gain clip(kp e + ki sum e + kr dr - kd dy), |u| <= limit.

    With a ``kv`` it is position P around velocity PI instead (`stickslip.control.linear.Cascade`):
    u = gain clip(kvp e_v + kvi sum e_v) with e_v = kv e + feed dr - dy, whose sum rests at the limit.

    ``velocity_span`` 1 takes the velocity dy as the difference of neighbouring samples, 2 as that of the means of
    two neighbours (EMPS). ``period`` 0: it acts at the record's times, else every `period` seconds on a reference
    that is held. ``count`` is the resolution at which it sees the position, ``filter`` the corner of a first-order
    low-pass on its velocity, Hz; 0: none.
    """

    kp: float = 0.0
    ki: float = 0.0
    kd: float = 0.0
    kr: float = 0.0
    limit: float = math.inf
    velocity_span: int = 1
    period: float = 0.0
    count: float = 0.0
    kv: float = 0.0
    kvp: float = 0.0
    kvi: float = 0.0
    feed: float = 1.0
    filter: float = 0.0

    @property
    def integrates(self) -> bool:
        """Whether it has a sum of errors, which no record holds."""
        return (self.kvi if self.kv else self.ki) != 0.0


@dataclass(frozen=True)
class Drive:
    """What moves the axis, at the times of a record.

    Attributes
    ----------
    time : array, shape (n,)
        s, strictly ascending.
    signal : array, shape (n,)
        What drives: torque, current or voltage ("held" or "linear" between samples), or the reference position
        ("feedback", through `controller`).
    kind : {"held", "linear", "feedback"}
    controller : Loop or None
    supply : array, shape (n,), or None
        Factor on the drive's output, such as the supply voltage under a duty cycle. Where it is 0, the winding is
        open: no back-EMF either.
    start : (float, float)
        Position and velocity at the begin.
    gain : float
        Factor on the signal, or on the controller's output before its limit.
    position : array, shape (n,), or None
        A measured motion for an observer; what it adds to the torque is the column ``correction`` of the result.
    spring : float
        Torque towards it at every sample, N·m/rad.
    damping, goal : array, shape (n,), or None
        Damping, N·m·s/rad, towards the velocity `goal`, the measured mean until the next sample. It is part of the
        implicit step, so that it may be as firm as one likes; behind backlash it acts a sample later, and has to be
        soft.
    forgets : float
        Share of the damper's memory that every sample replaces, 1 for none: it damps the velocity behind a first-order
        low-pass, so that an encoder's counts do not shake the axis.
    firm : array of bool, shape (n,), or None
        Where the damper remembers nothing and no spring pulls: the position is led back without force.
    returns : float
        Rate at which it is led back, 1/s.
    slack : float
        Distance from the measured position, rad, within which nothing pulls or leads back: half an encoder's count.
    disturbance : array, shape (n,), or None
        A torque on the axis, held from sample to sample.
    max_step : float
        Longest step of the integration, s.
    """

    time: Array
    signal: Array
    kind: str = "held"
    controller: Loop | None = None
    supply: Array | None = None
    start: tuple[float, float] = (0.0, 0.0)
    gain: float = 1.0
    position: Array | None = None
    spring: float = 0.0
    damping: Array | None = None
    goal: Array | None = None
    forgets: float = 1.0
    firm: np.ndarray[Any, np.dtype[np.bool_]] | None = None
    returns: float = 0.0
    slack: float = 0.0
    disturbance: Array | None = None
    max_step: float = 1e-3

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise UnknownName("kind of drive", self.kind, KINDS)
        if self.time.size < 2 or np.any(np.diff(self.time) <= 0.0):
            raise InputError(
                "drive: times must ascend strictly, at least two of them; sort and merge the record"
            )
        if (self.kind == "feedback") != (self.controller is not None):
            raise InputError("drive: a controller belongs to kind 'feedback'; give both or neither")
        for name in ("signal", "supply", "position", "damping", "goal", "firm", "disturbance"):
            values = getattr(self, name)
            if values is not None and values.shape != self.time.shape:
                raise InputError(f"drive: {name} has shape {values.shape}, time has {self.time.shape}")
        if not self.max_step > 0.0:
            raise ParameterError(f"drive: max_step = {self.max_step:g} s must be greater than 0")

    def signals(self) -> Array:
        """Rows that the kernel reads (`SAMPLE`), shape (n, numbers)."""
        s = np.zeros(self.time.size, SAMPLE)
        s["time"], s["signal"] = self.time, self.signal
        s["supply"] = 1.0 if self.supply is None else self.supply
        for name in ("position", "damping", "goal", "firm"):
            values = getattr(self, name)
            s[name] = 0.0 if values is None else values
        return s.view(np.float64).reshape(self.time.size, -1)

    def numbers(self) -> Array:
        """Scalars that the kernel reads, a `DRIVE`."""
        k = self.controller or Loop()
        given = vars(k) | vars(self) | {
            "kind": KINDS[self.kind], "signal_gain": self.gain, "span": k.velocity_span, "control_period": k.period,
            "start_position": self.start[0], "start_velocity": self.start[1], "corner": 2.0 * math.pi * k.filter,
        }  # fmt: skip
        return packed(DRIVE, given)


class Course:
    """A drive and a law, laid out and compiled: `run` takes only the numbers that a fit changes."""

    def __init__(self, law: Law, drive: Drive) -> None:
        self.law = law
        self.drive = drive
        self._numbers = drive.numbers()
        self._disturbance = flat(
            np.zeros(drive.time.size) if drive.disturbance is None else drive.disturbance
        )
        self.scaled_by_load = not reads_load(law)
        self._last: tuple[Any, Array] | None = None

    @functools.cached_property
    def _signals(self) -> Array:
        return self.drive.signals()

    def run(
        self, mechanics: Mechanics, parameters: Any, *, gain: float | None = None,
        start: tuple[float, float] | None = None,
    ) -> Array:  # fmt: skip
        """Simulate; `parameters` is the law's NamedTuple.

        Returns
        -------
        array, shape (n, 4)
            `COLUMNS`: position (behind the backlash), velocity, the drive's signal as it acts, the observer's
            pull. Rows after a divergence are NaN.
        """
        # Weights, misfits and pictures ask for one run after the other at one place.
        begin = None if start is None else (float(start[0]), float(start[1]))
        asked = (mechanics, parameters, gain, begin)
        last = self._last
        if last is None or last[0] != asked:
            self._last = last = asked, self._run(mechanics, parameters, gain, begin)
        return last[1].copy()

    def _run(
        self, mechanics: Mechanics, parameters: Any, gain: float | None, start: tuple[float, float] | None
    ) -> Array:
        numbers = self._numbers.copy()
        c = numbers.view(DRIVE)[0]
        if gain is not None:
            c["signal_gain"] = gain
        if start is not None:
            c["start_position"], c["start_velocity"] = start
        state = flat(self.law.pack_state(self.law.state(parameters)))
        laid = laid_out(
            mechanics.numbers(self.scaled_by_load), numbers, flat(self.law.pack(parameters)), state,
            compiled_law(self.law), self._signals, self._disturbance,
        )  # fmt: skip
        loop.follow(laid)
        return laid.out


@functools.cache
def reads_load(law: Law) -> bool:
    """Whether the law's own functions depend on the load; the engine scales the torque of one that does not."""
    functions = {"step": law.step} if law.holding is None else {"step": law.step, "holding": law.holding}
    translated = lower({f"_{name}_": function for name, function in functions.items()}, law_layouts(law))
    place = Surroundings._fields.index("load")
    return any(f"u[{place}]" in ast.unparse(function) for function in translated.values())


def control_signal(
    controller: Loop, time: Array, reference: Array, position: Array, gain: float = 1.0
) -> Array:
    """What a controller makes of a recorded reference and position at the record's times, shape (n,)."""
    drive = Drive(time, reference, "feedback", controller, gain=gain, position=position)
    out = np.zeros(time.size)
    loop.respond(drive.numbers(), drive.signals(), out)
    return out


def drive_axis(mechanics: Mechanics, friction: Model, drive: Drive) -> Array:
    """Simulate an axis over the times of a drive; shape (n, 4), columns `COLUMNS` (see `Course.run`)."""
    return Course(friction.law, drive).run(mechanics, friction.parameters)
