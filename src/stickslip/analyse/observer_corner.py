"""How fast an observer may be: the largest corner with which the sampled loop on a sliding axis is stable, exactly.

The loop is that of the text that runs (`stickslip.analyse.controller_loop`) with the axis as an inertia between two
samples, its torque held and late by whole samples; it is stable where every eigenvalue lies inside the unit circle. An
inertia believed too large and a delay are the dangerous sides.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from stickslip.analyse.controller_loop import linearised
from stickslip.analyse.presliding_loop import Loop
from stickslip.control.controller import Controller
from stickslip.errors import ParameterError
from stickslip.machines.drivetrain import Drivetrain

Array = np.ndarray[Any, np.dtype[np.complex128]]
HIGHEST = 6000.0
"""1/s, up to which corners are tried."""
LOWEST = 10.0
STEP = 1.25
"""Factor between two corners that are tried, before the limit between them is bisected."""
DAMPING = 0.3
"""Damping ratio of every pole with the default corner."""
UNCERTAIN = (0.8, 1.0, 1.25)
"""Inertia over the nominal one with which the default corner keeps it."""


def poles(controller: Controller, inertia: float, delay: int = 0) -> Array:
    """Eigenvalues of the loop from sample to sample on a sliding axis without viscous friction.

    Parameters
    ----------
    controller : Controller
    inertia : float
        Of the axis, kg·m².
    delay : int
        Samples by which the torque acts late.
    """
    drive = linearised(controller, math.inf, 1.0, float(delay))
    found = np.linalg.eigvals(Loop(Drivetrain((inertia,)), drive).matrix())
    return np.asarray(found, dtype=np.complex128)


def damped(values: Array, damping: float) -> bool:
    """Whether every pole lies inside the unit circle and has that damping ratio."""
    sizes = np.abs(values)
    if not float(sizes.max()) < 1.0:
        return False
    logs = np.log(np.where(sizes > 1e-12, values, 1e-12))
    return bool(np.all(-np.real(logs) >= damping * np.abs(logs)))


def largest_corner(
    made: Callable[[float], Controller], inertia: float, delay: int = 0, damping: float = 0.0
) -> float:
    """The corner, 1/s, below which every loop is stable, to 1; `HIGHEST` where all up to there are, 0 where none is.

    Parameters
    ----------
    made : callable
        ``made(corner)``: the controller.
    inertia : float
        Of the axis, kg·m².
    delay : int
        Samples by which the torque acts late.
    damping : float
        Ratio that every pole shall have besides.
    """

    def holds(corner: float) -> bool:
        return damped(poles(made(corner), inertia, delay), damping)

    good, bad = 0.0, LOWEST
    while holds(bad):
        if bad == HIGHEST:
            return HIGHEST
        good, bad = bad, min(bad * STEP, HIGHEST)
    while bad - good > 1.0:
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good


def default_corner(controller: Controller, delay: int = 0) -> float:
    """The largest corner, 1/s, of its disturbance observer with which every pole keeps a damping ratio of `DAMPING`.

    With the nominal inertia off by a quarter up and a fifth down. Where the loop itself has less damping without an
    observer, half of what is stable.

    Raises
    ------
    ParameterError
        If the controller has no disturbance observer.
    """
    part = next((p for p, b in controller.blocks.items() if b.law.name == "disturbance_observer"), "")
    if not part:
        raise ParameterError("default_corner: the controller has no disturbance_observer; give it one")
    nominal = controller.blocks[part].parameters.inertia

    def made(corner: float) -> Controller:
        return controller.with_values({f"{part}_corner": corner})

    kept = min(largest_corner(made, nominal * x, delay, DAMPING) for x in UNCERTAIN)
    return kept or 0.5 * min(largest_corner(made, nominal * x, delay) for x in UNCERTAIN)
