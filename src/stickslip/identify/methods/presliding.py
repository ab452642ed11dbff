"""GMS elements from loops of torque over displacement (`stickslip.identify.presliding.presliding`)."""

from __future__ import annotations

from collections.abc import Sequence

from stickslip.identify.estimate import Identification
from stickslip.identify.methods._records import CURVE, curve_values, has_torque, single, with_torque
from stickslip.identify.methods.method import TORQUE, Method, Options
from stickslip.identify.presliding.hysteresis import Loop
from stickslip.identify.presliding.presliding import identify_presliding
from stickslip.record import Record


def identify(records: Sequence[Record], options: Options) -> Identification:
    """Elements from the loops of one record; the inertia is among the values where it is known."""
    (record,), channel = with_torque([single(records, "presliding")], options, "presliding")
    loop = Loop.of(record, channel)
    return identify_presliding(
        loop, curve_values(options, "presliding"), elements=options.elements, noise=options.noise,
        inertia=options.values.get("inertia", 0.0),
    )  # fmt: skip


METHOD = Method(
    "presliding",
    "GMS elements from pre-sliding loops",
    identify,
    has_torque("presliding"),
    uses=TORQUE | {"values", "inertia", "model", "noise", "elements"},
    values=(*CURVE, "inertia"),
)
