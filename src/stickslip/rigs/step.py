"""One guarded sample as called by the Python loop: by addresses, and rehearsed before it is due."""

from __future__ import annotations

import numpy as np

from stickslip.rigs.loop_sample import ADDRESSES, COLUMNS, MEASURED, Control, addresses, decide_at, nothing_at
from stickslip.rigs.rig import Setpoint

SETPOINT, ROW = ((ADDRESSES.names or ()).index(name) for name in ("setpoint", "row"))
"""Indices of the addresses that change from sample to sample; by name they would take twice as long."""


class Step:
    """The compiled sample of a control.

    Parameters
    ----------
    control : Control
    """

    def __init__(self, control: Control) -> None:
        self.control = control
        self._addresses = addresses(control)
        self._sample = self._addresses.view(np.float64)  # as kernels require it
        # The rehearsal uses copies at rest at their setpoint. They are kept here, because only their addresses are
        # used.
        self._copies = control._replace(
            **{name: getattr(control, name).copy() for name in control._fields[1:]}
        )
        position = float(control.measured.view(MEASURED)["position"][0])
        self._still, self._row = np.array(Setpoint(position=position, closed=1.0)), np.zeros(len(COLUMNS))
        at = addresses(self._copies)
        at[SETPOINT], at[ROW] = self._still.ctypes.data, self._row.ctypes.data
        self._rehearsal = at.view(np.float64)

    def decide(self, setpoint: int, row: int) -> float:
        """Return the torque for the next sample, N·m; `setpoint` and `row` are addresses."""
        self._addresses[SETPOINT], self._addresses[ROW] = setpoint, row
        return decide_at(self._sample)

    def rehearse(self) -> None:
        """Run the sample on copies, which loads its code into the processor's caches."""
        decide_at(self._rehearsal)
        nothing_at(self._rehearsal)

    def idle(self) -> None:
        """Call a compiled function that does nothing, to measure call and clock."""
        nothing_at(self._sample)
