"""A controller made of control laws as a linear sampled system about rest: matrices, transfer function, margins.

The matrices are taken from the text that runs: what one sample of the composition makes of a small change of every
number that it remembers, and of the measured angle. A friction law that a block holds is the spring and damper that it
is for motion of that amplitude (`stickslip.analyse.presliding_loop.describing`), and nothing while it slides. What a
law does only at its torque limit, or only while the reference rests, does not enter. A law that is not smooth about
rest is refused, and one that is dead there. What is smooth may bend soon: `linear_to` says up to which motion the
matrices are the law's.
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
from stickslip.errors import InputError
from stickslip.machines.drivetrain import FREE
from stickslip.model import Model
from stickslip.spec import Law, Par

Array = np.ndarray[Any, np.dtype[np.float64]]
AGREES = 0.2
"""Part of the largest torque by which a motion's torque may differ from that of the matrices that stand for it."""
FINER = math.sqrt(10.0)
"""Between the sizes of motions that are tried."""
LONG = 200
"""Samples over which numbers are compared in size, and torques of a motion."""
SPANNED = 1e-9
"""Part of a vector that has to be new for a motion of its own."""


class Params(NamedTuple):
    """Spring and damper."""

    stiffness: Annotated[float, Par("N·m/rad", "k", "stiffness", lower=0.0)]
    damping: Annotated[float, Par("N·m·s/rad", "d", "damping")]


class State(NamedTuple):
    """What the spring remembers."""

    angle: Annotated[float, Par("rad", "x", "angle of the spring")]


def spring(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    z.angle += 0.5 * (v0 + v1) * dt
    return p.stiffness * z.angle + p.damping * v1


SPRING = Law(
    "spring_and_damper", Params, spring, title="Spring and damper", equation=r"F = k x + d v",
    source=("thesis 5.2",), example={"stiffness": 100.0, "damping": 0.01}, State=State,
)  # fmt: skip
"""What a held friction law is about rest."""


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
        By how much of a sample time, or of several, the torque comes late.
    factor : float
        On the torque.
    """

    matrices: tuple[Array, Array, Array, float]
    sample_time: float
    delay: float = 0.0
    factor: float = 1.0

    def state_space(self) -> tuple[Array, Array, Array, float]:
        """A, B, C, D."""
        a, b, c, d = self.matrices
        return a, b, self.factor * c, self.factor * d

    def response(self, frequency: Array) -> Any:
        """The transfer function from measured angle to torque at frequencies in Hz, N·m/rad, complex.

        Its sign is that of a controller: a stiffness gives -k.
        """
        a, b, c, d = self.state_space()
        turn = np.exp(2j * math.pi * np.asarray(frequency) * self.sample_time)
        unit = np.eye(a.shape[0])
        late = turn ** (-self.delay)
        found = [float_of(c @ np.linalg.solve(z * unit - a, b)) + d for z in turn]
        return np.array(found) * late


def float_of(one: Any) -> complex:
    """The one number of a matrix."""
    return complex(one[0, 0])


def linearised(
    controller: Controller, amplitude: float, frequency: float, delay: float = 0.0
) -> LinearController:
    """The controller about rest.

    Parameters
    ----------
    controller : Controller
    amplitude, frequency : float
        Of the small motion that held friction laws see, rad and Hz; an infinite amplitude for laws that slide. Other
        laws are what they are for changes so small that they do not bend: maybe of a smaller motion, `linear_to`.
    delay : float
        Of the torque, samples.

    Raises
    ------
    InputError
        If a law is not smooth about rest or has a dead band there, or the controller acts in continuous time.
    """
    if controller.sample_time == 0.0:
        raise InputError(
            "stability: the controller acts in continuous time; give it a sample_time greater than 0"
        )
    run = _about_rest(controller, amplitude, frequency)
    found = [slope_at_rest(run, row) for row in np.eye(run.size + 1)]
    whole = np.array(found).T  # what every number becomes, and the torque, by what changed it
    n = run.size
    # A friction law's spring and the last angle are the same number but for a constant: that one is no motion.
    matrices = moved_and_felt(whole[:n, :n], whole[:n, n:], whole[n:, :n])
    return LinearController((*matrices, float(whole[n, n])), controller.sample_time, delay)


def linear_to(controller: Controller, amplitude: float, frequency: float) -> float:
    """The motion up to which the laws are what `linearised` makes of them, rad: at most `amplitude`, 0 for none.

    A sine of the measured angle goes through samples and matrices; their torques must agree within `AGREES`.

    Parameters
    ----------
    controller : Controller
    amplitude, frequency : float
        Of the sine, rad and Hz: at least a period in `LONG` samples, at most one in four.

    Raises
    ------
    InputError
        As of `linearised`.
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
    """A sample of the controller without its torque limit, held friction laws as springs."""
    return Sample(with_springs(replace(controller, torque_limit=math.inf), amplitude, frequency))


def moved_and_felt(a: Array, b: Array, c: Array) -> tuple[Array, Array, Array]:
    """The part of a system that its input moves and its output feels."""
    # What is never felt goes by its name first: mixed with the rest, rounding would be felt of it.
    felt = _sizes(a.T, c.T) > 0.0
    a, b, c = a[np.ix_(felt, felt)], b[felt], c[:, felt]
    for _ in range(2):  # the second time of the transposed system, which turns it back too
        sizes = _sizes(a, b)
        moves = sizes > 0.0
        scale, a, b, c = sizes[moves], a[np.ix_(moves, moves)], b[moves], c[:, moves]
        a, b, c = a * scale / scale[:, None], b / scale[:, None], c * scale
        base = _krylov(a, b)
        a, b, c = base.T @ a @ base, base.T @ b, c @ base
        a, b, c = a.T, c.T, b.T
    return a, b, c


def _sizes(a: Array, b: Array) -> Array:
    """The largest value of every number after an impulse, shape (n,)."""
    x, largest = b[:, 0], np.abs(b[:, 0])
    for _ in range(LONG):
        if not float(largest.max(initial=0.0)) < 1e100:
            break
        x = a @ x
        largest = np.maximum(largest, np.abs(x))
    return largest


def _krylov(a: Array, b: Array) -> Array:
    """An orthonormal base of what b, A b, A A b, ... span, shape (n, rank)."""
    base = np.zeros((len(a), 0))
    # What A makes of a unit vector may be nothing but rounding.
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
    """The controller with a spring and damper for every friction law that it holds."""
    return controller.with_blocks(_stuck(b, amplitude, frequency) for b in controller.blocks.values())


def _stuck(block: ControlBlock, amplitude: float, frequency: float) -> ControlBlock:
    if block.friction is None:
        return block
    found = FREE if math.isinf(amplitude) else describing(block.friction, amplitude, frequency)
    own = {f.name: getattr(block.parameters, f.name) for f in block.law.fields}
    return ControlBlock(block.law, Model(SPRING, stiffness=found.stiffness, damping=found.damping), **own)
