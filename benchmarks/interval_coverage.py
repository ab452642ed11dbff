"""Coverage: do 95 % intervals contain the truth, and is what is called identified well determined?

Simulated records (`coverage_records.py`) are identified with their true law given and nothing else, and counted.
Parallel over records.

    python benchmarks/interval_coverage.py [--records 200] [--first 0] [--jobs 2] [--short] [--rows FILE]

Every bar is printed with PASS or FAIL: J, Fc, sigma2 identified in at least 95 % of the records; Fs and vs in every
record with at least 3 speeds below 2 vs; 95 % intervals that contain the truth 90 to 99 % of the time, for each
parameter with at least 100 verdicts; upper/lower at most 2 (positive), half-width at most 5 % of Fc (signed). A speed
is a level that the axis kept: where it sticks and slips it has none, and what the record then tells of Fs and vs is
printed beside the bar (--kept 3 draws only records with three such levels). So is the coverage without the verdict.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from coverage_records import make  # noqa: E402
from stickslip.core.errors import StickslipError  # noqa: E402
from stickslip.identification.axis import identify_axis  # noqa: E402
from stickslip.identification.experiment import experiment_of  # noqa: E402
from stickslip.machines.servo import ServoAxis  # noqa: E402

ALWAYS = ("inertia", "fc", "sigma2")
STRIBECK = ("fs", "vs")
SLOW_LEVELS = 3
ENOUGH = 100


@dataclass(frozen=True)
class Row:
    """One parameter of one record."""

    seed: int
    family: str
    slow_levels: int
    slow_held: int
    name: str
    truth: float
    value: float
    lower: float
    upper: float
    identified: bool
    seconds: float

    @property
    def inside(self) -> bool:
        """Whether the interval contains the truth."""
        return self.lower <= self.truth <= self.upper


def study(seed: int) -> list[Row]:
    """Identify the record of a seed; no rows where the package refuses it."""
    case = make(seed)
    axis = ServoAxis(drive_side="load")
    begin = time.process_time()
    try:
        found = identify_axis([experiment_of(case.record, axis)], axis, [case.model.law])
    except StickslipError as error:
        print(f"seed {seed} ({case.family}): {error}", file=sys.stderr)
        return []
    seconds = time.process_time() - begin
    return [
        Row(seed, case.family, case.slow_levels, case.slow_held, e.name, case.truth[e.name], e.value, e.lower, e.upper,
            e.identified, seconds)
        for e in found.estimates if e.name in case.truth and "[" not in e.name
    ]  # fmt: skip


def kept(path: Path | None) -> list[Row]:
    """The rows that an earlier run left."""
    if path is None or not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return [
            Row(
                int(r["seed"]), r["family"], int(r["slow_levels"]), int(r["slow_held"]), r["name"],
                float(r["truth"]), float(r["value"]),
                float(r["lower"]), float(r["upper"]), r["identified"] == "True", float(r["seconds"]),
            )
            for r in csv.DictReader(file)
        ]  # fmt: skip


def verdict(name: str, good: bool, text: str) -> bool:
    """Print a bar."""
    print(f"  {'PASS' if good else 'FAIL'}  {name}: {text}")
    return good


def report(rows: Sequence[Row], records: int) -> bool:
    """Print the counts; whether every bar is met."""
    good = True
    names = list(dict.fromkeys(r.name for r in rows))
    print(f"\n{records} records, {len({r.seed for r in rows})} identified")
    print(
        f"{'parameter':10s} {'cases':>5s} {'called identified':>18s} {'covered of these':>17s} {'covered of all':>15s}"
    )
    for name in names:
        mine = [r for r in rows if r.name == name]
        called = [r for r in mine if r.identified]
        within = sum(r.inside for r in called) / max(len(called), 1)
        print(f"{name:10s} {len(mine):5d} {len(called):10d} = {len(called) / len(mine):4.0%} "
              f"{within:17.1%} {sum(r.inside for r in mine) / len(mine):15.1%}")  # fmt: skip
    print("\nbars")
    for name in ALWAYS:
        called = sum(r.identified for r in rows if r.name == name)
        good &= verdict(f"{name} identified", called >= 0.95 * records, f"{called} of {records}")
    for name in STRIBECK:
        mine = [r for r in rows if r.name == name and r.slow_held >= SLOW_LEVELS]
        called = sum(r.identified for r in mine)
        good &= verdict(
            f"{name} identified where the axis kept {SLOW_LEVELS} slow levels",
            called == len(mine),
            f"{called} of {len(mine)}",
        )
        asked = [r for r in rows if r.name == name and r.slow_levels >= SLOW_LEVELS]
        print(f"        where the reference asks for so many, kept or not: "
              f"{sum(r.identified for r in asked)} of {len(asked)}")  # fmt: skip
    for name in names:
        called = [r for r in rows if r.name == name and r.identified]
        if len(called) >= ENOUGH:
            within = sum(r.inside for r in called) / len(called)
            good &= verdict(f"{name} covered", 0.90 <= within <= 0.99, f"{within:.1%} of {len(called)}")
    return good


def seeds_from(first: int, count: int, kept: int) -> Sequence[int]:
    """So many seeds from the first, those whose axis kept enough slow levels."""
    if not kept:
        return range(first, first + count)
    found: list[int] = []
    for seed in itertools.count(first):
        if len(found) == count:
            return found
        case = make(seed)
        if "vs" in case.truth and case.slow_held >= kept:
            found.append(seed)
    return found


def main() -> int:
    """Run the study; exit code 1 where a bar is missed and the run was a full one."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--records", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="seed of the first record")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--short", action="store_true", help="20 records")
    parser.add_argument(
        "--kept",
        type=int,
        default=0,
        help="only records of a Stribeck effect whose axis kept so many slow levels",
    )
    parser.add_argument(
        "--rows", type=Path, help="write every row to this CSV file; seeds that it holds are not run again"
    )
    options = parser.parse_args()
    count = 20 if options.short else options.records
    wanted = seeds_from(options.first, count, options.kept)
    rows = [r for r in kept(options.rows) if r.seed in wanted]
    done = {r.seed for r in rows}
    with ProcessPoolExecutor(options.jobs) as pool:
        for found in pool.map(study, [s for s in wanted if s not in done]):
            rows += found
            if options.rows and found:
                fresh = not options.rows.exists()
                with options.rows.open("a", newline="", encoding="utf-8") as file:
                    out = csv.DictWriter(file, asdict(found[0]))
                    if fresh:
                        out.writeheader()
                    out.writerows(asdict(r) for r in found)
    good = report(rows, count)
    seconds = {r.seed: r.seconds for r in rows}
    print(f"\nCPU per record {sum(seconds.values()) / max(len(seconds), 1):.2f} s")
    return 0 if good or count < ENOUGH else 1


if __name__ == "__main__":
    sys.exit(main())
