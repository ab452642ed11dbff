"""Torque of any law at constant velocities: what a sliding curve is fitted to."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.core.spec import Law
from stickslip.jit import LawPointers, call_value, compiled_law, flat, kernel, pointer

Array = np.ndarray[Any, np.dtype[np.float64]]

BARELY = 1e-150
"""rad/s, at which a law is asked for its torque next to rest. Below every Stribeck velocity that a search may try (at
1e-12 a curve could fall before it was looked at, and the break-away torque told nothing); its square is not 0."""


@kernel()
def evaluate(steady: int, sliding: int, p: Any, velocity: Any, side: Any, out: Any) -> None:
    """Torques at the velocities; at rest the largest that the contact withstands towards `side`."""
    for i in range(velocity.size):
        if velocity[i] != 0.0:
            out[i] = call_value(steady, velocity[i], pointer(p, 0))
        elif sliding != 0:
            out[i] = side[i] * call_value(sliding, side[i] * BARELY, pointer(p, 0))
        else:
            out[i] = call_value(steady, side[i] * BARELY, pointer(p, 0))


@kernel()
def evaluate_all(steady: int, sliding: int, p: Any, velocity: Any, side: Any, out: Any) -> None:
    """The same for every row of parameters."""
    for k in range(p.shape[0]):
        evaluate(steady, sliding, p[k], velocity, side, out[k])


class Steady:
    """A law at fixed velocities.

    Parameters
    ----------
    law : Law
    velocity : array, shape (n,)
        rad/s; 0 asks for the break-away torque.
    side : array, shape (n,)
        Direction (+1, -1) of the torque where the velocity is 0.
    """

    def __init__(self, law: Law, velocity: Array, side: Array) -> None:
        self._pointers: LawPointers = compiled_law(law)
        self._velocity, self._side = flat(velocity), flat(side)
        self._count = velocity.size

    def torque(self, packed: Array) -> Array:
        """Torque at every velocity for the law's packed parameters, N·m, shape (n,)."""
        out = np.empty(max(self._count, 1))
        evaluate(self._pointers.steady, self._pointers.sliding, flat(packed), self._velocity, self._side, out)
        return out[: self._count]

    def torques(self, packed: Array) -> Array:
        """Torque at every velocity for several packed parameters, shape (m, q): N·m, shape (m, n)."""
        out = np.empty((len(packed), max(self._count, 1)))
        evaluate_all(self._pointers.steady, self._pointers.sliding, packed, self._velocity, self._side, out)
        return out[:, : self._count]
