"""The inertia from the frequency response (`stickslip.identification.response.inertia`)."""

from __future__ import annotations

from collections.abc import Sequence

from stickslip.analyse.split_runs import pieces
from stickslip.core.record import Record
from stickslip.identification.estimate import Identification
from stickslip.identification.methods._experiments import driven, experiments_of
from stickslip.identification.methods.method import AXIS, Method, Options
from stickslip.identification.response.inertia import inertia


def identify(records: Sequence[Record], options: Options) -> Identification:
    """Identify the inertia; a procedure's record of several currents is split into one response each."""
    parts = [part for record in records for _, part in pieces("", record)]
    axis, experiments = experiments_of(parts, options)
    return inertia(experiments, axis)


METHOD = Method(
    "inertia", "inertia from the frequency response", identify, driven, uses=AXIS - {"pendulum"}, values=()
)
