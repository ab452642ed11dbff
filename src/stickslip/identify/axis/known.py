"""Parts of an axis that are held and not fitted, and what friction per direction does not go with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from stickslip.errors import InputError
from stickslip.identify.axis.form import by_usual_names
from stickslip.identify.axis.search import Asked
from stickslip.identify.regression.regression import Regression
from stickslip.machines.servo import ServoAxis
from stickslip.spec import Law

UNITS = {"inertia": "kg·m²", "offset": "N·m"}
"""Parts of an axis beside its friction."""


def refuse_a_weight(sliding: Regression | None, axis: ServoAxis) -> None:
    """Refuse friction per direction where it would drive the axis in one of them: a constant torque acts.

    Raises
    ------
    InputError
    """
    if sliding is None or not sliding.each_way:
        return
    level, constant = abs(sliding.numbers["fc"].value), sliding.numbers["offset"].value
    for name in ("fc_positive", "fc_negative"):
        if sliding.interval(name)[1] < 0.0:
            raise InputError(
                f"a constant torque of {constant:.3g} {axis.unit('N·m')} acts, a weight, a spring or an offset, larger "
                f"than friction, {level:.3g}: it cannot be distinguished from a difference between "
                "friction's directions; leave out --per-direction"
            )


def known_to_sliding(asked: Asked, laws: Sequence[Law], per_direction: bool) -> dict[str, float]:
    """Values that are held and not fitted, beside which certain sliding fits the others, by their names there.

    Level and slope of friction only where every law means these by their names and both directions share them.
    """
    names = {"inertia", "offset"}
    if per_direction:
        names = {"inertia"}
    elif all(by_usual_names(law) for law in laws):
        names |= {"fc", "sigma2"}
    return {n: float(asked.values[n]) for n in asked.frozen if n in names and n in asked.values}


def on_known(known: Mapping[str, float], axis: ServoAxis) -> list[str]:
    """Which parts of the axis beside friction were held, and at what, in a sentence; nothing where none was."""
    parts = [f"{n} = {known[n]:g} {axis.unit(u)}" for n, u in UNITS.items() if n in known]
    return [f"Known, not fitted: {', '.join(parts)}."] if parts else []


def refuse_a_known_torque(frozen: Sequence[str], values: Mapping[str, float], axis: ServoAxis) -> None:
    """Refuse a constant torque that is held beside friction per direction: certain sliding counts it as friction.

    Raises
    ------
    InputError
    """
    known = values.get("offset", 0.0)
    if "offset" in frozen and known != 0.0:
        raise InputError(
            f"offset = {known:g} {axis.unit('N·m')}: a constant torque that is known is not taken off friction per "
            "direction; subtract it from the torque's column, or leave out --per-direction"
        )
