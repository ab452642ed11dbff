"""Conversion of records to experiments of an axis according to the options, with checks before any computation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from stickslip.control.linear import Cascade, Gains
from stickslip.control.own_loop import ReferenceVelocity, kind_of_loop, split_loop
from stickslip.core.errors import InputError
from stickslip.core.messages import name_columns, name_option
from stickslip.core.record import Record
from stickslip.identification.experiment import DRIVES, Experiment, experiment_of
from stickslip.identification.methods._records import MOTORS, with_extra
from stickslip.identification.methods.method import Options
from stickslip.machines.servo import Motor, ServoAxis
from stickslip.simulation.recorded_input.simulation import Loop

BESIDE_GAINS = ("limit", "filter", "period", "count", "span")
NOT_NEGATIVE = (*Gains._fields, *Cascade._fields, "filter", "period", "count")
RANGES = {"limit": "greater than 0", **dict.fromkeys(NOT_NEGATIVE, "a finite number of 0 or more")}


def experiments_of(records: Sequence[Record], options: Options) -> tuple[ServoAxis, list[Experiment]]:
    """Return the axis and an experiment for every record."""
    axis = axis_of(records[0], options)
    return axis, [experiment(record, axis, options) for record in records]


def driven(records: Sequence[Record], options: Options) -> None:
    """Refuse records without the signal that drives the axis, and constants that no signal uses."""
    _, experiments = experiments_of(records, options)
    refuse_unused(records, experiments, options)


def refuse_unused(records: Sequence[Record], experiments: Sequence[Experiment], options: Options) -> None:
    """Refuse a motor's constant that no signal uses: it would be ignored silently."""
    quantities = {t.quantity for t in experiments} if options.drive_gain is None else {"gain"}
    derived = any("motor_torque" in r.meta.get("derived", {}) for r in records)
    unused: list[str] = []
    for name in MOTORS:
        value = getattr(options, name)
        if value is not None and not quantities & {"current", "voltage"} and not derived:
            unused.append(name_option(name, f"{value:g}"))
    if options.resistance is not None and "voltage" not in quantities:
        unused.append(name_option("resistance", f"{options.resistance:g}"))
    if unused:
        instead = f"; {name_option('drive_gain')} says all of it" if options.drive_gain is not None else ""
        made = ", the loop's output" if any(t.drive is None for t in experiments) else ""
        raise InputError(
            f"{' and '.join(unused)} would not be used: the drive's signal is a {' and a '.join(sorted(quantities))}"
            f"{made}{instead}; leave it out, map the current or voltage ({name_columns(current='COLUMN')}), or "
            f"say {name_option('loop_output')}"
        )


def axis_of(record: Record, options: Options) -> ServoAxis:
    """Return the axis; the reader has already converted the record to one side of the gearing."""
    linear = record.units.get("position") == "m"
    return ServoAxis(
        motion="linear" if linear else "rotary", drive_side="load",
        gravity="pendulum" if options.pendulum else "constant", drive_gain=options.drive_gain,
        motor=Motor(
            torque_constant=motor_constant(record, options, linear),
            resistance=options.resistance,
        ),
    )  # fmt: skip


def motor_constant(record: Record, options: Options, linear: bool) -> float | None:
    """Return the torque per current, N·m/A (N/A for a linear axis), from the options or else from the record's reading.

    Raises
    ------
    InputError
        If the options give a linear motor's constant for a rotary axis.
    """
    if options.force_constant is not None and not linear:
        raise InputError(
            f"{name_option('force_constant', f'{options.force_constant:g}')} is a linear motor's, and the "
            "record's positions are angles; "
            f"leave it out, or give {name_option('torque_constant', 'NM_PER_A')}"
        )
    known = record.meta.get("reading", {}).get("drive", {})  # Including a profile's.
    said = [getattr(options, name) for name in MOTORS]
    kept = [known.get(name) for name in (MOTORS if linear else MOTORS[:1])]
    return next((value for value in (*said, *kept) if value is not None), None)


def experiment(record: Record, axis: ServoAxis, options: Options) -> Experiment:
    """Return the record as an experiment."""
    name = str(record.meta.get("reading", {}).get("file", "")) or "record"
    loop = str(record.meta.get("loop", ""))
    if loop and not {"position_reference", "reference"} & set(record.channels):
        raise InputError(
            f"{name}: {name_option('loop')} needs the reference position beside {', '.join(record.channels)}; "
            "map its column with "
            f"{name_columns(position_reference='COLUMN')}, or leave {name_option('loop')} out"
        )
    recorded = bool(set(DRIVES) & set(record.channels))
    output = options.loop_output or ("torque" if options.resistance is None else "voltage")
    if recorded or output != "voltage":  # A signal in V or A does not depend on the supply.
        record = replace(record, channels={k: v for k, v in record.channels.items() if k != "supply"})
    if options.extra_torque and (loop or "motor_torque" not in record.channels):
        why = (
            f"the loop that {name_option('loop')} simulates would not make it"
            if loop
            else "no torque is recorded"
        )
        raise InputError(
            f"{name_option('extra_torque', options.extra_torque)} is added to the recorded torque, but {why}; "
            "leave one out"
        )
    record = with_extra(record, options.extra_torque, "motor_torque")
    return experiment_of(record, axis, loop=loop_of(loop) if loop else None, name=name, output=output)


def loop_of(given: str | Mapping[str, float | ReferenceVelocity]) -> Loop:
    """Return the sampled controller of ``kp=..,kd=..`` or ``kv=..,kvp=..``, or of a mapping with these names."""
    numbers, reference_velocity = split_loop(given)
    if reference_velocity == "instant":
        raise InputError(
            f"{name_option('loop')}: reference_velocity = instant is not in a record, whose reference is known "
            "at its rows only: the "
            "loop is simulated with the difference of two rows; leave it out"
        )
    kind_of_loop(numbers, BESIDE_GAINS)
    for name, value in numbers.items():
        above = math.isfinite(value) or name == "limit"
        if not above or (name in NOT_NEGATIVE and value < 0.0) or (name == "limit" and not value > 0.0):
            raise InputError(
                f"{name_option('loop')}: {name} = {value:g} must be {RANGES.get(name, 'a finite number')}"
            )
    span = numbers.pop("span", 1.0)
    if span not in (1.0, 2.0):
        raise InputError(f"{name_option('loop')}: span = {span:g} must be 1 or 2 samples")
    return Loop(velocity_span=int(span), **numbers)
