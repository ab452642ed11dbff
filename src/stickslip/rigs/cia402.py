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
"""Where a drive shows a fault and has not said which"""


def state_of(status: int) -> str:
    """The state that a statusword tells."""
    return next((name for name, (mask, value) in STATES.items() if status & mask == value), f"0x{status:04X}")


def signed(value: int) -> int:
    """32 bits as a signed number."""
    return (value ^ 0x80000000) - 0x80000000
