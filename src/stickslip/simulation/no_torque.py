"""What is said of a controller that gives no number: which law, in which sample, and what it was handed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.control.composition import MEMORY
from stickslip.control.controller import Controller

HANDED = (
    "position",
    "velocity",
    "reference",
    "reference_velocity",
    "reference_acceleration",
    "error",
    "applied",
)
"""Of what a law sees, what is shown."""
PLACES = [f.name for f in MEMORY]


def no_torque(controller: Controller, memory: Any, time: float, sample_time: float) -> str:
    """Why a run ended in a sample whose torque is no number, in one sentence.

    Parameters
    ----------
    controller : Controller
    memory : array
        Of its composition, as that sample left it (`stickslip.simulation.compiled_controller.Sampled`).
    time, sample_time : float
        s
    """
    seen = dict(zip(PLACES, np.asarray(memory, dtype=float).tolist()))
    number = round(time / sample_time) + 1
    if seen["waited"] > 0.0:
        return (
            f"in sample {number} (of {sample_time:g} s each) the controller was handed a position or a reference that "
            "is no number or beyond 1e9; correct the reference, or a law that lets the axis run away"
        )
    units = {f.name: f.par.unit for f in MEMORY}
    shown = ", ".join(f"{name} = {seen[name]:.6g} {units[name]}" for name in HANDED)
    return (
        f"{_suspects(controller, seen)} gave no finite number in sample {number} (of {sample_time:g} s each); "
        f"it was handed {shown}; look for a division by 0, a root of a negative number or an overflow there"
    )


def _suspects(controller: Controller, seen: dict[str, float]) -> str:
    """The laws of the first place of which a number is missing; of the last two where none of the others is."""
    places = ("observer", "loop")
    if not math.isfinite(seen["velocity"]):
        places = ("estimator",)
    elif not math.isfinite(seen["feedforward"]):
        places = ("feedforward",)
    named = [
        f"the {block.law.place} {block.law.name!r}"
        for block in controller.blocks.values()
        if block.law.place in places
    ]
    return " or ".join(named)
