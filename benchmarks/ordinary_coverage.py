"""How often the numbers called identified hold on ordinary logs, cell by cell.

    python benchmarks/ordinary_coverage.py                # all 720 cells, one record each: half an hour on two cores
    python benchmarks/ordinary_coverage.py --every 7 --law lugre
    python benchmarks/ordinary_coverage.py --plain        # gross sliding alone: five minutes

Logs are those of `ordinary_logs.py`, in which nothing of the package takes part. A second table shows plain least
squares: the inverse dynamics in four lines of numpy.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402

import ordinary_logs as logs  # noqa: E402
from stickslip.core.errors import StickslipError  # noqa: E402
from stickslip.identification.axis import identify_axis  # noqa: E402
from stickslip.identification.experiment import Experiment  # noqa: E402
from stickslip.identification.sliding import estimate_sliding  # noqa: E402
from stickslip.machines.servo import ServoAxis  # noqa: E402

AXIS = ServoAxis(drive_side="load")
NAMES = ("inertia", "fc", "sigma2", "offset", "fs", "vs", "sigma0", "skew")
ENOUGH = 20
TOLD = 0.25  # of a row: half-width of a skew up to which a torque carries information of it


@dataclass(frozen=True)
class Row:
    """One number of one log; errors and half-widths relative to the truth (offset: to fc; skew: in ms)."""

    about: dict[str, Any]
    name: str
    error: float
    half: float
    inside: bool
    identified: bool
    plain: float


def cells(first: int, every: int) -> Iterable[tuple[int, str, int, str, str, str]]:
    """Seed and cell of every log."""
    product = itertools.product(logs.COLUMNS, logs.RATES, logs.LOOPS, logs.MOTIONS, logs.IMPERFECTIONS)
    for number, cell in enumerate(product):
        if number % every == 0:
            yield (first + number, *cell)


def four_lines(log: logs.Log) -> dict[str, float]:
    """What a user would do: low-pass, differentiate twice, least squares where it moves."""
    dt = float(log.time[1] - log.time[0])
    smooth = np.hanning(max(5, round(0.03 / dt)))
    smooth /= smooth.sum()
    q, torque = (np.convolve(x, smooth, "same") for x in (log.position, log.torque))
    v = np.gradient(q, dt)
    a = np.gradient(v, dt)
    moving = np.abs(v) > 0.02 * np.max(np.abs(v))
    moving[: smooth.size] = moving[-smooth.size :] = False
    values = np.linalg.lstsq(np.column_stack([a, v, np.sign(v), np.ones(v.size)])[moving], torque[moving])[0]
    return dict(zip(("inertia", "sigma2", "fc", "offset"), values.tolist(), strict=True))


def study(task: tuple[tuple[int, str, int, str, str, str], str, bool, float]) -> tuple[list[Row], float]:
    """The numbers of one log, and the seconds that they took."""
    cell, law, plain, exponent = task
    log = logs.draw(*cell, exponent=exponent)
    experiment = Experiment("log", log.time, log.position, log.torque)
    begin = time.process_time()
    try:
        if plain:
            found = estimate_sliding([experiment], AXIS)
            level = found.numbers["fc"].value
            told = {
                n: (x.value, x.lower, x.upper, 0.0 < x.upper <= 2.0 * x.lower)
                for n, x in found.numbers.items()
            }
            told["offset"] = (*told["offset"][:3], found.numbers["offset"].half <= 0.1 * level)
        else:
            result = identify_axis([experiment], AXIS, [law] if law else ("coulomb", "stribeck", "lugre"))
            told = {e.name: (e.value, e.lower, e.upper, e.identified) for e in result.estimates}
            found = result.details["sliding"]
    except StickslipError as error:
        print(f"{cell}: {error}", file=sys.stderr)
        return [], time.process_time() - begin
    seconds = time.process_time() - begin
    if found is not None:
        skew = found.numbers["skew"]
        told["skew"] = (skew.value, skew.lower, skew.upper, skew.half <= TOLD * experiment.period)
    simple, rows = four_lines(log), list[Row]()
    for name in NAMES:
        if name not in told:
            continue
        value, low, high, good = told[name]
        truth = log.truth[name]
        unit = log.truth["fc"] if name == "offset" else 1e-3 if name == "skew" else truth
        rows.append(
            Row(log.about, name, (value - truth) / unit, 0.5 * (high - low) / unit, low <= truth <= high, bool(good),
                abs(simple[name] - truth) / unit if name in simple else np.nan)
        )  # fmt: skip
    return rows, seconds


def table(rows: Sequence[Row]) -> None:
    """Counts of every number."""
    print(f"{'number':9s} {'logs':>5s} {'identified':>11s} {'of these hold':>14s} {'|error|: median':>16s} {'p90':>7s} "
          f"{'worst':>7s} {'half-width':>11s} {'least squares':>14s}")  # fmt: skip
    for name in NAMES:
        mine = [r for r in rows if r.name == name]
        good = [r for r in mine if r.identified]
        if not good:
            continue
        errors = np.abs([r.error for r in good])
        print(
            f"{name:9s} {len(mine):5d} {len(good) / len(mine):11.0%} {np.mean([r.inside for r in good]):14.1%} "
            f"{np.median(errors):16.4f} {np.quantile(errors, 0.9):7.3f} {np.max(errors):7.3f} "
            f"{np.median([r.half for r in good]):11.4f} {np.median([r.plain for r in good]):14.4f}"
        )


def report(rows: Sequence[Row]) -> None:
    """All logs, then every kind of column, rate, loop, motion and imperfection."""
    table(rows)
    known = [r for r in rows if r.name == "skew" and r.identified]
    close = [abs(r.error) <= 100.0 / r.about["rate"] for r in known]
    print(f"skew within a tenth of a row: {np.mean(close):.1%} of {len(known)} that tell it to a quarter")
    asked = [
        r for r in rows if r.name in ("inertia", "fc") and r.about["motion"] in ("production", "staircase")
    ]
    print(
        f"J and fc identified on moves both ways at three speeds: {np.mean([r.identified for r in asked]):.1%}"
    )
    for key in ("column", "rate", "loop", "motion", "imperfection"):
        groups: dict[Any, list[Row]] = defaultdict(list)
        for r in rows:
            groups[r.about[key]].append(r)
        for value, mine in groups.items():
            parts: list[str] = []
            for name in NAMES:
                good = [r for r in mine if r.name == name and r.identified]
                if len(good) >= ENOUGH:
                    parts.append(f"{name} {np.mean([r.inside for r in good]):.0%} of {len(good)}")
            print(f"  {key} {value}: {', '.join(parts)}")


def furthest(rows: Sequence[Row], count: int) -> None:
    """What does not hold, and the largest errors of what is called identified, log by log."""
    for name in NAMES:
        good = [r for r in rows if r.name == name and r.identified]
        for r in sorted(good, key=lambda r: (r.inside, -abs(r.error)))[:count]:
            print(
                f"  {name} {r.error:+.3f} in {r.half:.3f}, {'holds' if r.inside else 'WRONG'}; least squares "
                f"{r.plain:.3f}: {' '.join(str(v) for v in r.about.values())}"
            )


def main() -> int:
    """Run the study."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--first", type=int, default=50_000, help="seed of the first cell")
    parser.add_argument("--every", type=int, default=1, help="every so many cells")
    parser.add_argument("--law", default="", help="one law; otherwise chosen as `identify` does")
    parser.add_argument("--plain", action="store_true", help="gross sliding alone")
    parser.add_argument("--exponent", type=float, default=2.0, help="of friction's fall in the logs")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    parser.add_argument(
        "--furthest", type=int, default=0, help="of each number, print so many of the worst logs"
    )
    args = parser.parse_args()
    tasks = [(c, args.law, args.plain, args.exponent) for c in cells(args.first, args.every)]
    with ProcessPoolExecutor(args.processes) as pool:
        results = list(pool.map(study, tasks, chunksize=2))
    rows = [r for found, _ in results for r in found]
    print(f"{len(tasks)} logs, seeds from {args.first}; {np.mean([s for _, s in results]):.2f} s of CPU each")
    report(rows)
    furthest(rows, args.furthest)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
