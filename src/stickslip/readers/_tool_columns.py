"""Interpret columns of known tools whose meaning differs from their names: VESC Tool, UR's RTDE, LeRobot, ODrive,
moteus, SINAMICS."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np

from stickslip.core.finding import Finding
from stickslip.core.messages import name_columns, name_option
from stickslip.readers.table_columns import Column, Table


@dataclass(frozen=True)
class Tool:
    """A tool that writes logs.

    Attributes
    ----------
    name : str
    has : tuple of str
        Regular expressions; a table is this tool's if each of them matches a column.
    columns : tuple of (str, str, str)
        Regular expression of a name, channel ("none": not a channel of an axis; "": the one that the name indicates)
        and unit; the first match applies.
    notes : tuple of (str, str, str)
        Regular expression of a name, and the message and remedy to report if a column matches.
    run : str
        The column whose value changes at the start of another record.
    """

    name: str
    has: tuple[str, ...]
    columns: tuple[tuple[str, str, str], ...]
    notes: tuple[tuple[str, str, str], ...] = ()
    run: str = ""


JOINT = r"[_\[]?\d\]?"
"""Number of a joint at the end of a name."""
GROUP, INDEXED = r"(?:.*[.:/])?", r"(?:\[\d+\])?"
"""Text that may be before and after a signal's name."""
TOOLS = (
    Tool(
        "VESC Tool",
        ("ms_today", "erpm"),
        (
            ("ms_today", "time", "ms"),
            ("erpm", "velocity", "erpm"),
            ("q_axis_current", "current", "A"),
            ("encoder_position", "position", "deg"),  # 0 throughout without an encoder
            ("input_voltage", "supply", "V"),
            ("temp_motor", "temperature", "degC"),
            (".*", "none", ""),
        ),
        (
            (
                "current_motor",
                "current_motor is positive when the motor drives and negative when it brakes, in either direction: "
                "it is not used; q_axis_current has the sign of the torque",
                "",
            ),
        ),
    ),
    Tool(
        "Universal Robots RTDE",
        (f"actual_(q|qd|current){JOINT}", f"(actual|target)_(q|qd|qdd|current|moment){JOINT}"),
        (
            ("timestamp", "time", "s"),
            (f"actual_q{JOINT}", "position", "rad"),
            (f"actual_qd{JOINT}", "velocity", "rad/s"),
            (f"actual_current_as_torque{JOINT}", "motor_torque", "Nm"),
            (f"actual_current{JOINT}", "current", "A"),
            (f"target_q{JOINT}", "position_reference", "rad"),
            (f"target_qd{JOINT}", "velocity_reference", "rad/s"),
            (f"target_current{JOINT}", "current_reference", "A"),
            (f"joint_temperatures{JOINT}", "temperature", "degC"),
            (
                "(actual|target|joint|tool|speed|payload|tcp|ft|output|input|robot|safety|runtime|io)_.*",
                "none",
                "",
            ),
            ("(TCP|elbow|standard|configurable|euromap|momentum).*", "none", ""),
        ),
        (
            (
                f"target_moment{JOINT}",
                "target_moment is the torque that the controller's model predicts, not a measured one: it is not used",
                f"use actual_current_as_torque (PolyScope 5.23 and later), or actual_current with "
                f"{name_option('torque_constant', 'NM_PER_A')} of the joint (the motor's torque constant x gear ratio)",
            ),
        ),
    ),
    Tool(
        "LeRobot",
        (r"observation\.state.*", "action.*|episode_index|frame_index"),
        (("timestamp", "time", "s"), (".*", "none", "")),
        (
            (
                r"observation\.state.*",
                "a dataset states no units (degrees, radians or percent of a joint's range, by robot and "
                "calibration), and an action may be a position, a velocity or a difference: none of them is taken as a "
                "channel",
                f"map one joint with its units, such as {name_columns(position='observation.state[0]:deg')}; "
                "for friction the "
                f"dataset needs a torque or a current too, such as {name_columns(torque='observation.effort[0]:Nm')}",
            ),
        ),
        "episode_index",
    ),
    Tool(
        "ODrive",
        (rf"{GROUP}(pos|vel)_estimate",),
        (
            (rf"{GROUP}(pos_estimate|pos_setpoint|input_pos)", "", "rev"),
            (rf"{GROUP}(vel_estimate|vel_setpoint|input_vel)", "", "rev/s"),
        ),
        (
            (
                rf"{GROUP}(pos|vel)_estimate",
                "positions are in revolutions and velocities in revolutions per second, as since firmware 0.5",
                "if older firmware wrote the file, map them in counts and counts/s, with "
                f"{name_option('counts_per_rev', 'N')}",
            ),
        ),
    ),
    Tool(
        "moteus",
        (rf"{GROUP}servo_stats\.(position|velocity)",),
        (
            (rf"{GROUP}servo_stats\.position", "position", "rev"),
            (rf"{GROUP}servo_stats\.velocity", "velocity", "rev/s"),
            (rf"{GROUP}servo_stats\.torque_Nm", "motor_torque", "Nm"),
            (rf"{GROUP}servo_stats\.q_A", "current", "A"),
        ),
    ),
    Tool(
        "SINAMICS",
        (rf"{GROUP}r0*(6[1-3]|80){INDEXED}",),
        (
            (rf"{GROUP}r0*6[1-3]{INDEXED}", "", "rpm"),
            (rf"{GROUP}r0*(79|80){INDEXED}", "", "Nm"),
            (rf"{GROUP}r0*7[78]{INDEXED}", "", "A"),
        ),
        (
            (
                rf"{GROUP}r0*6[1-3]{INDEXED}",
                "speeds are in rpm and torques in N·m, as of a rotary motor",
                "map the columns of a linear motor with their units, m/min and N",
            ),
        ),
    ),
)


def with_tool(table: Table) -> Table:
    """Return the table with the channels and units that its tool defines; unchanged if no known tool wrote it."""
    names = [column.name for column in table.columns]
    tool = next((t for t in TOOLS if all(_first(pattern, names) for pattern in t.has)), None)
    if tool is None:
        return table
    columns = tuple(_defined(column, tool) for column in table.columns)
    notes = [
        Finding("note", "tool", f"{tool.name}: {message}", remedy=remedy)
        for pattern, message, remedy in tool.notes
        if _first(pattern, names)
    ]
    runs = table.runs
    number = next((c.values for c in table.columns if c.name == tool.run), None)
    if number is not None and not runs:
        starts = np.flatnonzero(np.diff(number) != 0.0) + 2
        runs = (1, *starts.tolist()) if starts.size else ()
    return replace(table, columns=columns, findings=(*table.findings, *notes), runs=runs)


def _first(pattern: str, names: list[str]) -> str:
    return next((name for name in names if re.fullmatch(pattern, name)), "")


def _defined(column: Column, tool: Tool) -> Column:
    if column.channel:
        return column
    found = next(((c, u) for pattern, c, u in tool.columns if re.fullmatch(pattern, column.name)), ("", ""))
    channel, unit = found
    if column.name == "encoder_position" and not np.any(column.values):
        channel = "none"
    return replace(column, channel=channel, unit=column.unit or unit)
