"""What certain sliding shows of a record besides numbers, in sentences: timing, widths of windows, friction's form."""

from __future__ import annotations

import math
import statistics

from stickslip.identify.axis.agreed import ALIGNED, KNOWN
from stickslip.identify.regression.flexible import moves_a_load
from stickslip.identify.regression.regression import Regression
from stickslip.identify.regression.together import bend_of, bends_by_itself
from stickslip.machines.servo import ServoAxis

AS_ONE = 4.0
"""Times as wide as noise asks from which on windows say that motor and load do not move as one. Of 182 logs of another
program 15 of 72 trains with play or a spring need such windows and 4 of 110 rigid axes, narrower ones 12 and 24."""
STIFFER = 0.9
"""Part of the lowest frequency that any band says of a swing, from which on it may be: of 15 loads behind springs it
held for all."""


def on_timing(found: Regression | None) -> list[str]:
    """When the torque acted, in a sentence; nothing where the record does not tell."""
    if found is None:
        return []
    low, high = found.interval("skew")
    half, row = 0.5 * (high - low), found.period
    if half > KNOWN * row or not found.shows_inertia:
        return []
    value = found.numbers["skew"].value
    where = "after" if value < 0.0 else "before"
    share = -value / row
    kind = (
        "as a command held from row to row" if abs(share - 0.5) <= max(ALIGNED, half / row)
        else "as a value sampled at the row" if abs(share) <= max(ALIGNED, half / row)
        else "as a mean over the row before" if abs(share + 0.5) <= max(ALIGNED, half / row)
        else "a hold and a delay together"
    )  # fmt: skip
    return [
        f"The torque acted {1e3 * abs(value):.3g} ms (±{1e3 * half:.2g}) {where} its row on average, {abs(share):.2g} "
        f"of a row: {kind}; this is allowed for."
    ]


def on_width(found: Regression | None) -> list[str]:
    """That inertia and friction are those of slower motion than the rows show, in a sentence; nothing where they are
    not. That motor and load do not move as one only where nothing else asks for such wide windows."""
    if found is None or found.widened == 1.0:
        return []
    corner = f"{found.bands[0].corner:.2g} Hz"
    if found.widened < AS_ONE:
        return [
            f"Inertia and friction are those of motion slower than {corner}: faster, the torque holds more than they "
            "explain (the drive's own timing, cogging, play or a train that rings), and this record does not tell what."
        ]
    return [
        f"Faster than {corner} the torque is not that of one inertia (play that opens while the axis slides, a train "
        "that rings, a torque that is filtered, torque over the position): inertia and friction are those of slower "
        "motion."
    ]


def on_swing(found: Regression | None) -> list[str]:
    """That a load swings behind a spring, or that the torque's column is filtered, in a sentence; nothing where neither
    shows."""
    swings = [] if found is None else [b.swing for b in found.bands if b.swing.torque]
    if found is None or not swings:
        return []
    swing = statistics.median(s.torque for s in swings)
    if told := found.two_inertias:
        (low, high), (least, most) = told.antiresonance_interval, told.motor_share_interval
        return [
            f"Motor and load do not move as one: with the motor held the load swings at {told.antiresonance:.3g} Hz "
            f"[{low:.3g}, {high:.3g}] (antiresonance), resonance at {told.resonance:.3g} Hz, the motor has "
            f"{told.motor_share:.2g} [{least:.2g}, {most:.2g}] of the inertia; this is allowed for, and the inertia is "
            "that of both."
        ]
    if swing > 0.0:
        lag = f"{1e3 * math.sqrt(2.0 * swing):.2g} ms"
        return [f"The torque column lags as behind a filter of about {lag}; this is allowed for."]
    if found.doubt or not moves_a_load(swings):
        return []
    # Noise and coarse windows bend the torque as a softer spring does, damping as one that is stiffer by little.
    slowest = STIFFER * min(s.antiresonance for s in swings if s.torque < 0.0)
    return [
        "The torque is not that of one rigid inertia: a load behind a spring would swing at "
        f"{slowest:.2g} Hz or faster with the motor held; rows far apart and uneven times look like it as well, and "
        "this record does not tell which. It is allowed for, and the inertia is the whole."
    ]


def on_creep(found: Regression | None, axis: ServoAxis) -> list[str]:
    """That friction is missing where the axis creeps, in a sentence; nothing where it is not."""
    # Of a record whose numbers are not believed at all, the level says nothing, nor what lacks of it.
    if found is None or found.creep.speed == 0.0 or found.doubt:
        return []
    speed, missing = f"{found.creep.speed:.3g} {axis.unit('rad/s')}", f"{found.creep.missing:.0%}"
    if found.creep.steady:
        return [
            f"Slower than {speed} {missing} of friction's level is missing although the axis slides steadily: friction "
            f"rises with velocity in another form than a level and a slope, which are those of faster motion alone."
        ]
    # While its load swings the motor slows down and speeds up, and what the spring gives it there is no play's.
    if moves_a_load([b.swing for b in found.bands]):
        return [
            f"Slower than {speed} the torque is less than friction's level, by {missing} of it, as the spring of a "
            "load that swings makes it: these rows are left out, inertia and friction are those of faster motion."
        ]
    return [
        f"Slower than {speed} {missing} of friction's level is missing (a motor that goes on alone within the play, or "
        f"friction that builds up with velocity): inertia and friction are those of faster motion."
    ]


def on_bend(found: Regression | None) -> list[str]:
    """That friction rises with velocity in another form than a level and a slope, in a sentence; nothing where it does
    not."""
    bend = 0.0 if found is None else bend_of(found.bands)
    if found is None or bend == 0.0:
        return []
    if not bends_by_itself(found.bands):
        return [
            f"The torque bends with velocity, by {min(abs(bend), 1.0):.0%} of Fc over the recorded speeds, as friction "
            "of another form bends it, a load that swings behind a spring, or an inertia that does not show; this "
            "record does not tell which, and level and slope hold there alone. Constant speeds, with gentle ramps "
            "between them, would tell."
        ]
    how, why = (
        ("faster", "drag with the square of the speed, a motor whose torque constant falls with the current")
        if bend > 0.0 else ("more slowly", "a lubricant that thins")
    )  # fmt: skip
    return [
        f"Friction rises ever {how} with velocity, as no law here does ({why}): over the recorded speeds the curve "
        f"bends by {min(abs(bend), 1.0):.0%} of Fc more, and level and slope hold there alone. Identify with a law of "
        "your own (--law FILE.py), or read the curve (identify --method sliding)."
    ]
