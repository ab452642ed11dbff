"""Samples on their way to disk: a file that is a readable record at any instant, whatever ends the process.

The file is a header (JSON: columns, units, meta), rows of 64-bit floats, and, once it was closed, a trailer (JSON:
what was known only at the end). Rows are stored straight into the operating system's memory of the file (`mmap`), then
their number: nothing is kept in the process, so ``kill -9`` loses no row that was committed. Space is reserved an
extent ahead by a thread; a full disk is therefore known while there is still room for the samples of a stop.
"""

from __future__ import annotations

import contextlib
import json
import mmap
import os
import struct
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.errors import InputError, RecordFault
from stickslip.record import Record

__all__ = ["MAGIC", "Stream", "load_stream"]

Array = np.ndarray[Any, np.dtype[np.float64]]

MAGIC = b"STKSLIP1"
HEAD = struct.Struct("<8sQQQQ")
"""Magic, offset of the rows, their number, length of the header's JSON, length of the trailer's"""
COUNT = 2  # place of the number of rows, in words of 8 bytes
PAGE = 65536
"""Mappings begin at multiples of this on every system"""
EXTENT = 8192
"""Rows that are reserved at a time: 8 s at 1 kHz, and whole pages whatever the number of columns"""


class Stream:
    """Rows that are written as they come.

    Parameters
    ----------
    units : mapping of str to str
        Columns and their units; ``time`` (s) first.
    path : path or None
        The file, which must not exist yet; None keeps the rows in memory.
    meta : mapping
        As `stickslip.record.Record`'s.
    absent : sequence of str
        Columns that nothing is measured for: they are left out of the record.

    Raises
    ------
    InputError
        If the file exists or cannot be created.
    RecordFault
        If there is no room for the first rows.
    """

    def __init__(
        self,
        units: Mapping[str, str],
        path: str | os.PathLike[str] | None = None,
        meta: Mapping[str, Any] | None = None,
        absent: Sequence[str] = (),
    ) -> None:
        self.units = dict(units)
        self.path = None if path is None else Path(path)
        self.meta = dict(meta or {})
        self.absent = tuple(absent)
        self.fault: RecordFault | None = None
        """Why no more room could be reserved; the rows that were reserved before can still be written."""
        self._extents: list[Array] = []
        self._places: list[int] = []
        self._stride = 8 * len(self.units)
        self._maps: list[mmap.mmap] = []
        self._wanted = threading.Semaphore(0)
        self._closing = False
        self._file = -1
        self._count = np.zeros(1, dtype=np.uint64)
        self._written = 0
        if self.path is not None:
            self._create(self.path)
        try:
            self._extend()
            self._extend()
        except OSError as error:
            self._release()
            raise RecordFault(f"{self.path}: no room for a record ({error.strerror}); make room") from None
        self._thread = threading.Thread(target=self._reserve, name="record", daemon=True)
        self._thread.start()

    # ---- writing -----------------------------------------------------------------------------------------

    @property
    def count(self) -> int:
        """Rows committed so far."""
        return self._written

    def room(self, count: int) -> Array:
        """Up to `count` rows to be written next, shape (n, columns), n > 0.

        Raises
        ------
        RecordFault
            If there is no room left.
        """
        extent, begin = divmod(self._written, EXTENT)
        if extent >= len(self._extents):
            self._await_room()
        return self._extents[extent][begin : begin + count]

    def place(self) -> int:
        """The address of the next row, for compiled code that writes it; raises as `room` does."""
        self.room(1)
        extent, begin = divmod(self._written, EXTENT)
        return self._places[extent] + begin * self._stride

    def commit(self, count: int = 1) -> None:
        """The next `count` rows hold samples: from now on they belong to the record."""
        before = self._written // EXTENT
        self._written += count
        self._count[0] = self._written
        if self._written // EXTENT != before:
            self._wanted.release()

    def touch(self) -> None:
        """Store into the next row, where there is time for it.

        A page that the system has written to disk meanwhile is write-protected until the next store, which then takes
        some µs.
        """
        extent, begin = divmod(self._written, EXTENT)
        if extent < len(self._extents):
            self._extents[extent][begin, -1] = 0.0

    def rows(self, begin: int, end: int) -> Array:
        """A copy of committed rows, shape (end - begin, columns)."""
        out = np.empty((end - begin, len(self.units)))
        done = begin
        while done < end:
            extent, first = divmod(done, EXTENT)
            part = self._extents[extent][first : first + end - done]
            out[done - begin : done - begin + len(part)] = part
            done += len(part)
        return out

    def record(self) -> Record:
        """What was committed so far."""
        return _record(self.units, self.absent, self.rows(0, self._written), self.meta)

    def close(self, meta: Mapping[str, Any] | None = None) -> None:
        """End the record: give back the room that was not needed, and add to its meta."""
        if self._closing:
            return
        self._closing = True
        self._wanted.release()
        self._thread.join()
        self.meta |= meta or {}
        if self._file >= 0:
            self._finish({**(meta or {}), "complete": True})
        self._release(keep_rows=self.path is None)

    # ---- the file ----------------------------------------------------------------------------------------

    def _create(self, path: Path) -> None:
        text = json.dumps({"units": self.units, "meta": self.meta, "absent": self.absent}).encode()
        start = -(-(HEAD.size + len(text)) // PAGE) * PAGE
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        except FileExistsError:
            raise InputError(f"{path} exists; remove it or give another name") from None
        except OSError as error:
            raise InputError(f"{path} cannot be created ({error.strerror}); give another name") from None
        try:
            _allocate(self._file, 0, start)
            os.pwrite(self._file, HEAD.pack(MAGIC, start, 0, len(text), 0) + text, 0)
        except OSError as error:
            self._release()
            raise RecordFault(f"{path}: no room for a record ({error.strerror}); make room") from None
        head = mmap.mmap(self._file, PAGE, offset=0)
        self._maps.append(head)
        self._count = np.frombuffer(head, dtype="<u8", count=COUNT + 1)[COUNT:]
        self._start = start

    def _extend(self) -> None:
        """Reserve one more extent and touch its pages, so that storing a row waits for nothing."""
        rows = self._mapped() if self._file >= 0 else np.empty((EXTENT, len(self.units)))
        rows[...] = 0.0  # every page is there before a sample wants it
        self._places.append(rows.ctypes.data)
        self._extents.append(rows)

    def _mapped(self) -> Array:
        width = len(self.units)
        size = EXTENT * width * 8
        offset = self._start + len(self._extents) * size
        _allocate(self._file, offset, size)
        mapped = mmap.mmap(self._file, size, offset=offset)
        self._maps.append(mapped)
        return np.frombuffer(mapped, dtype="<f8").reshape(EXTENT, width)

    def _reserve(self) -> None:
        """The thread: an extent ahead of the one that is written."""
        while True:
            self._wanted.acquire()
            if self._closing:
                return
            try:
                self._extend()
            except (OSError, MemoryError) as error:
                reason = getattr(error, "strerror", None) or error
                self.fault = RecordFault(f"{self.path}: the record cannot grow ({reason}); make room")
                return

    def _await_room(self) -> None:
        """Wait for the thread: only a loop that runs faster than the disk comes here."""
        extent = self._written // EXTENT
        while extent >= len(self._extents):
            if self.fault is not None or not self._thread.is_alive():
                raise self.fault or RecordFault(f"{self.path}: the record is closed")
            self._thread.join(1e-4)

    def _finish(self, meta: Mapping[str, Any]) -> None:
        """Cut the file after its last row and add the trailer."""
        text = json.dumps(meta).encode()
        end = self._start + self._written * len(self.units) * 8
        try:
            # Reserved room beyond the rows is given back first, so that a full disk takes the trailer.
            self._release_maps()
            os.ftruncate(self._file, end)
            os.pwrite(self._file, text, end)
            os.pwrite(self._file, struct.pack("<Q", len(text)), HEAD.size - 8)
        except OSError:
            return  # the rows are there; only what is known of the end is lost

    def _release_maps(self) -> None:
        """Let go of the mappings; whoever still holds rows of them keeps those alive."""
        self._extents = []
        self._count = np.zeros(1, dtype=np.uint64)
        for mapped in self._maps:
            with contextlib.suppress(BufferError):
                mapped.close()
        self._maps = []

    def _release(self, *, keep_rows: bool = False) -> None:
        if not keep_rows:
            self._release_maps()
        if self._file >= 0:
            os.close(self._file)
            self._file = -1


def _allocate(file: int, offset: int, size: int) -> None:
    """Reserve room on the disk; where the system cannot, by writing zeros."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file, offset, size)
        return
    zeros = bytes(min(size, 1 << 20))
    for begin in range(offset, offset + size, len(zeros)):
        os.pwrite(file, zeros[: offset + size - begin], begin)


# ---- reading ----------------------------------------------------------------------------------------------


def load_stream(path: str | os.PathLike[str]) -> Record:
    """The record in a stream's file, also in one that is being written or whose writer was killed.

    ``meta["complete"]`` is true where it was closed.

    Raises
    ------
    InputError
        If it is not such a file.
    """
    try:
        with open(path, "rb") as file:
            magic, start, count, length, trailer = HEAD.unpack(file.read(HEAD.size))
            if magic != MAGIC:
                raise ValueError("no header")
            header = json.loads(file.read(min(length, start)))
            units, absent, meta = (
                dict(header["units"]),
                header["absent"],
                {**header["meta"], "complete": False},
            )
            file.seek(start)
            data = file.read(min(count * len(units) * 8, os.fstat(file.fileno()).st_size))
            if trailer and len(data) == count * len(units) * 8:
                meta |= json.loads(file.read(trailer))
    except FileNotFoundError:
        raise InputError(f"no record at {path}; check the path") from None
    except (OSError, ValueError, KeyError, TypeError, OverflowError, struct.error) as error:
        raise InputError(f"{path} is not a record of this package ({error})") from None
    values = np.frombuffer(data, dtype="<f8", count=len(data) // 8)
    rows = values[: len(values) // len(units) * len(units)].reshape(-1, len(units))
    # After a crash of the whole machine the number may have reached the disk before the rows: these hold zeros.
    late = np.flatnonzero(~(np.diff(rows[:, 0]) > 0.0))
    whole = rows[: late[0] + 1] if late.size else rows
    return _record(units, absent, whole, meta)


def _record(units: Mapping[str, str], absent: Sequence[str], rows: Array, meta: Mapping[str, Any]) -> Record:
    names = list(units)
    channels = {
        name: np.ascontiguousarray(rows[:, i]) for i, name in enumerate(names) if i > 0 and name not in absent
    }
    return Record(rows[:, 0].copy(), channels, {name: units[name] for name in channels}, meta)
