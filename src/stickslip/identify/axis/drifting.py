"""Friction that drifts over a record: what is said of it, and the record as it would be without."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stickslip.identify.experiment import Experiment
from stickslip.identify.fit.smooth import Window, seen
from stickslip.identify.regression.drifting import DRIFTS, drift_of, length_of
from stickslip.identify.regression.number import QUANTILE
from stickslip.identify.regression.regression import Regression
from stickslip.identify.regression.sliding_rows import direction_in, fine_window, signals_of
from stickslip.identify.regression.together import together
from stickslip.machines.servo import ServoAxis

CLOSE = 0.999
LEVELS = ("offset", "fc", "sigma2")
MAY_DRIFT = (
    "Friction may drift over the record, not distinguished from other values of {names}: the interval holds both. "
    "Record moves to and fro all along, of a warm axis."
)


def on_drift(found: Regression | None) -> list[str]:
    """That friction drifts over the record, or may, in a sentence; nothing where it does not."""
    if found is None:
        return []
    drift = drift_of(found.numbers, found.rows)
    if drift is None:
        names = ", ".join(n for n in LEVELS if found.perhaps and asks_for_another(n, found))
        return [MAY_DRIFT.format(names=names)] if names else []
    return [
        f"Friction {drift} from the first row to the last, as where an axis warms up: this is allowed for, "
        "and values are those of the middle of the record."
    ]


def asks_for_another(name: str, found: Regression) -> bool:
    """Whether a number had its interval widened to hold what it is beside a drift that is not told."""
    own, other = found.numbers[name], together(name, found.perhaps)
    return abs(other.value - own.value) > CLOSE * QUANTILE * own.std


def at_the_middle(
    experiments: Sequence[Experiment], axis: ServoAxis, found: Regression | None
) -> list[Experiment]:
    """The experiments, what friction's drift adds taken out of their drive's signal: no other method knows of it."""
    if found is None or not found.drifts:
        return list(experiments)
    level, slope = (found.numbers[n].value for n in DRIFTS[:2])
    longest = max(length_of(r.signals) for r in found.rows)
    width, out = found.rows[0].window.width, list[Experiment]()
    for t in experiments:
        if t.drive is None:
            out.append(t)
            continue
        signals = signals_of(t, axis)
        fine = fine_window(Window(width, signals.period))
        (speed,) = seen(signals.position, fine.weights(1))
        late = (signals.time - signals.middle) / longest
        torque = late * (level * direction_in(signals, fine, speed) + slope * speed)
        gain, _ = axis.drive_gains(t.quantity)
        supply = 1.0 if t.supply is None else t.supply
        out.append(replace(t, drive=t.drive - np.interp(t.time, signals.time, torque) / (gain * supply)))
    return out
