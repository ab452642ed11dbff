"""The loop that a drive has, by the names of its gains: those of a PID, or of position P around velocity PI.

`stickslip identify --loop` and `stickslip recommend --loop` describe it so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from stickslip.control.linear import Cascade, Gains
from stickslip.errors import InputError, UnknownName

USUAL_TIME = 1e-3
"""s, sample time of a drive's loop where nothing tells it."""
CASCADE_ONLY = tuple(name for name in Cascade._fields if name not in Gains._fields)


def kind_of_loop(numbers: Mapping[str, float], beside: Sequence[str]) -> type[Gains] | type[Cascade]:
    """Which of both the names describe.

    Parameters
    ----------
    numbers : mapping of str to float
    beside : sequence of str
        What may be named besides the gains: ``filter``, ``limit``, ...

    Raises
    ------
    InputError
        If a name is unknown, both kinds are mixed, or a cascade lacks one of its loops.
    """
    cascade = any(name in CASCADE_ONLY for name in numbers)
    kind = Cascade if cascade else Gains
    names = (*kind._fields, *beside)
    for name in numbers:
        if name not in names:
            raise UnknownName(f"number of --loop of a {'cascade' if cascade else 'PID'}", name, names)
    for name in ("kv", "kvp") if cascade else ():
        if not numbers.get(name, 0.0) > 0.0:
            raise InputError(f"--loop of a cascade: give {name}, greater than 0")
    return kind
