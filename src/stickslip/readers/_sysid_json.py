"""Read the JSON files of WPILib's SysId and its predecessor frc-characterization: four tests of one mechanism.

Format: SysId, "Data Collection". A test is a list of rows: time (s), motor voltage (V), position (rotations of the
output) and velocity (rotations/s); for a drivetrain of the left and right side. frc-characterization adds the battery's
voltage and the commanded speed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding
from stickslip.core.messages import name_columns
from stickslip.readers.limits import insist_on_values
from stickslip.readers.table_columns import Array, Column, Table

TESTS = ("slow-forward", "slow-backward", "fast-forward", "fast-backward")
REV, RATE, NONE = "rev", "rev/s", "none"
MECHANISM = (
    ("time", "s", "time"), ("voltage", "V", "voltage"), ("position", REV, "position"), ("velocity", RATE, "velocity"),
)  # fmt: skip
SIDES = (
    ("left_voltage", "V", ""), ("right_voltage", "V", ""), ("left_position", REV, ""), ("right_position", REV, ""),
    ("left_velocity", RATE, ""), ("right_velocity", RATE, ""),
)  # fmt: skip
LAYOUTS = {
    4: MECHANISM,
    9: (MECHANISM[0], *SIDES, ("gyro_angle", "", NONE), ("gyro_rate", "", NONE)),
    10: (
        MECHANISM[0], ("battery_voltage", "V", "supply"), ("autospeed", "", NONE), *SIDES, ("gyro_angle", "", NONE),
    ),
}  # fmt: skip
"""Name, unit and channel of every column, by the number of columns; the user chooses the side of a drivetrain."""


def is_sysid(tree: Any) -> bool:
    """Whether a JSON object contains at least two of the four tests."""
    if not isinstance(tree, Mapping):
        return False
    tests = cast("Mapping[Any, Any]", tree)
    return sum(isinstance(tests.get(name), list) for name in TESTS) >= 2


def table_of_tests(path: Path, tree: Mapping[str, Any]) -> Table:
    """Return the tests one after the other, in the order of recording.

    Raises
    ------
    InputError
        If a test is not a table of 4, 9 or 10 columns.
    """
    tests = {name: _rows(path, name, tree[name]) for name in TESTS if isinstance(tree.get(name), list)}
    tests = {name: rows for name, rows in tests.items() if len(rows)}
    widths = {rows.shape[1] for rows in tests.values()}
    if len(widths) != 1:
        raise InputError(
            f"{path}: the tests have {', '.join(map(str, sorted(widths))) or 'no'} columns; give a file whose tests "
            "all have 4 (a mechanism), 9 or 10 (a drivetrain)"
        )
    layout = LAYOUTS[widths.pop()]
    findings = _with_signed_voltages(tests, [name for name, _, _ in layout])
    ordered = sorted(tests.items(), key=lambda test: test[1][0, 0])
    rows = np.concatenate([rows for _, rows in ordered])
    starts = np.cumsum([0, *(len(rows) for _, rows in ordered[:-1])]) + 1
    insist_on_values(path, rows.size)
    names = ", ".join(name for name, _ in ordered)
    message = f"the tests {names} are used as separate records"
    findings.append(Finding("note", "sysid-tests", message))
    if "voltage" not in {channel for _, _, channel in layout}:
        message = "a drivetrain has two sides; positions and velocities of both are in the file"
        left = name_columns(position="left_position", velocity="left_velocity", voltage="left_voltage")
        remedy = f"choose one: {left}"
        findings.append(Finding("note", "sysid-sides", message, remedy=remedy))
    columns = tuple(
        Column(name, np.ascontiguousarray(rows[:, i]), unit, None, channel)
        for i, (name, unit, channel) in enumerate(layout)
    )
    constants: dict[str, float | str] = {
        key: float(value) if isinstance(value, (int, float)) else value
        for key, value in tree.items()
        if isinstance(value, (str, int, float))
        and abs(value if isinstance(value, (int, float)) else 0) < 1e300
    }
    return Table("sysid", columns, constants, tuple(findings), runs=tuple(starts.tolist()))


def _rows(path: Path, name: str, given: Sequence[Any]) -> Array:
    rows: Array
    try:
        rows = np.asarray(given, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        rows = np.empty(0)
    if given and (rows.ndim != 2 or rows.shape[1] not in LAYOUTS):
        raise InputError(
            f"{path}: {name!r} is not a table of numbers with 4, 9 or 10 columns; give the file that SysId wrote"
        )
    return rows


def _with_signed_voltages(tests: dict[str, Array], names: Sequence[str]) -> list[Finding]:
    """Invert, in place, voltages that a test records without their sign: the motor drives throughout each test."""
    inverted: list[str] = []
    for test, rows in tests.items():
        for name in names:
            if not name.endswith("voltage") or name.replace("voltage", "velocity") not in names:
                continue
            voltage, velocity = (
                rows[:, names.index(name)],
                rows[:, names.index(name.replace("voltage", "velocity"))],
            )
            if np.nansum(voltage * velocity) < 0.0:
                voltage *= -1.0
                inverted.append(f"{name} of {test}")
    if not inverted:
        return []
    message = (
        f"{', '.join(inverted)}: the sign was inverted, since the voltage has the opposite sign of the velocity, and a "
        "motor that is tested drives"
    )
    return [
        Finding("warning", "sysid-sign", message, remedy="record the voltage with its sign if this is wrong")
    ]
