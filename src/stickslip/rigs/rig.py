"""The interface of a rig, which accepts a torque every sample time and returns measurements.

The loop (`stickslip.rigs.loop`) runs any `Rig`; procedures use the loop. One sample is::

    measured = rig.open()
    for every sample:
        torque = control and safety(measured, setpoint)      # `stickslip.rigs.loop_sample.decide`, compiled
        measured = rig.exchange(torque)                      # acts for one sample time, then measures

A rig whose plant is compiled may also be a `BlockRig`, which runs these lines for many samples in one compiled loop;
both give the same numbers bit for bit, because both call the same compiled `decide`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from stickslip.core.errors import InputError, ParameterError

if TYPE_CHECKING:
    from stickslip.core.config import Table
    from stickslip.rigs.loop_sample import Control

Array = np.ndarray[Any, np.dtype[np.float64]]

LIMIT_UNITS = {
    "position": "rad", "speed": "rad/s", "torque": "N·m", "temperature": "°C", "following error": "rad",
}  # fmt: skip
"""Units of limits, by their names in messages"""
STANDSTILL = 0.8
"""Default share of the torque limit: the largest break-away torque that a commissioning can exceed by a quarter."""


class Measurement(NamedTuple):
    """Measurements at the end of a sample; NaN without a sensor."""

    time: float
    """s, of the rig's own clock, increasing by a sample time from one sample to the next"""
    position: float
    """rad"""
    torque: float
    """Motor torque, N·m: measured current times the torque constant"""
    sensor: float = math.nan
    """Torque sensor, N·m; positive where the motor's torque is"""
    temperature: float = math.nan
    """Degrees Celsius"""
    status: float = 0.0
    """0 without a fault, else the rig's own fault number (CiA 402: error code 603Fh); a fault stops the loop"""


class Setpoint(NamedTuple):
    """The reference during one sample."""

    position: float = 0.0
    """rad"""
    velocity: float = 0.0
    """rad/s"""
    torque: float = 0.0
    """Added to the controller's output; the only torque if the loop is open, N·m"""
    closed: float = 0.0
    """1: the controller follows position and velocity, and the following error is checked. Its first command equals the
    last command; its integral absorbs the difference, or that fades over 0.1 s. 0: torque alone; the controller is
    reset"""
    acceleration: float = 0.0
    """rad/s², for an inertia feedforward"""


def setpoints(
    count: int,
    *,
    position: Any = 0.0,
    velocity: Any = 0.0,
    torque: Any = 0.0,
    closed: Any = 0.0,
    acceleration: Any = 0.0,
) -> Array:
    """Return setpoints of `count` samples, shape (count, 5).

    ``position`` (rad), ``velocity`` (rad/s), ``torque`` (N·m), ``closed`` (0 or 1) and ``acceleration`` (rad/s²) are
    numbers or arrays of that length; see `Setpoint`.
    """
    table = np.empty((count, len(Setpoint._fields)))
    for i, column in enumerate((position, velocity, torque, closed, acceleration)):
        table[:, i] = column
    return table


def insist_on_setpoints(table: Array) -> None:
    """Refuse invalid setpoints before any of them is applied.

    Raises
    ------
    InputError
        For another shape, or the first value that is not finite.
    """
    names = Setpoint._fields
    if table.ndim != 2 or table.shape[1] != len(names):
        raise InputError(f"setpoints have shape {table.shape}; give (n, {len(names)}), see setpoints()")
    wrong = np.argwhere(~np.isfinite(table))
    if wrong.size:
        row, column = wrong[0].tolist()
        raise InputError(
            f"setpoint {row} has {names[column]} = {table[row, column]:g}, which must be a finite number; correct its "
            "source"
        )


@dataclass(frozen=True)
class Limits:
    """Limits of a rig. Crossing any of them ramps the torque to zero (`stickslip.rigs.safety`).

    Attributes
    ----------
    torque : float
        Largest torque command, N·m. Measured torques (motor, sensor) may exceed it by a quarter: overshoot of the
        current loop and noise.
    speed : float
        rad/s, from the positions of two samples.
    position : (float, float)
        Lowest and highest position, rad; infinite for an axis without end stops.
    temperature : float
        Highest temperature, degrees Celsius; infinite if it is not measured.
    following_error : float
        Largest distance between reference and measured position while the loop is closed, rad.
    stop_time : float
        Duration of a stop, s: from the sample that detects the reason until the torque command is zero. The torque
        falls at the rate ``torque / stop_time``, so a smaller torque reaches zero sooner.
    answer_time : float
        Longest time without a plausible answer, s (`stickslip.rigs.safety`): `Rig.exchange` takes longer than a sample,
        its clock runs at another rate, readings freeze although the torque must change them. Infinite: not checked.
    standstill_torque : float
        Largest torque at which the axis may be at rest, N·m: more than its greatest break-away torque. 0 selects
        four fifths of ``torque``, as identification needs 1.25 times the break-away torque.
    """

    torque: float
    speed: float
    position: tuple[float, float] = (-math.inf, math.inf)
    temperature: float = math.inf
    following_error: float = math.inf
    stop_time: float = 0.02
    answer_time: float = 0.1
    standstill_torque: float = 0.0

    def __post_init__(self) -> None:
        for name in ("torque", "speed", "stop_time"):
            value = getattr(self, name)
            if not (value > 0.0 and math.isfinite(value)):
                raise ParameterError(f"limits: {name} = {value:g} must be a finite number greater than 0")
        if not self.following_error > 0.0:
            raise ParameterError(
                f"limits: following_error = {self.following_error:g} rad must be greater than 0"
            )
        if not self.answer_time > 0.0:
            raise ParameterError(f"limits: answer_time = {self.answer_time:g} s must be greater than 0")
        if not self.standstill_torque >= 0.0:
            raise ParameterError(
                f"limits: standstill_torque = {self.standstill_torque:g} N·m must be greater than 0"
            )
        if self.standstill_torque == 0.0:
            # Kept by `dataclasses.replace`: a lower limit on the torque lowers no break-away torque.
            object.__setattr__(self, "standstill_torque", STANDSTILL * self.torque)
        if not self.position[0] < self.position[1]:
            raise ParameterError(f"limits: position = {self.position} rad must be (lowest, highest)")
        if math.isnan(self.temperature):
            raise ParameterError("limits: temperature = nan °C must be a number")

    def narrowed(self, narrower: Limits) -> Limits:
        """Return the tighter limits `narrower`, which may not be wider than these.

        Raises
        ------
        InputError
            Names the limit and its value here.
        """
        for name in (
            "torque", "speed", "temperature", "following_error", "stop_time", "answer_time", "standstill_torque",
        ):  # fmt: skip
            value, most = getattr(narrower, name), getattr(self, name)
            if value > most:
                raise InputError(f"limits: {name} = {value:g} is wider than the rig's {most:g}")
        if narrower.position[0] < self.position[0] or narrower.position[1] > self.position[1]:
            raise InputError(
                f"limits: position = {narrower.position} rad is wider than the rig's {self.position}"
            )
        return narrower

    def text(self, name: str) -> str:
        """Return a limit as text, without its unit; empty for an unknown name."""
        if name == "position":
            return "{:g} to {:g}".format(*self.position)
        value: float | None = getattr(self, name.replace(" ", "_"), None)
        return "" if value is None or name not in LIMIT_UNITS else f"{value:g}"

    def plain(self) -> dict[str, Any]:
        """Return plain data for a record's meta, without infinite limits."""
        low, high = self.position
        values = {**vars(self), "position": None, "lowest_position": low, "highest_position": high}
        return {k: v for k, v in values.items() if v is not None and math.isfinite(v)}


@dataclass(frozen=True)
class Watchdog:
    """The rig's own watchdog, which removes the torque when the loop's process dies.

    ``time`` is its longest reaction time, s; ``how`` describes it for people.
    """

    time: float
    how: str


@dataclass(frozen=True)
class Capabilities:
    """Capabilities of a rig.

    Attributes
    ----------
    watchdog : Watchdog or None
        None: nothing removes the torque if this process dies; such a rig is armed only on request.
    real_clock : bool
        True: its time advances by itself, so the loop must run in real time. False: each exchange is one sample.
    blocks : bool
        Whether it is a `BlockRig`.
    torque_sensor, temperature : bool
        Whether it measures them.
    """

    watchdog: Watchdog | None
    real_clock: bool = True
    blocks: bool = False
    torque_sensor: bool = False
    temperature: bool = False


@runtime_checkable
class Rig(Protocol):
    """Accepts a torque every sample time and returns measurements.

    ``open``, ``exchange`` and ``pause`` raise `stickslip.core.errors.RigError`: `MessageLost` if the rig did not answer
    in time, `DriveFault` if it answered with a fault. `exchange` first sends, then waits for the answer: the loop
    continues to call it while it ramps the torque to zero, whatever it raises.
    """

    @property
    def name(self) -> str:
        """Name of the source in the record."""
        ...

    @property
    def sample_time(self) -> float:
        """s"""
        ...

    @property
    def limits(self) -> Limits:
        """Limits that are never exceeded; a run may tighten them."""
        ...

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities of the rig."""
        ...

    def open(self) -> Measurement:
        """Connect, check and arm, with zero torque; return the first measurement."""
        ...

    def exchange(self, torque: float) -> Measurement:
        """Apply a torque (N·m) for one sample time from now; return the measurement at its end."""
        ...

    def pause(self, seconds: float) -> Measurement:
        """Wait with zero torque; a virtual rig advances its clock without simulating every sample."""
        ...

    def close(self) -> None:
        """Remove the torque, disarm and disconnect. It may be called at any time: twice, after a failed `open`, and
        from another thread while `exchange` does not return."""
        ...


@runtime_checkable
class BlockRig(Rig, Protocol):
    """A rig that runs plant, controller and safety in one compiled loop."""

    def exchange_block(self, control: Control, setpoints: Array, rows: Array) -> int:
        """Run up to ``len(setpoints)`` samples; return their number.

        In a compiled loop, for every sample k: ``torque = decide(control, setpoints[k], rows[k])``, advance the plant
        by a sample with that torque, write what is then measured to ``control.measured`` (the order of `Measurement`),
        and leave the loop after the sample for which `finished(control)` is true. `decide` and `finished` are kernels
        of `stickslip.rigs.loop_sample`.
        """
        ...


@dataclass(frozen=True)
class RigKind:
    """A registered kind of rig.

    Attributes
    ----------
    name : str
    build : callable
        ``build(settings) -> Rig`` from the ``[rig]`` table of a TOML file (`stickslip.rigs.files`); raises
        `stickslip.core.errors.InputError` for invalid settings.
    title : str
        One line for people.
    """

    name: str
    build: Callable[[Table], Rig]
    title: str
