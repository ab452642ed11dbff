"""Time budget of the calls that the loop waits for, and the stop when a call exceeds it.

A Python controller or a rig may be slightly delayed now and then. If it falls further behind, or does not return, its
last torque stays on the axis. The delay is accumulated, and the loop stops when it exceeds the budget. A thread
watches the running calls, and stops the rig if a call does not return.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import ParamSpec, TypeVar

from stickslip.core.errors import RigError

BUDGET = 0.1
"""Default delay that a controller may accumulate, s"""
FIRST = 10.0
"""Limit for the first call, s, while no torque is applied: it imports, compiles and allocates memory"""
LOOKS = 5
"""Number of checks of the thread within the budget"""

P = ParamSpec("P")
Result = TypeVar("Result")
Complaint = Callable[[float], RigError]
"""Returns the error for a call from its duration, s"""


class Budget:
    """Makes calls and measures their time.

    Parameters
    ----------
    allowed : float
        Duration of a call that causes no delay, s.
    budget : float
        Largest delay of the calls behind the clock, s.
    complaint : callable
        Returns the error for a call with a larger delay.
    take_over : callable
        Called with that error by the watching thread, while the call is running; it stops the rig.
    lenient : bool
        Whether the first call may take `FIRST`.
    """

    def __init__(
        self,
        allowed: float,
        budget: float,
        complaint: Complaint,
        take_over: Callable[[RigError], None],
        *,
        lenient: bool = False,
    ) -> None:
        self.budget = budget
        self._allowed, self._complaint, self._take_over = allowed, complaint, take_over
        self._behind = -max(0.0, FIRST - budget) if lenient else 0.0
        self._since = 0.0
        self._spent = False
        self._lock = threading.Lock()

    def call(self, function: Callable[P, Result], *args: P.args, **kwargs: P.kwargs) -> Result:
        """Call a function, and return its result.

        Raises
        ------
        RigError
            If its delay exceeds the budget.
        """
        self._since = time.monotonic()
        try:
            found = function(*args, **kwargs)
        finally:
            with self._lock:  # after the thread has taken over, this waits for the end of its ramp
                took = time.monotonic() - self._since
                self._since = 0.0
                late = self._behind + took - self._allowed
                self._behind = max(0.0, late)
        if late > self.budget:
            self._behind = 0.0  # the calls of the ramp have their own
            raise self._complaint(took)
        return found

    def look(self) -> None:
        """Stop the rig, once, if the running call exceeds its budget."""
        with self._lock:
            took = time.monotonic() - self._since
            if not self._spent and self._since and self._behind + took - self._allowed > self.budget:
                self._spent = True
                self._take_over(self._complaint(took))


class Watch:
    """The thread that checks the running calls."""

    def __init__(self) -> None:
        self._budgets: list[Budget] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look, name="watch", daemon=True)

    @contextmanager
    def running(self) -> Generator[None]:
        """Watch until the end of the block."""
        self._thread.start()
        try:
            yield
        finally:
            self._over.set()
            self._thread.join()

    @contextmanager
    def over(self, budget: Budget) -> Generator[Budget]:
        """Watch the calls of a budget inside the block."""
        self._budgets = [*self._budgets, budget]
        try:
            yield budget
        finally:
            self._budgets = [b for b in self._budgets if b is not budget]

    def _look(self) -> None:
        while not self._over.wait(min((b.budget for b in self._budgets), default=BUDGET) / LOOKS):
            for budget in self._budgets:
                budget.look()
