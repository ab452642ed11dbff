"""Running a finished study again from its manifest: the numbers must be the same."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stickslip.core.errors import InputError
from stickslip.studies.files import read_manifest
from stickslip.studies.plan import load
from stickslip.studies.provenance import other_versions
from stickslip.studies.study import Progress, execute


@dataclass(frozen=True)
class Comparison:
    """What running again found.

    Attributes
    ----------
    runs, metrics : int
        How many were compared.
    differences : sequence of str
        One line for each metric that differs.
    largest : float
        The largest difference over the metric's former value.
    notes : sequence of str
        Versions that differ from the manifest's.
    """

    runs: int
    metrics: int
    differences: Sequence[str]
    largest: float
    notes: Sequence[str]


Former = tuple[str, dict[str, float]]
"""Why a run ended early (empty: it did not), and its metrics."""


def _former(folder: Path) -> tuple[Path, dict[str, Path], dict[str, Former], dict[str, Any], dict[str, Any]]:
    """The study's file, the copies of the others by where they lay, every run as it was, the versions, and what the
    command gave instead of the file."""
    manifest = read_manifest(folder)
    try:
        source, *others = manifest["inputs"]
        moved = {str(entry["written"]): Path(os.path.realpath(folder / entry["copy"])) for entry in others}
        before = {
            str(e["run"]): (
                str(e["failure"]),
                {k: math.nan if v is None else float(v) for k, v in e["metrics"].items()},
            )
            for e in manifest["runs"]
        }
        config: dict[str, Any] = manifest.get("configuration", {})
        given = {k: config[k] for k in ("seeds", "ablation") if k in config and "experiments" in config}
        return folder / source["copy"], moved, before, dict(manifest["versions"]), given
    except KeyError as error:
        why = f"an entry {error} is missing"
    except (TypeError, ValueError, AttributeError) as error:
        why = str(error)
    raise InputError(f"{folder / 'manifest.json'} is damaged ({why}); restore it, or run the study anew")


def rerun(folder: Path, jobs: int = 1, progress: Progress | None = None) -> Comparison:
    """Simulate every run of a study's manifest anew, from the copies of its inputs, and compare the metrics.

    Raises
    ------
    InputError
        If the folder holds no study, or its inputs were changed.
    """
    if jobs < 1:
        raise InputError(f"jobs = {jobs} must be at least 1")
    source, moved, before, then, given = _former(folder)
    study = load(source, moved, given)
    everything = [*study.runs, *study.extras]
    planned = [p for p in everything if p.key in before]
    if missing := sorted(before.keys() - {p.key for p in planned}):
        raise InputError(
            f"{folder}: the manifest and its inputs differ in run {missing[0]}; run the study anew"
        )
    for p in planned:
        p.check()
    differences: list[str] = []
    count, largest = 0, 0.0
    with ThreadPoolExecutor(jobs) as pool:
        for done, (p, executed) in enumerate(zip(planned, pool.map(execute, planned)), 1):
            failure, old = before[p.key]
            count += len(old)
            if executed.failure != failure:
                differences.append(f"{p.key}: {executed.failure or 'finished'}, was {failure or 'finished'}")
            for name in old.keys() | executed.metrics.keys():
                a, b = old.get(name, math.nan), executed.metrics.get(name, math.nan)
                if a != b and not (math.isnan(a) and math.isnan(b)):
                    differences.append(f"{p.key} {name}: {b!r}, was {a!r}")
                    largest = max(largest, abs(b - a) / abs(a) if a and not math.isnan(b - a) else math.inf)
            if progress:
                progress(done, len(planned))
    return Comparison(len(planned), count, differences, largest, other_versions(then))
