"""The record survives: kill -9 at any instant, a full disk, a crash of the machine."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from stickslip.core.errors import InputError, RecordFault
from stickslip.core.record import Record
from stickslip.core.stream import EXTENT, MAGIC, Stream
from stickslip.readers import read

UNITS = {"time": "s", "position": "rad", "temperature": "°C"}


class Victim:
    """Orders loops from the process of victim.py."""

    def __init__(self, prefix: tuple[str, ...] = ()) -> None:
        script = Path(__file__).parents[1] / "support" / "victim.py"
        self._process = subprocess.Popen(
            [*prefix, sys.executable, str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def start(self, path: Path, *, realtime: bool = False, blocks: bool = True, file_limit: int = 0) -> int:
        self.count = path.with_suffix(".count")
        self.count.write_bytes(bytes(16))
        order = {
            "path": str(path), "count": str(self.count), "realtime": realtime, "blocks": blocks,
            "file_limit": file_limit,
        }  # fmt: skip
        assert self._process.stdin
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()
        return int(self._answer())

    def ended(self) -> dict[str, object]:
        return json.loads(self._answer())

    def _answer(self) -> str:
        assert self._process.stdout
        return self._process.stdout.readline()

    def given(self) -> tuple[int, float]:
        """How many torques the rig was given, and the last."""
        count, torque = struct.unpack("<dd", self.count.read_bytes())
        return int(count), torque

    def close(self) -> None:
        assert self._process.stdin
        self._process.stdin.close()
        self._process.wait(60)


@pytest.fixture(scope="module")
def victim() -> Iterator[Victim]:
    process = Victim()
    yield process
    process.close()


# The 100 ms are real time: a thread writes the rows, and a busy machine may keep it from that.
@pytest.mark.flaky(reruns=2)
@pytest.mark.parametrize(("realtime", "blocks"), [(True, False), (False, True), (False, False)])
def test_kill_9_at_any_instant_loses_at_most_100_ms(victim, tmp_path, realtime, blocks):
    rng = random.Random(5 + 2 * realtime + blocks)
    for trial in range(6):
        path = tmp_path / f"{trial}.stream"
        pid = victim.start(path, realtime=realtime, blocks=blocks)
        while victim.given()[0] == 0:
            time.sleep(1e-3)
        time.sleep(rng.uniform(0.0, 0.2))
        os.kill(pid, signal.SIGKILL)
        assert victim.ended()["signal"] == signal.SIGKILL
        given, _ = victim.given()
        record = Record.load(path)
        assert record.meta["complete"] is False
        # A sample is 1 ms. The rig may have been given a torque more than it could count, hence + 1 and a block.
        assert given - 100 <= len(record) <= given + 50
        assert np.allclose(np.diff(record.time), 1e-3)
        assert np.all(np.isfinite(record["motor_torque"]))
        assert len(read(path)) == len(record)


@pytest.mark.parametrize("blocks", [True, False])
def test_a_record_that_cannot_grow_stops_the_loop_and_survives(victim, tmp_path, blocks):
    """RLIMIT_FSIZE stands for the disk: the file may hold four extents."""
    path = tmp_path / "run.stream"
    victim.start(path, blocks=blocks, file_limit=4_200_000)
    answer = victim.ended()
    assert "RecordFault" in str(answer["said"])
    assert "make room" in str(answer["said"])
    given, torque = victim.given()
    assert torque == 0.0
    record = Record.load(path)
    assert len(record) == given > 3 * EXTENT
    assert record["torque_command"][-1] == 0.0
    assert record.meta["complete"] is True
    assert "make room" in record.meta["ended"]


def test_a_full_disk_stops_the_loop_and_the_record_survives(tmp_path):
    """A real one: a file system of 3 MB, where the user may mount it."""
    if shutil.which("unshare") is None:
        pytest.skip("no unshare")
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = f'mount -t tmpfs -o size=3m tmpfs {disk} && exec "$@" && true'
    allowed = subprocess.run(["unshare", "-m", "sh", "-c", mount, "sh", "true"], capture_output=True)
    if allowed.returncode != 0:
        pytest.skip("mounting is not permitted")
    # The file system is seen by the victim alone, so it copies the record out of it at the end.
    copy = f'mount -t tmpfs -o size=3m tmpfs {disk} && "$@" && cp {disk}/run.stream {tmp_path}/copy.stream'
    victim = Victim(("unshare", "-m", "sh", "-c", copy, "sh"))
    path = disk / "run.stream"
    victim.count = tmp_path / "count"
    victim.count.write_bytes(bytes(16))
    order = {
        "path": str(path), "count": str(victim.count), "realtime": False, "blocks": True, "file_limit": 0,
    }  # fmt: skip
    assert victim._process.stdin
    victim._process.stdin.write(json.dumps(order) + "\n")
    victim._process.stdin.flush()
    assert int(victim._answer()) > 0
    answer = victim.ended()
    victim.close()
    assert "No space left" in str(answer["said"])
    given, torque = victim.given()
    assert torque == 0.0
    record = Record.load(tmp_path / "copy.stream")
    assert len(record) == given
    assert record["torque_command"][-1] == 0.0


# ---- the file -------------------------------------------------------------------------------------------------


def filled(path: Path, count: int) -> Stream:
    stream = Stream(UNITS, path, {"who": "me"}, absent=("temperature",))
    done = 0
    while done < count:
        rows = stream.room(min(1000, count - done))
        rows[:, 0] = np.arange(done, done + len(rows)) * 1e-3
        rows[:, 1] = np.sin(rows[:, 0])
        rows[:, 2] = np.nan
        stream.commit(len(rows))
        done += len(rows)
    return stream


@pytest.mark.parametrize("count", [0, 1, EXTENT - 1, EXTENT, EXTENT + 1, 3 * EXTENT + 7])
def test_what_is_written_is_what_is_read(tmp_path, count):
    path = tmp_path / "a.stream"
    stream = filled(path, count)
    while_open = Record.load(path)
    assert len(while_open) == count == len(stream.record())
    stream.close({"seen": 3})
    record = Record.load(path)
    assert np.array_equal(record.time, 1e-3 * np.arange(count))
    assert np.array_equal(record["position"], np.sin(record.time))
    assert list(record.channels) == ["position"]
    assert record.meta == {"who": "me", "seen": 3, "complete": True}
    # Room that was reserved ahead is given back.
    assert path.stat().st_size < 65536 + count * 24 + 200


def test_a_number_of_rows_that_outran_the_rows_is_cut(tmp_path):
    """What a crash of the machine may leave: the header on disk, the last rows not."""
    path = tmp_path / "a.stream"
    stream = filled(path, 500)
    data = bytearray(path.read_bytes())
    stream.close()
    data[65536 + 400 * 24 : 65536 + 500 * 24] = bytes(100 * 24)
    path.write_bytes(data)
    assert len(Record.load(path)) == 400


@pytest.mark.parametrize("keep", [0, 8, 39, 60, 65536, 65536 + 100 * 24 + 5])
def test_a_file_cut_short_is_read_or_refused(tmp_path, keep):
    path = tmp_path / "a.stream"
    filled(path, 500).close()
    path.write_bytes(path.read_bytes()[:keep])
    if keep < 65536:
        with pytest.raises(InputError):
            Record.load(path)
    else:
        assert len(Record.load(path)) == (keep - 65536) // 24


def test_noise_is_refused(tmp_path):
    path = tmp_path / "a.stream"
    rng = np.random.default_rng(1)
    for _ in range(50):
        path.write_bytes(MAGIC + rng.bytes(500))
        with pytest.raises(InputError):
            Record.load(path)


def test_no_room_at_all_is_said(tmp_path):
    with pytest.raises(InputError, match="cannot be created"):
        Stream(UNITS, tmp_path / "none" / "a.stream")
    with pytest.raises((InputError, RecordFault)):
        Stream(UNITS, "/dev/full")
