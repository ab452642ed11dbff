"""Columns as they are in a file, before they are assigned to channels: the result of a format's reader."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.finding import Finding

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True, eq=False)
class Column:
    """One column of a file.

    Attributes
    ----------
    name : str
        As written in the file; in files with groups the path of names, joined by dots.
    values : array, shape (n,)
        As written: units are converted later. NaN if the file has no number.
    unit : str
        As written; empty if the file states none.
    clock : array, shape (n,), or None
        The column's own times in s, if columns have their own times.
    channel : str
        The channel defined by the format, or "none" for a quantity that is not a channel; empty if only name and unit
        indicate it.
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
        Their lengths differ if the file has several tables.
    constants : mapping of str to float or str
        Single values in the file.
    findings : tuple of Finding
        Findings about the file.
    unread : mapping of str to str
        Name and first cell of columns that were left out because they have neither numbers nor times.
    runs : tuple of int
        Rows, from 1, at which another record of the same axis starts, such as consecutive tests or episodes.
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
        Suffixes of file names, in lower case with the dot.
    recognise : callable
        ``recognise(head, path) -> bool``: whether the first 4096 bytes (none for a folder) are the start of such a
        file.
    read : callable
        ``read(path) -> Table``; raises `InputError` on a file it cannot read.
    extra : str
        The extra of the package that the format requires; empty if none.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    recognise: Callable[[bytes, Path], bool]
    read: Callable[[Path], Table]
    extra: str = ""
