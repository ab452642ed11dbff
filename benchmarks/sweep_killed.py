"""Twenty kills at random times: a sweep that was killed and resumed equals an undisturbed one row for row.

In every round a sweep is begun in a new folder and something is killed (SIGKILL) at a random moment: a worker process,
the client of a Dask scheduler, or the whole command with all its processes. Then the command is run to its end, and
every row compared with those of a sweep that nothing disturbed. Moments and kinds come from `--seed`.

    python benchmarks/sweep_killed.py [--rounds 20]

Needs Dask (`pip install 'stickslip[dask]'`) for the client; without it the other two are killed.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.dataset

SWEEP = """
study = "thesis"
only = ["signed", "low", "nominal", "PD", "FF-gms"]
method = "sobol"
cases = {cases}
seed = 1
tolerance = 1e-6
metrics = ["position_rms_rad", "velocity_rms_rad_s"]
[vary."friction.fs"]
scale = [0.8, 1.2]
[vary."axis.inertia"]
scale = [0.8, 1.2]
"""
KINDS = ("worker", "client", "command")


def command(sweep: Path, out: Path, kind: str, scheduler: str) -> list[str]:
    """The command line of a round."""
    where = {
        "worker": ["--processes"], "client": ["--scheduler", scheduler], "command": ["--processes"],
    }[kind]  # fmt: skip
    return [
        sys.executable, "-m", "stickslip", "sweep", str(sweep), "--out", str(out), "--no-report", "--jobs", "2",
        *where,
    ]  # fmt: skip


def begun(line: list[str]) -> subprocess.Popen[bytes]:
    """Start the command in a process group of its own."""
    return subprocess.Popen(
        line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


def workers_of(process: subprocess.Popen[bytes]) -> list[int]:
    """Worker processes of a command."""
    listed = subprocess.run(
        ["ps", "-o", "pid=,args=", "--ppid", str(process.pid)], capture_output=True, text=True, check=False
    )
    lines = [line.split(None, 1) for line in listed.stdout.splitlines()]
    return [int(pid) for pid, *args in lines if args and "loky" in args[0] and "tracker" not in args[0]]


def disturbed(process: subprocess.Popen[bytes], kind: str, rng: np.random.Generator, longest: float) -> str:
    """Kill at a random moment; says what was killed, and when."""
    after = rng.uniform(0.3, longest)
    start = time.monotonic()
    while time.monotonic() - start < after and process.poll() is None:
        time.sleep(0.01)
    killed = "nothing (it had ended)"
    if process.poll() is None:
        if kind == "worker":
            while process.poll() is None and not (found := workers_of(process)):
                time.sleep(0.02)
            if process.poll() is None:
                victim = int(rng.choice(found))
                with contextlib.suppress(ProcessLookupError):
                    os.kill(victim, signal.SIGKILL)
                    killed = f"worker {victim}"
        elif kind == "client":
            process.kill()
            killed = "the client"
        else:
            os.killpg(process.pid, signal.SIGKILL)
            killed = "the command"
    moment = time.monotonic() - start
    process.wait()
    return f"{killed} after {moment:.2f} s"


def rows(folder: Path) -> Any:
    """All rows of a data set, in order."""
    table = pyarrow.dataset.dataset(folder / "data", partitioning="hive", exclude_invalid_files=True)
    return table.to_table().sort_by([("controller", "ascending"), ("case", "ascending")])


def main() -> None:
    """Kill, resume, compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--cases", type=int, default=520)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    kinds, good, hit = list(KINDS), 0, 0
    with tempfile.TemporaryDirectory() as place, contextlib.ExitStack() as stack:
        scheduler = ""
        try:
            distributed: Any = importlib.import_module("distributed")
            local = {"host": "127.0.0.1", "dashboard_address": None, "local_directory": f"{place}/dask"}
            cluster = stack.enter_context(
                distributed.LocalCluster(n_workers=2, threads_per_worker=1, **local)
            )
            scheduler = cluster.scheduler_address
        except ImportError:
            print("Dask is missing: no client is killed")
            kinds.remove("client")
        sweep = Path(place) / "killed.toml"
        sweep.write_text(SWEEP.format(cases=options.cases))
        start = time.monotonic()
        begun(command(sweep, Path(place) / "undisturbed", "worker", scheduler)).wait()
        longest = time.monotonic() - start
        sure = rows(Path(place) / "undisturbed")
        for i in range(options.rounds):
            kind = kinds[i % len(kinds)]
            out = Path(place) / f"round-{i}"
            line = command(sweep, out, kind, scheduler)
            what = disturbed(begun(line), kind, rng, longest)
            kept = len(list(out.rglob("*.parquet")))
            code = begun(line).wait()
            same = code == 0 and rows(out).equals(sure)
            good += same
            hit += "nothing" not in what
            verdict = "equal" if same else f"DIFFERS (exit {code})"
            print(f"{i + 1:3d} {kind:8} {what}; {kept} blocks were kept: {verdict}", flush=True)
    print(f"{'PASS' if good == options.rounds else 'FAIL'}  {good} of {options.rounds} equal row for row,"
          f" {hit} of them hit while running")  # fmt: skip
    if good != options.rounds:
        sys.exit(1)


if __name__ == "__main__":
    main()
