"""Torque over the angle: cogging, and friction by angle (`stickslip.identification.cogging`)."""

from __future__ import annotations

from collections.abc import Sequence

from stickslip.core.errors import InputError, UnknownName
from stickslip.core.messages import name_columns, name_option, name_parameter
from stickslip.core.record import Record
from stickslip.identification.cogging import identify_cogging
from stickslip.identification.estimate import Identification
from stickslip.identification.experiment import TORQUES
from stickslip.identification.methods._records import with_extra
from stickslip.identification.methods.method import TORQUE, Method, Options

GEAR = "gear_ratio"


def channel_of(records: Sequence[Record], options: Options) -> str:
    """Return the channel of the torque, or of the current if no torque is known."""
    have = [set(r.channels) for r in records]
    for name in (options.torque,) if options.torque else (*TORQUES, "current"):
        if all(name in channels for channels in have):
            return name
    if options.torque:
        raise UnknownName("channel", options.torque, sorted(set[str]().union(*have)))
    raise InputError(
        f"cogging needs a torque or a current in every record; map a column with {name_columns(current='COLUMN:A')} or "
        f"{name_columns(torque='COLUMN:UNIT')}"
    )


def identify(records: Sequence[Record], options: Options) -> Identification:
    """Identify the even and odd part of the torque over the angle."""
    channel = channel_of(records, options)
    records = [with_extra(r, options.extra_torque, channel) for r in records]
    return identify_cogging(records, torque=channel, gear=gear_of(options), progress=options.progress)


def gear_of(options: Options) -> float:
    """Return the turns of the position's shaft per turn of the slowest shaft."""
    for name in options.values:
        if name != GEAR:
            raise UnknownName(f"value of {name_option('method', 'cogging')}", name, (GEAR,))
    gear = float(options.values.get(GEAR, 1.0))
    if not gear >= 1.0:
        raise InputError(
            f"{name_parameter(GEAR, f'{gear:g}')} must be at least 1: turns of the position's shaft for one of "
            "the slowest"
        )
    return gear


def check(records: Sequence[Record], options: Options) -> None:
    """Refuse records without torque or current, and values that are not used."""
    channel_of(records, options)
    gear_of(options)


METHOD = Method(
    "cogging", "torque over the angle: cogging, and friction by angle", identify, check,
    uses=TORQUE | {"values"}, takes_current=True,
)  # fmt: skip
