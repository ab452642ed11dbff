"""Notes on the motion: its source, its jumps, and the attribute on which the error left depends most."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from stickslip.core.messages import name_option
from stickslip.identification.identified_file import Identified
from stickslip.machines.rigid import RigidAxis
from stickslip.recommendation.candidate_run import Drive
from stickslip.recommendation.candidates import Candidate
from stickslip.recommendation.course import measured
from stickslip.recommendation.separation import dependence

APART = 1.5
"""Ratio of both medians of the remaining error above which an attribute is reported."""


def on_motion(drive: Drive, angle: str) -> Iterator[str]:
    """Return the notes on a motion that is not the drive's reference, or that no axis can follow; `angle` is the
    unit."""
    course = drive.course
    if drive.motion is not None and measured(course.judged):
        yield (
            "The motion is the measured position, smoothed, since its log has no reference. The drive's own may "
            "differ: where it steps, or asks for more than the axis can follow, an error is left that no compensator "
            f"takes away, and the reduction is smaller than said here. Give the reference with {name_option('motion')}."
        )
    if course.jumps:
        often = f"{len(course.jumps)} times" if len(course.jumps) > 1 else "once"
        yield (
            f"The reference steps {often}, by up to {course.highest_jump:.3g} {angle}, which no axis "
            f"follows at once. {_at_jumps(drive)}"
        )


def _at_jumps(drive: Drive) -> str:
    """Return the reference velocity that is simulated at jumps of the position, as text."""
    if drive.reference_velocity == "difference":
        return "The drive differentiates it: the jump of the reference velocity is simulated."
    return (
        "Its velocity and acceleration are taken as 0 at a step, as in a drive that feeds nothing forward there; one "
        "that differentiates a step gets a kick, which is not simulated."
    )


def by_attribute(found: Identified, chosen: Candidate | None, plants: Sequence[RigidAxis]) -> Iterator[str]:
    """Return the sampled attribute on which the remaining error depends most, from the axes of the confirmation."""
    if chosen is None or len(chosen.errors) < len(plants):
        return
    most = dependence(found, plants[1:], chosen.errors[1 : len(plants)], APART)
    if most is not None:
        split, worse, better = most
        yield (
            f"The error left depends most on {split.attribute.name}: {100.0 * worse:.2g} % on half of the sampled "
            f"axes {split.side(split.above)}, {100.0 * better:.2g} % on half of those {split.side(not split.above)}. "
            f"To know it: {split.remedy}."
        )
