"""Refuse a loop that is too fast for the drive's command delay.

Such a loop is unstable while the axis slides. Friction dissipates the energy of small swings, so a simulation along a
slow motion may not show it, until a push is large enough.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from stickslip.analyse.controller_loop import linearised
from stickslip.analyse.presliding_loop import Loop
from stickslip.control.controller import Controller
from stickslip.core.errors import InputError
from stickslip.core.messages import name_option
from stickslip.identification.identified_file import Identified
from stickslip.machines.machine import SHORT_DELAY
from stickslip.recommendation.candidate_run import Drive
from stickslip.recommendation.plant import Plant
from stickslip.recommendation.sample_time import MIDDLE, WELL_DAMPED

SLOWER = 0.9
"""Ratio of successive bandwidths."""
SLOWEST = 1e-3
"""Lowest bandwidth to name, relative to the drive's."""


def sensitivity_of(found: Identified, drive: Drive, inertia: float, loop: Controller) -> float:
    """Return the largest sensitivity of the loop while the axis (inertia in kg·m²) slides; infinite if it is unstable,
    NaN if the controller is not smooth."""
    plant = Plant(inertia, found.model, machine=drive.machine).built(drive.sample_time, drive.encoder_counts)
    try:
        linear = linearised(loop, math.inf, MIDDLE, drive.latest)
    except InputError:
        return math.nan
    return Loop(plant.linear(), linear).sensitivity()


def fastest(found: Identified, drive: Drive, inertia: float) -> float:
    """Return the bandwidth below the drive's at which its loop is well damped, Hz; 0 if there is none."""
    bandwidth = drive.bandwidth
    while (bandwidth := SLOWER * bandwidth) > SLOWEST * drive.bandwidth:
        slower = place_at(drive, bandwidth, inertia)
        if sensitivity_of(found, drive, inertia, slower) <= WELL_DAMPED:
            return bandwidth
    return 0.0


def place_at(drive: Drive, bandwidth: float, inertia: float) -> Controller:
    """Return the drive's loop placed at another bandwidth, Hz."""
    return replace(drive, bandwidth=bandwidth).loop(inertia)


def refuse_late(found: Identified, drive: Drive, inertia: float) -> None:
    """Refuse a loop that is unstable while the axis slides, because of the drive's delay.

    Raises
    ------
    InputError
    """
    if drive.latest == 0.0 or sensitivity_of(found, drive, inertia, drive.loop(inertia)) != math.inf:
        return
    late = f"as commands act {drive.latest:g} samples ({1e3 * drive.latest * drive.sample_time:.3g} ms) late"
    if drive.given:
        raise InputError(
            f"this loop is unstable while the axis slides, {late}; check the delay, which is in samples and not in s, "
            "and the gains"
        )
    best = fastest(found, drive, inertia)
    rigid = "" if drive.machine else " (of a rigid axis; a belt or a shaft bears less)"
    remedy = (
        f"give {name_option('bandwidth', f'{best:.2g}')} or less{rigid}"
        if best
        else "no lower bandwidth is well damped on this machine"
    )
    raise InputError(
        f"a loop of {drive.bandwidth:g} Hz is unstable while the axis slides, {late}, and friction alone keeps it calm "
        f"at rest; {remedy}"
    )


def seconds_meant(drive: Drive) -> Iterator[str]:
    """Return the note that a short delay may be in s."""
    if drive.delay and drive.delay < SHORT_DELAY:
        yield (
            f"The delay of {drive.delay:g} is in samples, so that commands act {drive.delay * drive.sample_time:.3g} s "
            f"late; if it is in s, give {name_option('delay', f'{drive.delay / drive.sample_time:g}')}."
        )


def hardly_damped_where_late(found: Identified, drive: Drive, inertia: float) -> Iterator[str]:
    """Return the note that a placed loop is poorly damped with the drive's delay, and a well-damped bandwidth."""
    if drive.latest == 0.0 or drive.given:
        return
    peak = sensitivity_of(found, drive, inertia, drive.loop(inertia))
    if peak > WELL_DAMPED and (best := fastest(found, drive, inertia)):
        yield (
            f"With commands {drive.latest:g} samples late this loop is hardly damped while the axis slides (greatest "
            f"sensitivity {peak:.2g}, where {WELL_DAMPED:g} at most is usual): {best:.2g} Hz would be well damped"
            f"{'' if drive.machine else ' on a rigid axis'} ({name_option('bandwidth')})."
        )
