"""Read and write the files of a study's folder: records, metrics.csv, manifest.json and copies of the inputs."""

from __future__ import annotations

import csv
import json
import math
import os
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import ask_for_place
from stickslip.core.record import Record
from stickslip.core.whole_files import draft_of, prepared_folder, write_whole
from stickslip.studies.parquet_table import write_parquet
from stickslip.studies.provenance import engine_hash, file_hash, versions
from stickslip.studies.result import Run

if TYPE_CHECKING:
    from stickslip.studies.plan import Study
    from stickslip.studies.planned_run import PlannedRun

KEYS = ("slip_rule", "reference", "friction", "controller")
KINDS = ("study", "sweep", "tune")
MARK = ".stickslip-results"
"""File that says whose results a folder holds, from before the first of them"""
PLACES = (
    "manifest.json", "metrics.csv", "metrics.parquet", "summary.csv", "cases.parquet", "report.html", "results.jsonl",
    "*-tuned.json", "*-tried.csv", "inputs", "figures", "records", "data", "variants",
)  # fmt: skip
"""Patterns of the names of results: what is there and is not ours is not overwritten"""


def claim_folder(folder: Path, name: str, kind: str = "study") -> Path:
    """Prepare the folder for results, unless other results or files of somebody else lie where they go.

    Parameters
    ----------
    folder : Path
    name : str
        Of the study, sweep or tuning; the same one goes on in its folder.
    kind : str
        ``"study"``, ``"sweep"`` or ``"tune"``.

    Raises
    ------
    InputError
        That names what lies there.
    """
    found = _owner(folder)
    if found is None:
        for place in (found for pattern in PLACES for found in folder.glob(pattern)):
            if place.is_file() or any(_inside(place)):
                raise InputError(
                    f"{folder} holds {place.name} already, which no {kind} of stickslip wrote; "
                    f"{ask_for_place()}, or move it away"
                )
    elif found != (kind, name):
        raise InputError(f"{folder} holds the {found[0]} {found[1]!r}; {ask_for_place()}, or delete it")
    prepared_folder(folder)
    write_whole(folder / MARK, json.dumps({kind: name}))
    return folder


def _owner(folder: Path) -> tuple[str, str] | None:
    """Kind and name of the results in a folder; None where no file of ours says so."""
    for file in (MARK, "manifest.json"):
        try:
            told: Any = json.loads((folder / file).read_text(encoding="utf-8"))
            return next((kind, str(told[kind])) for kind in KINDS if kind in told)
        except (OSError, ValueError, TypeError, StopIteration):
            continue
    return None


def _inside(folder: Path) -> Iterator[Path]:
    """What a folder holds; nothing where there is none."""
    return folder.iterdir() if folder.is_dir() else iter(())


# ---- records -----------------------------------------------------------------------------------------------


def record_path(folder: Path, planned: PlannedRun) -> Path:
    """Where the record of a run lies."""
    return folder / "records" / f"{planned.key}.npz"


def keep_record(folder: Path, planned: PlannedRun, record: Record) -> Path:
    """Write the record of a run. Returns its path."""
    path = record_path(folder, planned)
    prepared_folder(path.parent)
    return record.save(path)


def find_run(folder: Path, planned: PlannedRun) -> Run | None:
    """The run as an earlier call finished it, or None."""
    path = record_path(folder, planned)
    try:
        with np.load(path, allow_pickle=False) as data:
            meta: dict[str, Any] = json.loads(str(data["__header__"]))["meta"]
        about: dict[str, Any] = meta["study"]
        if about["fingerprint"] != planned.fingerprint:
            return None
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
        return None  # Missing, cut off or written by something else: it is run again.
    return Run(
        planned.slip_rule, planned.reference, planned.friction, planned.controller,
        meta.get("metrics", {}), path, about["failure"], about["seconds"], depends_on_start(meta),
        planned.compensation,
    )  # fmt: skip


def depends_on_start(meta: Mapping[str, Any]) -> bool:
    """Whether a record's meta says that the run depends on its start."""
    return bool(meta.get("accuracy", {}).get("depends_on_start", False))


# ---- tables -----------------------------------------------------------------------------------------------


def metric_names(runs: Sequence[Run]) -> list[str]:
    """Every metric that a run has, in the order of the first that has it."""
    return list(dict.fromkeys(name for run in runs for name in run.metrics))


def write_metrics(folder: Path, runs: Sequence[Run]) -> None:
    """Write metrics.csv (exact decimals; NaN as an empty cell), with pyarrow also metrics.parquet; one row per run."""
    names = metric_names(runs)
    rows = [[getattr(run, key) for key in KEYS] + [_cell(run.metrics.get(n)) for n in names] for run in runs]
    with draft_of(folder / "metrics.csv") as draft, draft.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([[*KEYS, *names], *rows])
    columns: dict[str, np.ndarray[Any, Any]] = {
        key: np.array([getattr(run, key) for run in runs], dtype=np.str_) for key in KEYS
    }
    columns |= {name: np.array([run.metrics.get(name, math.nan) for run in runs]) for name in names}
    write_parquet(folder / "metrics.parquet", [columns])


def _cell(value: float | None) -> str:
    return "" if value is None or math.isnan(value) else repr(float(value))


# ---- the manifest -----------------------------------------------------------------------------------------------


def write_manifest(
    folder: Path,
    study: Study,
    only: Sequence[str] | None,
    planned: Sequence[PlannedRun],
    results: Mapping[str, Run],
    timings: Mapping[str, float],
) -> dict[str, Any]:
    """Write the manifest of a study."""
    inputs = [(study.source.name, study.source), *study.files.items()]
    content: dict[str, Any] = {
        "only": list(only or ()),
        "configuration": study.config,
        "timings": dict(timings),
        "runs": [_entry(folder, p, results[p.key], study) for p in planned],
    }
    return save_manifest(folder, {"study": study.name, "title": study.title}, inputs, content)


def save_manifest(
    folder: Path, named: Mapping[str, str], inputs: Sequence[tuple[str, Path]], content: Mapping[str, Any]
) -> dict[str, Any]:
    """Write manifest.json and copy the inputs beside it, so that `stickslip rerun` needs nothing else.

    It begins with what it is of, and with what the numbers come from.
    """
    manifest: dict[str, Any] = {
        **named,
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": versions(),
        "engine_sha256": engine_hash(),
        "inputs": copy_inputs(folder, inputs),
        **content,
    }
    write_whole(folder / "manifest.json", json.dumps(manifest, indent=1, default=str))
    return manifest


def _entry(folder: Path, planned: PlannedRun, run: Run, study: Study) -> dict[str, Any]:
    return {
        "run": run.key,
        "fingerprint": planned.fingerprint,
        "record": run.path.relative_to(folder).as_posix(),
        "sample_time_s": planned.control.sample_time,
        "design_inertia_kg_m2": float(study.config.get("design_inertia", planned.axis.inertia)),
        "cpu_s": run.seconds,
        "failure": run.failure,
        "metrics": {k: None if math.isnan(v) else v for k, v in run.metrics.items()},
    }


def copy_inputs(folder: Path, files: Sequence[tuple[str, Path]]) -> list[dict[str, str]]:
    """Copy files to inputs/, the first under its own name; path as written, copy and SHA-256 of each."""
    target = prepared_folder(folder / "inputs")
    inputs: list[dict[str, str]] = []
    for i, (written, path) in enumerate(files):
        copy = target / (path.name if i == 0 else f"{i}-{path.name}")
        if os.path.realpath(copy) != os.path.realpath(path):
            write_whole(copy, path.read_bytes())
        inputs.append(
            {"written": written, "copy": copy.relative_to(folder).as_posix(), "sha256": file_hash(copy)}
        )
    return inputs


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read the manifest of a study's folder.

    Raises
    ------
    InputError
        If there is none, or an input's copy is not what it was.
    """
    path = folder / "manifest.json"
    try:
        manifest: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        for entry in manifest["inputs"]:
            if file_hash(folder / entry["copy"]) != entry["sha256"]:
                raise InputError(
                    f"{folder / entry['copy']} was changed since; restore it, or run the study anew"
                )
    except OSError as error:
        if error.filename and Path(error.filename) != path:
            raise InputError(
                f"{error.filename}, an input of the study in {folder}, cannot be read ({error.strerror}); restore it, "
                "or run the study anew"
            ) from None
        raise InputError(
            f"no study in {folder} ({path.name}: {error.strerror}); give a folder that `stickslip study` or"
            " `stickslip sweep` wrote"
        ) from None
    except ValueError as error:
        raise InputError(f"{path} is not JSON ({error}); run the study anew") from None
    except (KeyError, TypeError):
        raise InputError(
            f"{path} lists no inputs of a study with their SHA-256; run the study anew"
        ) from None
    return manifest
