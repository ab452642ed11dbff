"""The dead travel of an axis's motor at its reversals, as the doctor finds it, added to the axis's other numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stickslip.core.record import Record
from stickslip.identification.doctor.play import dead_travel
from stickslip.identification.doctor.view import View
from stickslip.identification.estimate import Estimate, Identification
from stickslip.identification.experiment import Experiment
from stickslip.machines.servo import ServoAxis

HOLDS_ZERO = "its interval holds 0"


def with_dead_travel(
    found: Identification, experiments: Sequence[Experiment], axis: ServoAxis
) -> Identification:
    """Return the axis's result with ``dead_travel``, if a record shows one; of several the most often seen."""
    unit, force = axis.unit("rad"), axis.unit("N·m")
    seen = [
        one
        for t in experiments
        if t.drive is not None and not t.closed_loop
        and (one := dead_travel(View(Record(
            t.time, {"position": t.position, "motor_torque": t.torque(axis, t.velocity())},
            {"position": unit, "motor_torque": force},
        )))) is not None
    ]  # fmt: skip
    if not seen:
        return found
    best = max(seen, key=lambda one: one.reversals)
    verdict = "" if best.lower > 0.0 else HOLDS_ZERO
    estimate = Estimate(
        "dead_travel", unit, "b", best.value, best.std, best.lower, best.upper, not verdict, verdict
    )
    correlation = np.eye(len(found.estimates) + 1)
    correlation[:-1, :-1] = found.correlation
    note = (
        f"Backlash: at {best.reversals} reversals the motor travels {best.value:.2g} {unit} before it takes the load "
        "along. What only reversals show (pre-sliding friction) is not the contact's."
    )
    return replace(
        found, estimates=(*found.estimates, estimate), correlation=correlation, notes=(*found.notes, note)
    )
