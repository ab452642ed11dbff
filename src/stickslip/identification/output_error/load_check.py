"""Whether records tell friction that grows with the load of the gearing from friction that does not.

With T = J a + T_outer + f sign(v) (1 + l |T|), and a drive that never brakes, |T| sign(v) is T itself, so that
(1 - l f) T = J a + T_outer + f sign(v): greater J, T_outer and f do what l does, exactly at one speed and nearly so at
all. What noise and rounding leave then decides, and the interval of a least-squares fit does not know it. So the
load's effect is compared with what the other parameters explain of it, where the axis moves.
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
"""Part of the load's effect that nothing else explains, from which on it is told apart. Simulated axes of load_motor
0.8 came out between 0.1 and 0.7 where that part was below 0.06, and within 6 % of 0.8 where it was above 0.14."""
MOVING = 0.05
"""Of the usual (RMS) speed, from which on an axis counts as moving: reversals would pass for an effect of the load."""
SURE = 3.0
"""Standard deviations by which a torque differs from 0 where it is taken as there."""
OUTER = ("offset", "gravity_", "cos[", "sin[")
"""Names of the torques from outside among the columns of the inverse dynamics."""
ADVICE = (
    "Record decelerations so hard that the drive brakes: only there load-dependent friction can be "
    f"distinguished. Without load_motor ({name_option('load', True)}) the other values hold at the load of "
    "these records."
)


def own_part(inverse: InverseDynamics, mechanics: Mechanics) -> float:
    """Part of the load's effect on friction that no other parameter has: norm of what is left over the whole norm.

    Parameters
    ----------
    inverse : InverseDynamics
        Whose columns are the effects of the other parameters.
    mechanics : Mechanics
        With load_motor and load_external: where both act, their sum may turn its sign.
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
    """Whether records show a constant outer torque's own share of the load: the torque is there, and the drive brakes.

    Where the drive never brakes, that share is one with the level of friction.
    """
    if not inverse.has("offset"):
        return False
    place = inverse.names.index("offset")
    there = abs(inverse.values[place]) > SURE * inverse.robust_std[place]
    return bool(there) and own_part(inverse, Mechanics(1.0, load_motor=1.0, load_external=1.0)) >= LEAST


def own_part_external(inverse: InverseDynamics, mechanics: Mechanics) -> float:
    """As `own_part`, of the load that torques from outside make, with load_motor held: a constant one loads a drive
    that never brakes as more friction would."""
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
    """The estimates; where the records do not tell load_external, neither it nor the torques of friction are."""
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
    """The estimates; where the records do not tell load_motor, neither it nor what goes with it is identified.

    All torques and inertias go with it: they scale alike. With load_motor held, load_external alone goes with the level
    of friction.
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
