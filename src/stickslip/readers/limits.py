"""Limits for one file: columns, length of lines, and number of values after unpacking.

A small compressed file may unpack to more than the machine's memory. Readers therefore compare the sizes that a file
declares with these bounds before they unpack it.
"""

from __future__ import annotations

from pathlib import Path

from stickslip.core.errors import InputError
from stickslip.core.resources import free_memory, size_text

MAX_COLUMNS = 5_000
"""Most columns of a file: a car's measurement file has a few thousand channels."""
LONGEST_LINE = 32 * MAX_COLUMNS
"""Most characters of a line: `MAX_COLUMNS` numbers with all digits and delimiters."""
COPIES = 3
"""Copies of a value in memory while a file is read: as stored, as a column, as a channel."""


def memory_for(size: int) -> int:
    """Return the memory, in bytes, that reading a file of `size` bytes may use.

    A text of numbers takes about four times its size while it is read and examined.
    """
    return 900 * 2**20 + 12 * size


def too_large(path: Path) -> InputError:
    """Return the error for a file that uses more memory than `memory_for` while it is read."""
    size = size_of(path)
    return InputError(
        f"{path} has {size_text(size)} and needs more than {size_text(memory_for(size))} of memory to read; save it "
        "without compression, or export only the signals and the rows that you need"
    )


def size_of(path: Path) -> int:
    """Return the size of a file, or of all files in a folder, in bytes."""
    if path.is_dir():
        return sum(p.stat().st_size for p in path.rglob("*") if p.is_file())
    return path.stat().st_size


def insist_on_values(path: Path, count: float) -> None:
    """Refuse a file with too many values for its size.

    Parameters
    ----------
    path : Path
    count : float
        Numbers in all columns.

    Raises
    ------
    InputError
    """
    size = size_of(path)
    needed = 8.0 * COPIES * count
    if needed <= min(memory_for(size), free_memory()):
        return
    free = free_memory()
    if needed > free:
        bound, remedy = f"{size_text(free)} are free", "export only the signals and the rows that you need"
    else:
        bound = f"at most {size_text(memory_for(size))} are used for a file of this size"
        remedy = "save it without compression, or export only the signals and the rows that you need"
    raise InputError(
        f"{path} has {size_text(size)} and unpacks to {count:.3g} numbers, which need {size_text(needed)} of memory; "
        f"{bound}; {remedy}"
    )


def insist_on_columns(path: Path | str, count: int) -> None:
    """Refuse more columns than `MAX_COLUMNS`.

    Raises
    ------
    InputError
    """
    if count > MAX_COLUMNS:
        raise InputError(
            f"{path} has {count} columns; at most {MAX_COLUMNS} are read: export only the signals that you need"
        )
