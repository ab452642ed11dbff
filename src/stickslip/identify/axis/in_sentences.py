"""What certain sliding shows of a record besides numbers, in sentences: timing, widths of windows, friction's form."""

from __future__ import annotations

import math
import statistics

from stickslip.identify.axis.agreed import ALIGNED, KNOWN
from stickslip.identify.regression.flexible import Swing
from stickslip.identify.regression.regression import Regression
from stickslip.identify.regression.together import bend_of
from stickslip.machines.servo import ServoAxis


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
    """That motor and load do not move as one in the shortest windows, in a sentence; nothing where they do."""
    if found is None or found.widened == 1.0:
        return []
    return [
        f"Faster than {found.bands[0].corner:.2g} Hz the torque is not that of one inertia (play that opens while the "
        "axis slides, a train that rings, a torque that is filtered, torque over the position): inertia and friction "
        "are those of slower motion."
    ]


def on_swing(found: Regression | None) -> list[str]:
    """That a load swings behind a spring, or that the torque's column is filtered, in a sentence; nothing where neither
    shows."""
    swings = [] if found is None else [b.swing.torque for b in found.bands if b.swing.torque]
    if found is None or not swings:
        return []
    swing = statistics.median(swings)
    if told := found.two_inertias:
        (low, high), (least, most) = told.antiresonance_interval, told.motor_share_interval
        return [
            f"Motor and load do not move as one: with the motor held the load swings at {told.antiresonance:.3g} Hz "
            f"[{low:.3g}, {high:.3g}] (antiresonance), resonance at {told.resonance:.3g} Hz, the motor has "
            f"{told.motor_share:.2g} [{least:.2g}, {most:.2g}] of the inertia; this is allowed for, and the inertia is "
            "that of both."
        ]
    if swing < 0.0:
        return [
            "The torque is not that of one rigid inertia: a load behind a spring would swing at about "
            f"{Swing(swing, 0.0, 0.0).antiresonance:.2g} Hz with the motor held; rows far apart and uneven times look "
            "like it as well, and this record does not tell which. It is allowed for, and the inertia is the whole."
        ]
    return [
        f"The torque column lags as behind a filter of about {1e3 * math.sqrt(2.0 * swing):.2g} ms; this is allowed "
        "for."
    ]


def on_creep(found: Regression | None, axis: ServoAxis) -> list[str]:
    """That friction is missing where the axis creeps, in a sentence; nothing where it is not."""
    if found is None or found.creep.speed == 0.0:
        return []
    speed, missing = f"{found.creep.speed:.3g} {axis.unit('rad/s')}", f"{found.creep.missing:.0%}"
    if found.creep.steady:
        return [
            f"Slower than {speed} {missing} of friction's level is missing although the axis slides steadily: friction "
            f"rises with velocity in another form than a level and a slope, which are those of faster motion alone."
        ]
    return [
        f"Slower than {speed} {missing} of friction's level is missing (a motor that goes on alone within the play, or "
        f"friction that builds up with velocity): inertia and friction are those of faster motion."
    ]


def on_bend(found: Regression | None) -> list[str]:
    """That friction rises with velocity in another form than a level and a slope, in a sentence; nothing where it does
    not."""
    bend = 0.0 if found is None else bend_of(found.bands)
    if bend == 0.0:
        return []
    how, why = (
        ("faster", "drag with the square of the speed, a motor whose torque constant falls with the current")
        if bend > 0.0 else ("more slowly", "a lubricant that thins")
    )  # fmt: skip
    return [
        f"Friction rises ever {how} with velocity, as no law here does ({why}): over the recorded speeds the curve "
        f"bends by {min(abs(bend), 1.0):.0%} of Fc more, and level and slope hold there alone. Identify with a law of "
        "your own (--law FILE.py), or read the curve (identify --method sliding)."
    ]
