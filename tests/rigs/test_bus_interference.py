"""What other devices on the bus, and the drive itself, send during a run: each ends it with its cause and no torque."""

from __future__ import annotations

import time

import pytest

can = pytest.importorskip("can")

from test_ds402 import NODE, drive  # noqa: E402, F401

from stickslip.core.errors import DriveFault, InputError, RigError  # noqa: E402
from stickslip.core.record import Record  # noqa: E402
from stickslip.rigs import cia402  # noqa: E402
from stickslip.rigs.ds402 import Ds402  # noqa: E402
from stickslip.rigs.loop import Loop  # noqa: E402
from stickslip.rigs.rig import Measurement, setpoints  # noqa: E402

pytestmark = pytest.mark.flaky(reruns=2)
SET_MODE = bytes([0x2F, 0x60, 0x60, 0, 1, 0, 0, 0])
"""SDO: mode of operation 1, profile position"""


class Disturbed(Ds402):
    """The drive; another device sends frames at the 60th sample."""

    def __init__(self, settings, frames) -> None:
        super().__init__(settings)
        self._frames, self.calls = frames, 0
        self.torques: list[float] = []

    def exchange(self, torque: float) -> Measurement:
        self.calls += 1
        self.torques.append(torque)
        if self.calls == 60:
            with can.Bus(**self.settings.bus) as other:
                for number, data, extended in self._frames:
                    other.send(can.Message(arbitration_id=number, data=data, is_extended_id=extended))
        return super().exchange(torque)


INTERFERENCE = {
    "emergency": ([(0x80 + NODE, b"\x10\x81\x11\0\0\0\0\0", False)], "reports fault 0x8110"),
    "emergency that passes": (
        [(0x80 + NODE, b"\x20\x81" + bytes(6), False), (0x80 + NODE, bytes(8), False)], "reports fault 0x8120",
    ),
    "boot-up": ([(0x700 + NODE, b"\0", False)], "has restarted"),
    "heartbeat of a stopped node": ([(0x700 + NODE, b"\x04", False)], "NMT state 4"),
    "NMT stop": ([(0, bytes([2, NODE]), False)], "NMT command 'stop'"),
    "NMT reset of all": ([(0, bytes([0x81, 0]), False)], "NMT command 'reset node'"),
    "commands": ([(0x200 + NODE, bytes([0x0F, 0, 100, 0]), False)], "another master commands this drive"),
    "SYNC": ([(0x80, b"", False)], "another device sends SYNC"),
    "shorter TPDO": ([(0x180 + NODE, bytes(6), False)], "TPDO has 6 bytes"),
    "mode": ([(0x600 + NODE, SET_MODE, False)], "another master writes object 6060h:0 "),
    "watchdog": (
        [(0x600 + NODE, bytes([0x2B, 0, 0x14, 5, 0, 0, 0, 0]), False)], "another master writes object 1400h:5 ",
    ),
    "SDO abort": (
        [(0x580 + NODE, bytes([0x80, 0x61, 0x60, 0, 0, 0, 4, 8]), False)], "refuses upload of 6061h",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", INTERFERENCE)
def test_interference_ends_the_run(drive, name, tmp_path):  # noqa: F811
    frames, cause = INTERFERENCE[name]
    rig = Disturbed(drive.settings(), frames)
    begin = time.monotonic_ns()
    with pytest.raises(DriveFault, match=cause), Loop(rig, path=tmp_path / "run.stream") as loop:
        loop.run(setpoints(3000, torque=0.2))
    assert len(rig.torques) < 1000
    assert rig.torques[-1] == 0.0
    assert drive.changes(begin)[-1][1] == 0.0
    assert cause in Record.load(tmp_path / "run.stream").meta["ended"]
    drive.tell((0x6060, 0, "<b", 10))


def test_a_mode_that_the_drive_leaves_by_itself(drive, monkeypatch):  # noqa: F811
    """Nobody is seen to write it: an input or another interface of the drive."""
    monkeypatch.setattr(cia402, "interference", lambda *_: "")
    rig = Disturbed(drive.settings(), [(0x600 + NODE, SET_MODE, False)])
    with pytest.raises(DriveFault, match="mode of operation is 1 instead of 10"), Loop(rig) as loop:
        loop.run(setpoints(3000, torque=0.2))
    assert rig.torques[-1] == 0.0
    drive.tell((0x6060, 0, "<b", 10))


@pytest.mark.parametrize(
    ("bit", "cause"),
    [(4, "voltage is off"), (9, "no longer remote"), (12, "no longer follows the target torque")],
)
def test_a_bit_of_the_statusword_that_is_lost(drive, bit, cause):  # noqa: F811
    class Losing(Ds402):
        calls = 0

        def _cycle(self, word: int, torque: float) -> tuple[int, Measurement]:
            self.calls += 1
            status, measured = super()._cycle(word, torque)
            return (status | 1 << bit if self.calls < 60 else status & ~(1 << bit)), measured

    begin = time.monotonic_ns()
    with pytest.raises(DriveFault, match=cause), Loop(Losing(drive.settings())) as loop:
        loop.run(setpoints(3000, torque=0.2))
    assert drive.changes(begin)[-1][1] == 0.0


def test_frames_of_29_bits_are_not_the_drives(drive):  # noqa: F811
    """Their lower bits are the identifiers of its PDO, emergency, boot-up and SDO, and SYNC's."""
    numbers = (0x180 + NODE, 0x80 + NODE, 0x700 + NODE, 0x580 + NODE, 0x80, 0x200 + NODE)
    rig = Disturbed(drive.settings(), [(n, bytes(8), True) for n in numbers])
    with Loop(rig) as loop:
        rows = loop.run(setpoints(200, torque=0.1))
    assert len(rows) == 200
    assert len(set(rows[:, 0])) == 200


def test_frames_of_others_are_left_alone(drive):  # noqa: F811
    """Another node's PDO, emergency, boot-up and the NMT start of all."""
    frames = [
        (0x180 + 9, bytes(8), False),
        (0x80 + 9, bytes(8), False),
        (0x700 + 9, b"\0", False),
        (0, b"\1\0", False),
    ]
    with Loop(Disturbed(drive.settings(), frames)) as loop:
        assert len(loop.run(setpoints(200, torque=0.1))) == 200


def test_a_drive_that_refuses_its_configuration(drive):  # noqa: F811
    """An SDO abort names the object."""

    class Refused(Ds402):
        def _configure(self) -> None:
            self._node.write(0x5FFF, 0, 1, 2)

    with pytest.raises(InputError, match="refuses download of 5FFF"), Loop(Refused(drive.settings())):
        pass


def both(first: Ds402, second: Ds402) -> None:
    with Loop(first) as loop:
        loop.run(setpoints(50, torque=0.1))
        with Loop(second):
            loop.run(setpoints(50, torque=0.1))


def test_two_rigs_cannot_share_a_bus(drive):  # noqa: F811
    """The second one's SYNC makes the first drive act and measure between its samples."""
    with pytest.raises(RigError, match=r"SYNC|commands this drive|NMT command"):
        both(Ds402(drive.settings()), Ds402(drive.settings()))
    assert drive.changes(0)[-1][1] == 0.0
