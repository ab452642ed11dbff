"""What the user must know of the motion: whose it is, where it jumps, and how the drive forms its velocity."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import median

import numpy as np

from stickslip.machines.rigid import RigidAxis
from stickslip.recommend.candidate_run import Drive
from stickslip.recommend.candidates import Candidate
from stickslip.recommend.course import measured
from stickslip.recommend.plant import Plant

APART = 1.5
"""Times the error left on half of the axes of one kind, from which on it matters which kind the drive is, where three
quarters of the one kind leave more than three quarters of the other."""


def on_motion(drive: Drive, angle: str) -> Iterator[str]:
    """Where the motion is not the drive's reference, or no axis can follow it; `angle` is the unit of positions."""
    course = drive.course
    if drive.motion is not None and measured(course.judged):
        yield (
            "The motion is the measured position, smoothed, since its log has no reference. The drive's own may "
            "differ: where it steps, or asks for more than the axis can follow, an error is left that no compensator "
            "takes away, and the reduction is smaller than said here. Give the reference with --motion (Python: "
            "motion=)."
        )
    if course.jumps:
        often = f"{len(course.jumps)} times" if len(course.jumps) > 1 else "once"
        yield (
            f"The reference steps {often}, by up to {course.highest_jump:.3g} {angle}, which no axis "
            "follows at once. Its velocity and acceleration are taken as 0 at a step, as in a drive that feeds nothing "
            "forward there; one that differentiates a step gets a kick, which is not simulated."
        )


def by_reference_velocity(chosen: Candidate | None, plants: Sequence[RigidAxis]) -> Iterator[str]:
    """Whether it matters how the drive forms its reference velocity, by the axes on which it was confirmed."""
    if chosen is None:
        return
    drawn = list(zip(plants, chosen.errors, strict=False))[1:]
    backward, instant = (
        [error for plant, error in drawn if isinstance(plant, Plant) and plant.backward is kind]
        for kind in (True, False)
    )
    if not backward or not instant:
        return
    mean, there = median(backward), median(instant)
    less, more = sorted((backward, instant), key=median)
    if median(more) <= APART * median(less) or np.quantile(more, 0.25) <= np.quantile(less, 0.75):
        return
    which = "difference of two setpoints" if mean < there else "velocity of the instant"
    yield (
        f"What is left depends on the drive's reference velocity: {100.0 * mean:.2g} % of the error on half of the "
        f"sampled axes where it is the difference of two setpoints over the sample time, as the measured velocity is, "
        f"{100.0 * there:.2g} % where it is the velocity of the instant; the {which} is better. The best estimate has "
        "the difference."
    )
