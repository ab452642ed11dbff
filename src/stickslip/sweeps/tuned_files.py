"""The files of `stickslip tune`: what was chosen, and every setting tried."""

from __future__ import annotations

import csv
import json
from pathlib import Path

from stickslip.core.whole_files import draft_of, write_whole
from stickslip.sweeps.plan import Sweep
from stickslip.sweeps.tune import Tuned


def write(folder: Path, sweep: Sweep, tuned: Tuned) -> list[Path]:
    """Write CONTROLLER-tuned.json and CONTROLLER-tried.csv; returns their paths."""
    stem = tuned.run.key.replace("/", "-")
    table, chosen = folder / f"{stem}-tried.csv", folder / f"{stem}-tuned.json"
    heads = [*tuned.names, *(f"{name}_p{sweep.percentile:g}" for name in sweep.metrics)]
    with draft_of(table) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(heads)
        writer.writerows([*a, *b] for a, b in zip(tuned.tried.tolist(), tuned.scores.tolist()))
    content = {
        "run": tuned.run.key,
        "percentile": sweep.percentile,
        "settings": dict(zip(tuned.names, tuned.after.tolist())),
        "gains": tuned_gains(tuned),
        "at_bounds": dict(tuned.at_bounds),
        "metrics": dict(zip(sweep.metrics, tuned.scores_after.tolist())),
        "metrics_before": dict(zip(sweep.metrics, tuned.scores_before.tolist())),
    }
    write_whole(chosen, json.dumps(content, indent=1))
    return [table, chosen]


def tuned_gains(tuned: Tuned) -> dict[str, float]:
    """The linear gains of the chosen setting, for the drive; of a controller made of control laws all its numbers."""
    from stickslip.sweeps.numbers import varied

    return varied(tuned.run, dict(zip(tuned.names, tuned.after.tolist()))).control.numbers()
