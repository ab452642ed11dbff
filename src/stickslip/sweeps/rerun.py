"""Running a finished sweep again from its manifest: the numbers must be the same."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.studies.files import read_manifest
from stickslip.studies.provenance import other_versions
from stickslip.studies.rerun import Comparison
from stickslip.sweeps import dataset
from stickslip.sweeps.block import Block
from stickslip.sweeps.execute import Progress, computed, ready
from stickslip.sweeps.plan import BLOCK, Sweep, load

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
    ready(sweep)
    for i, run in enumerate(sweep.runs):
        found = dataset.rows_of(folder, sweep, i)
        if found != sweep.drawn.cases:
            raise InputError(f"{folder}: {run.key} has {found} of {sweep.drawn.cases} cases;"
                             " run the sweep again to complete it")  # fmt: skip
    differences: list[tuple[int, int, str]] = []
    largest, done = 0.0, 0
    for block in computed(sweep, sweep.blocks, jobs or os.cpu_count() or 1):
        lines, off = _compared(folder, sweep, block)
        left = max(0, MOST_LINES - len(differences))
        differences += [(block.run, block.start, line) for line in lines[:left]]
        largest, done = max(largest, off), done + len(block.numbers)
        if progress:
            progress(done, sweep.cases)
    differences.sort(key=lambda found: found[:2])  # Blocks come as they get done.
    notes = other_versions(manifest["versions"])
    lines = [line for *_, line in differences]
    return Comparison(sweep.cases, sweep.cases * len(sweep.metrics), lines, largest, notes)


def _sweep_of(folder: Path, manifest: Mapping[str, Any]) -> Sweep:
    """The sweep that a manifest tells of, with as many cases as were run."""
    source, *others = manifest["inputs"]
    moved = {entry["written"]: Path(os.path.realpath(folder / entry["copy"])) for entry in others}
    sweep = load(folder / source["copy"], moved)
    sizes = tuple(dataset.size_found(folder, sweep, i) or BLOCK for i in range(len(sweep.runs)))
    return replace(sweep, drawn=replace(sweep.drawn, cases=int(manifest["cases"])), sizes=sizes)


def _compared(folder: Path, sweep: Sweep, block: Block) -> tuple[list[str], float]:
    """A line for every number of a block that differs, and the largest difference over the former value."""
    columns = dict(zip(sweep.drawn.names, block.numbers.T)) | dict(zip(sweep.metrics, block.metrics.T))
    columns["flagged"] = block.flagged.astype(np.float64)
    before = dataset.read_block(folder, sweep, block.run, block.start, list(columns))
    lines, largest = list[str](), 0.0
    for name, found in columns.items():
        old = before[name]
        for i in np.flatnonzero((found != old) & ~(np.isnan(found) & np.isnan(old))):
            a, b = float(old[i]), float(found[i])
            lines.append(f"{sweep.runs[block.run].key} case {block.start + i} {name}: {b!r}, was {a!r}")
            largest = max(largest, abs(b - a) / abs(a) if a and np.isfinite(b - a) else float("inf"))
    return lines, largest
