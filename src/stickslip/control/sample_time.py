"""The sample time of a controller on what has one of its own: a machine, a rig."""

from __future__ import annotations

from dataclasses import replace

from stickslip.control.controller import Controller
from stickslip.core.errors import ParameterError


def sampled_by(controller: Controller, sample_time: float, owner: str) -> Controller:
    """The controller at the samples of what it runs on; one without a sample time takes theirs.

    Parameters
    ----------
    controller : Controller
    sample_time : float
        Of the owner, s.
    owner : str
        "rig", or "machine" with its name.

    Raises
    ------
    ParameterError
        If the controller is meant for another sample time.
    """
    if controller.sample_time not in (0.0, sample_time):
        raise ParameterError(
            f"controller: sample_time = {controller.sample_time:g} s, that of the {owner} is {sample_time:g} s; "
            f"give the {owner.partition(' ')[0]}'s, or none"
        )
    return replace(controller, sample_time=sample_time)
