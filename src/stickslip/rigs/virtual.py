"""The virtual rig: a machine of `stickslip.machines` with the interface of `stickslip.rigs.rig`.

It has its own clock: each exchange is one sample, and a pause advances the clock without simulating every sample
(friction drifts, the contact cools). Blocks and single samples give the same numbers, bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from stickslip.core.config import Table
from stickslip.core.errors import InputError
from stickslip.jit import kernel
from stickslip.machines.files import machine
from stickslip.machines.machine import IMPERFECTIONS, Machine
from stickslip.rigs.loop_sample import Control, decide, finished
from stickslip.rigs.rig import Capabilities, Limits, Measurement, RigKind, Watchdog
from stickslip.simulation.machine.layout import lay_out_machine, look, run, wait
from stickslip.simulation.machine.plant import Laid, plant_of
from stickslip.simulation.machine.step import sample

Array = np.ndarray[Any, np.dtype[np.float64]]

TORQUE, SPEED = 1.0, 100.0
"""Default limits, N·m and rad/s, if the machine's file has none."""
SETTLE, LONGEST_SETTLE = 0.05, 2.0
"""Longest simulated part of a pause, s, in which the axis comes to rest."""
AT_REST = 0.05
"""rad/s"""


@kernel()
def run_block(laid: Laid, control: Control, setpoints: Any, rows: Any) -> int:
    """Run `stickslip.rigs.rig.BlockRig.exchange_block` on a machine; return the number of samples."""
    plant = plant_of(laid)
    for k in range(setpoints.shape[0]):
        torque = decide(control, setpoints[k], rows[k])
        sample(plant, torque, control.measured)
        if finished(control):
            return k + 1
    return setpoints.shape[0]


class VirtualRig:
    """A machine as a rig.

    Parameters
    ----------
    machine : Machine
        With or without some of its imperfections (`Machine.without`).
    """

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.laid = lay_out_machine(machine)
        given = machine.limits
        current = machine.amplifier.torque_constant * machine.amplifier.current_limit
        torque = given.get("torque", current if math.isfinite(current) else TORQUE)
        self._limits = Limits(
            torque=min(torque, current), speed=min(0.98 * machine.encoder.max_speed, SPEED),
            temperature=given.get("temperature", math.inf),
            following_error=given.get("following_error", math.inf), stop_time=given.get("stop_time", 0.02),
        )  # fmt: skip
        self._one, self._row = np.zeros(1), np.zeros((1, len(Measurement._fields)))

    @property
    def name(self) -> str:
        """Name of the machine, and imperfections switched off."""
        off = self.machine.switched_off
        return f"virtual {self.machine.name}" + (f" without {', '.join(off)}" if off else "")

    @property
    def sample_time(self) -> float:
        """s"""
        return self.machine.sample_time

    @property
    def limits(self) -> Limits:
        """Limits of the machine's file; the speed is below that at which its encoder loses counts."""
        return self._limits

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities: a virtual machine ends with its process, which serves as watchdog."""
        return Capabilities(
            Watchdog(self.sample_time, "the machine ends with its process"), False, True, True, True
        )

    def open(self) -> Measurement:
        """Measure with zero torque; a machine that was closed continues from its state."""
        look(self.laid, self._row[0])
        return self._measured()

    def exchange(self, torque: float) -> Measurement:
        """Run one sample with a torque, N·m."""
        self._one[0] = torque
        run(self.laid, self._one, self._row)
        return self._measured()

    def exchange_block(self, control: Control, setpoints: Array, rows: Array) -> int:
        """Run samples of the loop, compiled."""
        return run_block(self.laid, control, setpoints, rows)

    def pause(self, seconds: float) -> Measurement:
        """Simulate zero torque until the axis rests, then advance the clock alone.

        Raises
        ------
        InputError
            If `seconds` is negative or not finite.
        """
        if not (seconds >= 0.0 and math.isfinite(seconds)):
            raise InputError(f"pause: seconds = {seconds:g} must be a finite number of at least 0")
        left = seconds
        rows = np.zeros((max(1, round(SETTLE / self.sample_time)), len(Measurement._fields)))
        width = len(rows) * self.sample_time
        while left >= width and (left > seconds - LONGEST_SETTLE or self.speed > AT_REST):
            run(self.laid, np.zeros(len(rows)), rows)
            left -= width
            if self.speed < 1e-3 * AT_REST:
                break
        wait(self.laid, left)
        return self.open()

    def close(self) -> None:
        """Drop the torque in the delay line; there is nothing to disconnect."""
        self.laid.forget_commands()

    @property
    def speed(self) -> float:
        """True velocity of the friction disk, rad/s."""
        return abs(float(self.laid.axis[int(self.laid.machine["disk"]) + 1]))

    def _measured(self) -> Measurement:
        return Measurement(*(float(x) for x in self._row[0]))


def virtual_rig(name: str, without: Sequence[str] = ()) -> VirtualRig:
    """Return the virtual rig of a machine by name or file, without some of its imperfections.

    Raises
    ------
    UnknownName, ConfigError
    """
    return VirtualRig(machine(name).without(*without))


def build(settings: Table) -> VirtualRig:
    """Build from ``machine`` (a name of the library, or a file next to this one) and ``without`` (a list of
    imperfections)."""
    without = settings.texts("without", IMPERFECTIONS) if settings.has("without") else []
    name = settings.text("machine")
    return virtual_rig(str(settings.document.locate(name)) if name.endswith(".toml") else name, without)


RIG = RigKind("virtual", build, "a simulated machine, with every imperfection of a real one")
