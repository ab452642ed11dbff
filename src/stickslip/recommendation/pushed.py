"""Push a feedback at rest: check whether the motion decays as with the linear controller alone.

A compensator that uses the measured velocity may rest and still have a limit cycle near that rest, which noise, a
changing load or a hand can start: velocity filter, delay and the law's own springs reverse its torque later than the
motion. Therefore a resting axis is also pushed out of the position at which it sticks.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from stickslip.control.controller import Controller
from stickslip.identification.fit.parallel import in_turn
from stickslip.machines.rigid import RigidAxis
from stickslip.models.friction_levels import static_level
from stickslip.recommendation.candidate_run import BUSY, Drive
from stickslip.recommendation.following import simulated
from stickslip.recommendation.swings import back_and_forth, repeats, turns

Array = np.ndarray[Any, np.dtype[np.float64]]

PUSHES = (0.8, 1.0, 1.5, 2.0)
"""Sizes of the pushes, relative to the break-away torque."""
FINER = tuple(0.8 + 0.1 * step for step in range(15))
"""The same for the linear controller alone, whose integral may hunt after some of them."""
MORE = 1.5
"""Multiple of the linear controller's largest swing above which a compensator is worse."""
PUSHED = 10e-3
"""Longest duration of a push, s."""
BEFORE, AFTER, JUDGED = 0.2, 3.0, 2.0
"""Rest before and after a push, and its evaluated last part, s."""


def pushes(plant: RigidAxis, drive: Drive, shares: Sequence[float] = PUSHES) -> Iterator[Array]:
    """Return the torques at every sample, N·m: each ends before the axis reaches the motion's own top speed."""
    friction = plant.friction
    held = max(static_level(friction), static_level(friction, -1.0)) if friction.law.steady else 0.0
    time = drive.sample_time
    if not 0.0 < held < math.inf:
        return
    for share in shares:
        longest = min(PUSHED, drive.path.top_speed * plant.inertia / (share * held))
        push = np.zeros(round((BEFORE + AFTER) / time))
        begin = round(BEFORE / time)
        push[begin : begin + max(1, round(longest / time))] = share * held
        yield push


def swings(
    plant: RigidAxis, controller: Controller, drive: Drive, least: float, shares: Sequence[float] = PUSHES
) -> Iterator[float]:
    """Return the swing long after each push, rad; 0 if it is at most `least`, infinite if it diverges."""

    def after(push: Array) -> float:
        position = simulated(plant, controller, np.zeros((push.size, 3)), push=push)
        if position is None:
            return math.inf
        late = position[-round(JUDGED / drive.sample_time) :]
        on = turns(late, least) > BUSY * JUDGED and repeats(late, least)
        return back_and_forth(late) if on else 0.0

    yield from in_turn(after, pushes(plant, drive, shares))


class AfterPushes:
    """Swings of the linear controller alone after pushes on one axis, simulated on demand."""

    def __init__(self, plant: RigidAxis, linear: Controller, drive: Drive, least: float) -> None:
        self._found, self._remaining = [0.0], swings(plant, linear, drive, least, FINER)

    def reach(self, swing: float) -> bool:
        """Return whether `MORE` times the largest of them is at least this swing, rad."""
        while MORE * max(self._found) < swing:
            if (further := next(self._remaining, None)) is None:
                return False
            self._found.append(further)
        return True


def swings_on(
    plant: RigidAxis, controller: Controller, drive: Drive, least: float, alone: AfterPushes
) -> bool:
    """Return whether it continues to swing after a push, by more than `MORE` times the linear controller's swing."""
    return any(not alone.reach(swing) for swing in swings(plant, controller, drive, least) if swing > 0.0)
