"""What a recommendation is refused for: a weak drive, unknown friction, a loop that holds no axis, a day of work."""

from __future__ import annotations

import math

import numpy as np

from stickslip.analyse.wording import ends
from stickslip.core.errors import InputError
from stickslip.core.messages import name_file, name_option
from stickslip.identification.fit.uncertainty import RATIO
from stickslip.identification.identified_file import Identified
from stickslip.recommendation.candidate_run import Drive, Trial
from stickslip.recommendation.candidates import breakaway, resistance

MOST_STEPS = 1e10
"""Of all simulations together; more would take half a day."""
STEPS_PER_HOUR = 1e9
"""Of a law with memory on one core, about."""
AT_THE_LOAD = (
    f"; this model, {name_option('loop')} and the limit are in kg and N: 1 N·m of a motor at a lead of P metres "
    "is 2 pi / P N"
)
"""Of a torque limit that is too low for a linear axis: it may be the motor's own, in N·m."""
WITHIN = 5.0
"""From the lower to the upper end of friction's level at most, for a setting to be looked for."""
LOST = 2.0
"""RMS error of the linear controller alone, in parts of the motion's RMS, from which on it does not hold the axis: one
that friction keeps from moving at all has 1."""


def refuse_weak(found: Identified, drive: Drive) -> None:
    """Refuse a torque limit at which the axis does not move, or does not follow.

    Raises
    ------
    InputError
    """
    limit, torque = drive.torque_limit, found.unit("N·m")
    converted = AT_THE_LOAD if torque == "N" else ""
    # A loop of somebody's own may have said it itself.
    option = name_option("torque_limit")
    option += f" (or limit of {name_option('loop')})" if drive.gains is not None else ""
    if limit <= (held := breakaway(found.model)):
        raise InputError(
            f"torque limit {limit:g} {torque}: the drive cannot move the axis, whose friction is {held:.3g} {torque}; "
            f"give a {option} above it{converted}"
        )
    if limit <= (friction := resistance(found.model, drive)):
        raise InputError(
            f"torque limit {limit:g} {torque}: the drive cannot follow this motion, along which friction reaches "
            f"{friction:.3g} {torque}; give a {option} above it, or a slower motion: another "
            f"{name_option('motion')}, or a "
            f"smaller {name_option('amplitude')} or {name_option('frequency')}{converted}"
        )


def refuse_unknown(found: Identified) -> None:
    """Refuse a law whose level the record does not tell to a factor of `WITHIN`: what is fed forward would be one
    choice among many. Within that factor the sampled axes decide: what helps on every one of them is safe.

    Raises
    ------
    InputError
    """
    for e in found.estimates:
        if any(math.isnan(x) for x in (e.value, e.lower, e.upper)):
            raise InputError(
                f"{name_file(found.path)}: the estimate of {e.name} is {e.value:g} [{e.lower:g}, {e.upper:g}], "
                "from which no axis "
                "can be sampled; identify the axis again"
            )
    levels = [e for e in found.law_estimates[0] if e.unit in ("N·m", "N")]
    if levels and not any(e.identified or 0.0 < e.upper <= WITHIN * e.lower for e in levels):
        listed = ", ".join(
            f"{e.name} {e.value:.3g} [{', '.join(ends(e.value, e.lower, e.upper, '.3g'))}]" for e in levels
        )
        why = next((f": {e.verdict}" for e in levels if e.verdict), "")
        raise InputError(
            f"{name_file(found.path)}: the record does not determine the friction level ({listed} "
            f"{levels[0].unit}, not "
            f"identified{why}); identify a record with constant speeds, three of them at least, each in both directions"
        )


def refuse_loaded(found: Identified) -> None:
    """Refuse friction that grows with the torques on the axis: no compensator that is tried has it.

    Raises
    ------
    InputError
    """
    grows = [name for name in ("load_motor", "load_external") if found.axis.get(name)]
    if grows:
        raise InputError(
            f"{name_file(found.path)}: its friction is that of an unloaded axis and grows with the load "
            f"({', '.join(grows)}), "
            f"which no compensator that is tried here has; identify without {name_option('load', True)}, for "
            "the friction at the loads of "
            "the record"
        )


def held(found: Identified, alone: Trial | str, drive: Drive, inertia: float | None = None) -> Trial:
    """The linear loop alone on the axis as it was identified, if it holds it: else no compensator is to blame.

    `inertia` is one that was given, kg·m².

    Raises
    ------
    InputError
    """
    size = float(np.std(drive.reference[:, 0]))
    if not isinstance(alone, str):
        error = alone.moving["position_rms_rad"]
        if error <= LOST * size:
            return alone
        alone = f"RMS error {error:.3g} {found.unit('rad')} along a motion of {size:.3g}"
    raise InputError(
        f"on the axis of {name_file(found.path)} the linear loop alone is unstable: {alone}; "
        + (unsure_inertia(found) if inertia is None else "")
        + "check its gains, or identify a record with faster motion"
    )


def unsure_inertia(found: Identified) -> str:
    """That a loop may be unstable on the model's inertia and not on the axis's; empty where the record tells it."""
    said, unit = inertia_said(found), found.unit("kg·m²")
    if not said:
        return ""
    own = f"give that with {name_option('inertia')} in {unit}"
    return f"{said}, and the loop may be stable on the axis's own: {own}, "


def inertia_said(found: Identified) -> str:
    """The model's inertia and its interval where the record does not tell it; empty where it does."""
    told = next((e for e in found.estimates if e.name == "inertia"), None)
    if told is None or (told.identified and told.upper <= RATIO * told.lower):
        return ""
    unit, of = found.unit("kg·m²"), "is not identified" if not told.identified else "is hardly determined"
    value = found.axis.get("inertia", told.value)
    interval = ", ".join(ends(value, told.lower, told.upper, ".3g"))
    return f"the model's inertia {value:.3g} {unit} {of} [{interval}]"


def refuse_endless(trials: int, drive: Drive, axes: int, confirm: int) -> None:
    """Refuse what would take more than `MOST_STEPS`, before anything is drawn or simulated.

    Raises
    ------
    InputError
    """
    if (steps := trials * drive.steps) > MOST_STEPS:
        raise InputError(
            f"up to {trials:.3g} simulations ({axes} axes, {confirm} to confirm) of {drive.steps:.2g} steps (sample "
            f"time {drive.sample_time:g} s, a motion of {drive.path.duration:.3g} s) would take about "
            f"{steps / STEPS_PER_HOUR:.2g} h; give fewer axes, a longer sample time or a shorter motion"
        )
