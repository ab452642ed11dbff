"""A drive with the CiA 402 profile over CANopen: cyclic synchronous torque, a SYNC every sample time.

In every sample the loop sends an RPDO (controlword 6040h, target torque 6071h) and a SYNC. At the SYNC the drive
applies the torque and latches the content of its TPDO (statusword 6041h, position 6064h, torque 6077h). The measurement
is therefore from the instant at which the torque starts to act: one sample of delay, as on any synchronous drive.

The drive has its own watchdog (CiA 301 and 402): it monitors the RPDO (its event timer, 1400h:5) or the heartbeat of
this process (1016h), and in their absence performs the action of 6007h, here "disable voltage". Both are sent by the
loop itself, so a loop that hangs is detected like one that was killed.

Another master must not interfere. Its SYNC, its commands (RPDO, NMT) and a restart of the drive are detected on the
bus; the mode of operation, which does not fit into a PDO, is read by SDO every `MODE_PERIOD`. Each ends the run, as an
emergency does. Frames with identifiers of 29 bits belong to other protocols.

Configuration uses `canopen`; during the run the bus is read in the loop's own thread, because passing frames between
threads takes longer than a sample. `pip install 'stickslip[canopen]'` brings canopen (MIT) and
python-can (LGPL).
"""

from __future__ import annotations

import contextlib
import math
import struct
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from stickslip.core.config import Table
from stickslip.core.errors import DriveFault, InputError, MessageLost, RigError
from stickslip.rigs import cia402 as cia
from stickslip.rigs.canopen_node import CanopenNode
from stickslip.rigs.files import limits_in
from stickslip.rigs.rig import Capabilities, Limits, Measurement, RigKind, Watchdog

COMMAND, ANSWER = struct.Struct("<Hh"), struct.Struct("<Hih")
WATCHDOGS = ("rpdo", "heartbeat", "none")
OWN_NODE = 127
"""Node number of this process, for its heartbeat"""
MODE_PERIOD, MODE_ANSWER = 0.02, 1.0
"""Period of reading the mode of operation, and timeout of the answer, s"""


@dataclass(frozen=True)
class Settings:
    """Settings of a drive.

    Attributes
    ----------
    bus : mapping
        Arguments of python-can's ``can.Bus``: ``interface``, ``channel``, ``bitrate``, ...
    node : int
    limits : Limits
        A finite position limit requires a homed drive.
    sample_time : float
        s
    watchdog : {"rpdo", "heartbeat", "none"}
        What the drive monitors: the cyclic torque, the heartbeat of this process, or nothing.
    watchdog_time : float
        Time after which the drive removes the torque, s; whole ms.
    reset_fault : bool
        Whether to reset a fault that the drive has when it is opened.
    timeout : float
        Timeout of the answer to a SYNC, s. The stop starts this long after a lost answer. The limit
        ``answer_time`` is at least twice as long.
    """

    bus: Mapping[str, Any]
    node: int
    limits: Limits
    sample_time: float = 1e-3
    watchdog: str = "rpdo"
    watchdog_time: float = 0.01
    reset_fault: bool = False
    timeout: float = 0.005

    def __post_init__(self) -> None:
        if not 1 <= self.node < OWN_NODE:
            raise InputError(f"ds402: node = {self.node} must be from 1 to {OWN_NODE - 1}")
        if self.watchdog not in WATCHDOGS:
            raise InputError(f"ds402: watchdog = {self.watchdog!r}; choose from {', '.join(WATCHDOGS)}")
        if self.watchdog != "none" and not 2.0 * self.sample_time <= self.watchdog_time <= 1.0:
            raise InputError(
                f"ds402: watchdog_time = {self.watchdog_time:g} s must be at least two sample times and at most 1 s"
            )


@dataclass
class Ds402:
    """A drive as a rig: see the module."""

    settings: Settings
    name: str = field(init=False)
    sample_time: float = field(init=False)
    limits: Limits = field(init=False)
    capabilities: Capabilities = field(init=False)

    def __post_init__(self) -> None:
        s = self.settings
        self.name, self.sample_time = f"ds402 node {s.node}", s.sample_time
        self.limits = replace(s.limits, answer_time=max(s.limits.answer_time, 2.0 * s.timeout))
        how = {"rpdo": "the drive misses the cyclic torque", "heartbeat": "the drive misses the heartbeat"}
        watchdog = None if s.watchdog == "none" else Watchdog(s.watchdog_time, how[s.watchdog])
        self.capabilities = Capabilities(watchdog)
        self._node = CanopenNode(self.name, s.node)
        self._beats = 0
        self._begin = 0
        self._lost = False
        self._armed = False
        self._found = ""
        self._status = 0
        self._asked = self._told = 0.0
        self._sent: Counter[tuple[int, bytes]] = Counter()
        self._echo: bool | None = None

    # ---- the rig ---------------------------------------------------------------------------------------------

    def open(self) -> Measurement:
        """Connect, check and configure the drive, and enable it with zero torque.

        Raises
        ------
        InputError
            Without `canopen`, if the bus cannot be opened, or if the drive does not support what is required.
        DriveFault, MessageLost
        """
        self._lost = False
        self._node.connect(self.settings.bus)
        self._check()
        self._configure()
        network = self._node.network
        network.send_message(0, bytes([0x80, self.settings.node]))  # pre-operational
        assert network.notifier is not None
        network.notifier.stop(1.0)  # from now on this thread reads the bus
        self._sent.clear()
        self._echo = None
        self._post(0, bytes([0x01, self.settings.node]))  # operational
        self._begin = time.monotonic_ns()
        self._found, self._status, self._node.error = "", 0, 0
        self._asked = self._told = time.monotonic()
        return self._enable()

    def exchange(self, torque: float) -> Measurement:
        """Send the torque and a SYNC, wait for the answer.

        Raises
        ------
        MessageLost
            If the drive does not answer in time.
        DriveFault
            If the drive has left "operation enabled" without a fault.
        """
        status, measured = self._cycle(cia.ENABLE, torque)
        state = cia.state_of(status)
        if state in ("fault", "fault reaction active") or self._node.error:
            return measured._replace(status=float(self._node.error or cia.UNKNOWN_FAULT))
        if gone := [text for bit, text in cia.KEPT.items() if self._status & ~status & bit]:
            raise DriveFault(
                f"{self.name}: the drive reports {gone[0]} (statusword 0x{status:04X})", measured.time
            )
        self._status = status
        if state != "operation enabled":
            raise DriveFault(
                f"{self.name}: the drive is in state {state!r} (statusword 0x{status:04X})", measured.time
            )
        return measured

    def pause(self, seconds: float) -> Measurement:
        """Send zero torque for that time at the sample rate, which keeps the drive's watchdog satisfied."""
        end = time.monotonic() + seconds
        measured = self.exchange(0.0)
        while time.monotonic() < end:
            time.sleep(self.sample_time)
            measured = self.exchange(0.0)
        return measured

    def quick_stop(self) -> None:
        """Send a quick stop (605Ah defines its kind) without waiting for an answer."""
        self._send(cia.QUICK_STOP, 0.0)

    def close(self) -> None:
        """Send zero torque, disable the drive and disconnect, even if the drive does not answer."""
        network = self._node.leave()
        if network is None:
            return
        try:
            if self._armed:
                self._armed = False
                for word in (cia.QUICK_STOP if self._lost else cia.ENABLE, cia.SHUTDOWN, cia.DISABLE):
                    network.send_message(0x200 + self.settings.node, COMMAND.pack(word, 0))
                    network.send_message(0x80, b"")
            network.send_message(0, bytes([0x80, self.settings.node]))
        except Exception as error:
            raise MessageLost(
                f"{self.name}: the bus failed while the drive was disabled ({error})"
            ) from error
        finally:
            network.disconnect()

    # ---- checking and configuring --------------------------------------------------------------------------------

    def _check(self) -> None:
        """Check the profile, cyclic torque mode, absence of faults, and homing if the position is limited."""
        self._node.network.send_message(0, bytes([0x80, self.settings.node]))
        if (kind := self._node.read(cia.DEVICE_TYPE) & 0xFFFF) != cia.PROFILE:
            raise InputError(
                f"{self.name}: its device type is profile {kind}, not CiA {cia.PROFILE}; check the node"
            )
        if not self._node.read(cia.MODES) >> (cia.CYCLIC_TORQUE - 1) & 1:
            raise InputError(f"{self.name}: the drive has no cyclic synchronous torque mode (6502h)")
        self._rated = 1e-3 * self._node.read(cia.RATED_TORQUE)  # mN·m
        increments, turns = self._node.read(cia.ENCODER, 1), self._node.read(cia.ENCODER, 2)
        if not self._rated > 0.0 or increments == 0:
            raise InputError(
                f"{self.name}: rated torque (6076h) or encoder resolution (608Fh) is 0; set them"
            )
        if self.limits.torque > 32.767 * self._rated:
            raise InputError(
                f"{self.name}: the torque limit is beyond 3276.7 % of the rated {self._rated:g} N·m"
            )
        self._count = 2.0 * math.pi * max(turns, 1) / increments
        self._reset()
        if math.isfinite(self.limits.position[0]) or math.isfinite(self.limits.position[1]):
            self._demand_homed()

    def _reset(self) -> None:
        """Reset a fault if requested; otherwise refuse the drive."""
        if cia.state_of(self._node.read(cia.STATUSWORD)) != "fault":
            return
        code = self._node.read(cia.ERROR_CODE)
        if not self.settings.reset_fault:
            raise DriveFault(
                f"{self.name}: the drive has fault 0x{code:04X}; remove its cause, or set reset_fault"
            )
        self._node.write(cia.CONTROLWORD, 0, 0, 2)
        self._node.write(cia.CONTROLWORD, 0, cia.RESET, 2)
        self._node.wait_for(
            cia.STATUSWORD, lambda word: cia.state_of(word) != "fault", f"fault 0x{code:04X} does not reset"
        )
        self._node.write(cia.CONTROLWORD, 0, 0, 2)
        self._node.error = 0

    def _demand_homed(self) -> None:
        """Refuse a drive that is not homed, by the statusword in homing mode."""
        self._node.write(cia.MODE, 0, cia.HOMING, 1)
        self._node.wait_for(cia.MODE_SHOWN, lambda mode: mode == cia.HOMING, "it does not enter homing mode")
        status = self._node.read(cia.STATUSWORD)
        if not status & cia.HOMED or status & cia.HOMING_ERROR:
            raise InputError(
                f"{self.name}: the position is limited, but the drive is not homed; home it first"
            )

    def _configure(self) -> None:
        """Configure PDOs, watchdog and mode."""
        node = self.settings.node
        self._node.map_pdo(cia.RPDO, cia.RPDO_MAP, 0x200 + node, {cia.CONTROLWORD: 16, cia.TARGET_TORQUE: 16})
        self._node.map_pdo(
            cia.TPDO, cia.TPDO_MAP, 0x180 + node, {cia.STATUSWORD: 16, cia.POSITION: 32, cia.TORQUE: 16}
        )
        milliseconds = math.ceil(1e3 * self.settings.watchdog_time - 1e-6)
        watched = self.settings.watchdog
        self._node.write(cia.ABORT_OPTION, 0, cia.DISABLE_VOLTAGE_COMMAND if watched != "none" else 0, 2)
        self._watch(cia.RPDO, 5, milliseconds, 2, watched == "rpdo")
        self._watch(cia.CONSUMER_HEARTBEAT, 1, OWN_NODE << 16 | milliseconds, 4, watched == "heartbeat")
        self._beat_every = max(1, int(0.3 * self.settings.watchdog_time / self.sample_time))
        self._node.write(cia.MODE, 0, cia.CYCLIC_TORQUE, 1)
        self._node.wait_for(
            cia.MODE_SHOWN, lambda mode: mode == cia.CYCLIC_TORQUE, "it does not enter cyclic torque mode"
        )
        self._last = cia.signed(self._node.read(cia.POSITION))
        self._turned = self._last

    def _watch(self, index: int, sub: int, value: int, size: int, wanted: bool) -> None:
        """Set a watchdog of the drive, or switch off one of an earlier session."""
        if wanted:
            self._node.write(index, sub, value, size)
            return
        with contextlib.suppress(InputError):  # the drive may lack the other one
            self._node.write(index, sub, 0, size)

    # ---- cycles --------------------------------------------------------------------------------------------------

    def _enable(self) -> Measurement:
        """Step the state machine to "operation enabled", with a SYNC every sample time."""
        end = time.monotonic() + 1.0
        word, misses = cia.DISABLE, 0
        while True:
            try:
                status, measured = self._cycle(word, 0.0)
            except MessageLost:
                # The first answers may take longer while the drive starts its PDOs.
                misses, self._lost = misses + 1, False
                if misses > 20:
                    raise
                continue
            state = cia.state_of(status)
            if state == "operation enabled":
                self._armed, self._lost = True, False
                return measured
            if state in ("fault", "fault reaction active") or self._node.error:
                code = self._node.error or cia.UNKNOWN_FAULT
                raise DriveFault(f"{self.name}: fault 0x{code:04X} while it is enabled", measured.time)
            if time.monotonic() > end:
                raise DriveFault(f"{self.name}: the drive stays in state {state!r} while it is enabled")
            word = cia.NEXT.get(state, cia.DISABLE)
            self._armed = True
            time.sleep(self.sample_time)

    def _send(self, word: int, torque: float) -> None:
        network = self._node.network
        per_mille = max(-32768, min(32767, round(1e3 * torque / self._rated)))
        self._post(0x200 + self.settings.node, COMMAND.pack(word, per_mille))
        self._post(0x80, b"")
        if (now := time.monotonic()) - self._asked > MODE_PERIOD:
            self._asked = now
            network.send_message(0x600 + self.settings.node, cia.MODE_QUESTION)
            if now - self._told > MODE_ANSWER:
                self._found = self._found or f"no answer to upload of {cia.MODE_SHOWN:04X}h"
        if self.settings.watchdog == "heartbeat":
            if self._beats % self._beat_every == 0:
                network.send_message(0x700 + OWN_NODE, b"\x05")
            self._beats += 1

    def _post(self, service: int, data: bytes) -> None:
        """Send an object that no other master may send, and recognise its echo on the bus."""
        self._node.network.send_message(service, data)
        if self._echo is not False:
            self._sent[service, data] += 1

    def _is_echo(self, service: int, data: bytes) -> bool:
        """Whether a frame is from this process; some buses return them."""
        if not self._sent.get((service, data)):
            return False
        self._echo = True
        self._sent[service, data] -= 1
        if not self._sent[service, data]:
            del self._sent[service, data]
        return True

    def _cycle(self, word: int, torque: float) -> tuple[int, Measurement]:
        """Run one sample: return statusword and measurement."""
        network = self._node.network
        bus: Any = network.bus
        try:
            # Late answers of earlier samples must not be used for this one.
            while (stale := bus.recv(0)) is not None:
                self._heed(stale)
            self._send(word, torque)
            sent = time.monotonic_ns()
            # After a missed answer the loop is stopping: its ramp does not wait any more.
            patience = 0.5 * self.sample_time if self._lost else self.settings.timeout
            end = sent + int(1e9 * patience)
            answer = None
            while answer is None and not self._found:
                left = end - time.monotonic_ns()
                message = bus.recv(1e-9 * left) if left > 0 else None
                if message is None:
                    break
                answer = self._heed(message)
        except RigError:
            raise
        except Exception as error:  # python-can's drivers raise their own errors
            self._lost = True
            raise MessageLost(f"{self.name}: the bus failed ({error})") from error
        if self._found:
            self._lost = True
            raise DriveFault(f"{self.name}: {self._found}", 1e-9 * (sent - self._begin))
        if answer is None:
            self._lost = True
            raise MessageLost(
                f"{self.name}: no answer within {1e3 * self.settings.timeout:g} ms",
                1e-9 * (sent - self._begin),
            )
        status, position, per_mille = ANSWER.unpack(answer)
        self._turned += cia.signed((position - self._last) & 0xFFFFFFFF)
        self._last = position
        return status, Measurement(
            1e-9 * (sent - self._begin), self._count * self._turned, 1e-3 * per_mille * self._rated
        )

    def _heed(self, message: Any) -> bytes | None:
        """Process a frame; return its data if it is the TPDO. A reason to end the run is stored in `_found`."""
        if message.is_error_frame:
            if message.arbitration_id & cia.BUS_OFF:
                self._found = self._found or "the bus is off"
            return None
        if message.is_extended_id or message.is_remote_frame or not message.is_rx:
            return None
        if self._is_echo(message.arbitration_id, bytes(message.data)):
            return None
        service, data, node = message.arbitration_id, bytes(message.data), self.settings.node
        if service == 0x180 + node:
            if len(data) == ANSWER.size:
                if self._echo is None:  # an echo of the SYNC that it answers would have been first
                    self._echo = False
                    self._sent.clear()
                return data
            found = f"its TPDO has {len(data)} bytes instead of {ANSWER.size}: another master has changed its mapping"
        elif service == 0x80 + node and len(data) >= 2:
            self._node.on_emergency(0, bytearray(data), 0.0)
            return None
        elif service == 0x580 + node:
            found = self._mode_of(data)
        else:
            found = cia.interference(service, data, node)
        self._found = self._found or found
        return None

    def _mode_of(self, data: bytes) -> str:
        """Return the fault in the drive's answer about its mode of operation; empty if there is none."""
        if len(data) < 5 or data[1:4] != cia.MODE_QUESTION[1:4]:
            return ""
        if data[0] == cia.ABORT:
            return f"the drive refuses upload of {cia.MODE_SHOWN:04X}h (abort code 0x{data[4:].hex()})"
        self._told = time.monotonic()
        mode = int.from_bytes(data[4:5], "little", signed=True)
        if mode == cia.CYCLIC_TORQUE:
            return ""
        return (
            f"the mode of operation is {mode} instead of {cia.CYCLIC_TORQUE} (cyclic torque): another master has "
            "changed it"
        )


def whole(value: Any) -> Any:
    """Return integers as int, which python-can requires for ports and bit rates."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


# ---- from a file ----------------------------------------------------------------------------------------------


def build(table: Table) -> Ds402:
    """Build a drive from ``bus``, ``node``, ``limits`` and the optional fields of `Settings`."""
    node = table.number("node", "")
    if not node.is_integer():
        raise table.error("node", "must be a whole number")
    bus = {k: whole(v) for k, v in table.table("bus").rest().items()}
    return Ds402(
        Settings(
            bus=bus,
            node=int(node),
            limits=limits_in(table),
            sample_time=table.positive("sample_time", "s", 1e-3),
            watchdog=table.choice("watchdog", WATCHDOGS, "rpdo"),
            watchdog_time=table.positive("watchdog_time", "s", 0.01),
            reset_fault=table.flag("reset_fault", False),
            timeout=table.positive("timeout", "s", 0.005),
        )
    )


RIG = RigKind("ds402", build, "a CiA 402 drive over CANopen, cyclic synchronous torque")
