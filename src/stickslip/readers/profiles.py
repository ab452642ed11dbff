"""Profiles: the user's choices for a layout of columns, saved for the next file with that layout.

A profile is a TOML file, named by the user or kept under the layout's fingerprint in the user's configuration folder
(`STICKSLIP_CONFIG`, else `XDG_CONFIG_HOME`/stickslip, `APPDATA`/stickslip or ~/.config/stickslip).
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.config import Table as Section
from stickslip.core.config import read_toml
from stickslip.core.errors import unwritable
from stickslip.core.record import Record
from stickslip.core.whole_files import write_whole
from stickslip.readers._choose import parse_mapping
from stickslip.readers.convert import TURNING, Drive
from stickslip.readers.table_columns import Table

PUTS_OUT = {"force_constant": TURNING, **dict.fromkeys(TURNING, ("force_constant",))}
"""Numbers of a linear motor replace those of a rotary one in a profile, and vice versa."""
SIZES = ("speed", "torque")
"""Quantities of `sizes`."""
STATEMENTS = 20
"""Most files whose numbers a profile keeps, the latest ones."""


@dataclass(frozen=True, slots=True)
class Statement:
    """Numbers given for one file. They belong to its machine; files of other machines may have the same columns.

    Attributes
    ----------
    drive : Drive
    sample_time : float or None
        s
    file, sha256, date : str
        Path and digest of the file, and the date (ISO 8601) of the last change; empty if unknown.
    seen : mapping of str to float
        Size of speed and torque in the file, from `sizes`.
    """

    drive: Drive
    sample_time: float | None = None
    file: str = ""
    sha256: str = ""
    date: str = ""
    seen: Mapping[str, float] = field(default_factory=dict[str, float])

    def numbers(self) -> dict[str, Any]:
        """Its numbers, by name."""
        out = {n: x for n, x in self.drive.known().items() if (n, x) != ("side", "motor")}
        return out if self.sample_time is None else {**out, "sample_time": self.sample_time}


@dataclass(frozen=True, slots=True)
class Profile:
    """The choices for files of one layout.

    Attributes
    ----------
    mapping : mapping of str to str
        Channel to "COLUMN", "COLUMN:UNIT" or "COLUMN:UNIT@side".
    drive : Drive
        Numbers of a profile that the user names, which belongs to one machine.
    sample_time : float or None
        s, for files without times.
    said : tuple of Statement
        Numbers of a profile that is found by its columns, for each file, the latest at the end.
    """

    mapping: Mapping[str, str]
    drive: Drive
    sample_time: float | None = None
    said: tuple[Statement, ...] = ()


def alike(first: Profile, second: Profile) -> bool:
    """Whether both are equal; missing numbers (NaN) are equal to each other."""
    said = [
        (dict(p.mapping), p.drive.known(), p.sample_time, [(s.sha256, s.numbers()) for s in p.said])
        for p in (first, second)
    ]
    return said[0] == said[1]


def sizes(record: Record) -> dict[str, float]:
    """Return the sizes of speed and torque that 95 % of the rows do not exceed, in the record's units."""
    out: dict[str, float] = {}
    if "position" in record.channels and len(record) > 100:
        step = max(1, len(record) // 1000)
        way, time = record["position"][::step], record.time[::step]
        with np.errstate(all="ignore"):
            out["speed"] = float(np.nanpercentile(np.abs(np.diff(way) / np.diff(time)), 95))
    if "motor_torque" in record.channels and np.any(np.isfinite(record["motor_torque"])):
        out["torque"] = float(np.nanpercentile(np.abs(record["motor_torque"]), 95))
    return {key: value for key, value in out.items() if math.isfinite(value) and value > 0.0}


def fingerprint(table: Table) -> str:
    """Return sixteen digits that identify names and units of the columns, in any order."""
    layout = sorted((c.name, c.unit) for c in table.columns)
    return hashlib.sha256(json.dumps(layout).encode()).hexdigest()[:16]


def folder() -> Path:
    """Return the folder of this user's profiles."""
    if own := os.environ.get("STICKSLIP_CONFIG"):
        return Path(own) / "profiles"
    base = os.environ.get("APPDATA") if os.name == "nt" else os.environ.get("XDG_CONFIG_HOME")
    return Path(base or Path.home() / ".config") / "stickslip" / "profiles"


def remembered(table: Table) -> Path | None:
    """Return the profile saved for this layout, or None."""
    path = folder() / f"{fingerprint(table)}.toml"
    return path if path.is_file() else None


def load(path: Path) -> Profile:
    """Read a profile.

    Raises
    ------
    ConfigError
        If it cannot be read, or has unknown keys or values.
    """
    with read_toml(path) as top:
        top.text("fingerprint", "")
        sample_time = top.positive("sample_time", "s", math.nan) if top.has("sample_time") else None
        mapping: dict[str, str] = {}
        if top.has("columns"):
            with top.table("columns") as columns, columns.blamed():
                mapping = parse_mapping({key: columns.text(key) for key in columns.values})
        drive = Drive()
        if top.has("drive"):
            with top.table("drive") as table, table.blamed():
                drive = _drive_in(table)
        said = [_statement(own) for own in top.tables("said").values()]
        if top.has("seen"):  # an older form: one statement without a file
            said.insert(0, Statement(drive, sample_time, seen=_seen_in(top)))
        return Profile(mapping, drive, sample_time, tuple(said))


def _seen_in(top: Section) -> dict[str, float]:
    with top.table("seen") as table, table.blamed():
        return {key: table.positive(key, "") for key in SIZES if table.has(key)}


def _drive_in(table: Section) -> Drive:
    numbers = [f.name for f in fields(Drive) if f.name != "side" and table.has(f.name)]
    values: dict[str, Any] = {name: table.positive(name, "") for name in numbers}
    return Drive(**values, side=table.choice("side", ("motor", "load"), "motor"))


def _statement(own: Section) -> Statement:
    with own, own.blamed():
        period = own.positive("sample_time", "s", math.nan) if own.has("sample_time") else None
        words = {key: own.text(key, "") for key in ("file", "sha256", "date")}
        seen = _seen_in(own) if own.has("seen") else {}
        return Statement(_drive_in(own), period, **words, seen=seen)


def merged(mapping: Sequence[str], drive: Drive, sample_time: float | None, kept: Profile | None) -> Profile:
    """Return a profile with the current choices, which have priority."""
    before = kept or Profile({}, Drive())
    said = drive.known()
    out = {kept for name in said for kept in PUTS_OUT.get(name, ())}
    numbers = {n: x for n, x in before.drive.known().items() if n not in out} | said
    if drive.side == "motor" and before.drive.side == "load":
        numbers["side"] = "load"
    period = sample_time if sample_time is not None else before.sample_time
    return Profile({**before.mapping, **parse_mapping(mapping)}, Drive(**numbers), period)


def save(profile: Profile, table: Table, path: Path | None = None) -> Path:
    """Write a profile to a file, or to the place where `remembered` finds it; return the path.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    target = path or folder() / f"{fingerprint(table)}.toml"
    lines = ["# Which column is which channel, for files with these columns:"]
    lines += [f"#   {_comment(c.name)}" for c in table.columns[:40]]
    lines += [f"fingerprint = {json.dumps(fingerprint(table))}"]
    if profile.sample_time is not None:
        lines.append(f"sample_time = {profile.sample_time!r}")
    lines += ["", "[columns]", *(f"{role} = {_quoted(text)}" for role, text in profile.mapping.items())]
    if profile.said:
        lines += [
            "",
            "# Numbers said for one file. Another with these columns gets none of them without a warning.",
        ]
    else:
        lines += [
            "",
            "[drive]",
            *(f"{key} = {_quoted(value)}" for key, value in profile.drive.known().items()),
        ]
    for number, said in enumerate(profile.said, 1):
        lines += ["", f"[said.{number}]"]
        words = {"file": said.file, "sha256": said.sha256, "date": said.date}
        lines += [f"{key} = {_quoted(value)}" for key, value in (words | said.numbers()).items()]
        # Sizes that 95 % of the record's rows keep, in SI units.
        lines += [f"seen.{key} = {value:.4g}" for key, value in said.seen.items()]
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(target, error, "profile") from None
    return write_whole(target, "\n".join(lines) + "\n", "profile")


def _comment(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)


def _quoted(value: str | float) -> str:
    """Return a TOML string: JSON's escapes are those of TOML, except for one character that JSON does not escape."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
