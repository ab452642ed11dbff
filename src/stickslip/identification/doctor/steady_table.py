"""Check a table of steady points: rows of constant velocity and its torque, without times."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np

from stickslip.core.finding import Finding
from stickslip.core.messages import name_columns, name_option
from stickslip.core.record import Record
from stickslip.identification.doctor import units
from stickslip.identification.doctor.view import View, is_number
from stickslip.identification.experiment import TORQUES
from stickslip.readers.cut import file_rows, range_words, taken

Array = np.ndarray[Any, np.dtype[np.float64]]

NOTES = "notes_on_rows"
"""Key of a record's meta: notes on the rows left out of a table."""
MOST = 1000
"""Most rows of a table: each is a test at constant velocity, which takes seconds. More rows are a log without times."""
ALIKE = 0.1
"""Least relative difference of the torque between both directions for its sign to be certain."""


def is_steady_table(record: Record) -> bool:
    """Return whether the rows of a record are steady points."""
    return bool(record.meta.get("reading", {}).get("steady_points", False))


def torque_in(record: Record) -> str:
    """Return the channel of the torque, or of the current."""
    return next((name for name in (*TORQUES, "current") if name in record.channels), "")


def examine_table(record: Record) -> tuple[Record, list[Finding]]:
    """Return the rows that are steady points, and the findings."""
    reading = cast("Mapping[str, Any]", record.meta["reading"])
    findings = [Finding.from_data(f) for f in reading.get("findings", [])]
    findings += units.assumed(View(record))
    if len(record) > MOST:
        message = f"{len(record)} rows without times are more than a table of steady points has: a log"
        remedy = f"give their times with {name_columns(time='COLUMN:UNIT')} or {name_option('sample_time', 'SECONDS')}"
        return record, [*findings, Finding("error", "no-clock", message, remedy=remedy)]
    torque = torque_in(record)
    velocity, effort = record["velocity"], record[torque]
    said: list[str] = []
    known = is_number(velocity) & is_number(effort)
    still = known & (velocity == 0.0)
    left_out = (
        (~known, "trimmed", "are left out, since a value is missing"),
        (still, "standstill-rows", "are left out: at velocity 0 any torque up to break-away is possible"),
    )
    for rows, code, why in left_out:
        if np.any(rows):
            listed = range_words(file_rows(record)[rows])
            said.append(f"{np.sum(rows)} of {len(record)} rows {why}: rows {listed}")
            findings.append(Finding("note", code, said[-1]))
    kept = taken(record, known & ~still)
    if not len(kept):
        message = "no row has a velocity other than 0 and a torque"
        findings.append(Finding("error", "never-moved", message, remedy="check the columns and their units"))
        return kept, findings
    if reading.get("unused"):
        said.append(f"columns not used: {', '.join(reading['unused'])}")
    message = f"the rows have no times: each is taken as a steady point, {len(kept)} of velocity and {torque}"
    findings.append(Finding("note", "steady-points", message))
    kept = replace(kept, meta={**kept.meta, NOTES: said})
    return kept, [*findings, *signs(kept["velocity"], kept[torque])]


def signs(velocity: Array, torque: Array) -> Iterator[Finding]:
    """Yield an error if the torque's signs in both directions cannot be those of friction."""
    ahead, back = torque[velocity > 0.0], torque[velocity < 0.0]
    if not (ahead.size and back.size):
        return
    forward, backward = float(np.median(ahead)), float(np.median(back))
    size = max(abs(forward), abs(backward))
    if forward < backward and backward - forward > ALIKE * size:
        message = (
            f"the torque is {forward:.4g} at positive velocities and {backward:.4g} at negative ones: friction would "
            "drive the axis"
        )
        remedy = f"if the torque is counted the other way, give {name_columns(torque='COLUMN:-UNIT')}"
        yield Finding("error", "torque-sign", message, remedy=remedy)
    elif abs(forward - backward) <= ALIKE * size and forward * backward > 0.0:
        message = (
            f"the torque is {forward:.4g} at positive velocities and {backward:.4g} at negative ones: a magnitude "
            "without its sign, or a constant torque far above friction"
        )
        remedy = (
            "give torques at negative velocities their sign; if it is right, "
            f"{name_option('accept', 'torque-magnitude')}"
        )
        yield Finding("error", "torque-magnitude", message, remedy=remedy)
