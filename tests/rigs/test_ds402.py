"""The rig `ds402` on a drive in another process: cyclic torque, faults, watchdogs."""

from __future__ import annotations

import contextlib
import os
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

canopen = pytest.importorskip("canopen")
can = pytest.importorskip("can")
pytest.importorskip("durand")
pytest.importorskip("msgpack")

from test_loop import sine  # noqa: E402

from stickslip.cli import main  # noqa: E402
from stickslip.control.compensator import Feedforward  # noqa: E402
from stickslip.control.controller import Controller  # noqa: E402
from stickslip.control.linear import pd  # noqa: E402
from stickslip.core.errors import DriveFault, InputError, MessageLost, RigError  # noqa: E402
from stickslip.core.record import Record  # noqa: E402
from stickslip.models.model import Model  # noqa: E402
from stickslip.rigs.ds402 import Ds402, Settings  # noqa: E402
from stickslip.rigs.files import read_rig  # noqa: E402
from stickslip.rigs.loop import Loop  # noqa: E402
from stickslip.rigs.rig import Limits, setpoints  # noqa: E402

# Drive and loop keep each other's watchdogs, of tens of ms: a machine that stands still for longer ends both.
pytestmark = pytest.mark.flaky(reruns=2)
NODE = 5
CHANNEL = "239.74.163.2"
LOG = struct.Struct("<qdqd")
LIMITS = Limits(torque=1.0, speed=60.0, following_error=1.0, stop_time=0.02, answer_time=1.0)
PD = Controller(pd(19.7612, 0.1747), torque_limit=0.9)
DROP_ANSWERS, LATE_ANSWERS, TRIP, SAFE_TORQUE_OFF, DROP_COMMANDS = range(1, 6)


class Drive:
    """The other process, its bus and its log."""

    def __init__(self, folder: Path) -> None:
        worker = int("".join(filter(str.isdigit, os.environ.get("PYTEST_XDIST_WORKER", "0"))) or 0)
        self.port = 43200 + (os.getpid() % 500) + 500 * worker
        self.log = folder / "drive.log"
        script = Path(__file__).parents[1] / "support" / "drive.py"
        self.process = subprocess.Popen(
            [sys.executable, str(script), CHANNEL, str(self.port), str(NODE), str(self.log)],
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self.process.stdout
        assert self.process.stdout.readline() == "ready\n"

    @property
    def bus(self) -> dict[str, object]:
        return {"interface": "udp_multicast", "channel": CHANNEL, "port": self.port, "hop_limit": 0}

    def settings(self, **options: object) -> Settings:
        # Patient where nothing is measured: the machine that tests may be busy.
        given = {"limits": LIMITS, "watchdog_time": 0.2, "timeout": 0.1, "reset_fault": True, **options}
        return Settings(self.bus, NODE, **given)

    def tell(self, *objects: tuple[int, int, str, int]) -> None:
        """Write objects of the drive."""
        network = canopen.Network()
        network.NOTIFIER_CYCLE = 0.02
        with network.connect(**self.bus):
            sdo = network.add_node(NODE, canopen.ObjectDictionary()).sdo
            sdo.RESPONSE_TIMEOUT = 30.0  # nothing is measured here
            for index, sub, form, value in objects:
                sdo.download(index, sub, struct.pack(form, value))

    def fault(self, kind: int, at: int = 0, value: int = 0) -> None:
        self.tell((0x2000, 1, "<H", kind), (0x2000, 2, "<I", at), (0x2000, 3, "<I", value))

    def changes(self, since: int) -> list[tuple[float, ...]]:
        """Changes of the drive's torque after a time of the monotonic clock: ns, N·m, SYNC, state."""
        return [entry for entry in LOG.iter_unpack(self.log.read_bytes()) if entry[0] >= since]


@pytest.fixture(scope="module")
def drive(tmp_path_factory) -> Iterator[Drive]:
    try:
        can.Bus(interface="udp_multicast", channel=CHANNEL, port=43199, hop_limit=0).shutdown()
    except (can.CanError, OSError):
        pytest.skip("this machine has no multicast")
    process = Drive(tmp_path_factory.mktemp("drive"))
    yield process
    process.process.kill()
    process.process.wait()


@pytest.fixture(autouse=True)
def _sound(drive):
    drive.fault(0)


def test_it_tracks_through_the_bus(drive):
    with Loop(Ds402(drive.settings())) as loop:
        loop.prepare(PD)
        rows = loop.run(sine(1500), PD)
        account = loop.account()
    assert len(rows) == 1500
    error = rows[300:, 7] - rows[300:, 1]
    assert np.sqrt(np.mean(error**2)) < 0.05
    assert np.ptp(rows[:, 1]) > 0.8
    assert account.samples >= 1500
    # The drive's own word: torque acted, and is gone.
    assert len(drive.changes(0)) > 500
    assert drive.changes(0)[-1][1] == 0.0


@pytest.mark.parametrize(
    ("kind", "value", "error", "message"),
    [
        (DROP_ANSWERS, 1, MessageLost, "no answer within"),
        (DROP_ANSWERS, 1000, MessageLost, "no answer within"),
        (LATE_ANSWERS, 200, MessageLost, "no answer within"),
        (TRIP, 0x7500, DriveFault, "fault 0x7500"),
        (TRIP, 0x2310, DriveFault, "fault 0x2310"),
        (SAFE_TORQUE_OFF, 0, DriveFault, "switch on disabled"),
        (DROP_COMMANDS, 1000, DriveFault, "switch on disabled"),
    ],
)
def test_faults_on_the_bus_and_in_the_drive(drive, tmp_path, kind, value, error, message):
    drive.fault(kind, at=150, value=value)
    begin = time.monotonic_ns()
    timeout = 0.02 if kind in (DROP_ANSWERS, LATE_ANSWERS) else 0.1
    rig = Ds402(drive.settings(timeout=timeout))
    with pytest.raises(error, match=message), Loop(rig, path=tmp_path / "run.stream") as loop:
        loop.run(setpoints(2000, torque=0.25), None)
    changes = drive.changes(begin)
    assert changes[-1][1] == 0.0
    record = Record.load(tmp_path / "run.stream")
    assert record["torque_command"][-1] == 0.0
    # From the sample that saw the fault to zero within the declared time, counted in samples.
    stopping = record["torque_command"][record["state"] >= 1]
    assert stopping.size * 1e-3 <= LIMITS.stop_time
    assert np.all(np.diff(stopping) < 0)


def test_a_fault_is_reset_on_request_only(drive):
    drive.fault(TRIP, at=30, value=0x3210)
    with pytest.raises(DriveFault), Loop(Ds402(drive.settings())) as loop:
        loop.run(setpoints(200, torque=0.2))
    drive.fault(0)
    with (
        pytest.raises(DriveFault, match="has fault 0x3210"),
        Loop(Ds402(drive.settings(reset_fault=False))),
    ):
        pass
    with Loop(Ds402(drive.settings())) as loop:
        assert len(loop.run(setpoints(20))) == 20


def test_a_limited_position_demands_a_homed_drive(drive):
    limits = replace(LIMITS, position=(-50.0, 50.0))
    drive.tell((0x2001, 0, "<B", 0))
    with pytest.raises(InputError, match="not homed"), Loop(Ds402(drive.settings(limits=limits))):
        pass
    drive.tell((0x2001, 0, "<B", 1))
    with Loop(Ds402(drive.settings(limits=limits))) as loop:
        assert len(loop.run(setpoints(20))) == 20


def test_a_drive_that_is_not_there(drive):
    settings = replace(drive.settings(), node=9)
    with pytest.raises(MessageLost, match="no answer to upload of 1000h"), Loop(Ds402(settings)):
        pass


def test_without_a_watchdog_it_does_not_arm(drive):
    rig = Ds402(drive.settings(watchdog="none"))
    with pytest.raises(InputError, match="without_watchdog=True"):
        Loop(rig)
    with Loop(rig, without_watchdog=True) as loop:
        assert len(loop.run(setpoints(10))) == 10


def test_the_drive_is_served_while_a_controller_is_compiled(drive, tmp_path):
    """A law that no cache knows takes far longer to compile than the drive's watchdog waits."""
    text = (Path(__file__).parents[1] / "support" / "brittle.py").read_text()
    law = tmp_path / "fresh.py"
    law.write_text(
        text.replace("p.vmax - abs(v1)", f"p.vmax + {time.time_ns()}.0 - abs(v1)").replace(
            '"brittle"', '"fresh"'
        )
    )
    helper = Feedforward(Model(str(law), fc=1e-9, vmax=1.0))
    begin = time.monotonic()
    with Loop(Ds402(drive.settings(watchdog_time=0.15))) as loop:
        loop.run(setpoints(20, torque=0.1))
        rows = loop.run(sine(100, 0.1), Controller(pd(5.0, 0.05), helper, torque_limit=0.9))
    assert len(rows) == 100
    assert time.monotonic() - begin > 0.15 + 0.12, "compiling took no time: the test shows nothing"


def test_quick_stop(drive):
    begin = time.monotonic_ns()
    rig = Ds402(drive.settings())

    def stopped_by_itself(loop: Loop) -> None:
        loop.run(setpoints(50, torque=0.3))
        rig.quick_stop()
        loop.run(setpoints(50, torque=0.3))

    with pytest.raises(DriveFault, match="quick stop active"), Loop(rig) as loop:
        stopped_by_itself(loop)
    stopped = [c for c in drive.changes(begin) if c[1] == 0.0]
    assert stopped[0][3] == 4.0  # the state in which the torque went: quick stop


# ---- kill -9 ------------------------------------------------------------------------------------------------------

VICTIM = """
import sys
sys.path.insert(0, {tests!r})
from stickslip.rigs.ds402 import Ds402, Settings
from stickslip.rigs.loop import Loop
from stickslip.rigs.rig import Limits, setpoints
settings = Settings({bus!r}, {node}, Limits(torque=1.0, speed=60.0), watchdog={watchdog!r}, watchdog_time=0.01,
                    timeout=0.05, reset_fault=True)
with Loop(Ds402(settings), path={path!r}) as loop:
    loop.run(setpoints(50, torque=0.3))
    print("moving", flush=True)
    loop.run(setpoints(20000, torque=0.3))
"""


def moving(code):
    """A process that moves the drive; begun again where a busy machine kept it from its watchdog at the start."""
    for _ in range(4):
        process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
        assert process.stdout
        if process.stdout.readline() == "moving\n":
            return process
        process.wait()
    raise AssertionError("the drive does not move")


@pytest.mark.parametrize("watchdog", ["rpdo", "heartbeat"])
def test_after_kill_9_the_drive_takes_the_torque_away_within_20_ms(drive, tmp_path, watchdog):
    """Seen in the drive's own process, by the clock that both processes share."""
    path = tmp_path / "run.stream"
    code = VICTIM.format(
        tests=str(Path(__file__).parent), bus=drive.bus, node=NODE, watchdog=watchdog, path=str(path)
    )
    for _ in range(2):
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
        process = moving(code)
        time.sleep(0.1)
        assert drive.changes(0)[-1][1] == pytest.approx(0.3, abs=1e-3)
        killed = time.monotonic_ns()
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        time.sleep(0.1)
        gone = [c for c in drive.changes(killed) if c[1] == 0.0]
        assert gone, "the torque acts on"
        assert 1e-9 * (gone[0][0] - killed) < 0.020
        record = Record.load(path)
        assert record["torque_command"][-1] == pytest.approx(0.3)
        last = float(record.time[-1])
        assert len(record) > 0
        assert last > 0.1


# ---- what is refused ------------------------------------------------------------------------------------------------


def test_from_a_file(drive, tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(
        f"""
        [rig]
        kind = "ds402"
        node = {NODE}
        bus = {{interface = "udp_multicast", channel = "{CHANNEL}", port = {drive.port}, hop_limit = 0}}
        watchdog_time = 0.2
        timeout = 0.1
        reset_fault = true
        [rig.limits]
        torque = 1.0
        speed = 60.0
        """
    )
    with Loop(read_rig(path)) as loop:
        assert len(loop.run(setpoints(10))) == 10


def test_a_procedure_from_the_command_line(drive, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("drive.toml").write_text(
        f"""
        [rig]
        kind = "ds402"
        node = {NODE}
        bus = {{interface = "udp_multicast", channel = "{CHANNEL}", port = {drive.port}, hop_limit = 0}}
        watchdog_time = 0.2
        timeout = 0.1
        [rig.limits]
        torque = 1.0
        speed = 60.0
        """
    )
    command = [
        "rig",
        "run",
        "presliding",
        "--rig",
        "drive.toml",
        "--set",
        "frequency=1",
        "--stream",
        "a.stream",
    ]
    assert main([*command, "--limit", "torque=0.5"]) == 0
    out = capsys.readouterr().out
    assert "deadlines missed" in out
    assert "ok     moved" in out
    assert Record.load("a.stream").meta["limits"]["torque"] == 0.5
    assert Record.load("presliding.npz").meta["loop"]["samples"] > 500
    assert main([*command[:-1], "b.stream", "--limit", "torque=0.1"]) == 2
    assert "allows 0.1" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("node = 0", "node = 0 must be"),
        ("node = 1.5", "whole number"),
        ('node = 1\nwatchdog = "dog"', "rpdo"),
        ("node = 1\nwatchdog_time = 0.001", "at least two sample times"),
        ("node = 1\ncolour = 1", "colour"),
    ],
)
def test_bad_files(tmp_path, change, message):
    path = tmp_path / "rig.toml"
    path.write_text(
        f'[rig]\nkind = "ds402"\nbus = {{interface = "virtual"}}\n{change}\n[rig.limits]\ntorque = 1\nspeed = 1\n'
    )
    with pytest.raises(InputError, match=message):
        read_rig(path)


def test_a_bus_that_is_not_there():
    settings = Settings({"interface": "no-such-thing"}, NODE, LIMITS)
    with pytest.raises(InputError, match="cannot be opened"):
        Ds402(settings).open()
    with pytest.raises(RigError, match="not open"):
        Ds402(settings).exchange(0.0)
