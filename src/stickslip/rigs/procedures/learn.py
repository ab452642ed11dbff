"""Learn: a tracking repeated, each time with a feedforward over time that the times before have left."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from stickslip.control.block import ControlBlock
from stickslip.control.composed import composed_of
from stickslip.control.learned import refuse_others, write_table
from stickslip.control.learning import low_pass, relearned
from stickslip.control.sampled_controller import SampledController
from stickslip.control.written import tables_of
from stickslip.errors import InputError
from stickslip.record import Record
from stickslip.rigs.loop_sample import COLUMNS
from stickslip.rigs.procedures.base import POSITION, Check, Plan, Step, Steps
from stickslip.rigs.procedures.track import Track, machine_in
from stickslip.rigs.rig import Rig, setpoints
from stickslip.simulation.compiled_controller import FEEDFORWARD, compiled, replay_memory
from stickslip.spec import Surroundings

__all__ = ["PROCEDURE", "Learn"]

Array = np.ndarray[Any, np.dtype[np.float64]]
TORQUE = COLUMNS.index("torque_command")
RETURNED = 1e-3
"""Of the reference's range, by which it may end beside its start."""
GROWN = 1.5
"""Times the least error: a repetition that is worse ends the learning."""


@dataclass(frozen=True)
class Learn(Track):
    """Options of `track`, with a reference that returns to its start; ``times`` repetitions, of whose torque the share
    ``rate`` is taken over each time through a low-pass without lag of the ``corner`` (Hz; 0: the bandwidth), given
    ``advance`` samples earlier. ``save`` is the TOML file to which the controller with the best table is written, for
    `track` with ``controller``; one that is there is replaced only where the same was learned on the same machine. Its
    ``uncertainty`` is by how much another repetition would have changed the table, N·m RMS.

    No model of the rig is asked for, so that the condition of convergence is not checked beforehand
    (`stickslip learn` does on a simulation): a repetition whose error is half as large again as the least ends it.
    """

    name: ClassVar[str] = "learn"
    title: ClassVar[str] = "learn a feedforward over repetitions of a tracking"

    reference: str = "high"
    linear: str = "PID"
    bandwidth: float = 10.0
    duration: float = 10.0
    times: int = 6
    rate: float = 0.8
    corner: float = 0.0
    advance: int = 0
    save: str = ""

    def plan(self, rig: Rig) -> Plan:
        """Every repetition."""
        one, angle = Track.plan(self, rig), self.samples(rig)[:, 0]
        if abs(float(angle[-1] - angle[0])) > RETURNED * float(np.ptp(angle)):
            raise InputError(
                f"learn: reference = {self.reference} does not end where it starts; give low or high, and a duration "
                "of whole periods"
            )
        if self.learned:
            raise InputError(f"learn: learned = {self.learned} belongs to `track`; give save")
        if self.save:
            refuse_others(Path(self.save), self.origin(rig))
        if self.times < 2 or not 0.0 < self.rate < 2.0:
            raise InputError(
                f"learn: times = {self.times} must be at least 2, rate = {self.rate:g} between 0 and 2"
            )
        text = (
            *one.text,
            f"{self.times} times; {100.0 * self.rate:.0f} % of the torque is taken over each time",
        )
        return replace(one, duration=self.times * one.duration, text=text, pauses=self.times * self.wait)

    def steps(self, rig: Rig) -> Steps:
        """`Track.steps`, from the same place each time."""
        rows = yield Step(setpoints(round(0.05 / rig.sample_time)), pause=self.wait)
        motion = self.samples(rig)
        path = np.column_stack([float(rows[-1, POSITION]) + motion[:, 0], motion[:, 1:]])
        own = replace(composed_of(self.made(rig)), sample_time=rig.sample_time)
        weights, table = low_pass(self.corner or self.bandwidth, rig.sample_time), np.zeros(len(path))
        least, best, uncertainty = math.inf, own, math.nan
        for i in range(1, self.times + 1):
            controller = with_table(own, table)
            wanted = setpoints(
                len(path), position=path[:, 0], velocity=path[:, 1], acceleration=path[:, 2],
                torque=self.angle().torque(path[:, 0]), closed=1.0,
            )  # fmt: skip
            rest = (
                self.wait if i > 1 else 0.0
            )  # every repetition starts from rest without torque, as the first does
            rows = yield Step(wanted, controller, keep=True, pause=rest, label=f"repetition {i}")
            error = rms(path[: len(rows), 0] - rows[:, POSITION])
            before, better = table, error < least
            if better:
                least, best = error, controller
            if error > GROWN * least or len(rows) < len(path):
                break
            taken = rows[:, TORQUE] - ahead_of(controller, rows[:, POSITION], path)
            table = relearned(table, taken, self.rate, self.advance, weights, own.torque_limit)
            if better:
                uncertainty = rms(table - before)
        if self.save:
            content = {"axis": {"inertia": self.inertia}, **tables_of(best)}
            told = {"origin": self.origin(rig), "uncertainty": {"table": uncertainty}}
            write_table(Path(self.save), {**content, **told})

    def origin(self, rig: Rig) -> dict[str, str]:
        """What says whose table it is."""
        return {"machine": machine_in(rig.name), "procedure": self.name, "reference": self.reference}

    def checks(self, record: Record, rig: Rig) -> tuple[Check, ...]:
        """Whether the error fell."""
        each = errors(record, len(self.samples(rig)))
        listed = ", ".join(f"{1e3 * e:.4g}" for e in each)
        return (
            Check("learning", min(each) < each[0], f"errors of the repetitions {listed} mrad RMS"),
        )  # fmt: skip


def with_table(controller: SampledController, table: Array) -> SampledController:
    """The controller with a feedforward over time."""
    ahead = [b for b in controller.blocks.values() if b.law.place == "feedforward"]
    more = ControlBlock(
        "table_feedforward", None, {"over": "time"}, step=controller.sample_time, table=table.tolist()
    )
    return replace(controller, feedforward=[*ahead, more])


def ahead_of(controller: SampledController, position: Array, path: Array) -> Array:
    """The feedforward of every sample, N·m, shape (n,)."""
    torque, ahead = np.zeros(len(path)), np.zeros(len(path))
    inputs = np.ascontiguousarray(np.column_stack([position, path]))
    replay_memory(compiled(controller), inputs, np.array(Surroundings()), FEEDFORWARD, torque, ahead)
    return ahead


def errors(record: Record, samples: int) -> list[float]:
    """RMS error of every repetition, rad."""
    error = record["position_reference"] - record["position"]
    return [rms(error[i : i + samples]) for i in range(0, len(error), samples)]


def rms(error: Array) -> float:
    """Root mean square."""
    return math.sqrt(float(np.mean(error**2)))


PROCEDURE = Learn
