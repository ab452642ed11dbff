"""A feedforward learned from repetition to repetition of the same motion: the verb `learn`."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from stickslip.analyse.learning import Convergence, over_angle, over_time, widest
from stickslip.analyse.machine_axis import axis_of
from stickslip.analyse.presliding_loop import Axis
from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.control.learning import TimeTable, low_pass
from stickslip.control.sample_time import sampled_by
from stickslip.control.written import tables_of
from stickslip.core.arguments import arguments_checked, constructor_checked
from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.core.spec import Surroundings
from stickslip.core.whole_files import prepared_folder, write_whole
from stickslip.machines.drivetrain import Drivetrain
from stickslip.machines.machine import Machine
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Reference
from stickslip.simulation.closed_loop import simulate
from stickslip.simulation.compiled_controller import FEEDFORWARD, compiled, replay

Array = np.ndarray[Any, np.dtype[np.float64]]
LARGEST = 1e6
"""N·m, bound of what is learned where the torque has none."""
RETURNED = 1e-6
"""Of the range of a reference: how near to its start a repetition has to end."""


@constructor_checked
@dataclass(frozen=True, eq=False, repr=False)
class LearningResult:
    """What was learned; printed, it is what `stickslip learn` prints.

    Attributes
    ----------
    over : str
        "time" or "angle".
    errors : tuple of float
        RMS position error of every repetition, rad; the first is that of the controller alone.
    block : ControlBlock
        A `table_feedforward` that gives what was learned: over time, the table of the repetition with the least error.
    controller : Controller
        The controller with it.
    convergence : Convergence
        The condition that was checked before.
    record : Record
        Of that repetition (time) or of all of them (angle).
    inertia : float
        Of the axis, kg·m².
    """

    over: str
    errors: tuple[float, ...]
    block: ControlBlock
    controller: Controller
    convergence: Convergence
    record: Record
    inertia: float

    def __str__(self) -> str:
        rows = [f"{i:10d}  {1e3 * e:12.4g}" for i, e in enumerate(self.errors, 1)]
        head = f"learned over {'time' if self.over == 'time' else 'angle and direction'}"
        return "\n".join([head, self.convergence.line(), "repetition  error, mrad RMS", *rows])

    __repr__ = __str__

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "over": self.over, "errors": list(self.errors), "convergence": vars(self.convergence),
            "feedforward": self.block.as_dict(),
        }  # fmt: skip

    @arguments_checked
    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the controller as `stickslip export --controller` and `rig run track --set controller=` read it.

        Parameters
        ----------
        path : path
            Of the TOML file.

        Raises
        ------
        InputError
            If it cannot be written.
        """
        import tomli_w

        target = Path(path)
        prepared_folder(target.parent)
        content = {"axis": {"inertia": self.inertia}, **tables_of(self.controller)}
        return write_whole(target, tomli_w.dumps(content))


@arguments_checked
def learn(
    axis: RigidAxis | Machine,
    controller: Controller,
    reference: Reference,
    duration: float,
    *,
    over: Literal["time", "angle"] = "time",
    repetitions: int = 10,
    rate: float = 0.8,
    corner: float | None = None,
    advance: int | None = None,
    bins: int = 64,
    progress: Callable[[int, int], None] | None = None,
) -> LearningResult:
    """Learn a feedforward by repeating a motion in simulation.

    After every repetition the feedforward takes over a share of the torque that the loop gave. Over time, every
    repetition starts from rest, and what was learned holds for this motion alone. Over angle and direction, the motion
    goes on without a stop, and what was learned holds for every motion in its range, as far as its torque depends on
    the angle.

    Parameters
    ----------
    axis : RigidAxis or Machine
    controller : Controller
        Sampled; a disturbance observer in it sees the residual.
    reference : Reference
    duration : float
        Of a repetition, s; over the angle the reference is back at its start after it.
    over : {"time", "angle"}
    repetitions : int
    rate : float
        L, the share that is taken over.
    corner : float, optional
        Of the low-pass Q over time, Hz; the highest with which learning converges, up to a tenth of the sample rate.
    advance : int, optional
        Samples by which torques are given earlier, over time; chosen with the corner.
    bins : int
        Of the angle.
    progress : callable, optional
        ``progress(finished, repetitions)``; over the angle called at the end.

    Returns
    -------
    LearningResult

    Raises
    ------
    InputError
        If ``|Q (1 - L T)|`` is not below 1 (`stickslip.analyse.learning`), so that learning diverges; in a line.
    SimulationError
        If a run diverges.
    """
    if repetitions < 1:
        raise InputError(f"learn: repetitions = {repetitions} must be at least 1")
    loop = _Repeated(axis, controller, reference, duration)
    if corner is not None and not 1.0 / loop.duration <= corner <= 0.5 / loop.controller.sample_time:
        raise InputError(
            f"learn: corner = {corner:g} Hz must lie between {1.0 / loop.duration:g} Hz, one period per repetition, "
            f"and {0.5 / loop.controller.sample_time:g} Hz, half the sample rate; leave it out to have it chosen"
        )
    if advance is not None and abs(advance) >= loop.count:
        raise InputError(
            f"learn: advance = {advance} must be below {loop.count}, the samples of a repetition; leave it out to have "
            "it chosen"
        )
    if over == "time":
        return _over_time(loop, repetitions, rate, corner, advance, progress)
    if corner is not None or advance is not None:
        raise InputError(
            "learn: corner and advance belong to learning over time; leave them out, or set bins"
        )
    return _over_angle(loop, repetitions, rate, bins, progress)


class _Repeated:
    """A loop and the motion that it repeats."""

    def __init__(
        self, axis: RigidAxis | Machine, controller: Controller, reference: Reference,
        duration: float,
    ) -> None:  # fmt: skip
        own = controller.with_blocks(controller.blocks.values())
        if isinstance(axis, Machine):
            own = sampled_by(own, axis.sample_time, f"machine {axis.name}")
        if own.sample_time == 0.0:
            raise InputError("learn: the controller acts in continuous time; give it a sample_time above 0")
        whole = [b.law.name for b in own.blocks.values() if b.law.option_of("fed_with") == "whole"]
        if whole:
            raise InputError(
                f"learn: {whole[0]} is fed with the whole torque and cancels every feedforward; leave fed_with out"
            )
        self.axis, self.controller, self.reference = axis, own, reference
        self.count = round(duration / own.sample_time)
        if not (self.count >= 2 and abs(self.count * own.sample_time - duration) <= 1e-6 * own.sample_time):
            raise InputError(
                f"learn: duration = {duration:g} s must be a whole number of samples of {own.sample_time:g} s"
            )
        self.duration = self.count * own.sample_time
        self.motion = reference.sample(own.sample_time * np.arange(self.count + 1))

    @property
    def linear(self) -> Axis:
        """The axis as the condition of convergence sees it."""
        if isinstance(self.axis, Machine):
            return axis_of(self.axis)
        return Axis(Drivetrain((self.axis.inertia,)), self.axis.friction)

    @property
    def delay(self) -> float:
        """Samples by which a torque acts late."""
        return self.axis.delay if isinstance(self.axis, Machine) else 0.0

    @property
    def largest(self) -> float:
        """Bound of what is learned, N·m."""
        return min(self.controller.torque_limit, LARGEST)

    def having(self, block: ControlBlock) -> Controller:
        """The controller with one more feedforward."""
        return replace(self.controller, feedforward=[*self.controller.feedforward, block])

    def run(self, controller: Controller, repetitions: int = 1) -> Record:
        """The record, a row a sample."""
        if isinstance(self.axis, Machine):
            return simulate(
                self.axis, controller, self.reference, repetitions * self.duration,
                output=controller.sample_time, metered=False,
            )  # fmt: skip
        return simulate(
            self.axis, controller, self.reference, repetitions * self.duration, integrator="sampled",
            output=controller.sample_time, metered=False,
        )  # fmt: skip

    def rows(self, record: Record, count: int) -> tuple[Array, Array]:
        """Error (rad), shape (count,), and the controller's inputs, shape (count, 4), at its samples."""
        at = np.flatnonzero(record["event"] == 0.0)[:count]
        true, reference = record["position"][at], record["position_reference"][at]
        seen = record["position_measured"][at] if "position_measured" in record.channels else true
        if self.controller.encoder_counts > 0.0:
            step = 2.0 * math.pi / self.controller.encoder_counts
            seen = step * np.floor(seen / step + 0.5)
        motion = self.reference.sample(self.controller.sample_time * np.arange(count))
        return reference - true, np.column_stack([seen, motion])


def _rms(error: Array) -> float:
    return math.sqrt(float(np.mean(error**2)))


def _insist(found: Convergence, remedy: str) -> Convergence:
    """The condition, if it is met."""
    if not found.holds:
        raise InputError(
            f"learn: |Q (1 - L T)| is {found.worst:.3g} at {found.frequency:.3g} Hz, not below 1, so that errors of "
            f"that frequency grow; {remedy}"
        )
    return found


def _over_time(
    loop: _Repeated, repetitions: int, rate: float, corner: float | None, advance: int | None,
    progress: Callable[[int, int], None] | None,
) -> LearningResult:  # fmt: skip
    """Repetitions from rest, each with the table that the ones before have left."""
    axis, own, time = loop.linear, loop.controller, loop.controller.sample_time
    if corner is None:
        found = widest(axis, own, rate, loop.delay)
        if advance is not None:
            found = over_time(axis, own, rate, found.corner, advance, loop.delay)
    else:
        found = over_time(axis, own, rate, corner, advance or 0, loop.delay)
    _insist(found, "lower corner or rate, or leave corner and advance out to have them chosen")
    weights = low_pass(found.corner, time)
    table = TimeTable(np.zeros(loop.count), time, rate, found.advance, weights, loop.largest)
    errors: list[float] = []
    best = (table, None)
    for i in range(1, repetitions + 1):
        controller = loop.having(table.block())
        record = loop.run(controller)
        error, inputs = loop.rows(record, loop.count)
        errors.append(_rms(error))
        if errors[-1] == min(errors):
            best = (table, record)
        taken, _ = _replayed(controller, inputs)
        table = table.after(taken)
        if progress:
            progress(i, repetitions)
    assert best[1] is not None
    block = best[0].block()
    return LearningResult("time", tuple(errors), block, loop.having(block), found, best[1], loop.axis.inertia)


def _replayed(controller: Controller, inputs: Array) -> tuple[Array, Any]:
    """What the loop gave besides the feedforwards, N·m, shape (n,), and the state of the laws at the end."""
    sampled, torque, ahead = compiled(controller), np.zeros(len(inputs)), np.zeros(len(inputs))
    around = np.array(Surroundings())
    replay(sampled, np.ascontiguousarray(inputs), around, FEEDFORWARD, torque, ahead)
    return torque - ahead, controller.unpacked_state(sampled.state.tolist())


def _over_angle(
    loop: _Repeated, repetitions: int, rate: float, bins: int, progress: Callable[[int, int], None] | None
) -> LearningResult:
    """One motion in which the law `learned_feedforward` learns."""
    angle, speed = loop.motion[:, 0], float(np.max(np.abs(loop.motion[:, 1])))
    lower, upper = float(np.min(angle)), float(np.max(angle))
    if not upper > lower:
        raise InputError("learn: the reference does not move; there is no angle to learn over")
    if abs(angle[-1] - angle[0]) > RETURNED * (upper - lower):
        raise InputError(
            f"learn: after {loop.duration:g} s the reference is {angle[-1] - angle[0]:.3g} rad from its start; give a "
            "duration after which it repeats, or learn over time"
        )
    if bins < 2:
        raise InputError(f"learn: bins = {bins} must be at least 2")
    found = over_angle(loop.linear, loop.controller, rate, (upper - lower) / bins, speed, loop.delay)
    _insist(found, "lower bins or rate")
    limits: dict[str, Any] = {"lower": lower, "upper": upper}
    zero = [0.0] * bins
    learner = ControlBlock(
        "learned_feedforward", **limits, samples=float(loop.count), rate=rate, largest=loop.largest, forward=zero,
        backward=zero,
    )  # fmt: skip
    own = loop.having(learner)
    record = loop.run(own, repetitions)
    count = repetitions * loop.count
    error, inputs = loop.rows(record, count)
    learned = own.learned(_replayed(own, inputs)[1])
    part = next(p for p, b in own.blocks.items() if b.law.name == "learned_feedforward")
    block = ControlBlock(
        "table_feedforward", **limits, forward=learned[f"{part}_up"], backward=learned[f"{part}_down"]
    )
    if progress:
        progress(repetitions, repetitions)
    errors = tuple(_rms(part) for part in error.reshape(repetitions, loop.count))
    return LearningResult("angle", errors, block, loop.having(block), found, record, loop.axis.inertia)
