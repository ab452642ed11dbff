"""Check the properties and answers of a rig, because users may write their own."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any

from stickslip.core.errors import InputError, MeasurementFault, RigError
from stickslip.rigs.rig import Capabilities, Limits, Measurement, Rig

FASTEST, SLOWEST = 1e-7, 1e5
"""Shortest and longest sample time, s"""
FIELDS = len(Measurement._fields)


def checked(rig: Rig) -> Rig:
    """Return the rig if its properties are valid.

    Raises
    ------
    InputError
        Names the invalid property.
    """
    kind = type(rig).__name__
    name, sample_time = _told(kind, rig, "name"), _told(kind, rig, "sample_time")
    limits, able = _told(kind, rig, "limits"), _told(kind, rig, "capabilities")
    if not isinstance(name, str):
        raise InputError(f"rig {kind}: name = {name!r} must be a text")
    if not isinstance(sample_time, (int, float)) or not FASTEST <= sample_time <= SLOWEST:
        raise InputError(
            f"{name}: sample_time = {sample_time!r} s must be a number from {FASTEST:g} to {SLOWEST:g}"
        )
    if not isinstance(limits, Limits):
        raise InputError(f"{name}: limits = {limits!r} must be a `stickslip.rigs.rig.Limits`")
    if not isinstance(able, Capabilities):
        raise InputError(f"{name}: capabilities = {able!r} must be `stickslip.rigs.rig.Capabilities`")
    for method in ("open", "exchange", "pause", "close", *(("exchange_block",) if able.blocks else ())):
        if not callable(getattr(rig, method, None)):
            raise InputError(f"{name}: it has no method {method}; see `stickslip.rigs.rig.Rig`")
    return rig


def _told(kind: str, rig: Rig, what: str) -> Any:
    try:
        return getattr(rig, what)
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"rig {kind}: {what} raised {type(error).__name__}: {error}; correct it") from error


@contextmanager
def blamed(rig: Rig, doing: str) -> Generator[None]:
    """Convert any exception of a rig, exits included, to its error; errors for users stay as they are."""
    try:
        yield
    except (RigError, InputError):
        raise
    except BaseException as error:
        raise RigError(f"{rig.name}: {doing} raised {type(error).__name__}: {error}".rstrip(": ")) from error


def last_resort(rig: Rig) -> str:
    """Return a text that names what removes the torque if the loop cannot."""
    watchdog = rig.capabilities.watchdog
    if watchdog is None:
        return "it declares no watchdog: switch its power off"
    return f"its watchdog removes the torque within {watchdog.time:g} s ({watchdog.how})"


def answer(rig: Rig, doing: str, ask: Callable[[], Any]) -> Any:
    """Return a rig's answer as the numbers of `Measurement`.

    Raises
    ------
    RigError
    """
    with blamed(rig, doing):
        found = ask()
        if not isinstance(found, tuple) or len(found) != FIELDS:  # type: ignore[reportUnknownArgumentType]
            raise RigError(f"{rig.name}: {doing} gave {found!r}; it must give a Measurement")
        numbers = tuple(float(x) for x in found)  # type: ignore[reportUnknownVariableType,reportUnknownArgumentType]
        if not math.isfinite(numbers[0]):
            raise MeasurementFault(
                f"{rig.name}: {doing} gave the time {numbers[0]} s; correct the rig's clock"
            )
        return numbers
