"""A record seen in bands of frequencies beside a slow drift of friction, where one shows or may be there."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from stickslip.identify.regression.band_system import USUAL_EXPONENTS
from stickslip.identify.regression.bands import GAUSSIAN, Bands, calmed, in_bands
from stickslip.identify.regression.drifting import same_motion, usual_speed
from stickslip.identify.regression.sliding_rows import Signals, TooLittleSliding
from stickslip.identify.regression.together import together
from stickslip.machines.servo import ServoAxis

DRIFT_SHOWN, DRIFT_LEAST, DRIFT_UNSURE = 3.0, 0.02, 0.09
"""Standard deviations from which on friction is taken to drift over the record; parts of it at the usual speed: what
the drift must be, and its standard deviation at most. Of 168 of another program's logs without one 12, a staircase
nine times and others, pass the first alone, unsure by 0.11 and more."""
DRIFT_MAYBE = 1.3
"""Standard deviations from which on one that is not told may be there all the same: what certain sliding says without
it then has an interval that holds what it says beside it. A stair up one way and then the other does not tell a drift
from a constant torque."""


def calm_beside_drift(
    signals: Sequence[Signals], width: float, axis: ServoAxis, options: Mapping[str, Any], *ask: Any
) -> Bands:  # fmt: skip
    """What windows in which motor and load move as one show, beside a drift of friction where that shows."""
    first = beside_drift(in_bands(signals, width, axis, options, *ask), signals, width, axis, options, *ask)
    options = {**options, "train": first.train}
    seen = calmed(first, signals, width, axis, {**options, "drifting": first.drifts}, *ask)
    return seen if seen is first else beside_drift(seen, signals, width, axis, options, *ask)


def beside_drift(
    found: Bands, signals: Sequence[Signals], width: float, axis: ServoAxis, options: Mapping[str, Any], *ask: Any
) -> Bands:  # fmt: skip
    """What was found; what the same windows show beside a drift of friction, where that shows or may be.

    In a motion that is not the same throughout neither is ever said: nothing is fitted then.
    """
    if found.drifts or not same_motion(found.rows):
        return found
    exponents = GAUSSIAN if found.widened > 1.0 else tuple(USUAL_EXPONENTS)
    beside = {**options, "drifting": True, "train": found.train}
    with contextlib.suppress(TooLittleSliding):
        other = in_bands(signals, found.widened * width, axis, beside, *ask, exponents=exponents)
        if shows_a_drift(other):
            return replace(other, widened=found.widened)
        return replace(found, perhaps=other.fits if may_drift(other) else ())
    return found


def may_drift(found: Bands) -> bool:
    """Whether a drift is far from excluded."""
    drift = together("drift", found.fits)
    return abs(drift.value) >= DRIFT_MAYBE * drift.std and same_motion(found.rows)


def shows_a_drift(found: Bands) -> bool:
    """Whether friction drifts by more than its interval and a little, in a motion that is the same throughout."""
    drift, level, slope = (together(n, found.fits) for n in ("drift", "fc", "sigma2"))
    usual = abs(level.value) + max(slope.value, 0.0) * usual_speed(found.rows)
    shown = abs(drift.value) >= max(DRIFT_SHOWN * drift.std, DRIFT_LEAST * usual)
    return shown and drift.std <= DRIFT_UNSURE * usual and same_motion(found.rows)
