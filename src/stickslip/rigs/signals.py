"""SIGINT and SIGTERM as something that a loop looks at between two samples, so that it ends by its ramp."""

from __future__ import annotations

import signal
import threading
from contextlib import ExitStack

from stickslip.errors import Interrupted

__all__ = ["Signals"]


class Signals:
    """Which signal asked for the end; 0 while none did."""

    def __init__(self) -> None:
        self.number = 0

    def hear(self, undo: ExitStack) -> None:
        """Hear them until `undo`; only the main thread may ask to."""
        if threading.current_thread() is not threading.main_thread():
            return
        for number in (signal.SIGINT, signal.SIGTERM):
            undo.callback(signal.signal, number, signal.getsignal(number))
            signal.signal(number, self._on_signal)

    @property
    def error(self) -> Interrupted:
        """What it is told as."""
        return Interrupted(f"{signal.Signals(self.number).name} asked for the end")

    def _on_signal(self, number: int, _: object) -> None:
        self.number = number
