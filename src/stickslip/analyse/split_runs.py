"""Split a procedure's record into runs: one per velocity and direction, per repetition, or per current."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.core.record import Record

SAME = 1e-6
"""Relative change of the reference velocity that starts another run."""
GAP = 50.0
"""Multiple of the usual time step that counts as a pause."""
FEWEST = 20
"""Fewest rows of a run."""


def pieces(name: str, record: Record) -> list[tuple[str, Record]]:
    """Return the runs of a record of `stickslip rig run`, by name; for any other record the record itself.

    Parameters
    ----------
    name : str
        Of the record.
    record : Record
        Of ``sliding`` (one run per velocity and direction), ``repeat`` (one per repetition) or ``inertia`` (one per
        current).
    """
    constants: Any = record.meta.get("reading", {}).get("constants", {})
    kind = record.meta.get("procedure", constants.get("procedure"))
    if kind in ("repeat", "inertia"):
        steps = np.diff(record.time)
        runs = np.split(np.arange(len(record)), np.flatnonzero(steps > GAP * np.median(steps)) + 1)
        return [(f"{name} {i + 1}", rows_of(record, rows)) for i, rows in enumerate(runs)]
    if kind == "sliding":
        reference = record["velocity_reference"]
        edges = np.flatnonzero(np.abs(np.diff(reference)) > SAME * np.abs(reference[:-1])) + 1
        parts = [p for p in np.split(np.arange(len(record)), edges) if p.size >= FEWEST]
        return [(f"{name} {float(reference[p[0]]):+.3g} rad/s", rows_of(record, p)) for p in parts]
    return [(name, record)]


def rows_of(record: Record, rows: np.ndarray[Any, np.dtype[np.intp]]) -> Record:
    """Return some rows of a record with all its channels."""
    meta = {k: v for k, v in record.meta.items() if k != "procedure"}
    channels = {n: values[rows] for n, values in record.channels.items()}
    return Record(record.time[rows], channels, record.units, meta)
