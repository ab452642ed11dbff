"""Convergence of learning from repetition to repetition: ``|Q (1 - L T)|`` below 1 at every frequency.

In each repetition the feedforward adds the share L of the loop's torque, through a zero-phase low-pass Q. T is the
response of the loop's torque to a torque at the motor, in the sampled loop (`stickslip.analyse.controller_loop`) with
the machine sliding. Where the condition is met, the learned torque converges by at least that factor in every
repetition (Bristow et al. 2006); where it is not, errors of that frequency grow in the end, even if the first
repetitions look good. While the axis sticks, T is nearly 0 and nothing is learned.
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
from stickslip.core.errors import InputError
from stickslip.machines.drivetrain import Drivetrain

Array = np.ndarray[Any, np.dtype[np.float64]]
DRAWN = 600
"""Number of frequencies at which the condition is evaluated."""
LOWEST = 1e-5
"""Lowest frequency, as a share of half the sample rate."""
ADVANCES = 9
"""Largest advance that `widest` tries, samples, plus one."""
KEPT = 0.95
"""Largest value of the condition that `widest` allows."""
CORNERS = np.geomspace(0.1, 1e-3, 50)
"""Corners of Q as shares of the sample rate that `widest` tries, in descending order."""


@dataclass(frozen=True)
class Convergence:
    """The condition of monotone convergence.

    Attributes
    ----------
    worst : float
        Largest ``|Q (1 - L T)|``: the share of the deviation of the learned torque from its limit that remains after a
        repetition, at most.
    frequency : float
        Its frequency, Hz.
    rate : float
        L.
    corner : float
        Corner of Q, Hz: gain 0.71.
    advance : int
        Samples by which the learned torque is applied earlier.
    """

    worst: float
    frequency: float
    rate: float
    corner: float
    advance: int = 0

    @property
    def holds(self) -> bool:
        """Whether the condition is met."""
        return self.worst < 1.0

    def line(self) -> str:
        """Return the condition as a sentence."""
        return (
            f"|Q (1 - L T)| is at most {self.worst:.3g} (at {self.frequency:.3g} Hz; L = {self.rate:g}, Q to "
            f"{self.corner:.3g} Hz, {self.advance} samples earlier)"
        )


def response(drivetrain: Drivetrain, drive: LinearController, delay: float, frequency: Array) -> Any:
    """Return T, the response of the loop's torque to a torque at the motor, complex, shape (n,), at frequencies in Hz.

    Parameters
    ----------
    drivetrain : Drivetrain
    drive : LinearController
        Without delay.
    delay : float
        Delay of the torque, samples.
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
    """Return frequencies, Hz, and T of the sliding axis.

    Raises
    ------
    InputError
        If a law is not smooth about rest, or the loop is unstable.
    """
    drivetrain, drive = slid(axis), linearised(controller, math.inf, axis.ringing)
    if not Loop(drivetrain, linearised(controller, math.inf, axis.ringing, delay)).poles().stable:
        raise InputError("learning: the loop is unstable while the axis slides; lower its bandwidth first")
    frequency = np.geomspace(LOWEST, 1.0, DRAWN) * 0.5 / controller.sample_time
    return frequency, response(drivetrain, drive, delay, frequency)


def judged(
    frequency: Array, left: Any, passed: Array, rate: float, corner: float, advance: int
) -> Convergence:
    """Return the condition from the remaining error after a repetition and the gain of Q, by frequency."""
    size = np.abs(passed * left)
    place = int(np.argmax(size))
    return Convergence(float(size[place]), float(frequency[place]), rate, corner, advance)


def over_time(
    axis: Axis, controller: Controller, rate: float, corner: float, advance: int, delay: float = 0.0
) -> Convergence:
    """Return the condition for learning over time.

    Parameters
    ----------
    axis : Axis
    controller : Controller
        Without the learned feedforward.
    rate : float
        L, the share of the loop's torque that a repetition adds.
    corner : float
        Of Q, Hz.
    advance : int
        Samples by which it is applied earlier.
    delay : float
        Delay of the torque, samples.

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
    """Return the condition with the highest corner of Q, and the advance, with which it is at most `KEPT`.

    Parameters and errors as for `over_time`.

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
    """Return the condition for learning over the angle at the fastest motion, which has the highest frequencies.

    Parameters
    ----------
    axis, controller, rate, delay
        As of `over_time`.
    width : float
        Of a bin, rad.
    speed : float
        Largest velocity of the reference, rad/s.

    Raises
    ------
    InputError
        If the loop has no linear form, or is not stable.
    """
    frequency, taken = answers(axis, controller, delay)
    waves = frequency * width / speed  # per bin: the map contains no waves finer than two bins
    seen = waves <= 0.5
    passed = bin_response(waves[seen])
    corner = 0.182 * speed / width  # where cos² of pi times waves a bin is 0.71
    return judged(frequency[seen], 1.0 - rate * taken[seen], passed, rate, corner, 0)
