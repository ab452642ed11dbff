"""Common parts of methods that read records only: the channel of the torque and the known sliding curve."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from stickslip.core.errors import InputError, UnknownName
from stickslip.core.messages import name_columns, name_option, name_parameter
from stickslip.core.record import Record
from stickslip.identification.experiment import TORQUES
from stickslip.identification.methods.method import Options
from stickslip.models import plugins
from stickslip.models.model import Model

MOTORS = ("torque_constant", "force_constant")


def torque_channel(records: Sequence[Record], options: Options, method: str) -> str:
    """Return the channel of the torque: the one named, or the first known one that all records have."""
    have = [set(r.channels) for r in records]
    if options.torque:
        for channels in have:
            if options.torque not in channels:
                raise UnknownName("channel", options.torque, sorted(channels))
        return options.torque
    for name in TORQUES:
        if all(name in channels for channels in have):
            return name
    raise InputError(
        f"{method} needs a torque in every record; map a column with {name_columns(torque='COLUMN:UNIT')}, or give "
        f"{name_option('torque_constant')} for a current (of a linear motor {name_option('force_constant')})"
    )


def with_extra(record: Record, extra: str, torque: str) -> Record:
    """Return the record with the channel `extra` (empty: none) added to the channel `torque`.

    Raises
    ------
    UnknownName, InputError
        If the record has no such channel, or it has another unit.
    """
    if not extra:
        return record
    if extra not in record.channels:
        raise UnknownName(f"channel of {name_option('extra_torque')}", extra, sorted(record.channels))
    units = record.units[torque], record.units[extra]
    if extra == torque or units[0] != units[1]:
        why = "that torque itself" if extra == torque else f"in {units[1]}"
        raise InputError(
            f"{name_option('extra_torque', extra)} is added to {torque}, in {units[0]}, but it is {why}; name "
            "another channel"
        )
    return replace(record, channels={**record.channels, torque: record[torque] + record[extra]})


def with_torque(records: Sequence[Record], options: Options, method: str) -> tuple[list[Record], str]:
    """Return the records with a known extra torque added, and the channel of their torque."""
    channel = torque_channel(records, options, method)
    return [with_extra(r, options.extra_torque, channel) for r in records], channel


def refuse_idle_motor(records: Sequence[Record], options: Options) -> None:
    """Refuse a motor's constant that would be unused because a torque is recorded.

    Raises
    ------
    InputError
    """
    if any("motor_torque" in r.meta.get("derived", {}) for r in records):
        return
    for name in MOTORS:
        if (value := getattr(options, name)) is not None:
            raise InputError(
                f"{name_option(name, f'{value:g}')} would not be used: the torque is recorded; leave it out, or "
                f"map the current alone ({name_columns(current='COLUMN', motor_torque='none')})"
            )


def has_torque(method: str) -> Callable[[Sequence[Record], Options], None]:
    """Return a method's check that every record has a torque."""

    def check(records: Sequence[Record], options: Options) -> None:
        with_torque(records, options, method)
        refuse_idle_motor(records, options)

    return check


def known_curve(options: Options, method: str, own: Sequence[str]) -> Model:
    """Return the known sliding curve: the given model, or Stribeck's with the given values.

    Parameters
    ----------
    options : Options
    method : str
    own : sequence of str
        Names of values that do not belong to the curve.

    Raises
    ------
    InputError, UnknownName
        If parameters of the curve are missing, or a value belongs to neither.
    """
    law = plugins.law("stribeck_plain") if options.model is None else options.model.law
    values: dict[str, Any] = {} if options.model is None else options.model.parameters._asdict()
    given = {name: value for name, value in options.values.items() if name not in own}
    known = [f.name for f in law.fields if not f.per_element]
    for name in given:
        if name not in known:
            raise UnknownName(f"value for {name_option('method', method)}", name, [*own, *known])
    missing = [f.name for f in law.fields if f.name not in {**values, **given} and f.par.default is None]
    if options.model is None and {"fs", "fc", "vs"} & set(missing):
        raise InputError(
            f"{name_option('method', method)} needs the sliding curve, which lacks {', '.join(missing)}; "
            "identify it with "
            f"{name_option('method', 'sliding')} and give {name_option('model', 'model.toml')}, or "
            f"{name_parameter('fs')}, {name_parameter('fc')} and {name_parameter('vs')}"
        )
    return Model(law, {}, **{**values, **given})


def without_constant_torque(record: Record, channel: str, options: Options) -> Record:
    """Return a record without the known constant torque: the value ``offset``, or that of the model's file."""
    offset = options.values.get("offset", options.model_offset)
    return (
        replace(record, channels={**record.channels, channel: record[channel] - offset}) if offset else record
    )


def single(records: Sequence[Record], method: str) -> Record:
    """Return the only record of a method that accepts one."""
    if len(records) != 1:
        raise InputError(
            f"{name_option('method', method)} takes one record, not {len(records)}; run it for each"
        )
    return records[0]
