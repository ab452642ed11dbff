"""The slope at rest of a sample of a controller: its response to a small change, divided by that change.

A smooth law may bend immediately: a torque of |s|^1.5 has slope 0 at rest, and another slope for any change. Its slopes
converge as the change decreases; those of a sign, a root or a kink do not.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stickslip.analyse.controller_sample import Sample, suspects
from stickslip.core.errors import InputError
from stickslip.core.messages import name_command

Array = np.ndarray[Any, np.dtype[np.float64]]
SIZES = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
"""Changes of a state for finding the matrices, in its unit, in descending order: a smooth law may bend within 1e-6 rad
per sample. A law that bends within the smallest one is a sign function for every drive."""
BENT = 1e-4
"""Relative difference of the slopes for changes of different sizes if a law is linear about rest."""
DEAD = 1e-6
"""Share of the slope for larger changes below which a law does not respond to smaller ones."""
SHRINKS = 0.6
"""Smallest convergence of slopes per tenfold smaller change: that of |s|^1.25."""
UNSURE = 0.1
"""Allowed difference of the slopes at rest in both directions, relative to the last change of the slopes."""
SIMULATE = f"or simulate it ({name_command('simulate')}, `stickslip rig run track`)"


def slope_at_rest(run: Sample, row: Array) -> Array:
    """Return the response of a sample to a small change of one state, divided by that change.

    Raises
    ------
    InputError
        If the law is not smooth there, or has a dead band.
    """
    for size in SIZES:
        ahead, back, further = (run.answers(h * row) / h for h in (size, -size, 10.0 * size))
        off = max(float(np.abs(one - ahead).max()) for one in (back, further))
        if off <= BENT * max(float(np.abs(ahead).max()), 1.0):
            found = 0.5 * (ahead + back)
            _refuse_dead_band(run, row, found, size)
            return found
    ahead, back = (np.array([run.answers(h * row) / h for h in one * np.array(SIZES)]) for one in (1.0, -1.0))
    forwards, backwards = approached(ahead), approached(back)
    if forwards is None or backwards is None or _apart(forwards, backwards):
        raise InputError(_bent(run, row, ahead, back))
    return 0.5 * (forwards.slope + backwards.slope)


class Limit(NamedTuple):
    """Limit of the slopes for decreasing changes, and the difference of the last two."""

    slope: Array
    last: float


def approached(slopes: Array) -> Limit | None:
    """Return the limit of slopes for changes that decrease tenfold, None if they do not converge; shape (sizes, n)."""
    # A boundary layer may end within the largest changes.
    steps = np.diff(slopes, axis=0)[-3:]
    ways = np.abs(steps).max(axis=1)
    if not np.all(ways[1:] <= SHRINKS * ways[:-1]):
        return None
    share = ways[-1] / ways[-2] if ways[-2] > 0.0 else 0.0
    return Limit(slopes[-1] + steps[-1] * share / (1.0 - share), float(ways[-1]))


def _apart(ahead: Limit, back: Limit) -> bool:
    """Whether the slopes of both directions differ at rest."""
    most = max(float(np.abs(ahead.slope).max()), 1.0)
    return float(np.abs(ahead.slope - back.slope).max()) > max(
        BENT * most, UNSURE * max(ahead.last, back.last)
    )


def _bent(run: Sample, row: Array, ahead: Array, back: Array) -> str:
    """Return the error that names what is not smooth, and a remedy; slopes for `SIZES`, shape (sizes, n)."""
    off = np.maximum(np.abs(ahead[-1] - back[-1]), np.abs(ahead[-1] - ahead[-2]))
    place = run.telling(off > BENT * max(float(np.abs(ahead[-1]).max()), 1.0))
    before, now, behind = (float(one[place]) for one in (ahead[-2], ahead[-1], back[-1]))
    found = f"after a change of {run.name_of(int(row.argmax()))}, {run.answer_name(place)} changes by "
    if abs(now) > (1.0 + BENT) * abs(before):
        found += f"{before:.3g} times {10.0 * SIZES[-1]:g} and {now:.3g} times {SIZES[-1]:g}: a sign, a jump or a root"
    else:
        found += f"{now:.3g} times {SIZES[-1]:g} and {behind:.3g} times {-SIZES[-1]:g}: a kink"
    return (
        f"controller: {suspects(run.controller)} is not smooth about rest ({found}), so that there is no linear loop; "
        "write a smooth function in place of a sign, a root or a kink, tanh(v / v_s) or a boundary layer wider than "
        f"such changes, {SIMULATE}"
    )


def _refuse_dead_band(run: Sample, row: Array, found: Array, size: float) -> None:
    """Raise `InputError` if the law responds to large changes but not to small ones: such a loop stands still."""
    for larger in (one for one in (10.0 * SIZES[0], *SIZES) if one > size):
        slope = 0.5 * (run.answers(larger * row) - run.answers(-larger * row)) / larger
        most = max(float(np.abs(slope).max()), 1.0)
        if np.any((np.abs(found) <= DEAD * most) & (np.abs(slope) > BENT * most)):
            raise InputError(
                f"controller: {suspects(run.controller)} has a dead band about rest (it answers changes of {larger:g} "
                f"of {run.name_of(int(row.argmax()))}, and not those of {size:g}), so that the loop about rest is not "
                f"that of any motion; leave the dead band out here, {SIMULATE}"
            )
