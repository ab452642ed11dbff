"""Torque of any law along a measured motion: what hysteresis and lag in sliding are fitted to."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.spec import Law, Surroundings
from stickslip.jit import call_step, compiled_law, flat, kernel, pointer
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]


class Samples(NamedTuple):
    """A motion from sample to sample: s, rad, and the velocities at both ends of each stretch, rad/s."""

    time: Any
    position: Any
    before: Any
    after: Any


@kernel()
def follow(step: int, p: Any, u: Any, samples: Samples, z: Any, out: Any) -> None:
    """The law's steps from sample to sample."""
    time, x, before, after = samples.time, samples.position, samples.before, samples.after
    u[0] = x[0]
    out[0] = call_step(step, before[0], before[0], 0.0, pointer(z, 0), pointer(p, 0), pointer(u, 0))
    for i in range(1, time.size):
        u[0] = x[i]
        out[i] = call_step(
            step, before[i - 1], after[i - 1], time[i] - time[i - 1],
            pointer(z, 0), pointer(p, 0), pointer(u, 0),
        )  # fmt: skip


def torque_along(law: Law, packed: Array, parameters: Any, samples: Samples) -> Array:
    """Torque of a law at every sample, N·m, shape (n,), from rest with all states zero.

    Parameters
    ----------
    law : Law
    packed : array
        Its parameters as compiled functions read them.
    parameters : NamedTuple
        The same for its plain functions; only the number of elements is read.
    samples : Samples
        A time may occur twice: a jump of the velocity, during which nothing moves.
    """
    state = np.zeros(max(1, law.state_size(parameters)))
    out = np.empty(samples.time.size)
    follow(compiled_law(law).step, flat(packed), np.array(Surroundings()), samples, state, out)
    return out


def packed_numbers(model: Model) -> Array:
    """The parameters of a model as compiled functions read them."""
    return np.array(model.law.pack(model.parameters), dtype=np.float64)


class Along:
    """A law that is moved along samples, from rest with all states zero.

    Parameters
    ----------
    law : Law
    time : array, shape (n,)
        s, ascending.
    position : array, shape (n,)
        rad. Without velocities the motion is taken as uniform from sample to sample, so that every displacement is
        exact and the torque is that at the end of the stretch.
    velocity : array, shape (n,), optional
        rad/s; taken as linear from sample to sample.
    """

    def __init__(self, law: Law, time: Array, position: Array, velocity: Array | None = None) -> None:
        if time.size < 2 or position.shape != time.shape:
            raise InputError("a motion needs as many positions as times, at least two")
        width = np.diff(time)
        if np.any(width <= 0.0):
            raise InputError("times must ascend strictly; merge samples of the same time")
        mean = np.diff(position) / width
        self._law = law
        before, after = (mean, mean) if velocity is None else (velocity[:-1], velocity[1:])
        self._samples = Samples(flat(time), flat(position), flat(before), flat(after))

    @cached_property
    def velocity(self) -> Array:
        """Velocity at every sample, rad/s, shape (n,): the mean of that before and after it."""
        before, after = self._samples.before, self._samples.after
        return np.concatenate([before[:1], 0.5 * (after[:-1] + before[1:]), after[-1:]])

    def torque(self, packed: Array, parameters: Any) -> Array:
        """Torque at every sample, N·m, shape (n,).

        Parameters
        ----------
        packed : array
            The law's parameters as compiled functions read them.
        parameters : NamedTuple
            The same for the law's plain functions; only the number of elements is read.
        """
        return torque_along(self._law, packed, parameters, self._samples)

    def of(self, model: Model) -> Array:
        """Torque of a model at every sample, N·m, shape (n,)."""
        return self.torque(packed_numbers(model), model.parameters)
