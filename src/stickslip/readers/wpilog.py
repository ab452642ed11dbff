"""Read WPILib data logs (.wpilog), version 1.x: every numeric entry, with its own times.

Format: WPILib "Data Log File Format Specification, Version 1.0" and "Packed Struct Serialization Specification, Version
1.0". Entries of type boolean, int64, float and double, arrays of them, and structs of numbers become columns; the unit
is that of the entry's metadata, if any (as written by SysId, "Rotation per Second").
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding
from stickslip.readers._packed import MAX_ELEMENTS, Damaged, Member, columns_of, cut_off, dtype_of, members_of
from stickslip.readers.limits import insist_on_columns
from stickslip.readers.table_columns import Column, Format, Table

MAGIC = b"WPILOG"
HEADER = 12
"""Bytes before the header's text: magic, version, length of that text."""
NUMBERS = {"boolean": "?", "int64": "<i8", "float": "<f4", "double": "<f8"}
FIELDS = {
    "bool": "?", "int8": "i1", "int16": "<i2", "int32": "<i4", "int64": "<i8", "uint8": "u1", "uint16": "<u2",
    "uint32": "<u4", "uint64": "<u8", "float": "<f4", "float32": "<f4", "double": "<f8", "float64": "<f8",
    "char": "S1",
}  # fmt: skip
DECLARATION = re.compile(
    r"(?:(?:enum\s*)?\{[^}]*\}\s*)?(?P<kind>[^\s\[\]:;]+)\s+(?P<member>[^\s\[\]:;]+)\s*(?:\[\s*(?P<count>\d+)\s*\])?"
)
"""One member of a struct; a bit field, which has a colon, does not match."""
SCHEMA = "/.schema/struct:"
UNIT_NAMES = {
    "volt": "V", "volts": "V", "ampere": "A", "amp": "A", "amps": "A", "meter": "m", "meters": "m", "foot": "ft",
    "feet": "ft", "inch": "in", "inches": "in", "rotation": "rev", "rotations": "rev", "radian": "rad",
    "radians": "rad", "degree": "deg", "degrees": "deg", "newton meter": "Nm", "newton-meter": "Nm",
    "celsius": "degC", "second": "s", "seconds": "s",
}  # fmt: skip
"""Names of WPILib's units, in lower case, and their form here."""
PER = {"second": "s", "minute": "min"}


@dataclass
class _Entry:
    """An entry of the log, with its samples."""

    name: str
    kind: str
    metadata: str
    times: list[int] = field(default_factory=list[int])
    samples: list[bytes] = field(default_factory=list[bytes])


def recognise(head: bytes, path: Path) -> bool:
    """Accept its signature."""
    return head.startswith(MAGIC)


def read(path: Path) -> Table:
    """Read every numeric entry as one or more columns; entries of other types are listed as not read."""
    content = path.read_bytes()
    try:
        entries, cut = _entries(content)
    except Damaged as error:
        raise InputError(f"{path} is not a WPILib log that can be read: {error}; download it again") from None
    findings = [cut_off(cut, len(content))] if cut else []
    schemas = {e.name.removeprefix(SCHEMA): _text(e.samples[-1]) for e in entries
               if e.name.startswith(SCHEMA) and e.samples}  # fmt: skip
    columns: list[Column] = []
    unread: dict[str, str] = {}
    for entry in entries:
        if not entry.samples or entry.name.startswith("/.schema/"):
            continue
        made = _columns(entry, schemas)
        columns += made
        insist_on_columns(path, len(columns))
        if not made:
            unread[entry.name] = (
                _text(entry.samples[0])[:30] if entry.kind in ("string", "json") else entry.kind
            )
    if unread:
        names = ", ".join(repr(name) for name in list(unread)[:4]) + (", ..." if len(unread) > 4 else "")
        message = (
            f"{len(unread)} entries have no numbers, or arrays of changing length, and were left out: {names}"
        )
        findings.append(Finding("note", "not-read", message))
    return Table("wpilog", tuple(columns), findings=tuple(findings), unread=unread)


def _entries(content: bytes) -> tuple[list[_Entry], int]:
    """Return the entries with their samples, one per name, and the byte at which the file is cut off (0: complete)."""
    if len(content) < HEADER or content[7] != 1:
        raise Damaged("its version is not 1" if len(content) >= HEADER else "it ends in its header")
    by_id: dict[int, _Entry] = {}
    by_name: dict[tuple[str, str], _Entry] = {}
    cut = 0
    at = HEADER + int.from_bytes(content[8:12], "little")
    for number, time, payload in _records(content, at):
        if number == 0:
            _control(payload, by_id, by_name)
        elif number in by_id:
            by_id[number].times.append(time)
            by_id[number].samples.append(payload)
        elif number == -1:
            cut = time
    if not by_name:
        raise Damaged("it has no entries")
    return list(by_name.values()), cut


def _records(content: bytes, at: int) -> Iterator[tuple[int, int, bytes]]:
    """Yield entry, time in µs and payload of every record; entry -1 and the position where the file is cut off."""
    end = len(content)
    while at < end:
        bits = content[at]
        entry_end = at + 2 + (bits & 3)
        size_end = entry_end + 1 + (bits >> 2 & 3)
        time_end = size_end + 1 + (bits >> 4 & 7)
        size = int.from_bytes(content[entry_end:size_end], "little")
        if time_end + size > end:
            # If a robot is switched off, its log ends in zeros or an incomplete record.
            if any(content[at:]):
                yield -1, at, b""
            return
        number = int.from_bytes(content[at + 1 : entry_end], "little")
        time = int.from_bytes(content[size_end:time_end], "little", signed=time_end - size_end == 8)
        yield number, time, content[time_end : time_end + size]
        at = time_end + size


def _control(payload: bytes, by_id: dict[int, _Entry], by_name: dict[tuple[str, str], _Entry]) -> None:
    """Start or finish an entry, or change its metadata. Damaged records of this kind are ignored."""
    if len(payload) < 5:
        return
    number = int.from_bytes(payload[1:5], "little")
    texts = _strings(payload[5:])
    if payload[0] == 0 and len(texts) == 3:
        name, kind, metadata = texts
        # An entry that is finished and started again continues.
        entry = by_name.setdefault((name, kind), _Entry(name, kind, metadata))
        by_id[number] = entry
    elif payload[0] == 1:
        by_id.pop(number, None)
    elif payload[0] == 2 and texts and number in by_id:
        by_id[number].metadata = texts[0]


def _strings(data: bytes) -> list[str]:
    """Read strings, each after its length."""
    out: list[str] = []
    at = 0
    while at + 4 <= len(data):
        length = int.from_bytes(data[at : at + 4], "little")
        if at + 4 + length > len(data):
            break
        out.append(_text(data[at + 4 : at + 4 + length]))
        at += 4 + length
    return out


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


# ---- samples to columns -------------------------------------------------------------------------------------


def _columns(entry: _Entry, schemas: dict[str, str]) -> list[Column]:
    """Return the columns of an entry, or an empty list if its samples differ in size."""
    sizes = {len(sample) for sample in entry.samples}
    if len(sizes) != 1:
        return []
    members = _members(entry.kind, max(sizes), schemas)
    layout = dtype_of(members)
    if not members or layout.itemsize not in sizes:
        return []
    order = np.argsort(np.array(entry.times, dtype=np.int64), kind="stable")
    clock = 1e-6 * np.array(entry.times, dtype=np.float64)[order]
    rows = np.frombuffer(b"".join(entry.samples), dtype=layout)[order]
    # Poses and speeds of the robot: the x of a struct is not the position of an axis.
    channel = "none" if entry.kind.startswith("struct:") else ""
    return columns_of(entry.name, members, rows, clock, _unit(entry.metadata), channel)


def _members(kind: str, size: int, schemas: dict[str, str]) -> list[Member]:
    """Return suffix and type of every value in a sample of `size` bytes; an empty list if they are not known."""
    base, several = kind.removesuffix("[]"), kind.endswith("[]")
    if base in NUMBERS:
        inner = [("", NUMBERS[base])]
    elif base.startswith("struct:"):
        inner = members_of(base.removeprefix("struct:"), schemas, DECLARATION, FIELDS)
    else:
        return []
    width = sum(np.dtype(code).itemsize for _, code in inner)
    count = size // width if several and width else 1
    if count * len(inner) > MAX_ELEMENTS:
        return []
    return [(f"[{i}]{suffix}" if several else suffix, code) for i in range(count) for suffix, code in inner]


def _unit(metadata: str) -> str:
    """Return the unit in an entry's metadata: alone, or under "unit" or "units" of a JSON object."""
    text = metadata.strip()
    if text.startswith("{"):
        try:
            content: Any = json.loads(text)
        except (ValueError, RecursionError):
            return ""
        text = next((str(content[k]) for k in ("unit", "units") if isinstance(content.get(k), str)), "")
    above, per, below = text.lower().partition(" per ")
    unit = UNIT_NAMES.get(above.strip(), text if not per else above.strip())
    return f"{unit}/{PER.get(below.strip(), below.strip())}" if per else unit


FORMAT = Format("wpilog", "WPILib data log", (".wpilog",), recognise, read)
