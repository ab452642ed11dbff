"""Test a loop at long rest: with an integral, one cycle may take seconds, which a short rest does not show."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from stickslip.control.controller import Controller
from stickslip.control.linear import Cascade
from stickslip.identification.fit.parallel import in_turn
from stickslip.identification.identified_file import Identified
from stickslip.machines.rigid import RigidAxis
from stickslip.recommendation.candidate_run import Trial
from stickslip.recommendation.candidates import Bench, breakaway
from stickslip.recommendation.following import simulated
from stickslip.recommendation.ringing import against_friction, integral_of
from stickslip.recommendation.swings import back_and_forth, between_counts

RESTS = 20.0
"""s at rest, of which the second half is judged: an integral that is reset on a soft contact cycles in 6 to 12 s."""
LONGEST = 120.0
"""s at rest at most; a loop that needs longer to break away creeps rather than hunts."""
CYCLES = 4.0
"""Times the integral's time to break away: two of them are a cycle, and the second half of the rest is judged."""
OFF = (0.0, 1.0)
"""Times its error along the motion, by which the reference then moves on, for each of two rests."""
MORE = 1.5
"""Times the linear controller's widest swing, from which on a compensator is what hunts."""
HUNTS = "hunts at rest"
ASKED = 8
"""Axes on which a loop with an integral part rests for so long."""


def swing_for_long(controller: Controller, bench: Bench, axis: int, off: float = 0.0) -> float:
    """Return by how much an axis goes back and forth at rest long after the motion, rad.

    0 if that is within an encoder's counts or a part of the linear controller's error; infinite if it diverges. The
    reference rests `off` times that error beside the end of the motion: an integral that stops near there by luck would
    break away much later. The rest lasts `RESTS`, or longer where the integral needs longer to break the axis away
    (`time_to_break_away`).
    """
    drive, before, plant = bench.drive, bench.before(axis), bench.plants[axis]
    assert isinstance(before, Trial)
    last = drive.reference[-1] * np.array([1.0, 0.0, 0.0])
    last[0] += off * before.moving["position_rms_rad"]
    most = max(before.swing(drive), between_counts(drive.encoder_counts))
    rest, needed = 0.0, RESTS
    while rest < min(needed, LONGEST):
        rest = min(needed, LONGEST)
        held = np.tile(last, (round(rest / drive.sample_time), 1))
        position = simulated(plant, controller, np.vstack([drive.reference, held]))
        bench.ran()
        bench.longest_rest = max(bench.longest_rest, rest)
        if position is None:
            bench.hunted_within = max(bench.hunted_within, rest)
            return math.inf
        swing = back_and_forth(position[-held.shape[0] // 2 :])
        if swing > most:
            bench.hunted_within = max(bench.hunted_within, rest)
            return swing
        error = float(last[0] - position[-1])
        needed = RESTS + CYCLES * time_to_break_away(
            controller, plant, error, drive.deadband(1.0) * drive.sample_time
        )
    return 0.0


def time_to_break_away(controller: Controller, plant: RigidAxis, error: float, count: float) -> float:
    """Return how long the integral of a loop takes to move a sticking axis the other way, s.

    0 for a loop without gains or integral, and for an error (rad) that is within an encoder's count: such an integral
    stands still.
    """
    gains = controller.gains
    if gains is None or abs(error) <= count or error == 0.0:
        return 0.0
    rate = gains.kvi * gains.kv if isinstance(gains, Cascade) else gains.ki
    return 2.0 * breakaway(plant.friction) / (rate * abs(error)) if rate > 0.0 else 0.0


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
    return f"at rest {on} within {bench.hunted_within:g} s ({size}): {why}"


def rest_words(bench: Bench) -> str:
    """Return whether the linear controller alone hunts at rest, in words."""
    if not integrates(bench.linear):
        return "the loop alone has no integral part and cannot hunt"
    swings = alone_for_long(bench)
    on = f"{len(swings)} axes" if len(swings) > 1 else "the best estimate"
    if hunting := sum(swing > 0.0 for swing in swings):
        return f"the loop alone hunts on {f'{hunting} of ' if len(swings) > 1 else ''}{on}"
    return f"the loop alone does not hunt on {on} in {bench.longest_rest:g} s at rest"


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
