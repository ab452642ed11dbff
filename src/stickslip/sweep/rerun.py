"""Running a finished sweep again from its manifest: the numbers must be the same."""

from __future__ import annotations

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.study.files import read_manifest
from stickslip.study.provenance import versions
from stickslip.study.rerun import Comparison
from stickslip.sweep import dataset
from stickslip.sweep.block import Block, compute
from stickslip.sweep.execute import Progress
from stickslip.sweep.plan import BLOCK, Sweep, load

__all__ = ["is_sweep", "rerun"]

MOST_LINES = 1000


def is_sweep(folder: Path) -> bool:
    """Whether `stickslip sweep` wrote the folder.

    Raises
    ------
    InputError
        If there is no manifest, or an input's copy is not what it was.
    """
    return "sweep" in read_manifest(folder)


def rerun(folder: Path, jobs: int = 1, progress: Progress | None = None) -> Comparison:
    """Compute every case of a sweep anew, from the copies of its inputs, and compare numbers, metrics and flags.

    Parameters
    ----------
    folder : Path
    jobs : int
        Blocks at a time; 0 for one a core.
    progress : callable, optional
        ``progress(finished, all)`` in closed loops.

    Raises
    ------
    InputError
        If the folder holds no sweep, its inputs were changed, or cases are missing.
    """
    if jobs < 0:
        raise InputError(f"jobs = {jobs} must be at least 0")
    manifest = read_manifest(folder)
    sweep = _sweep_of(folder, manifest)
    for planned in sweep.runs:
        planned.check()
    names = (*sweep.drawn.names, *sweep.metrics, "flagged")
    before = [dataset.read(folder, sweep, run, names) for run in sweep.runs]
    for run, columns in zip(sweep.runs, before):
        if columns[names[0]].size != sweep.drawn.cases:
            raise InputError(f"{folder}: {run.key} has {columns[names[0]].size} of {sweep.drawn.cases} cases;"
                             " run the sweep again to complete it")  # fmt: skip
    differences: list[str] = []
    largest, done = 0.0, 0

    def computed(at: tuple[int, int]) -> Block:
        return compute(sweep, *at)

    with ThreadPoolExecutor(jobs or os.cpu_count() or 1) as pool:
        for block in pool.map(computed, sweep.blocks):
            lines, off = _compared(sweep, block, before[block.run])
            differences += lines[: max(0, MOST_LINES - len(differences))]
            largest, done = max(largest, off), done + len(block.numbers)
            if progress:
                progress(done, sweep.cases)
    now, then = versions(), manifest["versions"]
    notes = [f"{n} {now.get(n)}, was {then.get(n)}" for n in {**then, **now} if now.get(n) != then.get(n)]
    return Comparison(sweep.cases, sweep.cases * len(sweep.metrics), differences, largest, notes)


def _sweep_of(folder: Path, manifest: Mapping[str, Any]) -> Sweep:
    """The sweep that a manifest tells of, with as many cases as were run."""
    source, study, *others = manifest["inputs"]
    moved = {entry["written"]: (folder / entry["copy"]).resolve() for entry in (study, *others)}
    sweep = load(folder / source["copy"], moved)
    return replace(sweep, drawn=replace(sweep.drawn, cases=int(manifest["cases"])))


def _compared(sweep: Sweep, block: Block, before: Mapping[str, Any]) -> tuple[list[str], float]:
    """A line for every number of a block that differs, and the largest difference over the former value."""
    at = slice(block.start, min(block.start + BLOCK, sweep.drawn.cases))
    columns = dict(zip(sweep.drawn.names, block.numbers.T)) | dict(zip(sweep.metrics, block.metrics.T))
    columns["flagged"] = block.flagged.astype(np.float64)
    lines, largest = list[str](), 0.0
    for name, found in columns.items():
        old = before[name][at]
        for i in np.flatnonzero((found != old) & ~(np.isnan(found) & np.isnan(old))):
            a, b = float(old[i]), float(found[i])
            lines.append(f"{sweep.runs[block.run].key} case {block.start + i} {name}: {b!r}, was {a!r}")
            largest = max(largest, abs(b - a) / abs(a) if a and np.isfinite(b - a) else float("inf"))
    return lines, largest
