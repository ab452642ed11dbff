"""One guarded sample as the Python loop calls it: by addresses, and rehearsed before it counts."""

from __future__ import annotations

import numpy as np

from stickslip.rigs.loop_sample import ADDRESSES, COLUMNS, MEASURED, Control, addresses, decide_at, nothing_at
from stickslip.rigs.rig import Setpoint

SETPOINT, ROW = ((ADDRESSES.names or ()).index(name) for name in ("setpoint", "row"))
"""Places of the addresses that change from sample to sample; by name they would take twice as long."""


class Step:
    """The compiled sample of a control.

    Parameters
    ----------
    control : Control
    """

    def __init__(self, control: Control) -> None:
        self.control = control
        self._addresses = addresses(control)
        self._sample = self._addresses.view(np.float64)  # as kernels take it
        # The rehearsal works on copies that stand still on their setpoint. They live here, since only their
        # addresses are used.
        self._copies = control._replace(
            **{name: getattr(control, name).copy() for name in control._fields[1:]}
        )
        position = float(control.measured.view(MEASURED)["position"][0])
        self._still, self._row = np.array(Setpoint(position=position, closed=1.0)), np.zeros(len(COLUMNS))
        at = addresses(self._copies)
        at[SETPOINT], at[ROW] = self._still.ctypes.data, self._row.ctypes.data
        self._rehearsal = at.view(np.float64)

    def decide(self, setpoint: int, row: int) -> float:
        """The torque for the next sample, N·m; `setpoint` and `row` are addresses."""
        self._addresses[SETPOINT], self._addresses[ROW] = setpoint, row
        return decide_at(self._sample)

    def rehearse(self) -> None:
        """Run the sample on copies: its code is then in the caches of the processor."""
        decide_at(self._rehearsal)
        nothing_at(self._rehearsal)

    def idle(self) -> None:
        """A compiled function that does nothing, called as the sample is: what calling and clock take."""
        nothing_at(self._sample)
