"""A controller made of control laws as a linear sampled system about rest: matrices, transfer function, margins.

The matrices are derived from the text that runs: from the response of one sample of the composition to a small change
of every state and of the measured angle. A friction law in a block becomes its spring and damper for motion of that
amplitude (`stickslip.analyse.presliding_loop.describing`), and nothing while it slides. Behaviour at the torque limit
only, or only while the reference rests, is not included. A law that is not smooth about rest, or has a dead band there,
is refused. A smooth law may still bend at small motion: `linear_to` returns the motion up to which the matrices are
valid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, Any, NamedTuple

import numpy as np

from stickslip.analyse.controller_sample import Sample
from stickslip.analyse.presliding_loop import describing
from stickslip.analyse.slope_at_rest import SIZES, slope_at_rest
from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.core.errors import InputError
from stickslip.core.spec import Law, Par
from stickslip.machines.drivetrain import FREE
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]
AGREES = 0.2
"""Relative deviation of a motion's torque from that of the matrices, as a share of the largest torque."""
FINER = math.sqrt(10.0)
"""Ratio of successive amplitudes."""
LONG = 200
"""Samples over which states and torques are compared."""
SPANNED = 1e-9
"""Share of a vector that must be new to count as an independent motion."""


class Params(NamedTuple):
    """A spring and a damper."""

    stiffness: Annotated[float, Par("N·m/rad", "k", "stiffness", lower=0.0)]
    damping: Annotated[float, Par("N·m·s/rad", "d", "damping")]


class State(NamedTuple):
    """State of the spring."""

    angle: Annotated[float, Par("rad", "x", "angle of the spring")]


def spring(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    z.angle += 0.5 * (v0 + v1) * dt
    return p.stiffness * z.angle + p.damping * v1


SPRING = Law(
    "spring_and_damper", Params, spring, title="Spring and damper", equation=r"F = k x + d v",
    source=("thesis 5.2",), example={"stiffness": 100.0, "damping": 0.01}, State=State,
)  # fmt: skip
"""Linear form of a friction law in a block about rest."""


@dataclass(frozen=True, eq=False)
class LinearController:
    """From measured angle (rad) to torque (N·m), sample by sample: x' = A x + B angle, torque = C x + D angle.

    Attributes
    ----------
    matrices : tuple of arrays
        A, B, C and the number D.
    sample_time : float
        s
    delay : float
        Delay of the torque, in samples; may be fractional.
    factor : float
        Factor on the torque.
    """

    matrices: tuple[Array, Array, Array, float]
    sample_time: float
    delay: float = 0.0
    factor: float = 1.0

    def state_space(self) -> tuple[Array, Array, Array, float]:
        """The matrices A, B, C, D."""
        a, b, c, d = self.matrices
        return a, b, self.factor * c, self.factor * d

    def response(self, frequency: Array) -> Any:
        """Return the transfer function from measured angle to torque at frequencies in Hz, N·m/rad, complex.

        The sign is that of a controller: a stiffness gives -k.
        """
        a, b, c, d = self.state_space()
        turn = np.exp(2j * math.pi * np.asarray(frequency) * self.sample_time)
        unit = np.eye(a.shape[0])
        late = turn ** (-self.delay)
        found = [float_of(c @ np.linalg.solve(z * unit - a, b)) + d for z in turn]
        return np.array(found) * late


def float_of(one: Any) -> complex:
    """Return the only element of a matrix."""
    return complex(one[0, 0])


def linearised(
    controller: Controller, amplitude: float, frequency: float, delay: float = 0.0
) -> LinearController:
    """Return the controller linearised about rest.

    Parameters
    ----------
    controller : Controller
    amplitude, frequency : float
        Of the small motion for which friction laws in blocks are linearised, rad and Hz; infinite for sliding laws.
        Other laws are linearised for infinitesimal changes, which may be valid for smaller motion only (`linear_to`).
    delay : float
        Of the torque, samples.

    Raises
    ------
    InputError
        If a law is not smooth about rest or has a dead band there, or the controller is continuous.
    """
    if controller.sample_time == 0.0:
        raise InputError(
            "stability: the controller acts in continuous time; give it a sample_time greater than 0"
        )
    run = _about_rest(controller, amplitude, frequency)
    found = [slope_at_rest(run, row) for row in np.eye(run.size + 1)]
    whole = np.array(found).T  # responses of every state and of the torque, by the changed state
    n = run.size
    # The spring of a friction law and the last angle differ only by a constant, which is not a motion.
    matrices = moved_and_felt(whole[:n, :n], whole[:n, n:], whole[n:, :n])
    return LinearController((*matrices, float(whole[n, n])), controller.sample_time, delay)


def linear_to(controller: Controller, amplitude: float, frequency: float) -> float:
    """Return the motion up to which `linearised` is valid, rad: at most `amplitude`, 0 for none.

    The torques of samples and matrices for a sine of the measured angle must agree within `AGREES`.

    Parameters
    ----------
    controller : Controller
    amplitude, frequency : float
        Of the sine, rad and Hz: at least one period in `LONG` samples, at most one in four.

    Raises
    ------
    InputError
        As for `linearised`.
    """
    a, b, c, d = linearised(controller, amplitude, frequency).matrices
    turn = min(max(frequency * controller.sample_time, 1.0 / LONG), 0.25)
    sine = np.sin(2.0 * math.pi * turn * np.arange(1, LONG + 1))
    x, unit = np.zeros((len(a), 1)), np.zeros(LONG)
    for i, angle in enumerate(sine.tolist()):
        unit[i] = (c @ x).item() + d * angle
        x = a @ x + b * angle
    run = _about_rest(controller, amplitude, frequency)
    still = run.torques(0.0 * sine)
    size = amplitude
    while size >= SIZES[-1]:
        told = run.torques(size * sine) - still
        most = max(float(np.abs(told).max()), size * float(np.abs(unit).max()))
        if float(np.abs(told - size * unit).max()) <= AGREES * most:
            return size
        size /= FINER
    return 0.0


def _about_rest(controller: Controller, amplitude: float, frequency: float) -> Sample:
    """Return a sample of the controller without its torque limit, with friction laws as springs."""
    return Sample(with_springs(replace(controller, torque_limit=math.inf), amplitude, frequency))


def moved_and_felt(a: Array, b: Array, c: Array) -> tuple[Array, Array, Array]:
    """Return the controllable and observable part of a system."""
    # Unobservable states are removed by name first: mixed with the rest, their rounding errors would appear in the
    # output.
    felt = _sizes(a.T, c.T) > 0.0
    a, b, c = a[np.ix_(felt, felt)], b[felt], c[:, felt]
    for _ in range(2):  # the second time for the transposed system, which also transposes it back
        sizes = _sizes(a, b)
        moves = sizes > 0.0
        scale, a, b, c = sizes[moves], a[np.ix_(moves, moves)], b[moves], c[:, moves]
        a, b, c = a * scale / scale[:, None], b / scale[:, None], c * scale
        base = _krylov(a, b)
        a, b, c = base.T @ a @ base, base.T @ b, c @ base
        a, b, c = a.T, c.T, b.T
    return a, b, c


def _sizes(a: Array, b: Array) -> Array:
    """Return the largest value of every state after an impulse, shape (n,)."""
    x, largest = b[:, 0], np.abs(b[:, 0])
    for _ in range(LONG):
        if not float(largest.max(initial=0.0)) < 1e100:
            break
        x = a @ x
        largest = np.maximum(largest, np.abs(x))
    return largest


def _krylov(a: Array, b: Array) -> Array:
    """Return an orthonormal basis of the span of b, A b, A A b, ..., shape (n, rank)."""
    base = np.zeros((len(a), 0))
    # The product of A and a unit vector may consist of rounding errors only.
    v, size, largest = b[:, 0], float(np.linalg.norm(b)), float(np.linalg.norm(a))
    while base.shape[1] < len(a):
        for _ in range(2):  # once is not enough to full precision
            v = v - base @ (base.T @ v)
        left = float(np.linalg.norm(v))
        if not left > SPANNED * size or left == 0.0:
            break
        base = np.column_stack([base, v / left])
        v, size = a @ base[:, -1], largest
    return base


def with_springs(controller: Controller, amplitude: float, frequency: float) -> Controller:
    """Return the controller with a spring and damper in place of every friction law."""
    return controller.with_blocks(_stuck(b, amplitude, frequency) for b in controller.blocks.values())


def _stuck(block: ControlBlock, amplitude: float, frequency: float) -> ControlBlock:
    if block.friction is None:
        return block
    found = FREE if math.isinf(amplitude) else describing(block.friction, amplitude, frequency)
    own = {f.name: getattr(block.parameters, f.name) for f in block.law.fields}
    return ControlBlock(block.law, Model(SPRING, stiffness=found.stiffness, damping=found.damping), **own)
