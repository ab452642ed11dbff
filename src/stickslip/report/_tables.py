"""Tables of metrics for the report: one for each reference and friction, with the slip rules one below the other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from stickslip.report._view import StudyView
from stickslip.report.captions import HUNTS
from stickslip.studies.result import Run


@dataclass(frozen=True)
class Column:
    """A metric in the table.

    Attributes
    ----------
    metric, label, unit : str
    factor : float
        From the metric's unit into `unit`.
    best : str
        "all": the smallest of all is marked as best; "following": the smallest of the runs that follow the reference,
        because an axis that stays behind is smooth but useless; "resting": the smallest of the runs that rest at steady
        state; empty: none is marked.
    """

    metric: str
    label: str
    unit: str
    factor: float = 1.0
    best: str = "all"


COLUMNS = (
    Column("position_rms_rad", "RMS error", "mrad", 1e3),
    Column("position_peak_rad", "peak error", "mrad", 1e3),
    Column("second_half_position_rms_rad", "RMS error, second half", "mrad", 1e3),
    # A mean, which is small for a limit cycle around the target.
    Column("steady_state_error_rad", "steady-state error (mean)", "mrad", 1e3, ""),
    Column("settling_s", "settling", "s", 1.0, "resting"),
    Column("velocity_rms_rad_s", "velocity error RMS", "mrad/s", 1e3),
    Column("velocity_above_50Hz_rms_rad_s", "velocity above 50 Hz", "mrad/s", 1e3, "following"),
    Column("reversals_beyond_reference_per_s", "extra reversals", "1/s", 1.0, "following"),
    Column("standstills", "stand-stills", "", 1.0, "following"),
    Column("longest_standstill_s", "longest", "ms", 1e3, "following"),
    Column("limit_cycle_amplitude_rad", "limit cycle", "mrad", 1e3, ""),
    Column("torque_rms_Nm", "torque RMS", "N·m", 1.0, ""),
)
PERIODIC = ("second_half_position_rms_rad", "steady_state_error_rad", "settling_s")
AT_REST = ("standstills", "longest_standstill_s")
"""Columns that do not apply to a periodic motion, and to one that comes to rest."""


@dataclass(frozen=True)
class Cell:
    """Text of a cell, its CSS classes and the number of columns that it spans."""

    text: str
    classes: str = ""
    span: int = 1


@dataclass(frozen=True)
class Row:
    """A controller and its cells for one slip rule."""

    controller: str
    rule: str
    cells: Sequence[Cell]


@dataclass(frozen=True)
class MetricsTable:
    """The runs of one reference and friction."""

    title: str
    rules: Sequence[str]
    columns: Sequence[Column]
    rows: Sequence[Row]


def metrics_tables(view: StudyView) -> list[MetricsTable]:
    """Return a table for each reference and friction that was run."""
    tables: list[MetricsTable] = []
    for reference in view.references:
        idle = AT_REST if view.reference_kind(reference) == "step" else PERIODIC
        for friction in view.frictions:
            groups = {rule: view.group(rule, reference, friction) for rule in view.rules}
            runs = [run for group in groups.values() for run in group]
            columns = [c for c in COLUMNS if c.metric not in idle and any(_finite(r, c.metric) for r in runs)]
            if not runs:
                continue
            names = [c for c in view.controllers if any(r.controller == c for r in runs)]
            rows = [
                Row(name, rule, _cells(name, group, columns))
                for rule, group in groups.items()
                for name in names
            ]
            tables.append(
                MetricsTable(f"Reference {reference}, friction {friction}", view.rules, columns, rows)
            )
    return tables


def _finite(run: Run, metric: str) -> bool:
    return math.isfinite(run.metrics.get(metric, math.nan))


def _cells(controller: str, group: Sequence[Run], columns: Sequence[Column]) -> list[Cell]:
    """Return the cells of a controller in a group of runs."""
    run = next((r for r in group if r.controller == controller), None)
    if run is None:
        return [Cell("not run", "soft", len(columns))]
    if run.failure:
        return [Cell(f"failed: {run.failure}", "failed", len(columns))]
    return [Cell(_text(run, c), "best" if run in _best(group, c) else "") for c in columns]


def _best(group: Sequence[Run], column: Column) -> list[Run]:
    """Return the runs with the smallest magnitude of a metric."""
    worst = max((r.metrics.get("position_rms_rad", 0.0) for r in group), default=0.0)
    runs = [r for r in group if not r.failure and _finite(r, column.metric) and _eligible(r, column, worst)]
    least = min((abs(r.metrics[column.metric]) for r in runs), default=math.nan)
    return [r for r in runs if abs(r.metrics[column.metric]) == least]


def _eligible(run: Run, column: Column, worst: float) -> bool:
    """Whether a run may be a column's best; `worst` is the group's largest RMS error (rad)."""
    if column.best == "following":
        return run.metrics["position_rms_rad"] <= 0.5 * worst
    if column.best == "resting":
        return run.metrics.get("second_half_reversals_per_s", 0.0) <= HUNTS
    return column.best == "all"


def _text(run: Run, column: Column) -> str:
    if not _finite(run, column.metric):
        return "–"
    value = column.factor * run.metrics[column.metric]
    if abs(value) < 1e-7:
        return "0"
    if abs(value) < 1e-3:
        return "<0.001"
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
