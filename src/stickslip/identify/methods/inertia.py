"""The inertia from the frequency response (`stickslip.identify.response.inertia`)."""

from __future__ import annotations

from collections.abc import Sequence

from stickslip.identify.estimate import Identification
from stickslip.identify.methods._experiments import driven, experiments_of
from stickslip.identify.methods.method import AXIS, Method, Options
from stickslip.identify.response.inertia import inertia
from stickslip.record import Record


def identify(records: Sequence[Record], options: Options) -> Identification:
    """The inertia."""
    axis, experiments = experiments_of(records, options)
    return inertia(experiments, axis)


METHOD = Method(
    "inertia", "inertia from the frequency response", identify, driven, uses=AXIS - {"pendulum"}, values=()
)
