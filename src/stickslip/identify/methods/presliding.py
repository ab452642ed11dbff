"""GMS elements from loops of torque over displacement (`stickslip.identify.presliding.presliding`)."""

from __future__ import annotations

from collections.abc import Sequence

from stickslip.identify.estimate import Identification
from stickslip.identify.methods._records import CURVE, curve_values, has_torque, single, torque_channel
from stickslip.identify.methods.method import Method, Options
from stickslip.identify.presliding.hysteresis import Loop
from stickslip.identify.presliding.presliding import identify_presliding
from stickslip.record import Record


def identify(records: Sequence[Record], options: Options) -> Identification:
    """Elements from the loops of one record; the inertia is among the values where it is known."""
    record = single(records, "presliding")
    loop = Loop.of(record, torque_channel(records, options, "presliding"))
    return identify_presliding(
        loop, curve_values(options, "presliding"), elements=options.elements, noise=options.noise,
        inertia=options.values.get("inertia", 0.0),
    )  # fmt: skip


METHOD = Method(
    "presliding",
    "GMS elements from pre-sliding loops",
    identify,
    has_torque("presliding"),
    values=(*CURVE, "inertia"),
)
