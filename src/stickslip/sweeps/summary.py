"""What a sweep's cases say together: percentiles of a metric for every run, flagged and failed shares."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.whole_files import draft_of
from stickslip.studies.files import KEYS
from stickslip.sweeps.checked_numbers import not_varied, not_varied_lines
from stickslip.sweeps.dataset import read
from stickslip.sweeps.plan import Sweep

Array = np.ndarray[Any, np.dtype[np.float64]]
PERCENTILES = (5, 50, 95, 100)
BETWEEN = ", "
"""Between the numbers that a row says varied"""
LEAST_CASES = 20
"""Fewer cases than this say nothing of a percentile."""


def meaning_of_flags(sweep: Sweep) -> str:
    """What it says of a case that it is flagged, and what was run to find out."""
    if not sweep.check:
        return "nothing: no case was run again (check = false)"
    return (
        "every case was run again with other errors of its steps (check), and a metric of these changes by more than "
        "0.1 %: their motion hangs on details that nobody knows, and each is one of many that could be"
    )


def summarise(folder: Path, sweep: Sweep) -> list[dict[str, Any]]:
    """A row a run: its key, what varied in it, its cases, those flagged and failed, percentiles of every metric."""
    rows: list[dict[str, Any]] = []
    for run in sweep.runs:
        columns = read(folder, sweep, run, [*sweep.metrics, "flagged"])
        first = columns[sweep.metrics[0]]
        row: dict[str, Any] = {key: getattr(run, key) for key in KEYS}
        row |= {"cases": first.size, "flagged": int(np.nansum(columns["flagged"]))}
        for name in sweep.metrics:
            values = columns[name][np.isfinite(columns[name])]
            row[f"{name}_missing"] = int(first.size - values.size)
            for p in PERCENTILES:
                row[f"{name}_p{p}"] = float(np.percentile(values, p)) if values.size else float("nan")
        row |= {"flagged_means": meaning_of_flags(sweep), "varied": BETWEEN.join(sweep.varied(run))}
        rows.append(row | {"not_varied": BETWEEN.join(not_varied(sweep, run))})
    return rows


def write_summary(folder: Path, sweep: Sweep, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Write summary.csv, one row a run. Returns its path."""
    path = folder / "summary.csv"
    with draft_of(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return path


def summary_lines(rows: Sequence[Mapping[str, Any]], metric: str) -> list[str]:
    """A line a run under a heading: percentiles of a metric, flagged and missing cases; last what flagged means, and
    which runs do not have a number that varied."""
    keys = ["/".join(str(row[part]) for part in KEYS) for row in rows]
    width = max(24, *(len(key) for key in keys))
    heads = ("5 %", "50 %", "95 %", "worst")
    out = [f"{metric:<{width}}" + "".join(f"{h:>12}" for h in heads) + f"{'flagged':>10}{'missing':>9}"]
    for key, row in zip(keys, rows, strict=True):
        cells = "".join(f"{row[f'{metric}_p{p}']:>12.4g}" for p in PERCENTILES)
        flagged = f"{100.0 * row['flagged'] / max(1, row['cases']):.2f} %"
        out.append(f"{key:<{width}}{cells}{flagged:>10}{row[f'{metric}_missing']:>9}")
    return [*out, *dict.fromkeys(f"flagged: {row['flagged_means']}" for row in rows), *unvaried(rows)]


def unvaried(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Which runs do not have a number that varied."""
    return not_varied_lines(
        ("/".join(str(row[part]) for part in KEYS), _listed(row["varied"]), _listed(row["not_varied"]))
        for row in rows
    )


def _listed(joined: str) -> list[str]:
    return joined.split(BETWEEN) if joined else []


# ---- what uncertainty does ---------------------------------------------------------------------------------------


def within(levels: Array, off: Array, values: Array, percentile: float) -> Array:
    """The percentile of a metric over the cases of each level, from the one before it; NaN where there are too few."""
    out = np.full(levels.size, np.nan)
    for i, level in enumerate(levels):
        kept = values[(off > (levels[i - 1] if i else 0.0)) & (off <= level) & np.isfinite(values)]
        if kept.size >= LEAST_CASES:
            out[i] = np.percentile(kept, percentile)
    return out


def influences(drawn: Sequence[Array], values: Array) -> list[tuple[float, float]]:
    """Median of a metric over the lowest and the highest tenth of each number, the others as they come."""
    out: list[tuple[float, float]] = []
    for column in drawn:
        low, high = np.percentile(column, [10, 90])
        known = np.isfinite(values)
        out.append((
            float(np.median(values[(column <= low) & known])) if np.any((column <= low) & known) else float("nan"),
            float(np.median(values[(column >= high) & known])) if np.any((column >= high) & known) else float("nan"),
        ))  # fmt: skip
    return out
