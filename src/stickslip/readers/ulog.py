"""Read PX4 ULog (.ulg): every field of every topic, with the times of the topic.

Format: PX4 User Guide, "ULog File Format". A log of a vehicle has hundreds of fields and no axis, and its torques are
normalised commands. Therefore no field is assigned to a channel unless the user maps it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from struct import unpack_from

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding
from stickslip.core.messages import name_columns
from stickslip.readers._packed import Damaged, Member, columns_of, cut_off, dtype_of, members_of
from stickslip.readers.limits import insist_on_columns
from stickslip.readers.table_columns import Column, Format, Table

MAGIC = b"ULog\x01\x12\x35"
HEADER = 16
TYPES = {
    "int8_t": "i1", "uint8_t": "u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4", "uint32_t": "<u4",
    "int64_t": "<i8", "uint64_t": "<u8", "float": "<f4", "double": "<f8", "bool": "?", "char": "S1",
}  # fmt: skip
FIELD = re.compile(r"(?P<kind>\w+)(?:\[(?P<count>\d+)\])?\s+(?P<member>\w+)")
APPENDED = 1
"""The known incompatible flag: data were appended after a crash."""


@dataclass
class _Topic:
    """A subscription: its name in columns, the layout of its samples, and the samples."""

    name: str
    members: list[Member]
    samples: list[bytes] = field(default_factory=list[bytes])


def recognise(head: bytes, path: Path) -> bool:
    """Accept its signature."""
    return head.startswith(MAGIC)


def read(path: Path) -> Table:
    """Read every number of every topic."""
    try:
        topics, constants, findings = _topics(path.read_bytes())
    except Damaged as error:
        raise InputError(f"{path} is not a ULog file that can be read: {error}; download it again") from None
    columns: list[Column] = []
    for topic in topics:
        columns += _columns(topic)
        insist_on_columns(path, len(columns))
    message = (
        "a ULog file has the topics of a vehicle, and its torque setpoints are normalised to -1 ... 1: no field is "
        "taken as a channel by its name"
    )
    remedy = f"map the fields of one axis, such as {name_columns(velocity='esc_status.esc[0].esc_rpm:rpm')}"
    return Table(
        "ulog", tuple(columns), constants, (Finding("note", "tool", message, remedy=remedy), *findings)
    )


def _topics(content: bytes) -> tuple[list[_Topic], dict[str, float | str], list[Finding]]:
    """Return topics with their samples, parameters and information, and findings about the file."""
    formats: dict[str, str] = {}
    by_id: dict[int, _Topic] = {}
    constants: dict[str, float | str] = {}
    findings: list[Finding] = []
    topics: list[_Topic] = []
    dropouts, at = 0, HEADER
    while at + 3 <= len(content):
        size, kind = unpack_from("<HB", content, at)
        body = content[at + 3 : at + 3 + size]
        if len(body) < size:
            findings.append(cut_off(at, len(content)))
            break
        letter = chr(kind)
        if letter == "B" and size >= 16 and (body[8] & ~APPENDED or any(body[9:16])):
            raise Damaged("it uses a later version of the format")
        if letter == "F":
            name, _, fields = body.decode("utf-8", "replace").partition(":")
            formats[name] = fields
        elif letter == "A" and size > 3:
            name = body[3:].decode("utf-8", "replace")
            topic = _Topic(
                name if body[0] == 0 else f"{name}.{body[0]}", members_of(name, formats, FIELD, TYPES)
            )
            by_id[unpack_from("<H", body, 1)[0]] = topic
            topics.append(topic)
        elif letter == "D" and size > 2 and (topic := by_id.get(unpack_from("<H", body)[0])) is not None:
            topic.samples.append(body[2:])
        elif letter == "O":
            dropouts += 1
        elif letter in "IPQ":
            _constant(body, constants)
        at += 3 + size
    if not topics:
        raise Damaged("it has no topics")
    if dropouts:
        message = f"the logger lost samples {dropouts} times (dropouts)"
        findings.append(Finding("warning", "dropouts", message, remedy="use a faster SD card, or log less"))
    return topics, constants, findings


def _constant(body: bytes, constants: dict[str, float | str]) -> None:
    """Read a parameter or an information: type and name of one value, then the value; of several, the first."""
    length = body[0] if body else 0
    match = FIELD.fullmatch(body[1 : 1 + length].decode("utf-8", "replace"))
    value = body[1 + length :]
    kind = TYPES.get(match["kind"]) if match else None
    if match is None or kind is None:
        return
    if kind == "S1":
        constants.setdefault(match["member"], value.decode("utf-8", "replace"))
    elif not match["count"] and len(value) == np.dtype(kind).itemsize:
        constants.setdefault(match["member"], float(np.frombuffer(value, kind)[0]))


def _columns(topic: _Topic) -> list[Column]:
    """Return the numbers of a topic. Padding at the end of a message is not stored."""
    members = list(topic.members)
    while members and "._padding" in members[-1][0]:
        members.pop()
    layout = dtype_of(members)
    whole = [sample[: layout.itemsize] for sample in topic.samples if len(sample) >= layout.itemsize]
    suffixes = [suffix for suffix, _ in members]
    if not whole or ".timestamp" not in suffixes:
        return []
    rows = np.frombuffer(b"".join(whole), dtype=layout)
    clock = rows[f"f{suffixes.index('.timestamp')}"].astype(np.float64) * 1e-6
    columns = columns_of(topic.name, members, rows, clock, channel="none")
    return [c for c in columns if c.name != f"{topic.name}.timestamp" and "._padding" not in c.name]


FORMAT = Format("ulog", "PX4 ULog", (".ulg",), recognise, read)
