"""The short form of a controller: gains, a compensator and a low-pass on the velocity, as the control laws meant."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Any

from stickslip.control.block import ControlBlock
from stickslip.control.compensator import Compensator
from stickslip.control.linear import Cascade, Gains
from stickslip.core.arguments import no_number
from stickslip.core.errors import ParameterError
from stickslip.core.type_rules import is_number

FILTER_ROOM = 0.495  # of the sample rate: just below half of it, where a sampled low-pass ends


def highest_corner(sample_time: float) -> float:
    """Highest corner that a low-pass on samples can have, Hz; infinite in continuous time."""
    return FILTER_ROOM / sample_time if sample_time > 0.0 else math.inf


def refuse_short(gains: Any, compensator: Any, velocity_filter: float, sample_time: float) -> None:
    """Refuse numbers out of bounds, and compensators that act on samples where there are none.

    Raises
    ------
    ParameterError
    """
    for name, value in gains._asdict().items() if gains else ():
        if not is_number(value):
            raise no_number("controller", name, value, "")
        if not math.isfinite(value) or value < 0.0:
            raise ParameterError(f"controller: {name} = {value:g} must be at least 0")
    if not math.isfinite(velocity_filter) or velocity_filter < 0.0:
        raise ParameterError(f"controller: velocity_filter = {velocity_filter:g} Hz must be at least 0")
    corner = compensator.filter_hz if compensator else None
    if compensator and corner and corner > highest_corner(sample_time):
        raise ParameterError(
            f"{compensator.name}: filter_hz = {corner:g} Hz is too high for a sample time of {sample_time:g} "
            f"s; give at most {highest_corner(sample_time):g} Hz, or none"
        )
    names = compensator.sampled if compensator else ()
    if sample_time == 0.0 and names:
        raise ParameterError(
            f"controller: {names[0]} needs a sampled controller; give a sample_time greater than 0"
        )


def refuse_continuous(gains: Any, velocity_filter: float) -> None:
    """Refuse to run a cascade or a velocity filter in continuous time.

    Raises
    ------
    ParameterError
    """
    for name, given in (
        ("a cascade", isinstance(gains, Cascade)),
        ("a velocity_filter", velocity_filter > 0.0),
    ):
        if given:
            raise ParameterError(
                f"controller: {name} needs a sampled controller; give a sample_time greater than 0, or run it on a "
                "machine, which has its own"
            )


def laws_meant(
    gains: Gains | Cascade | None, compensator: Compensator | None, velocity_filter: float
) -> Mapping[str, tuple[ControlBlock, ...]]:
    """The control laws by their places."""
    corner = 2.0 * math.pi * velocity_filter
    feedforward, observer = _compensation(compensator, filtered=corner > 0.0) if compensator else ((), ())
    # A compensator behind gains of 0 has no loop: its torque belongs to another controller's.
    alone = compensator is not None and not any(gains or ())
    return {
        "estimator": (ControlBlock("filtered_difference", corner=corner),) if corner > 0.0 else (),
        "feedforward": feedforward,
        "observer": observer,
        "loop": (_loop(gains),) if gains is not None and not alone else (),
    }


@functools.lru_cache(maxsize=1024, typed=True)
def _loop(gains: Gains | Cascade) -> ControlBlock:
    """The loop's law."""
    return ControlBlock("cascade" if isinstance(gains, Cascade) else "gains", **gains._asdict())


@functools.lru_cache(maxsize=64)
def _compensation(
    compensator: Compensator, *, filtered: bool
) -> tuple[tuple[ControlBlock, ...], tuple[ControlBlock, ...]]:
    """Feedforwards and observers; ``filtered``: the loop's velocity passes a low-pass, which the law's does not."""
    ahead: tuple[ControlBlock, ...] = ()
    if compensator.offset or compensator.inertia_feedforward:
        fed = {"inertia": compensator.inertia_feedforward, "offset": compensator.offset}
        ahead = (ControlBlock("inertia_feedforward", None, None, **fed),)
    back = compensator.velocity == "measured"
    choices: dict[str, str] = {"source": "difference"} if back and filtered else {}
    values: dict[str, Any] = {"gain": compensator.gain, "deadband": compensator.deadband}
    if not back:
        values["lead"] = compensator.lead
    if compensator.filter_hz:
        choices["low_pass"], values["corner"] = "butterworth", 2.0 * math.pi * compensator.filter_hz
    if compensator.substeps != 1:
        choices["velocity"], values["substeps"] = "in_steps", float(compensator.substeps)
    law = "friction_feedback" if back else "friction_feedforward"
    friction = ControlBlock(law, compensator.model, choices, **values)
    return (ahead, (friction,)) if back else ((friction, *ahead), ())
