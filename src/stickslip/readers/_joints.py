"""Find the axis or joint of each column, and select columns of the same one.

The log of a robot has each signal once per joint: `q[0]`, `q[1]`, `tau[0]`, `tau[1]`. Columns of different joints must
not be combined.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from stickslip.core.finding import Finding
from stickslip.core.messages import name_columns
from stickslip.readers._names import Name
from stickslip.readers.table_columns import Array, Column

MAIN = ("time", "position", "velocity", "motor_torque")
"""Channels that are never chosen between equal candidates, because the wrong one spoils every result."""
RATES = frozenset(("qd", "xd", "thetad", "phid"))
"""Symbols that are a rate in robotics (q, qd, qdd) and a reference in control (desired q)."""
SECOND_RATES = frozenset(("qdd", "xdd", "thetadd", "phidd", "ddq", "qddot"))


class Joints:
    """The selected axis.

    Parameters
    ----------
    names : mapping of str to Name
        The parsed name of every column.
    """

    def __init__(self, names: Mapping[str, Name]) -> None:
        self.names = names
        self.first: tuple[str, str] | None = None
        """Channel and column that determined the axis."""
        self.plain: tuple[str, str] | None = None
        """Channel and column of the motion or torque whose name has no axis."""
        self.members: dict[str, set[str]] = {}
        for name in names.values():
            self.members.setdefault(name.family, set()).add(name.axis)

    def take(self, taken: Sequence[tuple[str, str]]) -> list[Finding]:
        """Note channels and their columns; a warning if they are of different axes."""
        for role, column in taken:
            if role == "time":
                continue
            if not self.names[column].axis:
                self.plain = self.plain or (role, column)
            elif self.first is None:
                self.first = (role, column)
            elif self.names[column].axis != self.names[self.first[1]].axis:
                other, of_first = self.first
                message = (
                    f"{role} {column!r} is of axis {self.names[column].axis}, {other} {of_first!r} of axis "
                    f"{self.names[of_first].axis}"
                )
                remedy = "map columns of one axis, unless the file counts its axes in two ways"
                return [Finding("warning", "ambiguous-column", message, remedy=remedy)]
        return []

    def of_one_axis(self, role: str, candidates: list[Column]) -> tuple[list[Column], list[Finding]]:
        """Return the candidates of the selected axis, and a finding if there are others or none."""
        axes = sorted({self.names[c.name].axis for c in candidates} - {""}, key=_order)
        if role == "time" or not axes:
            return candidates, []
        plain = [c for c in candidates if not self.names[c.name].axis]
        if self.first is not None:
            own = [c for c in candidates if self._together(c.name, self.first[1])]
            if own or plain:
                return own or plain, []
            other, column = self.first
            axis = self.names[column].axis.upper()
            return [], [self._asked(role, candidates, f"none belongs to axis {axis} of {other} {column!r}")]
        if len(axes) == 1 or plain:
            return candidates, []
        if self.plain is not None:
            return [], [self._asked(role, candidates, f"{self.plain[0]} {self.plain[1]!r} names no axis")]
        drives = [name for name in self.names.values() if name.role in ("motor_torque", "current")]
        driven = {name.axis for name in drives} - {""}
        axis = next((a for a in axes if a in driven), axes[0])
        own = [c for c in candidates if self.names[c.name].axis == axis]
        message = f"{role} may be any of {listed_names(candidates)}: the file has several axes"
        if role == "position" and drives and not driven and self.names[own[0].name].family.endswith("[]"):
            message += ", and its torque or current names none"
            remedy = f"choose the right one with {name_columns(**{role: 'COLUMN'})}"
            return own, [Finding("error", "ambiguous-column", message, remedy=remedy)]
        remedy = f"if another is meant, give {name_columns(**{role: 'COLUMN'})}"
        return own, [
            Finding("warning", "ambiguous-column", f"{message}; axis {axis.upper()} was taken", remedy=remedy)
        ]

    def _together(self, name: str, other: str) -> bool:
        """Whether two columns are of one axis; those of arrays only if both arrays have the same axes."""
        one, two = self.names[name], self.names[other]
        arrays = one.family.endswith("[]") and two.family.endswith("[]")
        return one.axis == two.axis and (not arrays or self.members[one.family] == self.members[two.family])

    def _asked(self, role: str, candidates: Sequence[Column], why: str) -> Finding:
        level = "error" if role in MAIN else "warning"
        message = f"{role} may be any of {listed_names(candidates)}; {why}, so none was taken"
        return Finding(
            level,
            "ambiguous-column",
            message,
            remedy=f"choose one with {name_columns(**{role: 'COLUMN'})}, or none with {name_columns(**{role: 'none'})}",
        )


def _order(axis: str) -> list[tuple[int, str]]:
    """Sort numbers by value, and letters after them."""
    return [(int(part), "") if part.isdigit() else (10**6, part) for part in axis.split(".")]


def listed_names(columns: Sequence[Column]) -> str:
    """Return the names of up to four columns."""
    return ", ".join([repr(c.name) for c in columns[:4]] + (["..."] if len(columns) > 4 else []))


def with_rates(columns: Sequence[Column], names: dict[str, Name]) -> dict[str, Name]:
    """Return the parsed names, with `qd` as the velocity if other names or the values show that it is one."""
    symbols = {n: name.family.removesuffix("[]") for n, name in names.items()}
    unsure = [
        c
        for c in columns
        if not c.channel and symbols[c.name] in RATES and names[c.name].role == "position_reference"
    ]
    others = {name.role for n, name in names.items() if symbols[n] not in RATES}
    if not unsure or "velocity" in others:
        return names
    named = not SECOND_RATES.isdisjoint(symbols.values()) or bool(
        others & {"position_reference", "velocity_reference"}
    )
    times = [c for c in columns if names[c.name].role == "time"]
    out = dict(names)
    for column in unsure:
        own = names[column.name]
        motions = [c for c in columns if names[c.name].role == "position" and names[c.name].axis == own.axis]
        if named or (len(motions) == 1 and _is_rate_of(column, motions[0], times[0] if times else None)):
            out[column.name] = replace(own, role="velocity", sure=1)
    return out


def _is_rate_of(column: Column, position: Column, time: Column | None) -> bool:
    """Whether a column is closer to the derivative of the position than to the position itself."""
    q: Array = position.values
    t = time.values if time is not None else np.arange(q.size, dtype=np.float64)
    if not column.values.size == q.size == t.size or q.size < 3:
        return False
    good = np.isfinite(q) & np.isfinite(t) & np.isfinite(column.values)
    q, t, v = q[good], t[good], column.values[good]
    if q.size < 3 or not np.all(np.diff(t) > 0.0) or min(np.ptp(q), np.ptp(v)) == 0.0:
        return False
    return abs(_correlation(v, np.gradient(q, t))) > abs(_correlation(v, q))


def _correlation(a: Array, b: Array) -> float:
    a, b = a - np.mean(a), b - np.mean(b)
    size = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    return float(np.sum(a * b)) / size if size > 0.0 else 0.0
