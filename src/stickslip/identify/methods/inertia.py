"""The inertia from the frequency response (`stickslip.identify.response.inertia`)."""

from __future__ import annotations

from collections.abc import Sequence

from stickslip.identify.estimate import Identification
from stickslip.identify.methods._trials import driven, trials_of
from stickslip.identify.methods.method import Method, Options
from stickslip.identify.response.inertia import inertia
from stickslip.record import Record

__all__ = ["METHOD"]


def identify(records: Sequence[Record], options: Options) -> Identification:
    """The inertia."""
    axis, trials = trials_of(records, options)
    return inertia(trials, axis)


METHOD = Method("inertia", "inertia from the frequency response", identify, driven)
