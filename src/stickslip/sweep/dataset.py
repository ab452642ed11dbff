"""The data set of a sweep: one Parquet file a block, in folders named after the run's parts.

``DIR/data/slip_rule=signed/reference=low/friction=nominal/controller=PD/part-000000.parquet``: what pandas, Polars,
DuckDB and pyarrow read as one table. A file is written aside and renamed, and holds the fingerprint of its numbers, so
that an interrupted sweep finds what it has, whatever stopped it.
"""

from __future__ import annotations

import importlib
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.errors import InputError, unwritable
from stickslip.messages import ask_for_place
from stickslip.study.planned_run import PlannedRun
from stickslip.sweep.block import Block
from stickslip.sweep.plan import Sweep
from stickslip.whole_files import DRAFTS, draft_of

OVERHEAD = 4000
"""Bytes that a file of a block takes besides its rows."""
KEY = b"stickslip"


def block_path(folder: Path, sweep: Sweep, run: int, start: int) -> Path:
    """Where a block lies."""
    p = sweep.runs[run]
    parts = (f"slip_rule={p.slip_rule}", f"reference={p.reference}", f"friction={p.friction}",
             f"controller={p.controller}")  # fmt: skip
    return folder.joinpath("data", *parts, f"part-{start // sweep.size_of(run):06d}.parquet")


def _parts(folder: Path, sweep: Sweep, run: int) -> list[Path]:
    """The files of a run's blocks that are there, in order of their cases."""
    return sorted(block_path(folder, sweep, run, 0).parent.glob("part-*.parquet"))


def has_block(folder: Path, sweep: Sweep, run: int, start: int) -> bool:
    """Whether the block lies there, whole, with these numbers."""
    about = _about(block_path(folder, sweep, run, start))
    return about == {"fingerprint": sweep.fingerprint(run), "size": sweep.size_of(run)}


def fingerprint_of(path: Path) -> str | None:
    """What a block was made of; None where it is missing, cut off or something else, and is to be run again."""
    return _about(path).get("fingerprint")


def size_found(folder: Path, sweep: Sweep, run: int) -> int:
    """Cases in a block of a run, as those that lie there have it; 0 where none does."""
    sizes = (int(_about(path).get("size", 0)) for path in _parts(folder, sweep, run))
    return next((size for size in sizes if size), 0)


def _about(path: Path) -> dict[str, Any]:
    """What a file says of its block; nothing where it is missing, cut off or something else."""
    parquet: Any = importlib.import_module("pyarrow.parquet")
    try:
        return dict(json.loads(parquet.read_schema(path).metadata[KEY]))
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def keep_block(folder: Path, sweep: Sweep, block: Block) -> None:
    """Write a block.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    pyarrow: Any = importlib.import_module("pyarrow")
    parquet: Any = importlib.import_module("pyarrow.parquet")
    path = block_path(folder, sweep, block.run, block.start)
    n = len(block.numbers)
    columns: dict[str, Any] = {"case": pyarrow.array(range(block.start, block.start + n), pyarrow.int64())}
    columns |= {name: _numbers(pyarrow, block.numbers[:, i]) for i, name in enumerate(sweep.drawn.names)}
    columns |= {name: _numbers(pyarrow, block.metrics[:, i]) for i, name in enumerate(sweep.metrics)}
    columns["flagged"] = pyarrow.array(block.flagged.tolist(), pyarrow.bool_())
    columns["failure"] = pyarrow.array(block.failures, pyarrow.string())
    columns["integrator"] = pyarrow.array(block.integrators, pyarrow.string())
    table = pyarrow.Table.from_arrays(list(columns.values()), names=list(columns))
    about = json.dumps(
        {"fingerprint": sweep.fingerprint(block.run), "size": sweep.size_of(block.run)}
    ).encode()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(path, error) from None
    with draft_of(path) as draft:
        parquet.write_table(table.replace_schema_metadata({KEY: about}), draft)


def _numbers(pyarrow: Any, values: Any) -> Any:
    """Doubles; NaN becomes null."""
    found = np.ascontiguousarray(values, dtype=np.float64)
    known = np.packbits(~np.isnan(found), bitorder="little")
    buffers = [pyarrow.py_buffer(known.tobytes()), pyarrow.py_buffer(found)]
    return pyarrow.Array.from_buffers(pyarrow.float64(), found.size, buffers)


def clear_drafts(folder: Path) -> None:
    """Remove what a killed command left half written."""
    for draft in (folder / "data").rglob(DRAFTS):
        draft.unlink(missing_ok=True)


def refuse_strays(folder: Path, sweep: Sweep) -> None:
    """Refuse a folder with blocks of another sweep: they would be read as this one's results, or lost to them.

    Raises
    ------
    InputError
    """
    own = {block_path(folder, sweep, *b): sweep.fingerprint(b[0]) for b in sweep.blocks}
    strays = [
        path for path in sorted((folder / "data").rglob("part-*.parquet"))
        if path not in own or fingerprint_of(path) not in (own[path], None)
    ]  # fmt: skip
    if strays:
        raise InputError(
            f"{folder} holds finished blocks of another sweep ({len(strays)}, such as "
            f"{strays[0].relative_to(folder)}): its cases, ranges, metrics, runs or numerics were others, or another "
            f"version of stickslip wrote them; run that one to go on, {ask_for_place()}, or delete it"
        )


def room_for(folder: Path, sweep: Sweep) -> None:
    """Refuse a sweep whose data set the disk has no room for.

    Raises
    ------
    InputError
    """
    import shutil

    place = next(p for p in (folder, *Path(os.path.realpath(folder)).parents) if p.exists())
    row = 8 * (1 + len(sweep.drawn.names) + len(sweep.metrics)) + 2
    wanted = (
        sweep.cases * row
        + sum(-(-sweep.drawn.cases // sweep.size_of(i)) for i in range(len(sweep.runs))) * OVERHEAD
    )
    free = shutil.disk_usage(place).free
    if wanted > free:
        raise InputError(
            f"{sweep.cases} cases take about {wanted / 1e9:.3g} GB and {place} has {free / 1e9:.3g} GB free; "
            f"run fewer, or {ask_for_place()}"
        )


def read(
    folder: Path, sweep: Sweep, run: PlannedRun, columns: Sequence[str]
) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
    """Columns of a run's cases, in order of the cases; NaN where there is no number."""
    parts = [_read_part(path, columns) for path in _parts(folder, sweep, list(sweep.runs).index(run))]
    return {name: np.concatenate([np.zeros(0), *(part[name] for part in parts)]) for name in columns}


def rows_of(folder: Path, sweep: Sweep, run: int) -> int:
    """Cases that a run's files hold."""
    parquet: Any = importlib.import_module("pyarrow.parquet")
    return sum(parquet.read_metadata(path).num_rows for path in _parts(folder, sweep, run))


def read_block(
    folder: Path, sweep: Sweep, run: int, start: int, columns: Sequence[str]
) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
    """Columns of one block's cases; empty ones where it is missing."""
    path = block_path(folder, sweep, run, start)
    return _read_part(path, columns) if path.exists() else {name: np.zeros(0) for name in columns}


def _read_part(path: Path, columns: Sequence[str]) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
    parquet: Any = importlib.import_module("pyarrow.parquet")
    table = parquet.ParquetFile(path).read(columns=list(columns))
    return {name: table.column(name).to_numpy().astype(np.float64) for name in columns}
