"""What a format's reader hands on: columns as they stand in the file, before anyone says what they mean."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.finding import Finding

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True, eq=False)
class Column:
    """One column of a file.

    Attributes
    ----------
    name : str
        As written in the file; the path of names, joined by dots, where the file has groups.
    values : array, shape (n,)
        As written: units are converted later. NaN where the file has no number.
    unit : str
        As written; empty where the file says none.
    clock : array, shape (n,), or None
        The column's own times in s, where the file gives columns times of their own.
    channel : str
        The channel that the format defines it to be, or "none" for a quantity that no channel holds; empty where only
        the name and the unit indicate it.
    """

    name: str
    values: Array
    unit: str = ""
    clock: Array | None = None
    channel: str = ""


@dataclass(frozen=True, eq=False)
class Table:
    """The contents of a file.

    Attributes
    ----------
    format : str
    columns : tuple of Column
        Of different lengths where the file has several tables.
    constants : mapping of str to float or str
        Single values found beside the columns.
    findings : tuple of Finding
        What was odd about the file.
    unread : mapping of str to str
        Name and first cell of columns that were left out, since they hold neither numbers nor a clock.
    runs : tuple of int
        Rows, from 1, at which another record of the same axis starts: tests or episodes one after the other.
    """

    format: str
    columns: tuple[Column, ...]
    constants: Mapping[str, float | str] = field(default_factory=dict[str, float | str])
    findings: tuple[Finding, ...] = ()
    unread: Mapping[str, str] = field(default_factory=dict[str, str])
    runs: tuple[int, ...] = ()


@dataclass(frozen=True)
class Format:
    """A file format that can be read.

    Attributes
    ----------
    name : str
    title : str
    suffixes : tuple of str
        Endings of file names, in lower case with their dot.
    recognise : callable
        ``recognise(head, path) -> bool``: whether the first 4096 bytes (none for a folder) begin such a file.
    read : callable
        ``read(path) -> Table``; raises `InputError` on a file it cannot read.
    extra : str
        The extra of the package that brings what the format needs; empty where nothing is needed.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    recognise: Callable[[bytes, Path], bool]
    read: Callable[[Path], Table]
    extra: str = ""
