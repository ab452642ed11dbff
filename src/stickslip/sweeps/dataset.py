"""Read and write the data set of a sweep: one `.npz` file per block, in folders named after the parts of the run.

``DIR/data/slip_rule=signed/reference=low/friction=nominal/controller=PD/part-000000.npz`` has one array per column. A
file is written as a draft and then renamed, and contains the fingerprint of its numbers. An interrupted sweep therefore
finds all finished blocks. Where pyarrow is installed, a finished sweep also has all cases in one table,
``cases.parquet``.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.errors import InputError, unwritable
from stickslip.core.messages import ask_for_place
from stickslip.core.whole_files import DRAFTS, draft_of
from stickslip.studies.files import KEYS
from stickslip.studies.parquet_table import write_parquet
from stickslip.studies.planned_run import PlannedRun
from stickslip.sweeps.block import Block
from stickslip.sweeps.plan import Sweep

OVERHEAD = 4000
"""Bytes that the file of a block takes in addition to its rows."""
ABOUT = "__about__"
"""Array of a block's file with its fingerprint and size, as JSON."""


def block_path(folder: Path, sweep: Sweep, run: int, start: int) -> Path:
    """Where a block lies."""
    p = sweep.runs[run]
    parts = (f"slip_rule={p.slip_rule}", f"reference={p.reference}", f"friction={p.friction}",
             f"controller={p.controller}")  # fmt: skip
    return folder.joinpath("data", *parts, f"part-{start // sweep.size_of(run):06d}.npz")


def _parts(folder: Path, sweep: Sweep, run: int) -> list[Path]:
    """The files of a run's blocks that are there, in order of their cases."""
    return sorted(block_path(folder, sweep, run, 0).parent.glob("part-*.npz"))


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
    """Return fingerprint and size of a block; nothing if the file is missing, cut off or something else."""
    try:
        with np.load(path, allow_pickle=False) as data:
            return dict(json.loads(str(data[ABOUT])))
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
        return {}


def keep_block(folder: Path, sweep: Sweep, block: Block) -> None:
    """Write a block.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    path = block_path(folder, sweep, block.run, block.start)
    n = len(block.numbers)
    columns: dict[str, Any] = {"case": np.arange(block.start, block.start + n)}
    columns |= {name: block.numbers[:, i] for i, name in enumerate(sweep.drawn.names)}
    columns |= {name: block.metrics[:, i] for i, name in enumerate(sweep.metrics)}
    columns["flagged"] = block.flagged
    columns["failure"] = np.array(block.failures, dtype=np.str_)
    columns["integrator"] = np.array(block.integrators, dtype=np.str_)
    about = {"fingerprint": sweep.fingerprint(block.run), "size": sweep.size_of(block.run)}
    columns[ABOUT] = np.array(json.dumps(about))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(path, error) from None
    with draft_of(path) as draft, draft.open("wb") as file:
        np.savez_compressed(file, **columns)


def write_cases(folder: Path, sweep: Sweep) -> bool:
    """Write all cases of all runs to cases.parquet, one row per case, if pyarrow is installed.

    Returns
    -------
    bool
        Whether it was written.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    return write_parquet(folder / "cases.parquet", _tables(folder, sweep))


def _tables(folder: Path, sweep: Sweep) -> Iterator[Mapping[str, Any]]:
    """Columns of each block: the parts of the run, then those of its file."""
    for i, run in enumerate(sweep.runs):
        for path in _parts(folder, sweep, i):
            with np.load(path, allow_pickle=False) as data:
                columns = {name: data[name] for name in data.files if name != ABOUT}
            n = len(columns["case"])
            yield {key: np.full(n, getattr(run, key)) for key in KEYS} | columns


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
        path for path in sorted((folder / "data").rglob("part-*.npz"))
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
    return sum(_read_part(path, ["case"])["case"].size for path in _parts(folder, sweep, run))


def read_block(
    folder: Path, sweep: Sweep, run: int, start: int, columns: Sequence[str]
) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
    """Columns of one block's cases; empty ones where it is missing."""
    path = block_path(folder, sweep, run, start)
    return _read_part(path, columns) if path.exists() else {name: np.zeros(0) for name in columns}


def _read_part(path: Path, columns: Sequence[str]) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
    with np.load(path, allow_pickle=False) as data:
        return {name: data[name].astype(np.float64) for name in columns}
