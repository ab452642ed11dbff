"""Samples on their way to disk: a file that is a readable record at any instant, whatever ends the process.

The file is a header (JSON: columns, units, meta), rows of 64-bit floats, and, once it was closed, a trailer (JSON:
what was known only at the end). Rows are stored into ordinary memory. What keeps pace with a clock leaves writing them
to a thread, every `PERIOD`: ``kill -9`` loses no more than came since. What keeps none writes them itself,
`batch` by `batch`. Nothing that befalls the file (no room, a disk that does not answer, another process that shortens,
overwrites or removes it) reaches the loop as anything but `Stream.fault`, which it looks at between two samples. Space
is reserved an extent ahead; a full disk is therefore known while there is still room for the samples of a stop.
"""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.errors import InputError, RecordFault
from stickslip.core.record import Record
from stickslip.core.stream_file import MAGIC, StreamFile, contents, rows_since

__all__ = ["EXTENT", "MAGIC", "PERIOD", "Stream", "rows_since"]

Array = np.ndarray[Any, np.dtype[np.float64]]

EXTENT = 8192
"""Rows that are reserved at a time: 8 s at 1 kHz, and whole pages whatever the number of columns"""
PERIOD = 0.02
"""s after which the thread writes what has come"""
KEPT = 256
"""Extents that stay in memory; older ones are read back from the file"""
PATIENT = 5
"""Periods after which the thread writes where the loop that should wake it does not"""
PATIENCE = 30.0
"""s that a disk may take to answer where nothing moves meanwhile"""


class Stream:
    """Rows that are written as they come.

    Parameters
    ----------
    units : mapping of str to str
        Columns and their units; ``time`` (s) first.
    path : path or None
        The file, which must not exist yet; None keeps the rows in memory.
    meta : mapping
        As `stickslip.core.record.Record`'s.
    absent : sequence of str
        Columns that nothing is measured for: they are left out of the record.
    paced : bool
        Rows come by a clock: whoever commits them never waits for the disk, nor touches the file, and calls `spare`.
    batch : int
        Rows after which they are written where they come by no clock.

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
        *,
        paced: bool = False,
        batch: int = 1,
    ) -> None:
        self.units = dict(units)
        self.path = None if path is None else Path(path)
        self.meta = dict(meta or {})
        self.absent = tuple(absent)
        self.fault: RecordFault | None = None
        """Why the record cannot go on; there still is room for the rows of a stop."""
        self._paced, self._batch = paced, batch
        self._due = 0.0
        self._extents: list[Array | None] = []
        self._places: list[int] = []
        self._ready = 0
        self._stride = 8 * len(self.units)
        self._written = self._flushed = 0
        self._closing = False
        self._lock = threading.Lock()  # of the file; a paced loop never takes it
        self._wanted = threading.Semaphore(0)
        self._file = None if self.path is None else StreamFile(self.path, self._header(), len(self.units))
        try:
            self._reserve()
        except OSError as error:
            if self._file is not None:
                self._file.discard()
            raise RecordFault(f"{self.path}: no room for a record ({error.strerror}); make room") from None
        self._thread = threading.Thread(target=self._keep, name="record", daemon=True)
        self._thread.start()

    def _header(self) -> bytes:
        return json.dumps({"units": self.units, "meta": self.meta, "absent": self.absent}).encode()

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
        if extent >= self._ready:
            self._await_room(extent)
        rows = self._extents[extent]
        assert rows is not None
        return rows[begin : begin + count]

    def place(self) -> int:
        """The address of the next row, for compiled code that writes it; raises as `room` does."""
        extent, begin = divmod(self._written, EXTENT)
        if extent >= self._ready:
            self._await_room(extent)
        return self._places[extent] + begin * self._stride

    def commit(self, count: int = 1) -> None:
        """The next `count` rows hold samples: from now on they belong to the record."""
        before = self._written // EXTENT
        self._written += count
        now = self._written // EXTENT
        if self._paced and self._written == count:
            self._wanted.release()  # the first rows: the file is a record with rows from now on
        if now != before:
            self._wanted.release()
            if self._paced and now + 1 >= self._ready and self.fault is None:
                # The thread had a whole extent's time; one more extent is left for the rows of a stop.
                self.fault = RecordFault(
                    f"{self.path}: the disk has not answered for {EXTENT} rows; give another one"
                )
        if not self._paced and self._written - self._flushed >= self._batch:
            self._write_now()

    def spare(self) -> None:
        """The loop now waits for its next sample: the thread may write, so as not to want the interpreter later."""
        now = time.monotonic()
        if now >= self._due:
            self._due = now + PERIOD
            self._wanted.release()

    def rows(self, begin: int, end: int) -> Array:
        """A copy of committed rows, shape (end - begin, columns).

        Raises
        ------
        RecordFault
            If old ones were in the file alone, and are no longer.
        """
        out = np.empty((end - begin, len(self.units)))
        done = begin
        while done < end:
            extent, first = divmod(done, EXTENT)
            count = min(EXTENT - first, end - done)
            kept = self._extents[extent]
            if kept is not None:
                out[done - begin : done - begin + count] = kept[first : first + count]
            else:
                assert self._file is not None
                out[done - begin : done - begin + count] = self._file.read(done, count)
            done += count
        return out

    def record(self) -> Record:
        """What was committed so far; without what was in the file alone and is no longer."""
        try:
            rows = self.rows(0, self._written)
        except RecordFault:
            rows = self.rows(self._first_kept(), self._written)
        return Record(*contents(self.units, self.absent, rows, self.meta))

    def close(self, meta: Mapping[str, Any] | None = None) -> None:
        """End the record: give back the room that was not needed, and add to its meta.

        What the file cannot take is said by `fault`; what another process did to it leaves the rows in a file of their
        own beside it.
        """
        if self._closing:
            return
        self._closing = True
        self._wanted.release()
        self._thread.join(PATIENCE)
        self.meta |= meta or {}
        if self._file is None:
            return
        if self._thread.is_alive():
            self.fault = self.fault or RecordFault(
                f"{self.path}: the disk does not answer; the record is not whole"
            )
            return
        self._finish(self._file, json.dumps({**(meta or {}), "complete": True}).encode())

    def discard(self) -> None:
        """Remove the file of a record that has no rows, if it is still ours: its name is free again."""
        if self._file is not None and not self._file.lost and self._written == 0:
            self._file.discard()

    # ---- the thread --------------------------------------------------------------------------------------

    def _keep(self) -> None:
        """Write what has come and reserve ahead, until it is closed."""
        while not self._closing:
            nothing = self._file is None or self._file.lost
            self._wanted.acquire(timeout=None if nothing else PATIENT * PERIOD if self._paced else PERIOD)
            try:
                self._write()
                if self.fault is None:
                    self._reserve()
            except (OSError, MemoryError) as error:
                self._fail(error)

    def _write(self) -> None:
        """Write the rows that were committed since, then their number."""
        file = self._file
        if file is None or file.lost:
            return
        with self._lock:
            if self._whole(file):
                self._append(file)
        self._forget()

    def _write_now(self) -> None:
        """As the thread does, from a loop that keeps no pace."""
        file = self._file
        if file is None or file.lost or not self._lock.acquire(timeout=PATIENCE):
            return
        try:
            self._append(file)  # whether it is still ours is looked at by the thread
        except OSError as error:
            self._fail(error)
        finally:
            self._lock.release()

    def _whole(self, file: StreamFile) -> bool:
        """Whether the file is still ours; a fault where it is not."""
        lost = file.foreign()
        if lost:
            self.fault = self.fault or RecordFault(
                f"{self.path} was {lost} by another process; what memory holds of the record goes to {file.beside}"
            )
        return not lost

    def _append(self, file: StreamFile) -> None:
        end = self._written
        while self._flushed < end:
            extent, first = divmod(self._flushed, EXTENT)
            rows = self._extents[extent]
            assert rows is not None
            part = rows[first : first + end - self._flushed]
            file.write(part, self._flushed)
            self._flushed += len(part)
        file.tell_count(self._flushed)

    def _reserve(self) -> None:
        """Room in the file for the extent after this one, in memory for one more: storing a row waits for nothing."""
        extent = self._written // EXTENT
        if self._file is not None:
            self._file.reserve((extent + 2) * EXTENT)
        while len(self._extents) < extent + 3:
            rows = np.empty((EXTENT, len(self.units)))
            rows[...] = 0.0  # every page is there before a sample wants it
            self._places.append(rows.ctypes.data)
            self._extents.append(rows)
        # What keeps no pace waits for the room in the file; what does may run ahead of it by an extent.
        self._ready = extent + (3 if self._paced else 2)

    def _forget(self) -> None:
        """Old extents are in the file: give their memory back."""
        for extent in range(self._flushed // EXTENT - KEPT, -1, -1):
            if self._extents[extent] is None:
                break
            self._extents[extent] = None

    def _first_kept(self) -> int:
        return EXTENT * next((i for i, rows in enumerate(self._extents) if rows is not None), 0)

    def _fail(self, error: OSError | MemoryError) -> None:
        reason = getattr(error, "strerror", None) or error
        self.fault = self.fault or RecordFault(f"{self.path}: the record cannot grow ({reason}); make room")

    def _await_room(self, extent: int) -> None:
        """Wait for the thread: only a loop that runs faster than the disk comes here, and no loop that keeps pace."""
        until = time.monotonic() + PATIENCE
        while extent >= self._ready:
            if self.fault is not None or not self._thread.is_alive():
                raise self.fault or RecordFault(f"{self.path}: the record is closed")
            if self._paced or time.monotonic() > until:
                raise RecordFault(f"{self.path}: the disk does not answer; give another one")
            self._thread.join(1e-4)

    # ---- the end -----------------------------------------------------------------------------------------

    def _finish(self, file: StreamFile, trailer: bytes) -> None:
        """Write what is left, cut the file after its last row and add the trailer."""
        try:
            self._write()
        except OSError as error:
            self._fail(error)
        try:
            if file.lost and self._written:
                file = self._rescued(file)
            if not file.lost:
                file.finish(self._flushed, trailer)
        except (OSError, InputError) as error:
            self.fault = self.fault or RecordFault(
                f"{self.path}: the end of the record was not written ({error})"
            )
        finally:
            file.close()

    def _rescued(self, lost: StreamFile) -> StreamFile:
        """What memory holds, in a file beside the one that is no longer ours."""
        first = self._first_kept()
        lost.close()
        beside = StreamFile(lost.beside, self._header(), len(self.units))
        for begin in range(first, self._written, EXTENT):
            beside.write(self.rows(begin, min(begin + EXTENT, self._written)), begin - first)
        self._flushed = self._written - first
        return beside
