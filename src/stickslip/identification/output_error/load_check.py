"""Whether records distinguish friction that grows with the gearing's load from friction that does not.

With T = J a + T_outer + f sign(v) (1 + l |T|), and a drive that never brakes, |T| sign(v) is T itself, so (1 - l f) T =
J a + T_outer + f sign(v): greater J, T_outer and f have the same effect as l, exactly at one speed and nearly at all.
Noise and rounding then decide, which the interval of a least-squares fit does not include. The load's effect is
therefore compared to the part of it that the other parameters explain in motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.core.messages import name_option
from stickslip.identification.estimate import Estimate
from stickslip.identification.regression.inverse import InverseDynamics
from stickslip.simulation.recorded_input.simulation import Mechanics

Array = np.ndarray[Any, np.dtype[np.float64]]

LEAST = 0.1
"""Least part of the load's effect that no other parameter explains, for it to be distinguished: below it, estimates of
load_motor are biased."""
MOVING = 0.05
"""Least speed of a moving axis, part of the usual (RMS) speed: reversals would resemble an effect of the load."""
SURE = 3.0
"""Standard deviations by which a torque must differ from 0 to count as present."""
OUTER = ("offset", "gravity_", "cos[", "sin[")
"""Names of external torques among the columns of the inverse dynamics."""
ADVICE = (
    "Record decelerations so hard that the drive brakes: only there load-dependent friction can be "
    f"distinguished. Without load_motor ({name_option('load', True)}) the other values hold at the load of "
    "these records."
)


def own_part(inverse: InverseDynamics, mechanics: Mechanics) -> float:
    """Return the part of the load's effect on friction that no other parameter explains: residual norm over norm.

    Parameters
    ----------
    inverse : InverseDynamics
        Its columns are the effects of the other parameters.
    mechanics : Mechanics
        With load_motor and load_external: if both act, their sum may change sign.
    """
    speed, torque = inverse.velocity, inverse.torque
    moving = np.abs(speed) > MOVING * float(np.sqrt(np.mean(speed**2)))
    outside = [i for i, n in enumerate(inverse.names) if n.startswith(OUTER)]
    outer: Array = inverse.matrix[:, outside] @ inverse.values[outside]
    carried = (mechanics.load_motor or 1e-9) * torque + mechanics.load_external * outer
    side = np.sign(speed) * np.where(carried < 0.0, -1.0, 1.0)
    others = [inverse.matrix, (side * outer)[:, None]] if mechanics.load_external else [inverse.matrix]
    effect = (side * torque)[moving]
    known = np.hstack(others)[moving]
    left: Array = effect - known @ np.linalg.lstsq(known, effect, rcond=None)[0]
    return float(np.linalg.norm(left) / np.linalg.norm(effect))


def tells_external(inverse: InverseDynamics) -> bool:
    """Return whether records determine the share of a constant outer torque in the load.

    This requires such a torque and a drive that brakes: otherwise the share is equivalent to the level of friction.
    """
    if not inverse.has("offset"):
        return False
    place = inverse.names.index("offset")
    there = abs(inverse.values[place]) > SURE * inverse.robust_std[place]
    return bool(there) and own_part(inverse, Mechanics(1.0, load_motor=1.0, load_external=1.0)) >= LEAST


def own_part_external(inverse: InverseDynamics, mechanics: Mechanics) -> float:
    """Return `own_part` of the load due to external torques, with load_motor held.

    For a drive that never brakes, a constant external torque has the same effect as more friction.
    """
    speed = inverse.velocity
    moving = np.abs(speed) > MOVING * float(np.sqrt(np.mean(speed**2)))
    outside = [i for i, n in enumerate(inverse.names) if n.startswith(OUTER)]
    outer: Array = inverse.matrix[:, outside] @ inverse.values[outside]
    carried = mechanics.load_motor * inverse.torque + (mechanics.load_external or 1e-9) * outer
    effect = (np.sign(speed) * np.where(carried < 0.0, -1.0, 1.0) * outer)[moving]
    known = inverse.matrix[moving]
    left: Array = effect - known @ np.linalg.lstsq(known, effect, rcond=None)[0]
    whole = float(np.linalg.norm(effect))
    return float(np.linalg.norm(left)) / whole if whole > 0.0 else 0.0


def judged_external(
    estimates: Sequence[Estimate], inverse: InverseDynamics | None, mechanics: Mechanics
) -> tuple[Estimate, ...]:
    """Return the estimates; without load_external, neither it nor the torques of friction are identified."""
    own = own_part_external(inverse, mechanics) if inverse is not None else 0.0
    if own >= LEAST:
        return tuple(estimates)
    torque = next(e.unit for e in estimates if e.name == "load_external").removeprefix("1/").strip("()")
    why = {
        e.name: "it goes with load_external, which is not identified"
        for e in estimates if e.identified and e.unit == torque and not e.name.startswith(OUTER)
    }  # fmt: skip
    why["load_external"] = (
        f"all but {100.0 * own:.2g} % of its effect looks like more friction; identified means at least "
        f"{100.0 * LEAST:g} %"
    )
    return tuple(replace(e, identified=False, verdict=why[e.name]) if e.name in why else e for e in estimates)


def judged_load(
    estimates: Sequence[Estimate], inverse: InverseDynamics | None, mechanics: Mechanics
) -> tuple[Estimate, ...]:
    """Return the estimates; if load_motor is undetermined, neither it nor the parameters coupled to it are identified.

    All torques and inertias are coupled to it, since they scale alike. With load_motor held, only the level of friction
    is coupled to load_external.
    """
    names = {e.name for e in estimates}
    if "load_motor" not in names:
        return (
            judged_external(estimates, inverse, mechanics) if "load_external" in names else tuple(estimates)
        )
    own = own_part(inverse, mechanics) if inverse is not None else 0.0
    why: dict[str, str] = {}
    if own < LEAST:
        tied = [e.name for e in estimates if e.identified and e.unit.startswith(("N", "kg"))]
        why = dict.fromkeys([*tied, "load_external"], "it goes with load_motor, which is not identified")
        why["load_motor"] = (
            "without the inverse dynamics its effect cannot be distinguished from that of friction and inertia"
            if inverse is None
            else f"all but {100.0 * own:.2g} % of its effect looks like more friction and inertia; identified means at "
            f"least {100.0 * LEAST:g} %"
        )
    return tuple(replace(e, identified=False, verdict=why[e.name]) if e.name in why else e for e in estimates)
