"""Read CSV traces of CODESYS V3 and of controllers based on it, such as Bosch ctrlX.

Lines of key and value are followed by a block for each variable: ``0.Variable; GVL.fPosAct``, more keys, ``0.Data;``,
and a line ``; time; value`` for each sample. Each variable has its own times.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding
from stickslip.core.messages import name_option
from stickslip.readers._cells import cell, decoded
from stickslip.readers.table_columns import Array, Column, Format, Table

HEADER = re.compile(r"\s*\[key\]\s*([;,\t|])", re.IGNORECASE)
BLOCK = re.compile(r"(?mi)^\s*\d+\.Variable\s*([;,\t|])")
VARIABLE = re.compile(r"(\d+)\.variable")
DATA = re.compile(r"(\d+)\.data")
OF_FLAGS = {0x20: (1e-6, "us"), 0x10: (1e-3, "ms")}
"""Bits of the line Flags that state the unit of the times."""
SLOWEST = 200.0
"""A larger step of the times is in us: no motion task runs slower than 5 Hz."""


@dataclass
class _Block:
    """The samples of a variable."""

    name: str
    line: int
    times: list[float] = field(default_factory=list[float])
    values: list[float] = field(default_factory=list[float])
    words: list[tuple[int, str]] = field(default_factory=list[tuple[int, str]])


def recognise(head: bytes, path: Path) -> bool:
    """Whether the file starts with the header of such a trace or the block of its first variable."""
    text = head.decode("utf-16" if head[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig", "replace")
    return HEADER.match(text) is not None or BLOCK.search(text) is not None


def read(path: Path) -> Table:
    """Read the variables of the trace, each with its own times."""
    text = decoded(path)
    found = HEADER.match(text) or BLOCK.search(text)
    blocks, constants = _blocks(path, text.splitlines(), found[1] if found else ";")
    sampled = [block for block in blocks if block.times]
    if not sampled:
        raise InputError(f"{path} is a CODESYS trace without samples; save it after the recording")
    factor, findings = _unit_of_times(constants, sampled)
    columns, unread, seen = list[Column](), dict[str, str](), dict[str, int]()
    for block in sampled:
        values: Array = np.array(block.values)
        if block.words:
            line, word = block.words[0]
            if np.isnan(values).all():
                unread[block.name] = word[:30]
                continue
            message = f"{block.name!r}: {len(block.words)} values are no numbers and count as missing, first {word!r}"
            findings.append(Finding("warning", "not-a-number", message, f"line {line}"))
        seen[block.name] = seen.get(block.name, 0) + 1
        name = block.name if seen[block.name] == 1 else f"{block.name} ({seen[block.name]})"
        columns.append(Column(name, values, "", factor * np.array(block.times)))
    empty = [block.name for block in blocks if not block.times and block.name not in seen]
    if empty:
        message = f"left out as they have no samples: {', '.join(map(repr, empty[:4]))}"
        findings.append(Finding("note", "not-read", message))
    if unread:
        message = f"left out as they hold words, not numbers: {', '.join(map(repr, unread))}"
        findings.append(Finding("note", "words", message))
    return Table("codesys", tuple(columns), constants, tuple(findings), unread)


def _blocks(path: Path, lines: list[str], separator: str) -> tuple[list[_Block], dict[str, float | str]]:
    """Return the blocks of samples in their order, and the keys above the first."""
    blocks, names, constants = list[_Block](), dict[str, str](), dict[str, float | str]()
    for number, line in enumerate(lines, 1):
        key, _, rest = line.partition(separator)
        key, rest = key.strip(), rest.strip()
        if (match := VARIABLE.fullmatch(key.lower())) is not None:
            names[match[1]] = rest or f"variable {match[1]}"
            blocks.append(_Block(names[match[1]], number))
        elif (match := DATA.fullmatch(key.lower())) is not None:
            name = names.get(match[1], f"variable {match[1]}")
            if not blocks or blocks[-1].name != name or blocks[-1].times:
                blocks.append(_Block(name, number))
        elif not key and rest:
            _sample(path, blocks, number, rest, separator)
        elif key and not blocks and rest and not key.startswith("["):
            value = cell(rest, ",")
            constants[key] = rest if value is None or np.isnan(value) else value
    return blocks, constants


def _sample(path: Path, blocks: list[_Block], number: int, rest: str, separator: str) -> None:
    """Add the sample "time; value" to the last block; a time that decreases starts a new recording."""
    moment, _, text = (part.strip() for part in rest.partition(separator))
    time, value = cell(moment, ","), cell(text, ",")
    if not blocks or time is None or np.isnan(time):
        what = "a sample before the first variable" if not blocks else f"no time in {moment!r}"
        raise InputError(f"{path}, line {number}: {what}; save the trace as CSV again")
    block = blocks[-1]
    if block.times and time < block.times[-1]:
        block = _Block(block.name, number)
        blocks.append(block)
    if value is None:
        block.words.append((number, text))
    block.times.append(time)
    block.values.append(np.nan if value is None else value)


def _unit_of_times(constants: dict[str, float | str], blocks: list[_Block]) -> tuple[float, list[Finding]]:
    """Return the factor to s, from the line Flags or else from the size of the steps, and a note if it is assumed."""
    flags = constants.get("Flags")
    if isinstance(flags, float) and flags.is_integer():
        units = [unit for bit, unit in OF_FLAGS.items() if int(flags) & bit]
        if len(units) == 1:
            return units[0][0], []
    steps = [float(np.median(np.diff(block.times))) for block in blocks if len(block.times) > 1]
    factor, unit = (1e-6, "us") if min(steps, default=0.0) > SLOWEST else (1e-3, "ms")
    message = f"the trace states no unit of its times: {unit} was assumed"
    if steps:
        message += f", {factor * min(steps):g} s a sample"
    return factor, [
        Finding(
            "note", "time-unit", message, remedy=f"if wrong, give {name_option('sample_time', 'SECONDS')}"
        )
    ]


FORMAT = Format("codesys", "CODESYS trace (CSV)", (".csv", ".txt", ".trace"), recognise, read)
