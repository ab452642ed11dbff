"""Torque at the break, per direction, from torque ramps (`stickslip.identify.presliding.breakaway`)."""

from __future__ import annotations

from collections.abc import Sequence

from stickslip.identify.estimate import Identification
from stickslip.identify.methods._records import has_torque, with_torque
from stickslip.identify.methods.method import TORQUE, Method, Options
from stickslip.identify.presliding.breakaway import identify_breakaway
from stickslip.record import Record


def identify(records: Sequence[Record], options: Options) -> Identification:
    """Torque at the break, per direction."""
    records, torque = with_torque(records, options, "breakaway")
    more = {} if options.threshold is None else {"threshold": options.threshold}
    return identify_breakaway(records, torque=torque, **more)


METHOD = Method(
    "breakaway", "break-away torque from torque ramps", identify, has_torque("breakaway"),
    uses=TORQUE | {"threshold"}, values=(),
)  # fmt: skip
