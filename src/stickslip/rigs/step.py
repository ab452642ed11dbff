"""One guarded sample as the Python loop calls it: by addresses, and rehearsed before it counts."""

from __future__ import annotations

import numpy as np

from stickslip.rigs.loop_sample import COLUMNS, ROW, SETPOINT, Control, addresses, decide_at, nothing_at
from stickslip.rigs.rig import Measurement, Setpoint

__all__ = ["Step"]

POSITION = Measurement._fields.index("position")


class Step:
    """The compiled sample of a control.

    Parameters
    ----------
    control : Control
    """

    def __init__(self, control: Control) -> None:
        self.control = control
        self._addresses = addresses(control)
        # The rehearsal works on copies that stand still on their setpoint. They live here, since only their
        # addresses are used.
        self._copies = control._replace(
            **{name: getattr(control, name).copy() for name in control._fields[1:-1]}
        )
        self._still = np.array(Setpoint(position=float(control.measured[POSITION]), closed=1.0))
        self._row = np.zeros(len(COLUMNS))
        self._rehearsal = addresses(self._copies)
        self._rehearsal[SETPOINT], self._rehearsal[ROW] = self._still.ctypes.data, self._row.ctypes.data

    def decide(self, setpoint: int, row: int) -> float:
        """The torque for the next sample, N·m; `setpoint` and `row` are addresses."""
        self._addresses[SETPOINT], self._addresses[ROW] = setpoint, row
        return decide_at(self._addresses)

    def rehearse(self) -> None:
        """Run the sample on copies: its code is then in the caches of the processor."""
        decide_at(self._rehearsal)
        nothing_at(self._rehearsal)

    def idle(self) -> None:
        """A compiled function that does nothing, called as the sample is: what calling and clock take."""
        nothing_at(self._addresses)
