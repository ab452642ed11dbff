"""What the default `stickslip identify` of a 25,000-row CSV takes, as a later process: report written, kernels cached.

Simulated records (`coverage_records.py`) of several laws, and EMPS where its record is at hand (STICKSLIP_DATA), are
written as CSV and identified by the command line as a user would call it, a warming call first. CPU time (user and
system) and time elapsed of the whole process, the best of `--repeats`; --profile shows where one process spends it.

    python benchmarks/identify_speed.py [--repeats 3] [--only NAME ...] [--keep FOLDER] [--profile]

Prints PASS or FAIL for the bar: 3 s elapsed.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from coverage_records import make

ROWS, LIMIT = 25_000, 3.0
SEEDS = {"coulomb": 18100, "stribeck": 18101, "lugre": 18102, "gms": 18103}
EMPS = Path(os.environ.get("STICKSLIP_DATA", "../shared/data")) / "emps" / "DATA_EMPS.mat"
IDENTIFY = ["-m", "stickslip", "identify"]
AS_INSTALLED = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
"""With the package's bytecode kept, as an installation has it."""


def written(folder: Path) -> dict[str, list[str]]:
    """Write the records; by name, what follows `stickslip identify`."""
    calls: dict[str, list[str]] = {}
    for family, seed in SEEDS.items():
        record = make(seed, family, rows=ROWS).record
        table = np.column_stack([record.time, record["position"], record["torque"]])
        calls[family] = [str(saved(folder / f"{family}.csv", "time [s],position [rad],torque [N·m]", table))]
    if EMPS.exists():
        from scipy.io import loadmat

        data = loadmat(EMPS)
        table = np.column_stack([data[k].ravel() for k in ("t", "qm", "vir")])
        path = saved(folder / "emps.csv", "time [s],position [m],voltage [V]", table)
        calls["emps"] = [str(path), "--drive-gain", str(float(data["gtau"].item()))]
    return calls


def saved(path: Path, header: str, table: np.ndarray) -> Path:
    """Write a table as CSV."""
    np.savetxt(path, table, fmt="%.10g", delimiter=",", header=header, comments="", encoding="utf-8")
    return path


def taken(command: list[str]) -> tuple[float, float, str]:
    """Time elapsed and CPU time of a process, s, and what it printed."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(
        [sys.executable, *command], capture_output=True, text=True, check=False, env=AS_INSTALLED
    )
    elapsed, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise SystemExit(done.stderr)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return elapsed, cpu, done.stdout


def main() -> int:
    """Print the table; exit code 1 where the bar is missed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--only", nargs="+", metavar="NAME", default=[])
    parser.add_argument(
        "--keep", type=Path, help="write records and results here instead of a temporary folder"
    )
    parser.add_argument(
        "--profile", action="store_true", help="print the result and where a process spends its time"
    )
    options = parser.parse_args()
    good = True
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        print(
            f"load {os.getloadavg()[0]:.1f}\n{'record':10s}{'elapsed, s':>12s}{'CPU, s':>9s}  bar {LIMIT:g} s"
        )
        for name, call in written(folder).items():
            if options.only and name not in options.only:
                continue
            command = [*IDENTIFY, *call, "--out", str(folder / name)]
            _, _, said = taken(command)
            times = [taken(command)[:2] for _ in range(options.repeats)]
            elapsed, cpu = (min(t) for t in zip(*times, strict=True))
            good &= elapsed <= LIMIT
            print(
                f"{name:10s}{elapsed:12.2f}{cpu:9.2f}  {'PASS' if elapsed <= LIMIT else 'FAIL'}", flush=True
            )
            if options.profile:
                print(said)
                print(taken(["-m", "cProfile", "-s", "tottime", *command])[2][:6000])
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
