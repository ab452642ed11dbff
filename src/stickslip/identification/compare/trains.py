"""A change of the spring between motor and load, such as a belt that slackens, in a sentence."""

from __future__ import annotations

import math

from stickslip.identification.identified_file import Identified
from stickslip.machines.two_inertias import TwoInertias


def on_trains(first: Identified, second: Identified) -> list[str]:
    """Compare the loads behind a spring of both models; return nothing if neither has one.

    The antiresonance is proportional to the square root of the spring's stiffness, whatever the motor.
    """
    if first.train is None or second.train is None:
        return [
            f"Only {found.path.name} tells a load behind a spring ({spoken(found.train)}): nothing is said of "
            "a change of it."
            for found in (first, second)
            if found.train is not None
        ]
    one, other = first.train, second.train
    apart = other.antiresonance / one.antiresonance - 1.0
    half = math.hypot(*(width_of(t) / t.antiresonance for t in (one, other)))
    by = f"{100.0 * apart:+.2g} % [{100.0 * (apart - half):+.2g}, {100.0 * (apart + half):+.2g}]"
    verdict = "no change of the spring shows"
    if abs(apart) > half:
        verdict = f"the spring has become {'stiffer' if apart > 0.0 else 'softer'}, or the load another"
    return [
        f"The antiresonance of motor and load is at {spoken(one)}, then at {spoken(other)} ({by}): {verdict}."
    ]


def width_of(train: TwoInertias) -> float:
    """Return the half-width of the frequency's interval, Hz."""
    low, high = train.antiresonance_interval
    return 0.5 * (high - low)


def spoken(train: TwoInertias) -> str:
    """Return the frequency with its interval as text."""
    low, high = train.antiresonance_interval
    return f"{train.antiresonance:.3g} Hz [{low:.3g}, {high:.3g}]"
