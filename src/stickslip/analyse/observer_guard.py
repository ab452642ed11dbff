"""Check whether a LuGre observer (Canudas de Wit et al. 1995) may be switched on.

The observer feeds the stiffness sigma0 back to a sticking axis. This positive feedback is stable only below a limit
near the contact's own stiffness, which follows exactly from the sampled loop on the sticking axis. In addition, one
encoder count must be too small to make the bristle slide.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.analyse.controller_loop import LinearController, linearised
from stickslip.analyse.presliding_loop import Loop
from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.core.errors import ParameterError
from stickslip.machines.drivetrain import Drivetrain, LinearContact

Array = np.ndarray[Any, np.dtype[np.float64]]
CLOSE = 1e-3
"""Relative accuracy of the largest stiffness."""


@dataclass(frozen=True)
class Ratios:
    """Ratios of the condition of strict positive realness: if each is at least 1, the observer's error decays.

    Attributes
    ----------
    velocity : float
        sigma1 K_v / (sigma0 J): damping of the loop relative to the feedback of the bristle. Infinite for a velocity
        loop.
    integral : float
        sigma0 K_p / (sigma1 K_i): infinite without an integral.
    """

    velocity: float
    integral: float

    @property
    def certified(self) -> bool:
        """Whether both are met; otherwise the condition makes no statement, and a simulation decides."""
        return self.velocity >= 1.0 and self.integral >= 1.0

    def __str__(self) -> str:
        word = "certified" if self.certified else "not certified: a simulation decides"
        return (
            f"sigma1 Kv / (sigma0 J) = {self.velocity:.3g}, sigma0 Kp / (sigma1 Ki) = {self.integral:.3g} "
            f"(each must be at least 1): {word}"
        )


def positive_real_ratios(
    sigma0: float,
    sigma1: float,
    inertia: float,
    kp: float,
    kv: float,
    ki: float = 0.0,
    *,
    position: bool = True,
) -> Ratios:
    """Return the condition in closed form, Canudas de Wit et al. 1995.

    Parameters
    ----------
    sigma0, sigma1 : float
        Of the observer, N·m/rad and N·m·s/rad.
    inertia : float
        kg·m²
    kp, kv, ki : float
        Gains of the loop on position error, velocity error and integral, N·m/rad, N·m·s/rad, N·m/(rad·s); for a
        velocity loop ``kp`` and ``ki`` are those of its PI.
    position : bool
        Whether it is a position loop; a velocity loop must meet only the second ratio.
    """
    velocity = sigma1 * kv / (sigma0 * inertia) if position else math.inf
    integral = sigma0 * kp / (sigma1 * ki) if sigma1 * ki > 0.0 else math.inf
    return Ratios(velocity, integral)


def stuck_radius(
    controller: Controller, inertia: float, stiffness: float, damping: float = 0.0, delay: int = 0
) -> float:
    """Return the largest magnitude of an eigenvalue of the loop on a sticking axis: stable below 1.

    Parameters
    ----------
    controller : Controller
    inertia, stiffness, damping : float
        Of the axis, kg·m²; of its sticking contact, N·m/rad and N·m·s/rad.
    delay : int
        Delay of the torque, samples.
    """
    drivetrain = Drivetrain((inertia,), contact=LinearContact(stiffness, damping))
    drive = LinearController(about_rest(controller), controller.sample_time, float(delay))
    return Loop(drivetrain, drive).poles().radius


def about_rest(controller: Controller) -> tuple[Array, Array, Array, float]:
    """Return A, B, C, D from the angle of the controller about rest, where its bristle is a spring driven by the
    velocity.

    States: those of the other blocks, the deflection of the bristle, and the angle one sample ago.
    """
    part = part_of(controller)
    if controller.blocks["estimator"].law.name != "backward_difference":
        raise ParameterError(
            "observer: its check requires the velocity as a backward difference; leave estimator out"
        )
    p, time = controller.blocks[part].parameters, controller.sample_time
    others = [b for name, b in controller.blocks.items() if b.law.place == "observer" and name != part]
    rest = linearised(replace(controller, observer=others or None), math.inf, 1.0).state_space()
    n = rest[0].shape[0]
    a, b, c = np.zeros((n + 2, n + 2)), np.zeros((n + 2, 1)), np.zeros((1, n + 2))
    a[:n, :n], b[:n], c[:, :n] = rest[:3]
    a[n, n], a[n, n + 1], b[n], b[n + 1] = 1.0, -1.0, 1.0 - p.correction * time, 1.0
    viscous = p.gain * p.sigma2 / time
    c += p.gain * p.sigma0 * a[n]
    c[0, n + 1] -= viscous
    return a, b, c, rest[3] + p.gain * p.sigma0 * float(b[n, 0]) + viscous


def largest_stiffness(
    controller: Controller, inertia: float, stiffness: float, damping: float = 0.0, delay: int = 0
) -> float:
    """Return the sigma0 of its LuGre observer up to which the loop on the sticking axis is stable, N·m/rad.

    Parameters as for `stuck_radius`.

    Raises
    ------
    ParameterError
        If the controller has no LuGre observer.
    """
    part = part_of(controller)
    bare = controller.with_values({f"{part}_sigma0": 1e-3 * stiffness})
    least = max(stuck_radius(bare, inertia, stiffness, damping, delay), 1.0)

    def holds(sigma0: float) -> bool:
        own = controller.with_values({f"{part}_sigma0": sigma0})
        return stuck_radius(own, inertia, stiffness, damping, delay) <= least + 1e-9

    good, bad = 0.0, 4.0 * stiffness
    while bad - good > CLOSE * stiffness:
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good


def part_of(controller: Controller) -> str:
    """Return the name of the block with its LuGre observer."""
    for part, block in controller.blocks.items():
        if block.law.name == "lugre_observer":
            return part
    raise ParameterError("largest_stiffness: the controller has no lugre_observer; give it one")


def objection(
    controller: Controller, inertia: float, stiffness: float, counts: float = 0.0, damping: float = 0.0,
    delay: int = 0,
) -> str:  # fmt: skip
    """Return the reason why its LuGre observer must not be switched on, as a sentence, or "".

    Parameters
    ----------
    controller : Controller
    inertia, stiffness, damping, delay
        As of `stuck_radius`.
    counts : float
        Encoder counts per revolution; 0: exact.
    """
    p: ControlBlock = controller.blocks[part_of(controller)]
    sigma0, gain, fc = p.parameters.sigma0, p.parameters.gain, p.parameters.fc
    limit = largest_stiffness(controller, inertia, stiffness, damping, delay)
    if sigma0 >= limit:
        return (
            f"its stiffness {gain:g} x {sigma0:g} N·m/rad is given back to a contact of {stiffness:g} N·m/rad, and is "
            f"stable at rest only below {limit:.0f} N·m/rad"
        )
    count = 2.0 * math.pi / counts if counts else 0.0
    if sigma0 * count >= fc:
        return (
            f"one count of the encoder, {count:.3g} rad, bends its bristle by {sigma0 * count:.3g} N·m, as much as "
            f"slides ({fc:g} N·m)"
        )
    return ""
