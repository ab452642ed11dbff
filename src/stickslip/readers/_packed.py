"""Unpack binary samples: the layout from the declarations of a struct or message, and its values as columns."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stickslip.core.finding import Finding
from stickslip.readers.table_columns import Array, Column

DEPTH = 8
"""Levels of nested structs."""
MAX_ELEMENTS = 1024
"""Values of one sample: a larger array is an image, not signals."""

Member = tuple[str, str]
"""Suffix of the column, and type of NumPy."""


class Damaged(ValueError):
    """A violation of the format of a file."""


def cut_off(at: int, size: int) -> Finding:
    """Return the warning about a file that ends within a record that starts at byte `at`."""
    message = f"the file is cut off after {at} of {size} bytes; what comes before was read"
    return Finding("warning", "cut-off", message, remedy="download it again if it was copied")


def members_of(
    name: str, declared: Mapping[str, str], pattern: re.Pattern[str], types: Mapping[str, str], depth: int = DEPTH
) -> list[Member]:  # fmt: skip
    """Return suffix and type of every value of a struct; an empty list if its layout is not known.

    Parameters
    ----------
    name : str
    declared : mapping of str to str
        By struct: the declarations of its members, with a semicolon between them.
    pattern : Pattern
        Matches a declaration; has the groups ``kind``, ``member`` and ``count``.
    types : mapping of str to str
        Types of NumPy by those of the format.
    depth : int
        Levels of structs that may follow.
    """
    out: list[Member] = []
    for declaration in declared.get(name, "").split(";") if depth else ():
        if not declaration.strip():
            continue
        match = pattern.fullmatch(declaration.strip())
        count = int(match["count"] or 1) if match else 0
        if match is None or count > MAX_ELEMENTS:
            return []
        kind = match["kind"]
        inner = (
            [("", types[kind])] if kind in types else members_of(kind, declared, pattern, types, depth - 1)
        )
        if not inner or len(out) + count * len(inner) > MAX_ELEMENTS:
            return []
        index = [f"[{i}]" for i in range(count)] if match["count"] else [""]
        out += [(f".{match['member']}{i}{suffix}", code) for i in index for suffix, code in inner]
    return out


def dtype_of(members: Sequence[Member]) -> np.dtype[Any]:
    """Return the type of a sample."""
    return np.dtype([(f"f{i}", code) for i, (_, code) in enumerate(members)])


def columns_of(
    name: str, members: Sequence[Member], rows: Any, clock: Array, unit: str = "", channel: str = ""
) -> list[Column]:
    """Return the numbers in samples as columns; texts are skipped."""
    return [
        Column(name + suffix, rows[f"f{i}"].astype(np.float64), unit, clock, channel)
        for i, (suffix, code) in enumerate(members)
        if not code.startswith("S")
    ]
