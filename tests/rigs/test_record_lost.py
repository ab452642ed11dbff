"""What befalls the record's file from outside ends the loop by its ramp, never otherwise, and leaves the rows."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from test_loop import sine

from stickslip.control.controller import Controller
from stickslip.control.linear import pd
from stickslip.core.errors import RecordFault
from stickslip.core.record import Record
from stickslip.core.stream import EXTENT, KEPT, PERIOD, Stream
from stickslip.rigs.loop import Loop
from stickslip.rigs.rig import Measurement
from support.axis_rig import LIMITS, AxisRig

PD = Controller(pd(19.7612, 0.1747), torque_limit=0.95)
FOREIGN = b"another program's file\n" * 50_000
Act = Callable[[Path], None]


def overwrite(path: Path) -> None:
    with path.open("r+b") as file:
        file.write(FOREIGN)


def replace(path: Path) -> None:
    other = path.with_name("other")
    other.write_bytes(FOREIGN)
    os.replace(other, path)


ACTS: dict[str, tuple[Act, str]] = {
    "emptied": (lambda path: os.truncate(path, 0), "shortened"),
    "cut": (lambda path: os.truncate(path, 70_000), "shortened"),
    "written over": (lambda path: path.write_bytes(FOREIGN), "shortened"),
    "written into": (overwrite, "overwritten"),
    "removed": (lambda path: path.unlink(), "removed"),
    "replaced": (replace, "removed"),
}


class Disturbed(AxisRig):
    """The axis, beside which another process does something to the record at a sample."""

    def __init__(self, act: Act, path: Path, at: int, *, blocks: bool) -> None:
        super().__init__(blocks=blocks)
        self._act, self._path, self._at = act, path, at
        self.noticed: Callable[[], bool] = lambda: True

    def exchange(self, torque: float) -> Measurement:
        measured = super().exchange(torque)
        self._disturb(1)
        return measured

    def exchange_block(self, control, wanted, rows):
        count = super().exchange_block(control, wanted, rows)
        self._disturb(count)
        return count

    def _disturb(self, last: int) -> None:
        count = len(self.torques)
        if count - last < self._at <= count:
            self._act(self._path)
            time.sleep(3 * PERIOD)
            # The loop would be through before a busy machine lets the thread look at the file.
            until = time.monotonic() + 60.0
            while not self.noticed() and time.monotonic() < until:
                time.sleep(PERIOD)


@pytest.mark.parametrize(("realtime", "blocks"), [(True, False), (False, False), (False, True)])
@pytest.mark.parametrize("name", ACTS)
def test_a_file_that_another_process_changes(name, realtime, blocks, tmp_path):
    act, word = ACTS[name]
    path = tmp_path / "run.stream"
    rig = Disturbed(act, path, 60, blocks=blocks)
    loop = Loop(rig, path=path, realtime=realtime)
    rig.noticed = lambda: loop._stream.fault is not None
    with pytest.raises(RecordFault, match=word) as stopped, loop:
        loop.run(sine(400), PD)
    torques = np.array(rig.torques)
    assert torques[-1] == 0.0
    assert not rig.open_now
    assert torques.size < 400
    # By the ramp, no faster, no slower.
    samples = round(LIMITS.stop_time / 1e-3)
    assert np.all(np.abs(np.diff(torques[-samples - 1 :])) <= LIMITS.torque / samples * (1 + 1e-9))
    # What was recorded is kept beside, whole; what is another's is left as it is.
    record = Record.load(tmp_path / "run.stream.rescued")
    assert np.array_equal(record["torque_command"], torques)
    assert np.array_equal(stopped.value.record["torque_command"], torques)
    assert record.meta["complete"] is True
    assert "run.stream.rescued" in str(stopped.value)
    if name == "replaced":
        assert path.read_bytes() == FOREIGN


def test_a_file_that_is_lost_after_the_last_sample_is_told(tmp_path):
    path = tmp_path / "run.stream"

    def run() -> None:
        with Loop(AxisRig(), path=path) as loop:
            loop.run(sine(100), PD)
            os.truncate(path, 0)

    with pytest.raises(RecordFault, match="shortened"):
        run()
    assert len(Record.load(tmp_path / "run.stream.rescued")) >= 100


def test_a_disk_that_does_not_answer_stops_a_loop_that_keeps_pace(tmp_path):
    """The thread hangs in the system's call: rows are stored all the same, and there is room for those of the stop."""
    path = tmp_path / "run.stream"
    stream = Stream({"time": "s"}, path, paced=True)
    hang = stream._lock
    with hang:
        stream.place()
        stream.commit(EXTENT)
        time.sleep(3 * PERIOD)
        assert stream.fault is None
        for _ in range(EXTENT):
            stream.place()
            stream.commit()
        assert "has not answered" in str(stream.fault)
        for _ in range(EXTENT):
            stream.place()
            stream.commit()
        with pytest.raises(RecordFault, match="has not answered"):
            stream.place()
        assert stream.count == 3 * EXTENT
    stream.close()
    assert path.stat().st_size > 3 * EXTENT * 8


def test_old_rows_are_read_back_from_the_file(tmp_path, monkeypatch):
    """Memory holds the newest alone, so that it does not grow with the run."""
    monkeypatch.setattr("stickslip.core.stream.KEPT", 2)
    assert KEPT > 2
    stream = Stream({"time": "s", "position": "rad"}, tmp_path / "a.stream")
    for extent in range(6):
        rows = stream.room(EXTENT)
        rows[:, 0] = extent * EXTENT + np.arange(EXTENT)
        rows[:, 1] = -rows[:, 0]
        stream.commit(EXTENT)
    until = time.monotonic() + 60.0
    while stream._extents[0] is not None and time.monotonic() < until:
        time.sleep(PERIOD)
    assert stream._extents[:3] == [None] * 3
    assert np.array_equal(stream.rows(EXTENT - 5, 6 * EXTENT)[:, 0], np.arange(EXTENT - 5, 6 * EXTENT))
    os.truncate(tmp_path / "a.stream", 0)
    with pytest.raises(RecordFault, match="can no longer be read"):
        stream.rows(0, 10)
    stream.close()
    assert "shortened" in str(stream.fault)
    # What memory held is saved.
    assert Record.load(tmp_path / "a.stream.rescued").time[-1] == 6 * EXTENT - 1
