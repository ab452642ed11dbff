"""The time that a controller written in Python may take, and what is done when it takes more.

A controller that is a little late now and then does no harm; one that falls ever further behind, or does not come back,
leaves its last torque on the axis. How far it is behind the clock is summed up, and beyond its budget the loop stops.
A thread watches the call under way, and where that does not come back it ramps the torque down itself meanwhile.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager

from stickslip.errors import Overrun
from stickslip.rigs.rig import Measurement, Setpoint

BUDGET = 0.1
"""s, by which a controller may be behind if nothing else is said"""
FIRST = 10.0
"""s, that the first call may take where no torque stands: it imports, compiles and reserves memory"""
LOOKS = 5
"""Times that the thread looks within the budget"""


class Budget:
    """Calls a controller and counts its time.

    Parameters
    ----------
    sample_time : float
        What a call may take without falling behind, s.
    budget : float
        By how much the controller may be behind the clock, s.
    take_over : callable
        Called with what is wrong by the watching thread, while the controller's call is under way: it stops the rig.
    rests : bool
        No torque stands yet, so that the first call may take `FIRST`.
    """

    def __init__(
        self, sample_time: float, budget: float, take_over: Callable[[Overrun], None], *, rests: bool = False
    ) -> None:
        self._sample_time, self._budget, self._take_over = sample_time, budget, take_over
        self._behind = -max(0.0, FIRST - budget) if rests else 0.0
        self._since = 0.0
        self._lock = threading.Lock()
        self._over = threading.Event()

    @contextmanager
    def watched(self) -> Generator[None]:
        """Watch the calls inside."""
        watcher = threading.Thread(target=self._watch, name="budget", daemon=True)
        watcher.start()
        try:
            yield
        finally:
            self._over.set()
            watcher.join()

    def call(
        self, controller: Callable[[Measurement, Setpoint], float], measured: Measurement, setpoint: Setpoint
    ) -> float:
        """The controller's torque, N·m.

        Raises
        ------
        Overrun
            If it is further behind than its budget.
        """
        self._since = time.monotonic()
        try:
            torque = controller(measured, setpoint)
        finally:
            with self._lock:  # once the thread has taken over, this waits for the end of its ramp
                took = time.monotonic() - self._since
                self._since = 0.0
                late = self._behind + took - self._sample_time
                self._behind = max(0.0, late)
        if late > self._budget:
            raise self._error(took)
        return torque

    def _watch(self) -> None:
        while not self._over.wait(self._budget / LOOKS):
            with self._lock:
                took = time.monotonic() - self._since
                if self._since and self._behind + took - self._sample_time > self._budget:
                    self._take_over(self._error(took))
                    return

    def _error(self, took: float) -> Overrun:
        return Overrun(
            f"the controller took {1e3 * took:.3g} ms in a sample of {1e3 * self._sample_time:.3g} ms and is more than "
            f"its budget of {1e3 * self._budget:.3g} ms behind the clock; make it faster, or give Loop a greater budget"
        )
