"""Learn: repeat a tracking, each time with the feedforward learned so far, over time or the angle."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.control.learned import refuse_others, write_table
from stickslip.control.learning import AngleTable, TimeTable, low_pass
from stickslip.control.position import position_feedforward
from stickslip.control.sample_time import sampled_by
from stickslip.control.written import tables_of
from stickslip.core.config import read_toml
from stickslip.core.errors import InputError, UnknownName
from stickslip.core.record import Record
from stickslip.core.spec import Surroundings
from stickslip.machines.position_map import PositionMap
from stickslip.rigs.loop_sample import COLUMNS
from stickslip.rigs.procedures.base import POSITION, Check, Plan, Step, Steps
from stickslip.rigs.procedures.track import Track, machine_in
from stickslip.rigs.rig import Rig, setpoints
from stickslip.simulation.compiled_controller import FEEDFORWARD, compiled, replay

Array = np.ndarray[Any, np.dtype[np.float64]]
TORQUE = COLUMNS.index("torque_command")
OVER = ("time", "angle")
RETURNED = 1e-3
"""Allowed distance between start and end of the reference, as a share of its range."""
GROWN = 1.5
"""Multiple of the smallest error at which the learning ends."""


@dataclass(frozen=True)
class Learn(Track):
    """Options of `track`, with a reference that returns to its start; ``times`` repetitions, each of which adds the
    share ``rate`` of its torque to the table. ``over`` time: through a zero-phase low-pass with the ``corner`` (Hz; 0:
    the bandwidth), applied ``advance`` samples earlier. ``over`` angle: the mean of each direction in each of ``bins``
    of the reference's range, valid for every motion in it as far as torque depends on the angle. ``map`` is the
    model.toml of an identified map over the angle (``[position_map]``): its even part is a feedforward from the first
    repetition on, and the residual is learned. ``save`` is the TOML file for the controller with the best table (and
    the map), for `track` with ``controller``; an existing file is replaced only if the same was learned on the same
    machine. Its ``uncertainty`` is the expected change of the table by another repetition, N·m RMS.

    No model of the rig is required, so convergence is not checked in advance (`stickslip learn` checks it on a
    simulation): a repetition with more than 1.5 times the smallest error ends the learning.
    """

    name: ClassVar[str] = "learn"
    title: ClassVar[str] = "learn a feedforward over repetitions of a tracking"

    reference: str = "high"
    linear: str = "PID"
    bandwidth: float = 10.0
    duration: float = 10.0
    over: str = "time"
    map: str = ""
    times: int = 6
    rate: float = 0.8
    bins: int = 64
    corner: float = 0.0
    advance: int = 0
    save: str = ""

    def plan(self, rig: Rig) -> Plan:
        """Plan every repetition."""
        one, angle = Track.plan(self, rig), self.samples(rig)[:, 0]
        if abs(float(angle[-1] - angle[0])) > RETURNED * float(np.ptp(angle)):
            raise InputError(
                f"learn: reference = {self.reference} does not end where it starts; give low or high, and a duration "
                "of whole periods"
            )
        if self.learned:
            raise InputError(f"learn: learned = {self.learned} belongs to `track`; give save")
        self.domain()
        self.mapped()
        if self.save:
            refuse_others(Path(self.save), self.origin(rig))
        if self.times < 2 or not 0.0 < self.rate < 2.0:
            raise InputError(
                f"learn: times = {self.times} must be at least 2, rate = {self.rate:g} between 0 and 2"
            )
        text = (
            *one.text,
            f"{self.times} times; {100.0 * self.rate:.0f} % of the torque is learned each time, over {self.over}",
        )
        return replace(one, duration=self.times * one.duration, text=text, pauses=self.times * self.wait)

    def domain(self) -> None:
        """Refuse an unknown domain, and options of the other one."""
        if self.over not in OVER:
            raise UnknownName("domain of learning", self.over, OVER)
        if self.over == "angle" and (self.corner or self.advance):
            raise InputError(
                "learn: corner and advance belong to learning over time; leave them out, or set bins"
            )
        if self.bins < 2:
            raise InputError(f"learn: bins = {self.bins} must be at least 2")

    def mapped(self) -> list[ControlBlock]:
        """Return the feedforward of the map, by the reference angle; none without a map.

        Raises
        ------
        InputError
            If the file has none, or the compensator's model has its own.
        """
        if not self.map:
            return []
        if self.angle().largest > 0.0:
            raise InputError(
                f"learn: map = {self.map} and the [angle] of model = {self.model} would both be compensated; leave one "
                "out"
            )
        table = read_toml(Path(self.map))
        if not table.has("position_map"):
            raise InputError(
                f"learn: map = {self.map} contains no map over the angle; give the model.toml of `stickslip identify "
                "--method cogging`"
            )
        return [position_feedforward(PositionMap.of(table.table("position_map").values), angle="reference")]

    def table(self, rig: Rig, path: Array, largest: float) -> TimeTable | AngleTable:
        """Return the empty table."""
        if self.over == "angle":
            return AngleTable.over(path[:, 0], path[:, 1], self.bins, self.rate, largest)
        weights = low_pass(self.corner or self.bandwidth, rig.sample_time)
        return TimeTable(np.zeros(len(path)), rig.sample_time, self.rate, self.advance, weights, largest)

    def steps(self, rig: Rig) -> Steps:
        """Generate the steps of `Track`, from the same place each time."""
        rows = yield Step(setpoints(round(0.05 / rig.sample_time)), pause=self.wait)
        motion = self.samples(rig)
        path = np.column_stack([float(rows[-1, POSITION]) + motion[:, 0], motion[:, 1:]])
        own = with_more(sampled_by(self.made(rig), rig.sample_time, "rig"), self.mapped())
        table = self.table(rig, path, own.torque_limit)
        least, best, uncertainty = math.inf, own, math.nan
        for i in range(1, self.times + 1):
            controller = with_more(own, [table.block()])
            sent = setpoints(
                len(path), position=path[:, 0], velocity=path[:, 1], acceleration=path[:, 2],
                torque=self.angle().torque(path[:, 0]), closed=1.0,
            )  # fmt: skip
            # Every repetition starts from rest without torque, like the first.
            rest = self.wait if i > 1 else 0.0
            rows = yield Step(sent, controller, keep=True, pause=rest, label=f"repetition {i}")
            error = rms(path[: len(rows), 0] - rows[:, POSITION])
            better = error < least
            if better:
                least, best = error, controller
            if error > GROWN * least or len(rows) < len(path):
                break
            before = table
            table = table.after(rows[:, TORQUE] - ahead_of(controller, rows[:, POSITION], path))
            if better:
                uncertainty = rms(table.torque - before.torque)
        if self.save:
            content = {"axis": {"inertia": self.inertia}, **tables_of(best)}
            told = {"origin": self.origin(rig), "uncertainty": {"table": uncertainty}}
            write_table(Path(self.save), {**content, **told})

    def origin(self, rig: Rig) -> dict[str, str]:
        """Return the origin of the table."""
        return {
            "machine": machine_in(rig.name), "procedure": self.name, "reference": self.reference, "domain": self.over,
        }  # fmt: skip

    def checks(self, record: Record, rig: Rig) -> tuple[Check, ...]:
        """Check that the error decreased."""
        each = errors(record, len(self.samples(rig)))
        listed = ", ".join(f"{1e3 * e:.4g}" for e in each)
        return (
            Check("learning", min(each) < each[0], f"errors of the repetitions {listed} mrad RMS"),
        )  # fmt: skip


def with_more(controller: Controller, more: list[ControlBlock]) -> Controller:
    """Return the controller with additional feedforwards."""
    return replace(controller, feedforward=[*controller.feedforward, *more])


def ahead_of(controller: Controller, position: Array, path: Array) -> Array:
    """Return the feedforward of every sample, N·m, shape (n,)."""
    torque, ahead = np.zeros(len(path)), np.zeros(len(path))
    inputs = np.ascontiguousarray(np.column_stack([position, path]))
    replay(compiled(controller), inputs, np.array(Surroundings()), FEEDFORWARD, torque, ahead)
    return ahead


def errors(record: Record, samples: int) -> list[float]:
    """Return the RMS error of every repetition, rad."""
    error = record["position_reference"] - record["position"]
    return [rms(error[i : i + samples]) for i in range(0, len(error), samples)]


def rms(error: Array) -> float:
    """Root mean square."""
    return math.sqrt(float(np.mean(error**2)))


PROCEDURE = Learn
