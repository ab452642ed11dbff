"""When the torque acted, as it is given (--torque-is, --delay), against what the record says of it."""

from __future__ import annotations

from collections.abc import Sequence

from stickslip.errors import UnknownName
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
BEHIND = {"commanded": -0.5, "actual": 0.0, "mean": 0.5}
"""Rows by which a column lies behind the torque: a command acts half a row after its row, on average, and a mean over
the row before acted half a row before it."""
TAKEN = (
    "With --delay alone the torque column counts as commanded from its row to the next (--torque-is commanded); say "
    "what it is if it is another."
)
ALONE = (
    "--torque-is alone does not say how late the torque acted (the delay of a current loop): that is found from the "
    "record. Give --delay as well to hold both, 0 where it acted at once."
)
NOTHING = {"inertia": 0.0, "sigma2": 0.0, "fc": 0.0, "offset": 0.0}


def given(
    experiments: Sequence[Experiment],
    axis: ServoAxis,
    torque_is: str | None,
    delay: float | None,
    regress: Regress,
) -> tuple[float | None, list[str]]:
    """s by which the torque's column lies behind the torque that acted, where that is held, and what is to be said.

    What the column holds does not say how late a current loop makes it act: without the delay nothing is held.

    Parameters
    ----------
    experiments : sequence of Experiment
    axis : ServoAxis
    torque_is : {"commanded", "actual", "mean"} or None
        What the column holds (`BEHIND`).
    delay : float or None
        s from then until the torque acts.
    regress : callable
        The regression on certain sliding, by which a contradicted timing is told.

    Raises
    ------
    UnknownName
        If there is no such meaning of a column.
    """
    if torque_is is not None and torque_is not in BEHIND:
        raise UnknownName("torque_is", torque_is, BEHIND)
    if delay is None:
        return None, [] if torque_is is None else [ALONE]
    skew = BEHIND[torque_is or "commanded"] * max(t.period for t in experiments) - delay
    taken = [TAKEN] if torque_is is None else []
    return skew, taken + against_record(experiments, axis, skew, regress)


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
    held, _ = regressed(experiments, axis, skew, regress=regress)
    if own is None or held is None or own.doubt or not (own.shows_inertia and own.confirmed("skew")):
        return []
    low, high = own.interval("skew")
    if low <= skew <= high or left_of(held) < LEAVES * left_of(own):
        return []
    half = f"±{1e3 * 0.5 * (high - low):.2g}"
    return [
        f"{CONTRADICTED}: the torque acted {in_words(0.5 * (low + high), half)} its row on average, not "
        f"{in_words(skew)} it; the given one leaves {left_of(held):.2%} of the torque where the axis slides, the "
        f"record's own {left_of(own):.2%}. Leave both options out, or correct them."
    ]


def in_words(skew: float, half: str = "") -> str:
    """When the torque acted, beside its row."""
    told = f"{1e3 * abs(skew):.3g} ms{f' ({half})' if half else ''}"
    return f"{told} {'after' if skew < 0.0 else 'before'}"


def left_of(found: Regression) -> float:
    """Part of the torque in certain sliding that is left."""
    return found.left / max(found.left_by(NOTHING), 1e-300)
