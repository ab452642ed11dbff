"""The adaptive integrator's hybrid loop one call at a time, for solvers that are written in Python."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.jit import kernel, pointer_at, record_at, spliced
from stickslip.simulation.adaptive import layout, switching
from stickslip.simulation.adaptive.engine import tolerances
from stickslip.simulation.adaptive.hybrid import rates
from stickslip.simulation.adaptive.layout import Laid, Loop
from stickslip.simulation.case_arrays import POSITION_0, VELOCITY_0, Case

__all__ = ["HybridLoop", "laid_out"]


def laid_out(case: Case) -> Laid:
    """The loop of a case at its start."""
    n = case.numbers
    return layout.laid_out(case, tolerances(case), (float(n[POSITION_0]), float(n[VELOCITY_0])))


@spliced
def loop_at(a: Any) -> Loop:
    """`layout.loop_of` by addresses: one array costs a call from Python less than all of them."""
    return Loop(
        record_at(pointer_at(a[0]), layout.CASE), record_at(pointer_at(a[1]), layout.NOW),
        record_at(pointer_at(a[2]), layout.PROGRESS), record_at(pointer_at(a[3]), layout.STEP),
        pointer_at(a[4]), pointer_at(a[5]), pointer_at(a[6]), pointer_at(a[7]), pointer_at(a[8]), pointer_at(a[9]),
        pointer_at(a[10]), pointer_at(a[11]), pointer_at(a[12]), pointer_at(a[13]), pointer_at(a[14]),
        pointer_at(a[15]), pointer_at(a[16]),
    )  # fmt: skip


@kernel()
def rates_at(a: Any, t: float) -> None:
    """The rates at y."""
    loop = loop_at(a)
    rates(loop, t, loop.y, loop.rates)


@kernel()
def events_at(a: Any, t: float) -> float:
    """The largest event value at y."""
    loop = loop_at(a)
    return switching.events(loop, t, loop.y)


@kernel()
def switch_at(a: Any, t: float) -> None:
    """Change the modes whose events are due."""
    loop = loop_at(a)
    switching.switch(loop, t, loop.y)


@kernel()
def begin_at(a: Any, t: float, soon: float) -> None:
    """Set the remembered signs at y."""
    loop = loop_at(a)
    switching.begin_side(loop, t, soon, loop.y)


class HybridLoop:
    """A case as right-hand side and event function, with its modes.

    Attributes
    ----------
    y : array
        The state vector at the start, then where it was asked for last.
    due : array
        The event values found last.
    """

    def __init__(self, case: Case) -> None:
        self._laid = laid_out(case)
        self._at = np.array([array.ctypes.data for array in self._laid])
        self.y, self.due = self._laid.y, self._laid.due

    def rates(self, t: float, y: Any) -> Any:
        """The time derivative of the state vector."""
        self.y[:] = y
        rates_at(self._at, t)
        return self._laid.rates[: self.y.size].copy()

    def events(self, t: float, y: Any) -> float:
        """The largest event value."""
        self.y[:] = y
        return float(events_at(self._at, t))

    def switch(self, t: float, y: Any) -> None:
        """Change the modes in y whose events are due."""
        self.y[:] = y
        switch_at(self._at, t)
        y[:] = self.y

    def begin(self, t: float, soon: float, y: Any) -> None:
        """Set the remembered signs for an interval that starts at t; `soon` lies inside it."""
        self.y[:] = y
        begin_at(self._at, t, soon)
