"""Whether learning from repetition to repetition converges: ``|Q (1 - L T)|`` below 1 at every frequency.

The feedforward takes over the share L of the torque that the loop gave, through a low-pass Q without lag. T is the
answer of that torque to a torque at the motor, in the sampled loop of the text that runs
(`stickslip.analyse.controller_loop`) with the machine sliding: L T is the L P_s of the error's point of view, with the
loop as learning filter. Where the condition holds, what is learned comes nearer to its limit with every repetition, by
that factor at least (Bristow et al. 2006); where it does not, errors of that frequency grow in the end, whatever the
first repetitions look like. Where the axis sticks, T is next to 0, and nothing is learned there in either case.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.analyse.controller_loop import LinearController, float_of, linearised
from stickslip.analyse.controller_margins import slid
from stickslip.analyse.presliding_loop import Axis, Loop, held
from stickslip.control.controller import Controller
from stickslip.control.learning import bin_response, low_pass, low_pass_response
from stickslip.errors import InputError
from stickslip.machines.drivetrain import Drivetrain

Array = np.ndarray[Any, np.dtype[np.float64]]
DRAWN = 600
"""Frequencies at which the condition is looked at."""
LOWEST = 1e-5
"""Of half the sample rate: the lowest of them."""
ADVANCES = 9
"""Samples of advance, less one, among which `widest` chooses."""
KEPT = 0.95
"""Largest value of the condition that `widest` allows."""
CORNERS = np.geomspace(0.1, 1e-3, 50)
"""Corners of Q over the sample rate that `widest` tries, from above."""


@dataclass(frozen=True)
class Convergence:
    """The condition of monotone convergence.

    Attributes
    ----------
    worst : float
        Largest ``|Q (1 - L T)|``: the factor by which a repetition leaves the learned torque off its limit, at most.
    frequency : float
        Where it is, Hz.
    rate : float
        L.
    corner : float
        Of Q, Hz: where it lets 0.71 through.
    advance : int
        Samples by which the torque that was learned from is given earlier.
    """

    worst: float
    frequency: float
    rate: float
    corner: float
    advance: int = 0

    @property
    def holds(self) -> bool:
        """Whether it is met."""
        return self.worst < 1.0

    def line(self) -> str:
        """The condition in a sentence."""
        return (
            f"|Q (1 - L T)| is at most {self.worst:.3g} (at {self.frequency:.3g} Hz; L = {self.rate:g}, Q to "
            f"{self.corner:.3g} Hz, {self.advance} samples earlier)"
        )


def response(drivetrain: Drivetrain, drive: LinearController, delay: float, frequency: Array) -> Any:
    """T: what the loop takes of a torque at the motor, complex, shape (n,), at frequencies in Hz.

    Parameters
    ----------
    drivetrain : Drivetrain
    drive : LinearController
        Without delay.
    delay : float
        Samples by which the torque acts late.
    frequency : array, shape (n,)
    """
    whole = math.floor(delay)
    a, new, old, c = held(drivetrain, drive.sample_time, delay - whole)
    turn = np.exp(2j * math.pi * frequency * drive.sample_time)
    unit = np.eye(len(a))
    angle = [float_of(c @ np.linalg.solve(z * unit - a, new + old / z)) * z ** (-whole) for z in turn]
    opened = -drive.response(frequency) * np.array(angle)
    return opened / (1.0 + opened)


def answers(axis: Axis, controller: Controller, delay: float) -> tuple[Array, Any]:
    """Frequencies, Hz, and T of the sliding axis there.

    Raises
    ------
    InputError
        If a law is not smooth about rest, or the loop is not stable.
    """
    drivetrain, drive = slid(axis), linearised(controller, math.inf, axis.ringing)
    if not Loop(drivetrain, linearised(controller, math.inf, axis.ringing, delay)).poles().stable:
        raise InputError("learning: the loop is not stable while the axis slides; lower its bandwidth first")
    frequency = np.geomspace(LOWEST, 1.0, DRAWN) * 0.5 / controller.sample_time
    return frequency, response(drivetrain, drive, delay, frequency)


def judged(
    frequency: Array, left: Any, passed: Array, rate: float, corner: float, advance: int
) -> Convergence:
    """The condition with what a repetition leaves of an error, and what Q lets through, by frequency."""
    size = np.abs(passed * left)
    place = int(np.argmax(size))
    return Convergence(float(size[place]), float(frequency[place]), rate, corner, advance)


def over_time(
    axis: Axis, controller: Controller, rate: float, corner: float, advance: int, delay: float = 0.0
) -> Convergence:
    """The condition of learning over time.

    Parameters
    ----------
    axis : Axis
    controller : Controller
        Without what is learned.
    rate : float
        L, the share of the loop's torque that a repetition takes over.
    corner : float
        Of Q, Hz.
    advance : int
        Samples by which it is given earlier.
    delay : float
        Samples by which a torque acts late.

    Raises
    ------
    InputError
        If the loop has no linear form, or is not stable.
    """
    frequency, taken = answers(axis, controller, delay)
    time = controller.sample_time
    left = 1.0 - rate * np.exp(2j * math.pi * frequency * time * advance) * taken
    passed = low_pass_response(low_pass(corner, time), frequency * time)
    return judged(frequency, left, passed, rate, corner, advance)


def widest(axis: Axis, controller: Controller, rate: float, delay: float = 0.0) -> Convergence:
    """The condition with the highest corner of Q, and the advance, that keep it at `KEPT` or below.

    Parameters and errors as of `over_time`.

    Raises
    ------
    InputError
        If there is none.
    """
    frequency, taken = answers(axis, controller, delay)
    time = controller.sample_time
    turn = np.exp(2j * math.pi * frequency * time)
    left = [1.0 - rate * turn**m * taken for m in range(ADVANCES)]
    for corner in (CORNERS / time).tolist():
        passed = low_pass_response(low_pass(corner, time), frequency * time)
        found = [judged(frequency, x, passed, rate, corner, m) for m, x in enumerate(left)]
        best = min(found, key=lambda one: one.worst)
        if best.worst <= KEPT:
            return best
    raise InputError(
        f"learning: rate = {rate:g} converges with no filter, as |1 - L T| is {abs(1.0 - rate * taken[0]):.3g} at low "
        "frequency; give a rate between 0.1 and 1"
    )


def over_angle(
    axis: Axis, controller: Controller, rate: float, width: float, speed: float, delay: float = 0.0
) -> Convergence:
    """The condition of learning over the angle at the fastest motion, which asks for the highest frequencies.

    Parameters
    ----------
    axis, controller, rate, delay
        As of `over_time`.
    width : float
        Of a bin, rad.
    speed : float
        Largest of the reference, rad/s.

    Raises
    ------
    InputError
        If the loop has no linear form, or is not stable.
    """
    frequency, taken = answers(axis, controller, delay)
    waves = frequency * width / speed  # a bin: finer than half a wave a bin there is nothing in the map
    seen = waves <= 0.5
    passed = bin_response(waves[seen])
    corner = 0.182 * speed / width  # where cos² of pi times waves a bin is 0.71
    return judged(frequency[seen], 1.0 - rate * taken[seen], passed, rate, corner, 0)
