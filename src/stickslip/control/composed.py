"""A controller with gains and a compensator as the control laws that it is made of."""

from __future__ import annotations

import functools
import math
from typing import Any

from stickslip.control.block import ControlBlock
from stickslip.control.compensator import Compensator
from stickslip.control.continuous import Continuous, continuous_form
from stickslip.control.controller import Controller
from stickslip.control.linear import Cascade, Gains
from stickslip.control.sampled_controller import SampledController

__all__ = ["composed_of", "continuous_of"]


def composed_of(controller: Controller | SampledController) -> SampledController:
    """The controller made of control laws; one that is already is returned as it is.

    Parameters
    ----------
    controller : Controller or SampledController
    """
    if isinstance(controller, SampledController):
        return controller
    feedforward, observer = _compensation(controller)
    corner = _corner(controller)
    # A compensator behind gains of 0 has no loop: its torque belongs to another controller's.
    alone = controller.compensator is not None and not any(controller.gains)
    return SampledController(
        None if alone else _loop(controller.gains),
        controller.sample_time,
        feedforward,
        observer,
        ControlBlock("filtered_difference", corner=corner) if corner > 0.0 else None,
        controller.torque_limit,
        controller.encoder_counts,
    )


def continuous_of(controller: Controller | SampledController) -> Continuous:
    """The controller in continuous time.

    The integral of a `Controller` goes on where the torque limit holds; one made of control laws is refused there.

    Raises
    ------
    ParameterError
        If one of its laws acts on samples only.
    """
    if isinstance(controller, SampledController):
        return controller.continuous
    feedforward, observer = _compensation(controller)
    blocks = {"loop": _loop(controller.gains), **{b.law.name: b for b in (*feedforward, *observer)}}
    return continuous_form(blocks)


def _corner(controller: Controller) -> float:
    """Of the low-pass on the loop's velocity, rad/s; 0 for none."""
    return 2.0 * math.pi * controller.velocity_filter


@functools.lru_cache(maxsize=1024, typed=True)
def _loop(gains: Gains | Cascade) -> ControlBlock:
    """The loop's law."""
    return ControlBlock("cascade" if isinstance(gains, Cascade) else "gains", **gains._asdict())


@functools.lru_cache(maxsize=64)
def _compensation(controller: Controller) -> tuple[tuple[ControlBlock, ...], tuple[ControlBlock, ...]]:
    """Feedforwards and observers; kept, as a controller is run on many axes and references."""
    compensator = controller.compensator
    if compensator is None:
        return (), ()
    ahead: tuple[ControlBlock, ...] = ()
    if compensator.offset or compensator.inertia_feedforward:
        fed = {"inertia": compensator.inertia_feedforward, "offset": compensator.offset}
        ahead = (ControlBlock("inertia_feedforward", None, None, **fed),)
    friction = _friction(compensator, filtered=_corner(controller) > 0.0)
    return (ahead, (friction,)) if compensator.velocity == "measured" else ((friction, *ahead), ())


def _friction(compensator: Compensator, *, filtered: bool) -> ControlBlock:
    """The compensator's law; ``filtered`` where the loop's velocity passes a low-pass that its own does not."""
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
    return ControlBlock(law, compensator.model, choices, **values)
