"""PX4 ULog (.ulg): every field of every topic, with the topic's clock.

Format: PX4 User Guide, "ULog File Format". A log of a vehicle has hundreds of fields and no axis, and its torques are
normalised commands. No field is therefore taken as a channel unless the user maps it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from struct import unpack_from
from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.finding import Finding
from stickslip.readers.limits import insist_on_columns
from stickslip.readers.table_columns import Column, Format, Table

MAGIC = b"ULog\x01\x12\x35"
HEADER = 16
TYPES = {
    "int8_t": "i1", "uint8_t": "u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4", "uint32_t": "<u4",
    "int64_t": "<i8", "uint64_t": "<u8", "float": "<f4", "double": "<f8", "bool": "?", "char": "S1",
}  # fmt: skip
FIELD = re.compile(r"(\w+)(?:\[(\d+)\])?\s+(\w+)")
DEPTH = 8
"""Levels of messages in messages."""
MAX_ELEMENTS = 1024
"""Values of one message."""
APPENDED = 1
"""The one flag of the first byte of incompatible flags that is known: data were appended after a crash."""

Member = tuple[str, str]
"""Suffix of the column, and type."""


class Damaged(ValueError):
    """What in the file breaks the format."""


@dataclass
class _Topic:
    """A subscription: its name in columns, the layout of its samples, and these."""

    name: str
    members: list[Member]
    samples: list[bytes] = field(default_factory=list[bytes])


def recognise(head: bytes, path: Path) -> bool:
    """Its signature."""
    return head.startswith(MAGIC)


def read(path: Path) -> Table:
    """Every number of every topic."""
    try:
        topics, constants, findings = _topics(path.read_bytes())
    except Damaged as error:
        raise InputError(f"{path} is not a ULog file that can be read: {error}; download it again") from None
    columns: list[Column] = []
    for topic in topics:
        columns += _columns(topic)
        insist_on_columns(path, len(columns))
    message = (
        "a ULog file holds the topics of a vehicle, and its torque setpoints are normalised to -1 ... 1: no field is "
        "taken as a channel by its name"
    )
    remedy = "map the fields of one axis, such as --map velocity=esc_status.esc[0].esc_rpm:rpm"
    return Table(
        "ulog", tuple(columns), constants, (Finding("note", "tool", message, remedy=remedy), *findings)
    )


def _topics(content: bytes) -> tuple[list[_Topic], dict[str, float | str], list[Finding]]:
    """Topics with their samples, parameters and information, and what is odd about the file."""
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
            message = f"the file is cut off after {at} of {len(content)} bytes; what comes before was read"
            findings.append(
                Finding("warning", "cut-off", message, remedy="download it again if it was copied")
            )
            break
        letter = chr(kind)
        if letter == "B" and size >= 16 and (body[8] & ~APPENDED or any(body[9:16])):
            raise Damaged("it uses a later version of the format")
        if letter == "F":
            name, _, fields = body.decode("utf-8", "replace").partition(":")
            formats[name] = fields
        elif letter == "A" and size > 3:
            name = body[3:].decode("utf-8", "replace")
            topic = _Topic(name if body[0] == 0 else f"{name}.{body[0]}", _members(name, formats, DEPTH))
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
    """A parameter or an information: the type and name of one value, then the value. Of several, the first."""
    length = body[0] if body else 0
    match = FIELD.fullmatch(body[1 : 1 + length].decode("utf-8", "replace"))
    value = body[1 + length :]
    if match is None or match[1] not in TYPES:
        return
    if match[1] == "char":
        constants.setdefault(match[3], value.decode("utf-8", "replace"))
    elif not match[2] and len(value) == np.dtype(TYPES[match[1]]).itemsize:
        constants.setdefault(match[3], float(np.frombuffer(value, TYPES[match[1]])[0]))


def _members(name: str, formats: dict[str, str], depth: int) -> list[Member]:
    """Suffix and type of every value of a message; nothing where its layout is not known."""
    out: list[Member] = []
    for declaration in formats.get(name, "").split(";") if depth else ():
        if not declaration.strip():
            continue
        match = FIELD.fullmatch(declaration.strip())
        count = int(match[2] or 1) if match else 0
        if match is None or count > MAX_ELEMENTS:
            return []
        inner = [("", TYPES[match[1]])] if match[1] in TYPES else _members(match[1], formats, depth - 1)
        if not inner or len(out) + count * len(inner) > MAX_ELEMENTS:
            return []
        index = [f"[{i}]" if match[2] else "" for i in range(count)]
        out += [(f".{match[3]}{i}{suffix}", code) for i in index for suffix, code in inner]
    return out


def _columns(topic: _Topic) -> list[Column]:
    """The numbers of a topic. Padding at the end of a message is not stored."""
    members = list(topic.members)
    while members and "._padding" in members[-1][0]:
        members.pop()
    layout: np.dtype[Any] = np.dtype([(f"f{i}", code) for i, (_, code) in enumerate(members)])
    whole = [sample[: layout.itemsize] for sample in topic.samples if len(sample) >= layout.itemsize]
    suffixes = [suffix for suffix, _ in members]
    if not whole or ".timestamp" not in suffixes:
        return []
    rows = np.frombuffer(b"".join(whole), dtype=layout)
    clock = rows[f"f{suffixes.index('.timestamp')}"].astype(np.float64) * 1e-6
    return [
        Column(topic.name + suffix, rows[f"f{i}"].astype(np.float64), "", clock, "none")
        for i, (suffix, code) in enumerate(members)
        if suffix != ".timestamp" and "._padding" not in suffix and code != "S1"
    ]


FORMAT = Format("ulog", "PX4 ULog", (".ulg",), recognise, read)
