"""What a file holds besides the law, and what its user must know of an export."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, cast

from stickslip.control.controller import Controller
from stickslip.control.recommended import Recommended, recommended_in
from stickslip.core.config import Table
from stickslip.core.messages import axis_unit, name_option
from stickslip.exports.controllers import depends_on, given_by
from stickslip.exports.job import Job
from stickslip.exports.nearest import read_by
from stickslip.exports.target import Target
from stickslip.machines.angle import AngleMap

SLOW = 0.02
"""s: sample times above it are told; a tenth of a period of 5 Hz."""


def axis_of(content: Table) -> dict[str, float]:
    """The numbers that a file holds of its axis: inertia, offset, gravity, ..."""
    axis: object = content.values.get("axis", {})
    known = cast("dict[str, Any]", axis) if isinstance(axis, dict) else {}
    return {k: float(v) for k, v in known.items() if isinstance(v, (int, float)) and math.isfinite(v)}


def constant_torque(content: Table) -> float:
    """The constant torque, in addition to friction, that a file holds of its axis or, where it is a map of the angle,
    its mean over a revolution, N·m."""
    if content.has("angle"):
        return AngleMap.of(content.table("angle").values).offset
    return axis_of(content).get("offset", 0.0)


def notes_on(content: Table, job: Job) -> Iterator[str]:
    """What the user must know of the export of a law: what the file holds besides it, and is left out."""
    yield from other_recommendation(content)
    yield from other_torques(content, 0.0, job.settings)


def notes_on_controller(
    content: Table, made: Controller, compensator: str | None, offset: float = 0.0
) -> Iterator[str]:
    """What the user must know of a controller besides what the target says; ``offset``: the constant torque in it."""
    if read := depends_on(made):
        yield f"friction depends on {read}: set load and temperature in every sample, position and time it keeps itself"
    if compensator is None:
        yield from angle_left_out(content)
        return
    yield from other_torques(content, offset, {})
    yield f"it gives {given_by(made)}"
    time = made.sample_time
    if time > SLOW:
        yield (
            f"a sample time of {time:g} s compensates a reversal up to {time:g} s late, and a loop tolerates it "
            "up to some "
            f"{0.1 / time:.2g} Hz only; give {name_option('sample_time')} in seconds"
        )
    if compensator == "recommended":
        found = recommended_in(content)
        what = "the loop of" if found.gains else f"a PD of {found.bandwidth:.4g} Hz:"
        gains = ", ".join(f"{k} {v:.5g}" for k, v in found.linear._asdict().items() if v or k == "feed")
        within = f" and both torques together within ±{found.torque_limit:.5g} {axis_unit('N·m')}"
        limit = within if math.isfinite(found.torque_limit) else ""
        yield f"it was tried with {what} {gains}{limit}; the linear controller is not in the export"
        yield from angle_left_out(content)
    else:
        yield from other_recommendation(content)


def angle_left_out(content: Table) -> Iterator[str]:
    """That a recommendation's torque over the angle is not in its export."""
    if content.has("recommended") and content.has("angle"):
        yield (
            "what the file knows of the angle ([angle]) is not in the export but for the mean of the torque beside "
            "friction: `stickslip rig run track` runs it"
        )


def around_of(chosen: Target, job: Job) -> Iterator[str]:
    """Where the target finds what the law depends on."""
    if (read := read_by(job.model)) and chosen.around:
        yield f"friction depends on {read}: {chosen.around}"


def in_words(found: Recommended) -> str:
    """What a file recommends, with its numbers."""
    units = {
        "lead": " s",
        "deadband": f" {axis_unit('rad/s')}",
        "filter": " Hz",
        "offset": f" {axis_unit('N·m')}",
        "inertia_feedforward": f" {axis_unit('kg·m²')}",
    }
    more = [
        f", {k.replace('_', ' ')} {getattr(found, k):.4g}{u}" for k, u in units.items() if getattr(found, k)
    ]
    return f"{found.compensator} with gain {found.gain:.4g}{''.join(more)}"


def other_recommendation(content: Table) -> Iterator[str]:
    """That the file recommends what is not in the export."""
    if content.has("recommended"):
        yield (
            f"{content.document.name} recommends {in_words(recommended_in(content))}: that is not in this export; "
            "`--to c99 --compensator recommended` (or another target that carries controllers) writes it"
        )


def other_torques(content: Table, given: float, settings: Mapping[str, object]) -> Iterator[str]:
    """Torques besides friction that the file holds and that are not in the export, which gives a constant torque."""
    known = axis_of(content)
    offset, gravity = constant_torque(content), known.get("gravity", 0.0)
    if offset and offset != given and "offset" not in settings:
        constant = f"{offset:.4g} {axis_unit('N·m')}"
        yield f"the constant torque of {constant} that acts in addition to friction is not in the export"
    if gravity and "gravity" not in settings:
        yield (
            f"gravity, up to {gravity:.4g} {axis_unit('N·m')} over the angle, acts in addition to friction and "
            "is not in the "
            "export: add gravity sin(q - gravity_angle) of the file's [axis] to the drive's torque"
        )
