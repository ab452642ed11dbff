"""Time budget of the calls that the loop waits for, and the stop when a call exceeds it.

A controller in Python or a rig may be slightly delayed now and then. If it falls further behind, or does not return,
its last torque stays on the axis. The delay is accumulated, and the loop stops when it exceeds the budget. A thread
watches the running calls, and stops the rig if a call does not return.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import ParamSpec, TypeVar

from stickslip.errors import RigError

BUDGET = 0.1
"""s, by which a controller may be behind if nothing else is said"""
FIRST = 10.0
"""s, that the first call may take where no torque stands: it imports, compiles and reserves memory"""
LOOKS = 5
"""Times that the thread looks within the budget"""

P = ParamSpec("P")
Result = TypeVar("Result")
Complaint = Callable[[float], RigError]
"""Makes the error for a call from its duration, s"""


class Budget:
    """Makes calls and counts their time.

    Parameters
    ----------
    allowed : float
        What a call may take without falling behind, s.
    budget : float
        By how much the calls may be behind the clock, s.
    complaint : callable
        The error for a call that is further behind.
    take_over : callable
        Called with that error by the watching thread, while the call is under way: it stops the rig.
    lenient : bool
        The first call may take `FIRST`.
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
            If it is further behind than its budget.
        """
        self._since = time.monotonic()
        try:
            found = function(*args, **kwargs)
        finally:
            with self._lock:  # once the thread has taken over, this waits for the end of its ramp
                took = time.monotonic() - self._since
                self._since = 0.0
                late = self._behind + took - self._allowed
                self._behind = max(0.0, late)
        if late > self.budget:
            self._behind = 0.0  # the calls of the ramp have their own
            raise self._complaint(took)
        return found

    def look(self) -> None:
        """Stop the rig, once, if the call under way is beyond its budget."""
        with self._lock:
            took = time.monotonic() - self._since
            if not self._spent and self._since and self._behind + took - self._allowed > self.budget:
                self._spent = True
                self._take_over(self._complaint(took))


class Watch:
    """The thread that looks at the calls under way."""

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
