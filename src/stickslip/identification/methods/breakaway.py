"""Torque at the break, per direction, from torque ramps (`stickslip.identification.presliding.breakaway`)."""

from __future__ import annotations

from collections.abc import Sequence

from stickslip.core.record import Record
from stickslip.identification.estimate import Identification
from stickslip.identification.methods._records import has_torque, with_torque
from stickslip.identification.methods.method import TORQUE, Method, Options
from stickslip.identification.presliding.breakaway import identify_breakaway


def identify(records: Sequence[Record], options: Options) -> Identification:
    """Identify the torque at the break, per direction."""
    records, torque = with_torque(records, options, "breakaway")
    more = {} if options.threshold is None else {"threshold": options.threshold}
    return identify_breakaway(records, torque=torque, **more)


METHOD = Method(
    "breakaway", "break-away torque from torque ramps", identify, has_torque("breakaway"),
    uses=TORQUE | {"threshold"}, values=(),
)  # fmt: skip
