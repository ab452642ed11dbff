"""Objects and state machine of a drive: CiA 301 and CiA 402 (IEC 61800-7-201)."""

from __future__ import annotations

# ---- objects ----------------------------------------------------------------------------------------------------
DEVICE_TYPE, CONSUMER_HEARTBEAT = 0x1000, 0x1016
RPDO, RPDO_MAP, TPDO, TPDO_MAP = 0x1400, 0x1600, 0x1800, 0x1A00
ABORT_OPTION, ERROR_CODE = 0x6007, 0x603F
CONTROLWORD, STATUSWORD, MODE, MODE_SHOWN, MODES = 0x6040, 0x6041, 0x6060, 0x6061, 0x6502
POSITION, TARGET_TORQUE, RATED_TORQUE, TORQUE, ENCODER = 0x6064, 0x6071, 0x6076, 0x6077, 0x608F
PROFILE = 402
HOMING, CYCLIC_TORQUE = 6, 10  # modes of operation
DISABLE_VOLTAGE_COMMAND = 2  # of the abort option code
SYNCHRONOUS = 1  # transmission type: at every SYNC
OFF = 1 << 31  # of a PDO's COB-ID: it does not exist

# ---- the state machine of CiA 402 -------------------------------------------------------------------------------
SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP, DISABLE, RESET = 0x06, 0x07, 0x0F, 0x02, 0x00, 0x80
STATES = {
    "switch on disabled": (0x4F, 0x40),
    "ready to switch on": (0x6F, 0x21),
    "switched on": (0x6F, 0x23),
    "operation enabled": (0x6F, 0x27),
    "quick stop active": (0x6F, 0x07),
    "fault reaction active": (0x4F, 0x0F),
    "fault": (0x4F, 0x08),
    "not ready to switch on": (0x4F, 0x00),
}
"""State: mask and value of the statusword"""
NEXT = {
    "switch on disabled": SHUTDOWN,
    "ready to switch on": SWITCH_ON,
    "switched on": ENABLE,
    "quick stop active": DISABLE,
}
"""The controlword that leads from a state towards operation enabled"""
HOMED, HOMING_ERROR = 1 << 12, 1 << 13  # of the statusword in homing mode
UNKNOWN_FAULT = 0xFFFF
"""Code of a fault that the drive does not specify"""
KEPT = {
    1 << 4: "that its voltage is off",
    1 << 9: "that it is no longer remote: it ignores the controlword",
    1 << 12: "that it no longer follows the target torque",
}
"""Bits of the statusword that a drive may never set, but must not clear"""

# ---- what is heard on the bus -----------------------------------------------------------------------------------
MODE_QUESTION = bytes([0x40, MODE_SHOWN & 0xFF, MODE_SHOWN >> 8, 0, 0, 0, 0, 0])
"""SDO: upload of the mode of operation"""
ABORT = 0x80  # of SDO
BUS_OFF = 0x40  # of an error frame, as SocketCAN numbers them
OPERATIONAL = 5
DOWNLOADS = (1, 6)
"""SDO commands that start to write an object, in one piece or in blocks"""
NMT = {0x02: "stop", 0x80: "enter pre-operational", 0x81: "reset node", 0x82: "reset communication"}
"""NMT commands after which a node exchanges no PDOs"""


def interference(service: int, data: bytes, node: int) -> str:
    """Return how a frame of another node interferes with this run, by its 11-bit identifier; empty if it does not."""
    if service == 0x80:
        return "another device sends SYNC on this bus: two masters cannot share it"
    if service == 0x200 + node:
        return f"another master commands this drive (RPDO {service:03X}h)"
    if service == 0x600 + node and len(data) == 8 and data[0] >> 5 in DOWNLOADS:
        index = int.from_bytes(data[1:3], "little")
        return f"another master writes object {index:04X}h:{data[3]} of this drive (SDO)"
    if service == 0 and len(data) == 2 and data[1] in (0, node) and data[0] in NMT:
        return f"another master has sent the NMT command {NMT[data[0]]!r}"
    if service == 0x700 + node and len(data) == 1:
        if data[0] == 0:
            return "the drive has restarted (boot-up message)"
        if data[0] & 0x7F != OPERATIONAL:
            return f"the drive is no longer operational (NMT state {data[0] & 0x7F} in its heartbeat)"
    return ""


def state_of(status: int) -> str:
    """Return the state from a statusword."""
    return next((name for name, (mask, value) in STATES.items() if status & mask == value), f"0x{status:04X}")


def signed(value: int) -> int:
    """Return 32 bits as a signed number."""
    return (value ^ 0x80000000) - 0x80000000
