"""The file of a `stickslip.core.stream.Stream`: what is written where, and whether it is still ours."""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.errors import InputError, RecordFault

Array = np.ndarray[Any, np.dtype[np.float64]]
Contents = tuple[Array, Mapping[str, Array], Mapping[str, str], Mapping[str, Any]]
"""Times, channels, their units, meta"""

MAGIC = b"STKSLIP1"
HEAD = struct.Struct("<8sQQQQ")
"""Magic, offset of the rows, their number, length of the header's JSON, length of the trailer's"""
COUNT = 16
"""Place of the number of rows, bytes"""
PAGE = 65536
"""Rows begin at a multiple of this"""


class StreamFile:
    """The open file; every method may raise `OSError` where none is named.

    Parameters
    ----------
    path : Path
        It must not exist yet.
    header : bytes
        JSON: columns with their units, meta.
    width : int
        Columns.

    Raises
    ------
    InputError
        If it exists or cannot be created.
    RecordFault
        If there is no room for the header.
    """

    def __init__(self, path: Path, header: bytes, width: int) -> None:
        self.path = path
        self.lost = ""
        """What another process did to the file; empty while it is ours."""
        self._stride = 8 * width
        self._header = header
        self._count = 0
        self._start = self._size = -(-(HEAD.size + len(header)) // PAGE) * PAGE
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        except FileExistsError:
            raise InputError(f"{path} exists; remove it or give another name") from None
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"{path} cannot be created ({reason}); give another name") from None
        found = os.fstat(self._file)
        self._identity = found.st_dev, found.st_ino
        try:
            allocate(self._file, 0, self._start)
            whole_write(self._file, self._head() + header, 0)
        except OSError as error:
            self.discard()
            raise RecordFault(f"{path}: no room for a record ({error.strerror}); make room") from None

    @property
    def beside(self) -> Path:
        """Where the rows go if the file is lost: a name that is free."""
        first = self.path.with_name(f"{self.path.name}.rescued")
        names = (first.with_name(f"{first.name}-{i}") for i in range(2, 1000))
        return first if not first.exists() else next((n for n in names if not n.exists()), first)

    def reserve(self, rows: int) -> None:
        """Make room for that many rows in all."""
        size = self._start + rows * self._stride
        if size > self._size and not self.lost:
            allocate(self._file, self._size, size - self._size)
            self._size = size

    def foreign(self) -> str:
        """What another process did to the file, in a word; empty where nothing shows."""
        if not self.lost:
            # Head before size: cut in between, the head alone would seem to be overwritten.
            head, found = os.pread(self._file, HEAD.size, 0), os.fstat(self._file)
            if found.st_nlink == 0:
                self.lost = "removed"
            elif found.st_size < self._size:
                self.lost = "shortened"
            elif head != self._head():
                self.lost = "overwritten"
        return self.lost

    def write(self, rows: Array, at: int) -> None:
        """Write rows, the first of them at the place of row `at`."""
        whole_write(self._file, np.ascontiguousarray(rows).data.cast("B"), self._start + at * self._stride)

    def tell_count(self, count: int) -> None:
        """From now on the first `count` rows belong to the record."""
        if count != self._count:
            whole_write(self._file, struct.pack("<Q", count), COUNT)
            self._count = count

    def read(self, at: int, count: int) -> Array:
        """Rows that were written.

        Raises
        ------
        RecordFault
            If they are not there any more.
        """
        size = count * self._stride
        try:
            data = b"" if self.lost else os.pread(self._file, size, self._start + at * self._stride)
        except OSError:
            data = b""
        if len(data) < size:
            raise RecordFault(f"{self.path}: rows {at} to {at + count} can no longer be read from it")
        return np.frombuffer(data, dtype="<f8").reshape(count, -1)

    def finish(self, count: int, trailer: bytes) -> None:
        """Cut the file after its last row and add the trailer."""
        end = self._start + count * self._stride
        # Room beyond the rows is given back first, so that a full disk takes the trailer.
        os.ftruncate(self._file, end)
        self._size = end
        self.tell_count(count)
        whole_write(self._file, trailer, end)
        whole_write(self._file, struct.pack("<Q", len(trailer)), HEAD.size - 8)

    def close(self) -> None:
        """Close it; twice does no harm."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def discard(self) -> None:
        """Close and remove it, unless another file has its name by now: it is empty."""
        self.close()
        with suppress(OSError):
            found = os.stat(self.path)
            if (found.st_dev, found.st_ino) == self._identity:
                self.path.unlink()

    def _head(self) -> bytes:
        return HEAD.pack(MAGIC, self._start, self._count, len(self._header), 0)


def whole_write(file: int, data: Any, at: int) -> None:
    """`os.pwrite` until all is written: a disk that fills may take a part."""
    left = memoryview(data)
    while left:
        done = os.pwrite(file, left, at)
        left, at = left[done:], at + done


def allocate(file: int, offset: int, size: int) -> None:
    """Reserve room on the disk; where the system cannot, by writing zeros."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file, offset, size)
        return
    zeros = bytes(min(size, 1 << 20))
    for begin in range(offset, offset + size, len(zeros)):
        whole_write(file, zeros[: offset + size - begin], begin)


# ---- reading ----------------------------------------------------------------------------------------------


def load(path: str | os.PathLike[str]) -> Contents:
    """What a record is made of, from a stream's file, also in one that is being written or whose writer was killed.

    ``meta["complete"]`` is true where it was closed. Else rows may be missing at the end: ``meta["rows_lost"]`` counts
    those that a crash of the machine kept from the disk.

    Raises
    ------
    InputError
        If it is not such a file, or its times do not increase.
    """
    try:
        with open(path, "rb") as file:
            magic, start, count, length, trailer = HEAD.unpack(file.read(HEAD.size))
            if magic != MAGIC:
                raise ValueError("no header")
            size = os.fstat(file.fileno()).st_size
            header = json.loads(file.read(min(length, start, size)))
            units, absent, meta = (
                dict(header["units"]),
                header["absent"],
                {**header["meta"], "complete": False},
            )
            file.seek(start)
            data = file.read(min(count * len(units) * 8, size))
            if trailer and len(data) == count * len(units) * 8:
                meta |= json.loads(file.read(min(trailer, size)))
    except FileNotFoundError:
        raise InputError(f"no record at {path}; check the path") from None
    except (OSError, ValueError, KeyError, TypeError, OverflowError, struct.error) as error:
        raise InputError(f"{path} is not a record of this package ({error or 'damaged'})") from None
    values = np.frombuffer(data, dtype="<f8", count=len(data) // 8)
    rows = values[: len(values) // len(units) * len(units)].reshape(-1, len(units))
    lost = 0 if meta["complete"] else empty_end(rows)
    if lost:
        rows, meta = rows[:-lost], {**meta, "rows_lost": lost}
    with np.errstate(invalid="ignore"):
        steps = np.diff(rows[:, 0])
    back = np.flatnonzero(~((steps > 0.0) & np.isfinite(steps)))
    if back.size:
        at = int(back[0])
        raise InputError(
            f"{path}: time goes from {rows[at, 0]:.9g} to {rows[at + 1, 0]:.9g} s after row {at + 1} of {len(rows)}, "
            "and must increase; record the run again with a rig whose clock advances in every sample"
        )
    return contents(units, absent, rows, meta)


def empty_end(rows: Array) -> int:
    """Return the number of rows at the end that contain zeros alone: their count was on the disk before their data."""
    written = np.flatnonzero(np.any(rows != 0.0, axis=1))
    return len(rows) - max(1, int(written[-1]) + 1 if written.size else 1) if len(rows) else 0


def contents(
    units: Mapping[str, str], absent: Sequence[str], rows: Array, meta: Mapping[str, Any]
) -> Contents:
    """Times, channels, their units and meta of rows whose first column is the time; columns `absent` are left out."""
    names = list(units)
    channels = {
        name: np.ascontiguousarray(rows[:, i]) for i, name in enumerate(names) if i > 0 and name not in absent
    }
    return rows[:, 0].copy(), channels, {name: units[name] for name in channels}, meta


def rows_since(path: Path, after: int) -> tuple[dict[str, str], Array]:
    """Columns with their units, and the rows behind row `after`, of a stream that may still be written.

    Raises
    ------
    InputError
        If it is no stream.
    """
    try:
        with path.open("rb") as file:
            magic, start, count, length, _ = HEAD.unpack(file.read(HEAD.size))
            if magic != MAGIC:
                raise ValueError("no header")
            size = os.fstat(file.fileno()).st_size
            header = json.loads(file.read(min(length, start, size)))
            units = {str(k): str(v) for k, v in header["units"].items()}
            file.seek(start + 8 * len(units) * after)
            content = file.read(min(8 * len(units) * max(0, count - after), size))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, OverflowError, struct.error) as error:
        raise InputError(f"{path} is no stream of a rig ({error})") from None
    whole = len(content) // (8 * len(units)) * len(units)
    return units, np.frombuffer(content, dtype="<f8", count=whole).reshape(-1, len(units))
