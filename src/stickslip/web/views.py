"""Store a record for the page once, in the worker, so the server only reads parts of files.

Every channel is a file of numbers, with the minimum and maximum of every 64, 512, 4096, ... samples. Any interval is
then drawn from a few thousand numbers without losing a spike, as an average would.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.record import Record

Array = np.ndarray[Any, np.dtype[np.float64]]

FIRST, FACTOR = 64, 8
"""Samples per block of the lowest level; blocks per block of the next."""
MOST_BINS = 4000
CELLS = (240, 180)
"""Cells of the plane of two channels, per side."""


def lay_out(record: Record, folder: Path) -> dict[str, Any]:
    """Write the view of a record; return the data for requesting parts of it."""
    folder.mkdir(exist_ok=True)
    time = np.ascontiguousarray(record.time, dtype=np.float64)
    ascending = bool(time.size > 1 and np.all(np.isfinite(time)) and np.all(np.diff(time) >= 0.0))
    np.save(folder / "time.npy", time if ascending else np.arange(1.0, time.size + 1.0))
    channels: list[dict[str, Any]] = []
    for number, (name, values) in enumerate(record.channels.items()):
        values = np.ascontiguousarray(values, dtype=np.float64)
        np.save(folder / f"{number}.npy", values)
        level = 0
        low = high = values
        while low.size > FIRST:
            low = blockwise(np.fmin, low, FIRST if level == 0 else FACTOR)
            high = blockwise(np.fmax, high, FIRST if level == 0 else FACTOR)
            level += 1
            np.save(folder / f"{number}-{level}.npy", np.stack([low, high]))
        good = values[np.isfinite(values)]
        span = [float(good.min()), float(good.max())] if good.size else [0.0, 0.0]
        missing = int(values.size - good.size)
        channels.append({"name": name, "unit": record.units[name], "levels": level, "span": span,
                         "missing": missing})  # fmt: skip
    axis = np.load(folder / "time.npy", mmap_mode="r")
    ends = [float(axis[0]), float(axis[-1])] if axis.size else [0.0, 0.0]
    return {"rows": int(time.size), "by": "time" if ascending else "row", "ends": ends, "channels": channels}


def blockwise(least: Any, values: Array, width: int) -> Array:
    """Return the minimum (or maximum) of every `width` values, ignoring NaN."""
    return least.reduceat(values, np.arange(0, values.size, width))


def samples(
    folder: Path, about: Mapping[str, Any], channels: Sequence[int], start: float, end: float, bins: int
) -> bytes:
    """Return an interval of some channels, thinned to minimum and maximum of `bins` blocks.

    Parameters
    ----------
    folder : Path
        Of the view.
    about : mapping
        The result of `lay_out`.
    channels : sequence of int
        Their indices.
    start, end : float
        s, or rows if times are not increasing.
    bins : int

    Returns
    -------
    bytes
        Little-endian 64-bit numbers: points, channels, samples in the interval, 1 if these are the samples themselves;
        the times of the points; then minimum and maximum of every channel.
    """
    time = np.load(folder / "time.npy", mmap_mode="r")
    first = max(0, int(np.searchsorted(time, start, "left")) - 1)
    last = min(time.size, int(np.searchsorted(time, end, "right")) + 1)
    count = max(0, last - first)
    width = 1
    level, block = 0, 1
    if count > 2 * bins:
        width = -(-count // bins)
        deepest = max((int(c["levels"]) for c in about["channels"]), default=0)
        while level < deepest and (FIRST if level == 0 else block * FACTOR) <= width:
            block = FIRST if level == 0 else block * FACTOR
            level += 1
        width = -(-width // block) * block
    begin = first // width * width
    points: Array = np.array(time[begin:last:width]) if count else np.zeros(0)
    parts = [np.array([points.size, len(channels), count, float(width == 1)]), points]
    for place in channels:
        parts += extremes(folder, place, level, block, begin, last, width) if count else [points, points]
    return np.concatenate(parts).astype("<f8").tobytes()


def extremes(
    folder: Path, place: int, level: int, block: int, begin: int, last: int, width: int
) -> list[Array]:
    """Return minimum and maximum of every `width` samples from `begin` to `last`."""
    if level == 0:
        values = np.asarray(np.load(folder / f"{place}.npy", mmap_mode="r")[begin:last])
        if width == 1:
            return [values, values]
        low, high = values, values
    else:
        pyramid = np.load(folder / f"{place}-{level}.npy", mmap_mode="r")
        low, high = (np.asarray(side[begin // block : -(-last // block)]) for side in pyramid)
    every = width // block
    return [blockwise(np.fmin, low, every), blockwise(np.fmax, high, every)]


def plane(x: Array, y: Array) -> dict[str, Any]:
    """Return one channel against another: one sample from every non-empty cell of a grid.

    No non-empty cell is left out, so a single outlier among ten million samples is visible.
    """
    good = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if not good.size:
        return {"x": [], "y": []}
    place = np.zeros(good.size, dtype=np.int64)
    for values, cells in zip((x, y), CELLS, strict=True):
        inside = values[good]
        low, high = float(inside.min()), float(inside.max())
        step = (high - low) / cells or 1.0
        place = place * cells + np.minimum(((inside - low) / step).astype(np.int64), cells - 1)
    _, kept = np.unique(place, return_index=True)
    rows = good[kept]
    return {"x": np.round(x[rows], 9).tolist(), "y": np.round(y[rows], 9).tolist()}
