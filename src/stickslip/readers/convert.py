"""Convert columns to a record in SI units; every step is listed in the record's meta."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding
from stickslip.core.messages import name_columns, name_option
from stickslip.core.record import Record
from stickslip.readers._choose import Choice
from stickslip.readers._clock import (
    NoTimes,
    may_be_steady,
    on_clock,
    on_own_clocks,
    restated,
    time_of,
    times_of,
)
from stickslip.readers._names import KINDS, commanded, role_of
from stickslip.readers._units import SI, Unit, parse_unit
from stickslip.readers.table_columns import Array, Column, Table

__all__ = ["Drive", "convert", "times_of"]

LINEAR = {
    "angle": "length",
    "angular velocity": "velocity",
    "angular acceleration": "acceleration",
    "torque": "force",
}
MOTION = (
    "position",
    "position_reference",
    "position_error",
    "velocity",
    "velocity_reference",
    "acceleration",
)
EFFORT = ("motor_torque", "friction_torque", "sensor_torque", "compensation_torque")
NUMBERS = (
    "counts_per_rev", "rated_torque", "rated_current", "torque_constant", "force_constant", "gear_ratio", "lead",
    "pole_pairs",
)  # fmt: skip
"""Numbers from a drive's data sheet, all positive."""
TURNING = ("torque_constant", "lead", "gear_ratio")
"""Numbers of rotary motors only; a linear one has `force_constant` instead."""
LONGEST_LEAD = 1.6
"""m per revolution, of a drum with a diameter of half a metre. A lead given in mm is larger, except for the finest
screws."""


@dataclass(frozen=True, slots=True)
class Drive:
    """Numbers from the drive's data sheet that a file does not contain; NaN if unknown.

    Attributes
    ----------
    counts_per_rev : float
        Encoder counts per revolution (4 x lines if the drive counts every edge).
    rated_torque : float
        N·m (or N), for torques in percent or per mille.
    rated_current : float
        A, for currents in percent or per mille.
    torque_constant : float
        N·m/A, for torque = current x torque constant.
    force_constant : float
        N/A, for a linear motor, which has neither lead nor gear.
    gear_ratio : float
        Motor revolutions per load revolution.
    side : {"motor", "load"}
        Side of the gear that the record describes; signals of the other side are converted.
    lead : float
        Travel of a linear axis per revolution, m: a screw's lead, a pinion's or pulley's circumference. If a record has
        both lengths and torques (angles and forces), all are converted to lengths and forces.
    pole_pairs : float
        Electrical revolutions per motor revolution, for speeds in electrical revolutions per minute (eRPM).
    """

    counts_per_rev: float = math.nan
    rated_torque: float = math.nan
    rated_current: float = math.nan
    torque_constant: float = math.nan
    force_constant: float = math.nan
    gear_ratio: float = math.nan
    side: str = "motor"
    lead: float = math.nan
    pole_pairs: float = math.nan

    def __post_init__(self) -> None:
        for name in NUMBERS:
            value = getattr(self, name)
            if not math.isnan(value) and not (math.isfinite(value) and value > 0.0):
                raise InputError(f"{name} = {value:g} must be greater than 0")
        others = [n for n in TURNING if not math.isnan(getattr(self, n))]
        if others and not math.isnan(self.force_constant):
            raise InputError(
                f"force_constant = {self.force_constant:g} N/A is a linear motor's, and {others[0]} = "
                f"{getattr(self, others[0]):g} that of one that turns; give one of them"
            )
        if self.lead > LONGEST_LEAD:
            raise InputError(
                f"lead = {self.lead:g} m a revolution is more than any screw, pinion or pulley moves; it is in m "
                f"({1e-3 * self.lead:g} for {self.lead:g} mm), on the command line (`--lead`) in mm"
            )
        if self.side not in ("motor", "load"):
            raise InputError(f"side = {self.side!r} is not known; choose from motor, load")

    def known(self) -> dict[str, Any]:
        """Return the given numbers as plain data."""
        return {k: v for k, v in asdict(self).items() if not (isinstance(v, float) and math.isnan(v))}


def convert(
    table: Table,
    choices: Sequence[Choice],
    drive: Drive,
    sample_time: float | None,
    findings: Sequence[Finding],
    *,
    steady: bool = False,
) -> Record:
    """Return the record.

    With `steady`, rows of velocity and torque without times are steady points: their times are 0, and `steady_points`
    of ``meta["reading"]`` is true.

    Raises
    ------
    InputError
        If there is no time, a conversion needs a number that is missing, or columns differ in length.
    """
    said = list(findings)
    by_role = {choice.role: choice for choice in choices}
    linear = is_linear(by_role)
    columns = {c.name: c for c in table.columns}
    try:
        time, origin, more = time_of(table, by_role, columns, sample_time)
        steady = False
    except NoTimes:
        if not (steady and may_be_steady(by_role)):
            raise
        time, origin, more = np.zeros(columns[by_role["velocity"].column].values.size), 0.0, []
    said += more
    if not steady:
        columns = restated(columns, by_role, sample_time)
        columns, time = on_own_clocks(columns, by_role, time, origin)
    if time.size == 0:
        raise InputError("there are no rows; give a record with samples")
    channels: dict[str, Array] = {}
    units: dict[str, str] = {}
    listed: list[dict[str, Any]] = []
    for role, choice in by_role.items():
        if role == "time":
            listed.append(_entry(choice, "s"))
            continue
        unit = unit_of(choice, linear)
        scale, target, steps = _scale(choice, unit, drive)
        values, resampled = on_clock(columns[choice.column], time, origin, role)
        said += resampled
        channels[role] = scale * values + (unit.offset if unit.offset else 0.0)
        units[role] = target
        listed.append(
            _entry(choice, target) | {"factor": scale, "side": choice.side or "motor", "steps": steps}
        )
    said += _one_kind(channels, units, listed, drive)
    said += [*_idle_gear(listed, drive), *_idle_numbers(listed, drive)]
    derived, more = _torque_from_current(channels, units, drive, linear)
    reading = _reading(table, listed, drive, origin, [*said, *more])
    if steady:
        reading["steady_points"] = True
    return Record(time, channels, units, {"reading": reading, "derived": derived})


def _entry(choice: Choice, unit: str) -> dict[str, Any]:
    """Return the entry of a column in the record's meta; `unit` is an assumed one."""
    entry: dict[str, Any] = {
        "channel": choice.role, "column": choice.column, "unit": choice.unit or unit, "source": choice.source,
    }  # fmt: skip
    if choice.role in ("motor_torque", "current") and commanded(choice.column):
        entry["commanded"] = True
    return entry


def _reading(
    table: Table, listed: Sequence[dict[str, Any]], drive: Drive, origin: float, said: Sequence[Finding]
) -> dict[str, Any]:
    """Return the entry ``reading`` of the record's meta."""
    used = {entry["column"] for entry in listed}
    unused = [c for c in table.columns if c.name not in used]
    return {
        "format": table.format,
        "columns": list(listed),
        "unused": [c.name for c in unused],
        "drives": [c.name for c in unused if _drives(c)],
        "constants": dict(table.constants),
        "drive": drive.known(),
        "time_origin": origin,
        "findings": [f.as_data() for f in said],
        "runs": list(table.runs),
    }


# ---- units --------------------------------------------------------------------------------------------------


def _drives(column: Column) -> bool:
    """Whether a column may be the drive signal: its unit is that of a torque, force, current or a fraction."""
    if column.channel:
        return False
    unit = column.unit if parse_unit(column.unit) else role_of(column.name).unit
    parsed = parse_unit(unit)
    return parsed is not None and parsed.kind in ("torque", "force", "current", "share")


def is_linear(by_role: dict[str, Choice]) -> bool:
    """Whether the axis is linear: a length, a linear velocity or a force is stated."""
    stated = [parse_unit(c.unit) for c in by_role.values() if c.unit and c.role in (*MOTION, *EFFORT)]
    kinds = [u.kind for u in stated if u is not None]
    return any(k in ("length", "velocity", "acceleration", "force") for k in kinds) and "angle" not in kinds


def unit_of(choice: Choice, linear: bool) -> Unit:
    """Return the unit in which a column is read: the stated one, or SI."""
    if (unit := parse_unit(choice.unit)) is not None:
        return unit
    kind = KINDS[choice.role][0]
    return Unit(LINEAR.get(kind, kind) if linear else kind)


def _scale(choice: Choice, unit: Unit, drive: Drive) -> tuple[float, str, list[str]]:
    """Return the factor to SI on the record's side of the gear, the SI unit, and the steps as text."""
    kind, factor, steps = unit.kind, unit.factor, list[str]()
    if kind in ("counts", "count rate"):
        per_rev = _needed(
            drive.counts_per_rev,
            choice,
            "counts",
            name_option("counts_per_rev"),
            f", or {name_columns(position='COLUMN:0.25um')} for a linear scale",
        )
        factor *= 2.0 * math.pi / per_rev
        kind = "angle" if kind == "counts" else "angular velocity"
        steps.append(f"2π / {per_rev:g} counts")
    elif kind == "electrical speed":
        pairs = _needed(
            drive.pole_pairs,
            choice,
            "electrical revolutions per minute (eRPM)",
            name_option("pole_pairs", "N"),
        )
        factor, kind = factor / pairs, "angular velocity"
        steps.append(f"{pairs:g} pole pairs")
    elif kind == "share" and choice.role in ("motor_torque", "compensation_torque"):
        rated = _needed(
            drive.rated_torque, choice, "a share of the rated torque", name_option("rated_torque")
        )
        factor, kind = factor * rated, "torque"
        steps.append(f"rated torque {rated:g}")
    elif kind == "share" and choice.role in ("current", "current_reference"):
        rated = _needed(
            drive.rated_current, choice, "a share of the rated current", name_option("rated_current")
        )
        factor, kind = factor * rated, "current"
        steps.append(f"rated current {rated:g} A")
    side = choice.side or "motor"
    if side != drive.side and choice.role in (*MOTION, *EFFORT) and (choice.side or drive.side == "load"):
        if choice.side == "load" and choice.source in ("map", "profile") and math.isnan(drive.gear_ratio):
            raise InputError(
                f"{choice.role}: column {choice.column!r} is on the load's side of the gear; give "
                f"{name_option('gear_ratio')}, "
                f"or {name_columns(**{choice.role: f'{choice.column}@motor'})} if it is not"
            )
        if not math.isnan(drive.gear_ratio):
            to_motor = drive.gear_ratio if side == "load" else 1.0 / drive.gear_ratio
            factor *= to_motor if choice.role in MOTION else 1.0 / to_motor
            steps.append(f"gear ratio {drive.gear_ratio:g}, {side} to {drive.side} side")
    return factor, SI[kind], steps


def _needed(value: float, choice: Choice, what: str, option: str, other: str = "") -> float:
    if math.isnan(value):
        raise InputError(f"{choice.role}: column {choice.column!r} is in {what}; give {option}{other}")
    return value


def _one_kind(
    channels: dict[str, Array], units: dict[str, str], listed: list[dict[str, Any]], drive: Drive
) -> list[Finding]:
    """Convert a record with lengths and torques (angles and forces) to lengths and forces in place, with the lead."""
    turning = [
        c for c in channels if (c in MOTION and "rad" in units[c]) or (c in EFFORT and units[c] == "N·m")
    ]
    along = [c for c in channels if c in (*MOTION, *EFFORT) and c not in turning]
    if not turning or not along:
        return []
    if math.isnan(drive.lead):
        columns = {e["channel"]: f"{e['channel']} {e['column']!r} in {e['unit']}" for e in listed}
        level = "error" if "motor_torque" in (*turning, *along) else "warning"
        message = f"the record mixes {columns[along[0]]} with {columns[turning[0]]}: lengths and torques"
        remedy = (
            f"give {name_option('lead', 'MM')}, what the axis moves for one revolution (a screw's lead, a "
            "pulley's circumference), and "
            f"{name_option('gear_ratio', 'N')} where a gear lies between"
        )
        rated = [e for e in listed if e["channel"] == "motor_torque" and _steps_of(e, "rated torque")]
        for entry in rated:
            unit = f"{entry['column']}:{entry['factor']:g}N"
            remedy += (
                f"; of a linear motor's rated force, instead of {name_option('rated_torque')}, "
                f"{name_columns(motor_torque=unit)}"
            )
        return [Finding(level, "mixed-units", message, remedy=remedy)]
    # Rotary signals are on the motor side, unless the gear ratio has been applied.
    geared = any(_steps_of(entry, "gear ratio") for entry in listed)
    way = drive.lead / (1.0 if geared else _ratio_or_one(drive)) / (2.0 * math.pi)
    for entry in listed:
        channel = entry["channel"]
        if channel in turning:
            factor = way if channel in MOTION else 1.0 / way
            channels[channel] = factor * channels[channel]
            units[channel] = units[channel].replace("rad", "m").replace("N·m", "N")
            entry["factor"] *= factor
            entry["steps"].append(f"{2e3 * math.pi * way:g} mm a revolution")
    return []


def _steps_of(entry: Mapping[str, Any], word: str) -> bool:
    """Whether a conversion step of a column contains this text."""
    return any(word in step for step in entry.get("steps", ()))


def _idle_numbers(listed: Sequence[dict[str, Any]], drive: Drive) -> list[Finding]:
    """Return findings on a rated torque, rated current or lead that converts nothing. The doctor reports fractions
    without a unit."""
    out: list[Finding] = []
    ratings = (("motor_torque", drive.rated_torque, "torque"), ("current", drive.rated_current, "current"))
    for channel, value, what in ratings:
        quiet = any(e["channel"] == channel and e["source"] == "assumed" for e in listed)
        if not (math.isnan(value) or quiet or any(_steps_of(e, f"rated {what}") for e in listed)):
            message = f"rated {what} {value:g} converts nothing: no column is a share of it"
            out.append(Finding("note", f"rated-{what}", message))
    by_current = "motor_torque" not in {e["channel"] for e in listed} and not math.isnan(
        drive.torque_constant
    )
    if not (math.isnan(drive.lead) or by_current or any(_steps_of(e, "mm a revolution") for e in listed)):
        message = (
            f"lead {1e3 * drive.lead:g} mm converts nothing: no column turns while another moves along a line"
        )
        out.append(Finding("note", "lead", message))
    return out


def _idle_gear(listed: Sequence[dict[str, Any]], drive: Drive) -> list[Finding]:
    """Return the finding that a gear ratio converts nothing, because all signals are taken as those of the motor
    side."""
    moved = [e for e in listed if e["channel"] in (*MOTION, *EFFORT)]
    used = drive.side == "load" or not math.isnan(drive.lead) or any(e["side"] == "load" for e in moved)
    if math.isnan(drive.gear_ratio) or used:
        return []
    message = f"gear ratio {drive.gear_ratio:g} converts nothing: every signal counts as the motor side's"
    remedy = (
        f"{name_option('side', 'load')} makes a record of the load's side of it, "
        f"{name_columns(position='COLUMN:UNIT@load')} says what was measured "
        "there"
    )
    return [Finding("note", "gear-ratio", message, remedy=remedy)]


def pendulum_before_gear(record: Record, told: str) -> list[Finding]:
    """Return the finding that a pendulum depends on the load's angle while the record has the motor's; else nothing.

    `told` describes the pendulum in the message.
    """
    drive: dict[str, Any] = record.meta.get("reading", {}).get("drive", {})
    ratio = float(drive.get("gear_ratio", 1.0))
    if ratio == 1.0 or drive.get("side", "motor") == "load" or record.units.get("position") != "rad":
        return []
    message = (
        f"{told}, but the record is about the motor's side of the gear of {ratio:g}: a pendulum is fitted once a turn "
        "of the motor"
    )
    remedy = (
        f"give {name_option('side', 'load')}, and {name_columns(position='COLUMN:UNIT@load')} for a column "
        "that was measured there"
    )
    return [Finding("warning", "gear-ratio", message, remedy=remedy)]


def _force_from_current(
    channels: dict[str, Array], units: dict[str, str], constant: float, along: bool
) -> dict[str, str]:
    """Add the force of a linear axis: current x force constant."""
    if not along:
        raise InputError(
            f"{name_option('force_constant', f'{constant:g}')} is a linear motor's, and the record's positions "
            "are angles; give "
            f"{name_option('torque_constant', 'NM_PER_A')}"
        )
    channels["motor_torque"], units["motor_torque"] = constant * channels["current"], SI["force"]
    return {"motor_torque": f"current x force constant {constant:g} N/A"}


def _torque_from_current(
    channels: dict[str, Array], units: dict[str, str], drive: Drive, linear: bool
) -> tuple[dict[str, str], list[Finding]]:
    """Add the torque, current x torque constant, if a current and a constant are given and no torque."""
    known = not (math.isnan(drive.torque_constant) and math.isnan(drive.force_constant))
    if "motor_torque" in channels or "current" not in channels or not known:
        return {}, []
    along = linear or any(units[c].startswith("m") for c in channels if c in MOTION)
    if not math.isnan(drive.force_constant):
        return _force_from_current(channels, units, drive.force_constant, along), []
    said: list[Finding] = []
    factor, gear = drive.torque_constant, ""
    if drive.side == "load" and not math.isnan(drive.gear_ratio):
        factor *= drive.gear_ratio
        gear = f" x gear ratio {drive.gear_ratio:g}"
    unit = SI["force" if along else "torque"]
    constant = f"{drive.torque_constant:g} {unit}/A"
    if along and not math.isnan(drive.lead):
        way = drive.lead / (1.0 if gear else _ratio_or_one(drive))
        factor *= 2.0 * math.pi / way
        constant, gear = f"{drive.torque_constant:g} N·m/A", f" x 2π / {1e3 * way:g} mm"
    elif along:
        message = (
            f"the axis moves along a line: {name_option('torque_constant', f'{drive.torque_constant:g}')} "
            "was taken in N/A"
        )
        said.append(
            Finding(
                "warning", "mixed-units", message,
                remedy=f"if it is in N·m/A, give the screw's {name_option('lead', 'MM')}; if it is a linear "
                    "motor's, say so with "
                f"{name_option('force_constant', 'N_PER_A')} in its place",
            )
        )  # fmt: skip
    channels["motor_torque"] = factor * channels["current"]
    units["motor_torque"] = unit
    return {"motor_torque": f"current x torque constant {constant}{gear}"}, said


def _ratio_or_one(drive: Drive) -> float:
    return 1.0 if math.isnan(drive.gear_ratio) else drive.gear_ratio
