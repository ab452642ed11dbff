"""Test a loop at long rest: with an integral, one cycle may take seconds, which a short rest does not show."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from stickslip.control.controller import Controller
from stickslip.identify.fit.parallel import in_turn
from stickslip.identify.identified_file import Identified
from stickslip.recommend.candidate_run import Trial
from stickslip.recommend.candidates import Bench
from stickslip.recommend.following import simulated
from stickslip.recommend.ringing import against_friction, integral_of
from stickslip.recommend.swings import back_and_forth, between_counts

RESTS = 20.0
"""s at rest, of which the second half is judged: an integral that is reset on a soft contact cycles in 6 to 12 s."""
OFF = (0.0, 1.0)
"""Times its error along the motion, by which the reference then moves on, for each of two rests."""
MORE = 1.5
"""Times the linear controller's widest swing, from which on a compensator is what hunts."""
HUNTS = f"hunts at rest within {RESTS:g} s"
ASKED = 8
"""Axes on which a loop with an integral part rests for so long."""


def swing_for_long(controller: Controller, bench: Bench, axis: int, off: float = 0.0) -> float:
    """What it goes to and fro by at rest long after the motion on one of the axes, rad; 0 where that is within an
    encoder's counts or a part of the linear controller's error, infinite where it diverges.

    It rests `off` times that error beside where the motion ends: an integral that stops near there by luck would break
    away much later.
    """
    drive, before = bench.drive, bench.before(axis)
    assert isinstance(before, Trial)
    last = drive.reference[-1] * np.array([1.0, 0.0, 0.0])
    last[0] += off * before.moving["position_rms_rad"]
    held = np.tile(last, (round(RESTS / drive.sample_time), 1))
    position = simulated(bench.plants[axis], controller, np.vstack([drive.reference, held]))
    bench.ran()
    if position is None:
        return math.inf
    swing = back_and_forth(position[-held.shape[0] // 2 :])
    most = max(before.swing(drive), between_counts(drive.encoder_counts))
    return swing if swing > most else 0.0


def swings_for_long(controller: Controller, bench: Bench) -> Iterator[float]:
    """Yield the wider of both swings on each of the first axes, where the motion ends and beside it, rad."""
    axes = [i for i in range(min(ASKED, len(bench.plants))) if isinstance(bench.before(i), Trial)]
    places = [(i, off) for i in axes for off in OFF]
    swings = in_turn(lambda place: swing_for_long(controller, bench, *place), places)
    for _ in axes:
        yield max(itertools.islice(swings, len(OFF)))


def alone_for_long(bench: Bench) -> list[float]:
    """Return the same of the linear controller alone, simulated once; nothing for one without an integral part."""
    if bench.rested is None:
        bench.rested = list(swings_for_long(bench.linear, bench)) if integrates(bench.linear) else []
    return bench.rested


def hunts_with(controller: Controller, bench: Bench) -> str:
    """Return that an integral part hunts with a compensator, and not, or by far less, alone; else ""."""
    alone = alone_for_long(bench)
    if not alone:
        return ""
    most = MORE * max(alone)
    return HUNTS if any(swing > most for swing in swings_for_long(controller, bench)) else ""


def hunts_alone(bench: Bench, torque: str) -> str:
    """That the linear controller alone hunts within seconds at rest, by how much, why, and what to change; empty where
    it has no integral part or comes to rest.

    Parameters
    ----------
    bench : Bench
    torque : str
        Unit of the torque: that of the swing follows.
    """
    swings, gains = alone_for_long(bench), bench.linear.gains
    found = [swing for swing in swings if swing > 0.0]
    if not found:
        return ""
    on = f"on {len(found)} of {len(swings)} axes" if len(swings) > 1 else "on the best estimate"
    why = (
        against_friction(gains, bench.drive.given)
        if gains is not None
        else "its integral part hunts against the friction at rest; lower it, or hold it while the error is small"
    )
    widest, unit = max(found), "m" if torque == "N" else "rad"
    size = f"by up to {widest:.2g} {unit} peak to peak" if math.isfinite(widest) else "it diverges"
    return f"at rest {on} within {RESTS:g} s ({size}): {why}"


def long_rests(loop: Controller) -> int:
    """Runs at rest for long, of the loop alone and with what is recommended, about."""
    return 2 * ASKED * len(OFF) if integrates(loop) else 0


def integrates(loop: Controller) -> bool:
    """Whether a part of the loop grows as long as there is an error."""
    if loop.gains is not None:
        return integral_of(loop.gains)[1] > 0.0
    return any(block.law.integrates for block in loop.blocks.values())


def unsure_at_rest(found: Identified, loop: Controller) -> tuple[str, ...]:
    """That nothing tells whether the integral part hunts, where the record does not tell friction at rest."""
    fields = {f.name for f in found.model.law.fields}
    told = {e.name for e in found.law_estimates[0] if e.identified}
    if not integrates(loop) or "fc" not in fields or "fs" in told:
        return ()
    return (
        "Whether the integral part hunts at rest, for seconds at a time, is not told: friction at rest (fs) is not "
        "identified. Watch the axis stand still for half a minute after a move.",
    )
