"""Resolution of the drive's encoder, and its source: the user, the machine, the controller or the record."""

from __future__ import annotations

import math

from stickslip.core.errors import InputError
from stickslip.core.messages import name_option
from stickslip.core.record import counts_of_step
from stickslip.identification.identified_file import Identified
from stickslip.machines.machine import Machine

OWN = f"give {name_option('counts_per_rev')}"


def encoder_for(
    found: Identified, given: float | None, machine: Machine | None = None, controller: float = 0.0
) -> tuple[float, str]:
    """Return the counts of the encoder per revolution (of a linear axis per 2 pi m; 0: exact), and their source.

    Parameters
    ----------
    found : Identified
        The model, whose records may show the step of the position.
    given : float, optional
        Counts that the user states.
    machine : Machine, optional
        Machine that is simulated.
    controller : float
        Counts in the user's controller; 0: none.

    Raises
    ------
    InputError
        If the given number is not a number of counts.
    """
    if given is not None:
        if not (given == 0.0 or 1.0 <= given < math.inf):
            raise InputError(
                f"{name_option('counts_per_rev', f'{given:g}')} must be at least 1 and finite, or 0 for exact "
                "positions; leave it out to "
                "take the resolution of the record"
            )
        return given, "as given"
    if machine is not None:
        return machine.encoder.counts, f"that of the machine {machine.name}"
    if controller > 0.0:
        return controller, "that of the controller"
    step, file = found.position_step
    if step > 0.0:
        record = f"the record {file}" if file else "the identified record"
        return float(counts_of_step(step, found.motion == "linear")), (
            f"the position step of {record} ({step:.3g} {found.unit('rad')}); if the drive's encoder is another one, "
            f"{OWN}"
        )
    return 0.0, (
        "assumed, as the model does not contain the position step of its record: with an encoder another setting may "
        f"be safe, or none; {OWN}"
    )


def resolution_words(counts: float, linear: bool) -> str:
    """Return the resolution as text."""
    if not counts:
        return "exact positions"
    return f"an encoder of {counts:.10g} counts per {'2π m' if linear else 'revolution'}"
