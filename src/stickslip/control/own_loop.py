"""The loop that a drive has, by the names of its gains: those of a PID, or of position P around velocity PI.

`stickslip identify --loop` and `stickslip recommend --loop` describe it so. How the drive forms its reference velocity
is a word of the same description, ``reference_velocity=difference``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

from stickslip.control.linear import Cascade, Gains
from stickslip.core.config import named_numbers, named_values
from stickslip.core.errors import InputError, UnknownName
from stickslip.core.messages import name_option

ReferenceVelocity = Literal["difference", "instant"]
"""How a drive forms its reference velocity: from the last two reference positions, or the trajectory's own velocity at
the sample."""
REFERENCE_VELOCITIES: tuple[ReferenceVelocity, ...] = ("difference", "instant")
REFERENCE_VELOCITY = "reference_velocity"
"""Its name in a description of a loop."""

USUAL_TIME = 1e-3
"""s, sample time of a drive's loop where nothing tells it."""
CASCADE_ONLY = tuple(name for name in Cascade._fields if name not in Gains._fields)


def loop_text(given: str | Mapping[str, float | ReferenceVelocity]) -> str:
    """Return a loop's description as written on the command line."""
    if isinstance(given, str):
        return given
    words = {name: x if isinstance(x, str) else repr(float(x)) for name, x in given.items()}
    return ",".join(f"{name}={word}" for name, word in words.items())


def split_loop(
    given: str | Mapping[str, float | ReferenceVelocity],
) -> tuple[dict[str, float], ReferenceVelocity | None]:
    """Return the numbers of a loop's description, and how its drive forms the reference velocity, if it is stated.

    Raises
    ------
    InputError
        If an entry is not NAME=VALUE, or the reference velocity is neither kind.
    """
    named = named_values(loop_text(given).split(",") if given else (), name_option("loop"))
    formed = named.pop(REFERENCE_VELOCITY, None)
    if formed is not None and formed not in REFERENCE_VELOCITIES:
        raise UnknownName(f"{REFERENCE_VELOCITY} of {name_option('loop')}", formed, REFERENCE_VELOCITIES)
    pairs = [f"{name}={text}" for name, text in named.items()]
    return named_numbers(pairs, name_option("loop"), infinite=("limit",)), formed


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
            raise UnknownName(
                f"number of {name_option('loop')} of a {'cascade' if cascade else 'PID'}", name, names
            )
    for name in ("kv", "kvp") if cascade else ():
        if not numbers.get(name, 0.0) > 0.0:
            raise InputError(f"{name_option('loop')} of a cascade: give {name}, greater than 0")
    return kind
