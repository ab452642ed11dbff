"""Sample time of the drive's loop if it is not given: that of the record, unless this is impossible.

A record may have fewer rows than the loop has samples. A loop in use is well damped; if it would not be with the sample
time of the record, it is sampled faster.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from stickslip.analyse.controller_loop import linearised
from stickslip.analyse.presliding_loop import Loop
from stickslip.control.controller import Controller
from stickslip.control.own_loop import USUAL_TIME
from stickslip.core.errors import InputError
from stickslip.core.messages import Note, name_option
from stickslip.identification.identified_file import Identified
from stickslip.machines.drivetrain import Drivetrain
from stickslip.machines.machine import Machine
from stickslip.recommendation.candidate_run import Drive

WELL_DAMPED = 2.0
"""Largest sensitivity of usual loops: 1.2 to 2 (Åström and Hägglund, Advanced PID Control, 2006)."""
MIDDLE = 10.0
"""Hz; a linear loop is the same at every frequency."""

ROWS = "rows"
"""Code of the sample time that is the time between the rows of a record."""
OWN = f"where the drive's is another one, give {name_option('sample_time')}"


def sample_time_for(
    found: Identified, given: float | None, machine: Machine | None, sampled: Callable[[float], Drive],
    inertia: float | None = None,
) -> tuple[float, str]:  # fmt: skip
    """Return the sample time of the drive, s, and its source: given, the machine's, the record's, or `USUAL_TIME`.

    Parameters
    ----------
    found : Identified
    given : float, optional
        s
    machine : Machine, optional
        The user's machine.
    sampled : callable
        Returns the drive with a sample time, s.
    inertia : float, optional
        kg·m², for checking whether the loop can have the record's sample time.
    """
    if given is not None:
        return given, "as given"
    if machine is not None:
        return machine.sample_time, f"that of the machine {machine.name}"
    period, file = found.sampled
    if not period:
        return USUAL_TIME, f"assumed, as the model does not contain its record's; {OWN}"
    record = f"the record {file}" if file else "the identified record"
    # Gains do not depend on it, and a bandwidth that is too high for it is not an error yet.
    corner = sampled(USUAL_TIME).velocity_filter if period > USUAL_TIME else 0.0
    if not below_half_the_rate(corner, period):
        return USUAL_TIME, (
            f"assumed: sampled every {period:.3g} s, as {record} has rows, this loop could not have its filter of "
            f"{corner:g} Hz, so that it is taken to run faster than the record was kept; {OWN}"
        )
    if period > USUAL_TIME and inertia and hardly_damped(sampled(USUAL_TIME).loop(inertia), period, inertia):
        return USUAL_TIME, (
            f"assumed: sampled every {period:.3g} s, as {record} has rows, this loop would be unstable or hardly "
            f"damped, so that it is taken to run faster than the record was kept; {OWN}"
        )
    return period, Note(f"the time between the rows of {record}; {OWN}", ROWS)


def below_half_the_rate(corner: float, period: float) -> bool:
    """Whether a low-pass of this corner, Hz, is possible at a sample time, s; 0: no filter."""
    return corner < 0.5 / period


def refuse_filter(drive: Drive) -> None:
    """Refuse a filter of the loop above half the sample rate.

    Raises
    ------
    InputError
    """
    corner, period = drive.velocity_filter, drive.sample_time
    if not below_half_the_rate(corner, period):
        raise InputError(
            f"{name_option('loop')}: filter = {corner:g} Hz must lie below half the sample rate, "
            f"{0.5 / period:g} Hz at a sample time "
            f"of {period:g} s; give a lower corner, or the drive's {name_option('sample_time')}"
        )


def hardly_damped(loop: Controller, period: float, inertia: float) -> bool:
    """Whether a loop on a rigid axis of this inertia, kg·m², would be poorly damped at a sample time, s.

    A controller that is not smooth about rest has no linear loop, so its sample time is accepted.
    """
    try:
        linear = linearised(replace(loop, sample_time=period), math.inf, MIDDLE)
    except InputError:
        return False
    return not Loop(Drivetrain((inertia,)), linear).sensitivity() <= WELL_DAMPED
