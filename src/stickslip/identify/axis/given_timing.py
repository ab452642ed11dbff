"""When the torque acted, as it is given (--torque-is, --delay), against what the record says of it."""

from __future__ import annotations

from collections.abc import Sequence

from stickslip.identify.axis.agreed import regressed
from stickslip.identify.experiment import Experiment
from stickslip.identify.regression.regression import Regression
from stickslip.identify.regression.regressions import Regress
from stickslip.machines.servo import ServoAxis

CONTRADICTED = "The record contradicts the timing given (--torque-is, --delay)"
"""How the sentence begins that says so."""
LEAVES = 1.1
"""Times what the record's own timing leaves of the torque in certain sliding, from which on one outside of its interval
is contradicted. Of 36 logs of another program the true one left 1.07 times as much at most wherever the interval did
not hold it, and one half a row or a row off 1.2 to 50 times as much where it was told to half a row."""
NOTHING = {"inertia": 0.0, "sigma2": 0.0, "fc": 0.0, "offset": 0.0}


def against_record(
    experiments: Sequence[Experiment], axis: ServoAxis, skew: float, regress: Regress
) -> list[str]:
    """That the record shows another timing than the given one, in a sentence; nothing where it does not tell.

    Parameters
    ----------
    experiments : sequence of Experiment
    axis : ServoAxis
    skew : float
        s by which the column of the torque is said to lie behind the torque that acted.
    regress : callable
        The regression on certain sliding.
    """
    own, _ = regressed(experiments, axis, None, regress=regress)
    given, _ = regressed(experiments, axis, skew, regress=regress)
    if own is None or given is None or own.doubt or not (own.shows_inertia and own.confirmed("skew")):
        return []
    low, high = own.interval("skew")
    if low <= skew <= high or left_of(given) < LEAVES * left_of(own):
        return []
    half = f"±{1e3 * 0.5 * (high - low):.2g}"
    return [
        f"{CONTRADICTED}: the torque acted {in_words(0.5 * (low + high), half)} its row on average, not "
        f"{in_words(skew)} it; the given one leaves {left_of(given):.2%} of the torque where the axis slides, the "
        f"record's own {left_of(own):.2%}. Leave both options out, or correct them."
    ]


def in_words(skew: float, half: str = "") -> str:
    """When the torque acted, beside its row."""
    told = f"{1e3 * abs(skew):.3g} ms{f' ({half})' if half else ''}"
    return f"{told} {'after' if skew < 0.0 else 'before'}"


def left_of(found: Regression) -> float:
    """Part of the torque in certain sliding that is left."""
    return found.left / max(found.left_by(NOTHING), 1e-300)
