"""A CiA 402 drive with an axis on it, in a process of its own: what the rig `ds402` is tested against.

CANopen itself (SDO, PDO, NMT, EMCY, the object dictionary) is `durand`, an independent responder; here are the
drive's state machine, its watchdogs (RPDO event timer 1400h:5, heartbeat consumer 1016h, abort option 6007h), its
torque and the axis. Everything runs in one thread, and the axis moves in real time, whether anybody speaks to the
drive or not.

Objects of the maker: 2000h says which fault to make at which SYNC, 2001h whether the drive is homed. Every change of
the torque is written to a file, with the time of the system's monotonic clock: what a process that was killed can no
longer say.
"""

from __future__ import annotations

import contextlib
import math
import os
import struct
import sys
import time
from collections.abc import Callable

import can
from axis_rig import AxisRig
from durand import MinimalNode, Variable
from durand.datatypes import DatatypeEnum as DT
from durand.network import NetworkABC
from durand.object_dictionary import Array, Record
from durand.scheduler import VirtualScheduler, set_scheduler
from durand.services.nmt import StateEnum

RATED = 1320  # mN·m
COUNTS = 1_000_000
LOG = struct.Struct("<qdqd")  # ns, torque N·m, SYNC, state
STATUS = {"switch on disabled": 0x250, "ready": 0x231, "switched on": 0x233, "enabled": 0x237,
          "quick stop": 0x217, "fault": 0x218}  # fmt: skip
# Faults of 2000h:1.
NO_FAULT, DROP_ANSWERS, LATE_ANSWERS, TRIP, SAFE_TORQUE_OFF, DROP_COMMANDS = range(6)


class Bus(NetworkABC):
    """durand's network on a python-can bus, read when asked."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus
        self.heard: dict[int, Callable[[int, bytes], None]] = {}
        self.outgoing: Callable[[int, bytes], bool] = lambda cob_id, msg: True

    def add_subscription(self, cob_id: int, callback: Callable[[int, bytes], None]) -> None:
        self.heard[cob_id] = callback

    def remove_subscription(self, cob_id: int) -> None:
        self.heard.pop(cob_id, None)

    def send(self, cob_id: int, msg: bytes) -> None:
        if self.outgoing(cob_id, msg):
            self.put(cob_id, msg)

    def put(self, cob_id: int, msg: bytes) -> None:
        self.bus.send(can.Message(arbitration_id=cob_id, data=msg, is_extended_id=False))


class Drive:
    def __init__(self, bus: can.BusABC, node_id: int, log: int) -> None:
        self.log = log
        self.scheduler = VirtualScheduler()
        set_scheduler(self.scheduler)
        self.network = Bus(bus)
        self.network.outgoing = self.sends
        self.node_id = node_id
        self.node = MinimalNode(self.network, node_id)
        self.od = self.node.object_dictionary
        self.describe()
        self.axis = AxisRig()
        self.position = self.axis.open().position
        self.state, self.torque, self.syncs, self.error = "switch on disabled", 0.0, 0, 0
        self.word = 0
        self.moved = time.monotonic()
        self.command_at = self.beat_at = None
        self.late: list[tuple[float, int, bytes]] = []
        self.node.sync.callbacks.add(self.on_sync)
        self.node.nmt.state_callbacks.add(self.on_nmt)
        self.network.add_subscription(0x700 + 127, self.on_heartbeat)
        self.show()

    def describe(self) -> None:
        """The objects of CiA 402 that the rig asks for."""
        od = self.od
        od.write(0x1000, 0, 0x00020192)
        od[0x1400][5] = Variable(DT.UNSIGNED16, "rw", 0, name="Event timer")
        od[0x1016] = Array(Variable(DT.UNSIGNED32, "rw", 0, name="Consumer heartbeat time"), 1)
        for index, kind, access, value, name in (
            (0x6007, DT.INTEGER16, "rw", 1, "Abort connection option code"),
            (0x603F, DT.UNSIGNED16, "ro", 0, "Error code"),
            (0x6040, DT.UNSIGNED16, "rw", 0, "Controlword"),
            (0x6041, DT.UNSIGNED16, "ro", 0, "Statusword"),
            (0x6060, DT.INTEGER8, "rw", 0, "Modes of operation"),
            (0x6061, DT.INTEGER8, "ro", 0, "Modes of operation display"),
            (0x6064, DT.INTEGER32, "ro", 0, "Position actual value"),
            (0x6071, DT.INTEGER16, "rw", 0, "Target torque"),
            (0x6076, DT.UNSIGNED32, "ro", RATED, "Motor rated torque"),
            (0x6077, DT.INTEGER16, "ro", 0, "Torque actual value"),
            (0x6502, DT.UNSIGNED32, "ro", 1 << 9 | 1 << 5, "Supported drive modes"),
            (0x2001, DT.UNSIGNED8, "rw", 1, "Homed"),
        ):
            od[index] = Variable(kind, access, value, name=name)
        resolution = Record(name="Position encoder resolution")
        resolution[1] = Variable(DT.UNSIGNED32, "ro", COUNTS, name="Increments")
        resolution[2] = Variable(DT.UNSIGNED32, "ro", 1, name="Motor revolutions")
        od[0x608F] = resolution
        fault = Record(name="Fault to make")
        fault[1] = Variable(DT.UNSIGNED16, "rw", 0, name="Kind")
        fault[2] = Variable(DT.UNSIGNED32, "rw", 0, name="At SYNC")
        fault[3] = Variable(DT.UNSIGNED32, "rw", 0, name="Value")
        od[0x2000] = fault
        od.update_callbacks[(0x6040, 0)].add(self.on_controlword)
        od.update_callbacks[(0x6060, 0)].add(self.on_mode)

    # ---- the state machine --------------------------------------------------------------------------------

    def show(self) -> None:
        status = STATUS[self.state]
        if self.od.read(0x6061, 0) == 6 and self.od.read(0x2001, 0):
            status |= 1 << 12
        self.od.write(0x6041, 0, status)

    def on_mode(self, mode: int) -> None:
        self.od.write(0x6061, 0, mode)
        self.show()

    def on_controlword(self, word: int) -> None:
        before, self.word = self.word, word
        if self.state == "fault":
            if word & 0x80 and not before & 0x80:
                self.error = 0
                self.od.write(0x603F, 0, 0)
                self.go("switch on disabled")
            return
        if not word & 0x02:
            self.go("switch on disabled")
        elif not word & 0x04:
            if self.state == "enabled":
                self.go("quick stop")
        elif self.state != "quick stop":
            command = word & 0x0F
            steps = {("switch on disabled", 0x06): "ready", ("ready", 0x07): "switched on",
                     ("switched on", 0x0F): "enabled", ("ready", 0x0F): "enabled", ("enabled", 0x07): "switched on",
                     ("enabled", 0x06): "ready", ("switched on", 0x06): "ready"}  # fmt: skip
            self.go(steps.get((self.state, command), self.state))

    def go(self, state: str) -> None:
        if state != self.state:
            self.state = state
            self.apply()
        self.show()

    def trip(self, code: int) -> None:
        self.error = code
        self.od.write(0x603F, 0, code)
        self.go("fault")
        self.node.emcy.set(code, 0x01)

    def apply(self) -> None:
        """The torque that acts from now on."""
        self.move()
        enabled = self.state == "enabled" and self.od.read(0x6061, 0) == 10
        torque = 1e-6 * self.od.read(0x6071, 0) * RATED if enabled else 0.0
        if torque != self.torque:
            self.torque = torque
            os.write(
                self.log, LOG.pack(time.monotonic_ns(), torque, self.syncs, list(STATUS).index(self.state))
            )

    def move(self) -> None:
        """The axis, up to now, in whole samples: one a SYNC, and as many as pass where none comes."""
        now = time.monotonic()
        for _ in range(round((now - self.moved) / self.axis.sample_time)):
            self.position = self.axis.exchange(self.torque).position
            self.moved = now

    # ---- messages ------------------------------------------------------------------------------------------

    def on_nmt(self, state: StateEnum) -> None:
        self.command_at = self.beat_at = None
        if state == StateEnum.OPERATIONAL:
            self.syncs = 0
        elif self.state not in ("fault",):
            self.go("switch on disabled")

    def on_heartbeat(self, _: int, __: bytes) -> None:
        self.beat_at = time.monotonic()

    def on_sync(self) -> None:
        self.syncs += 1
        kind, at, value = (self.od.read(0x2000, i) for i in (1, 2, 3))
        if kind and self.syncs == at:
            if kind == TRIP:
                self.trip(value)
            elif kind == SAFE_TORQUE_OFF:
                self.go("switch on disabled")
        self.move()
        position = round(self.position / (2.0 * math.pi) * COUNTS)
        self.od.write(0x6064, 0, (position + 2**31) % 2**32 - 2**31)
        self.od.write(0x6077, 0, round(1e6 * self.torque / RATED))
        self.show()

    def fault_now(self, kind: int) -> int:
        """The value of the fault, while it lasts."""
        wanted, at, value = (self.od.read(0x2000, i) for i in (1, 2, 3))
        return value if wanted == kind and self.syncs >= at > 0 else 0

    def sends(self, cob_id: int, msg: bytes) -> bool:
        """Whether a frame leaves now."""
        if cob_id != 0x180 + self.node_id:
            return True
        if (count := self.fault_now(DROP_ANSWERS)) and self.syncs < self.od.read(0x2000, 2) + count:
            return False
        if (delay := self.fault_now(LATE_ANSWERS)) and self.syncs == self.od.read(0x2000, 2):
            self.late.append((time.monotonic() + 1e-3 * delay, cob_id, bytes(msg)))
            return False
        return True

    def hear(self, message: can.Message) -> None:
        callback = self.network.heard.get(message.arbitration_id)
        if callback is None or message.is_error_frame or message.is_remote_frame:
            return
        if message.arbitration_id == 0x200 + self.node_id:
            count = self.fault_now(DROP_COMMANDS)
            if count and self.syncs < self.od.read(0x2000, 2) + count:
                return
            self.command_at = time.monotonic()
        callback(message.arbitration_id, message.data)
        if message.arbitration_id == 0x80:
            self.apply()

    def watch(self) -> None:
        """The watchdogs of CiA 301, and what 6007h makes of them."""
        now = time.monotonic()
        timer = self.od.read(0x1400, 5)
        beat = self.od.read(0x1016, 1) & 0xFFFF
        lost = (timer and self.command_at and now - self.command_at > 1e-3 * timer) or (
            beat and self.beat_at and now - self.beat_at > 1e-3 * beat
        )
        if not lost or self.state not in ("enabled", "quick stop", "switched on"):
            return
        self.command_at = self.beat_at = None
        option = self.od.read(0x6007, 0)
        if option == 1:
            self.trip(0x8130)
        elif option == 2:
            self.go("switch on disabled")
        elif option == 3:
            self.go("quick stop")

    def run(self, until: Callable[[], bool]) -> None:
        tick = time.monotonic()
        while not until():
            message = self.network.bus.recv(max(0.0, tick - time.monotonic()))
            # What has arrived is heard before anything is called missing.
            while message is not None:
                self.hear(message)
                message = self.network.bus.recv(0)
            now = time.monotonic()
            for entry in [e for e in self.late if e[0] <= now]:
                self.late.remove(entry)
                self.network.put(*entry[1:])
            if now >= tick:
                self.move()
                self.watch()
                tick = now + 1e-3


def main(channel: str, port: str, node: str, log: str) -> None:
    with contextlib.suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(40))
    bus = can.Bus(interface="udp_multicast", channel=channel, port=int(port), hop_limit=0)
    file = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    drive = Drive(bus, int(node), file)
    drive.axis.exchange(0.0)  # compiles, which must not keep the drive from its bus later
    drive.moved = time.monotonic()
    parent = os.getppid()
    print("ready", flush=True)
    drive.run(lambda: os.getppid() != parent)


if __name__ == "__main__":
    main(*sys.argv[1:])
