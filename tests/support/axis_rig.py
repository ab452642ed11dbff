"""The virtual rig under the tests of the loop: the ideal machine with limits, which remembers its torques."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from stickslip.machines.files import machine
from stickslip.rigs.loop_sample import COLUMNS, Control
from stickslip.rigs.rig import Capabilities, Limits, Measurement
from stickslip.rigs.virtual import VirtualRig

LIMITS = Limits(
    torque=1.0, speed=60.0, position=(-20.0, 20.0), temperature=80.0, following_error=1.0, stop_time=0.02
)
FRICTION = machine("thesis-dry").models["lugre"]
COMMAND = COLUMNS.index("torque_command")


class AxisRig(VirtualRig):
    """The ideal machine."""

    def __init__(self, *, blocks: bool = True, watchdog: bool = True, limits: Limits = LIMITS) -> None:
        super().__init__(machine("ideal"))
        self._limits = limits
        self._changed: dict[str, Any] = {"blocks": blocks} | ({} if watchdog else {"watchdog": None})
        self.torques: list[float] = []
        self.open_now = False

    @property
    def capabilities(self) -> Capabilities:
        return replace(super().capabilities, **self._changed)

    def open(self) -> Measurement:
        self.open_now = True
        return super().open()

    def exchange(self, torque: float) -> Measurement:
        self.torques.append(torque)
        return super().exchange(torque)

    def exchange_block(self, control: Control, setpoints: Any, rows: Any) -> int:
        count = super().exchange_block(control, setpoints, rows)
        self.torques.extend(rows[:count, COMMAND].tolist())
        return count

    def close(self) -> None:
        self.open_now = False
        super().close()
