"""Units that nobody states and that a number of the drive's tells: whoever gives counts a revolution has counts."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stickslip.readers._choose import Choice
from stickslip.readers.convert import Drive
from stickslip.readers.table_columns import Table

__all__ = ["told"]

PER_MILLE = re.compile(r"(?i)(?<![0-9a-f])60(?:77|b2)(?![0-9a-f])")
"""Objects of CiA 402 (IEC 61800-7-201) in thousandths of the rated torque: actual torque, torque offset."""


def told(choices: Sequence[Choice], table: Table, drive: Drive) -> list[Choice]:
    """The choices, with the units of whole numbers that the drive's numbers tell."""
    columns = {c.name: c for c in table.columns}
    known = drive.known()
    out: list[Choice] = []
    for choice in choices:
        unit = ""
        if choice.role in ("position", "position_reference") and "counts_per_rev" in known:
            unit = "counts"
        elif "rated_torque" in known and PER_MILLE.search(choice.column):
            unit = "permille"
        if unit and not choice.unit and _whole(columns[choice.column].values):
            choice = replace(choice, unit=unit, source="drive")
        out.append(choice)
    return out


def _whole(values: np.ndarray) -> bool:
    """Whether all values are whole numbers, and not all alike."""
    finite = values[np.isfinite(values)]
    return bool(finite.size and np.ptp(finite) > 0.0 and np.all(finite == np.round(finite)))
