"""GMS's attraction parameter from a motion in one direction (`stickslip.identification.presliding.attraction`)."""

from __future__ import annotations

from collections.abc import Sequence

from stickslip.core.errors import InputError
from stickslip.core.messages import name_columns, name_option
from stickslip.core.record import Record
from stickslip.identification.estimate import Identification
from stickslip.identification.methods._records import has_torque, single, with_torque, without_constant_torque
from stickslip.identification.methods.method import TORQUE, Method, Options
from stickslip.identification.presliding.attraction import identify_attraction
from stickslip.identification.presliding.hysteresis import Loop


def identify(records: Sequence[Record], options: Options) -> Identification:
    """Identify the attraction parameter of the given model."""
    record, model = single(records, "attraction"), options.model
    if model is None or model.law.name != "gms":
        raise InputError(
            f"{name_option('method', 'attraction')} needs a GMS law with its elements; identify it with "
            f"{name_option('method', 'presliding')} and give "
            f"{name_option('model', 'model.toml')}"
        )
    if "velocity" not in record.channels:
        raise InputError(
            f"{name_option('method', 'attraction')} needs the velocity; map a column with "
            f"{name_columns(velocity='COLUMN')}"
        )
    (record,), channel = with_torque([record], options, "attraction")
    loop = Loop.of(without_constant_torque(record, channel, options), channel, "velocity")
    return identify_attraction(loop, model, noise=options.noise)


METHOD = Method(
    "attraction",
    "GMS's attraction from a motion in one direction",
    identify,
    has_torque("attraction"),
    uses=TORQUE | {"model", "noise"},
    values=(),
)
