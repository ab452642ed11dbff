"""The channels of a record over time, as a Matplotlib figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stickslip.core.record import Record
from stickslip.report import plots
from stickslip.report.plots import Curve, Panel
from stickslip.report.styles import REFERENCE, Style

USUAL = (
    "position_reference", "position", "motor_position", "load_position", "velocity_reference", "velocity",
    "motor_torque", "friction_torque",
)  # fmt: skip
"""Channels that are drawn if none are named."""
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
QUANTITIES = {
    "rad": "position", "m": "position", "rad/s": "velocity", "m/s": "velocity", "N·m": "torque", "N": "force",
    "A": "current", "V": "voltage", "°C": "temperature",
}  # fmt: skip
"""What a unit stands for, on an axis of the figure."""
HEIGHT = 1.35
"""Of a panel, inches."""


def record_figure(record: Record, channels: Sequence[str] = ()) -> Any:
    """Return channels over time, one panel a unit, and the position error below the positions.

    Parameters
    ----------
    record : Record
    channels : sequence of str
        None: the usual ones that the record has, or all.

    Raises
    ------
    InputError
        If the record has no such channel.
    """
    named = channels or [n for n in USUAL if n in record.channels] or list(record.channels)
    values = {name: record[name] for name in named}
    panels: list[Panel] = []
    for unit in dict.fromkeys(record.units[name] for name in named):
        panels.append(_panel(record, {n: values[n] for n in named if record.units[n] == unit}, unit))
        if (
            not channels
            and {"position_reference", "position"} <= record.channels.keys()
            and unit in ("rad", "m")
        ):
            error = record["position_reference"] - record["position"]
            panels.append(_panel(record, {"error": error}, unit))
    what = str(record.meta.get("what", "")) or "record"
    span = (
        f"{record.time[0]:.4g} to {record.time[-1]:.4g} s, {len(record)} rows" if len(record) else "no rows"
    )
    with plots.house_style():
        return plots.figure_of(what.capitalize(), span, panels, HEIGHT)


def _panel(record: Record, values: dict[str, plots.Array], unit: str) -> Panel:
    """One unit's channels over time."""
    largest = max((float(np.nanmax(np.abs(x))) for x in values.values() if np.isfinite(x).any()), default=1.0)
    factor, prefixed = plots.scaled(largest, unit)
    colours = iter(COLOURS)
    curves: list[Curve] = []
    for name, x in values.items():
        style = REFERENCE if name.endswith("_reference") else Style(next(colours, COLOURS[-1]))
        curves.append(Curve(*plots.envelope(record.time, factor * x), name.replace("_", " "), style))
    title = "error" if list(values) == ["error"] else QUANTITIES.get(unit, "value")
    return Panel(curves, f"{title} ({prefixed})", "time (s)", legend="" if title == "error" else "best")
