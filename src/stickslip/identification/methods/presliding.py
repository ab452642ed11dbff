"""GMS elements from loops of torque over displacement (`stickslip.identification.presliding.presliding`)."""

from __future__ import annotations

from collections.abc import Sequence

from stickslip.core.record import Record
from stickslip.identification.estimate import Identification
from stickslip.identification.methods._records import (
    has_torque,
    known_curve,
    single,
    with_torque,
    without_constant_torque,
)
from stickslip.identification.methods.method import TORQUE, Method, Options
from stickslip.identification.presliding.hysteresis import Loop
from stickslip.identification.presliding.presliding import identify_presliding

OWN = ("inertia", "offset")
"""Values that do not belong to the sliding curve."""


def identify(records: Sequence[Record], options: Options) -> Identification:
    """Identify elements from the loops of one record; the inertia is among the values if it is known."""
    (record,), channel = with_torque([single(records, "presliding")], options, "presliding")
    curve = known_curve(options, "presliding", OWN)
    return identify_presliding(
        Loop.of(without_constant_torque(record, channel, options), channel), curve, elements=options.elements,
        shares=options.shares, noise=options.noise, inertia=options.values.get("inertia", 0.0),
    )  # fmt: skip


METHOD = Method(
    "presliding",
    "GMS elements from pre-sliding loops",
    identify,
    has_torque("presliding"),
    uses=TORQUE | {"values", "inertia", "model", "noise", "elements", "shares"},
)
