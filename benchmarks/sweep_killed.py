"""Twenty kills at random times: a sweep that was killed and resumed equals an undisturbed one row for row.

In every round a sweep is begun in a new folder and something is killed (SIGKILL) at a random moment: a worker process,
the client of a Dask scheduler, or the whole command with all its processes. Then the command is run to its end, and
every row compared with those of a sweep that nothing disturbed.

The moment is drawn inside the run: after a number of blocks that is drawn, and a part of the time that an undisturbed
run took for one. A round counts as a hit where what was killed lived and blocks were missing; rounds go on until
`--hits` have hit. Kinds take turns, numbers come from `--seed`.

    python benchmarks/sweep_killed.py [--hits 20]

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
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

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


def blocks_in(folder: Path) -> int:
    """Blocks that are kept there."""
    return sum(1 for _ in folder.rglob("part-*.npz"))


def moments(line: list[str], out: Path) -> list[float]:
    """Run the command undisturbed; seconds from its start to each block that it kept."""
    process, start, found = begun(line), time.monotonic(), list[float]()
    while process.poll() is None:
        found += [time.monotonic() - start] * (blocks_in(out) - len(found))
        time.sleep(0.005)
    return found + [time.monotonic() - start] * (blocks_in(out) - len(found))


def kill(process: subprocess.Popen[bytes], kind: str, rng: np.random.Generator) -> str:
    """Kill it, or one of its workers; says what, "" where there was nothing to kill."""
    if process.poll() is not None:
        return ""
    if kind == "worker":
        found = workers_of(process)
        while not found and process.poll() is None:
            time.sleep(0.005)
            found = workers_of(process)
        if not found:
            return ""
        victim = int(rng.choice(found))
        with contextlib.suppress(ProcessLookupError):
            os.kill(victim, signal.SIGKILL)
            return f"worker {victim}"
        return ""
    with contextlib.suppress(ProcessLookupError):
        if kind == "client":
            process.kill()
        else:
            os.killpg(process.pid, signal.SIGKILL)
    return f"the {kind}"


def disturbed(
    line: list[str], out: Path, kind: str, undisturbed: list[float], rng: np.random.Generator
) -> tuple[str, bool]:
    """Run the command and kill at a random moment inside; says what was killed when, and whether it hit."""
    process, start = begun(line), time.monotonic()
    after = int(rng.integers(0, len(undisturbed)))
    while process.poll() is None and blocks_in(out) < after:
        time.sleep(0.005)
    # After none the whole start counts: it may be killed before there is a worker.
    pause = undisturbed[after] - (undisturbed[after - 1] if after else 0.0)
    time.sleep(rng.uniform(0.0, 1.0) * pause)
    kept, what, moment = blocks_in(out), kill(process, kind, rng), time.monotonic() - start
    code = process.wait()
    # Only a command that outlives its worker ends well.
    hit = bool(what) and kept < len(undisturbed) and (kind == "worker" or code == -signal.SIGKILL)
    return f"{what or 'nothing'} after {moment:.2f} s and {kept} of {len(undisturbed)} blocks", hit


def rows(folder: Path) -> list[str]:
    """All rows of a data set, in order: a run's folder and the values of a case."""
    found: list[str] = []
    for path in sorted((folder / "data").rglob("part-*.npz")):
        with np.load(path) as data:
            columns = [data[name].tolist() for name in data.files if name != "__about__"]
        found += [f"{path.parent.name} {row}" for row in zip(*columns, strict=True)]
    return found


def main() -> None:
    """Kill, resume, compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--hits", type=int, default=20)
    parser.add_argument("--cases", type=int, default=1040)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    kinds, rounds, good = list(KINDS), 0, 0
    hits: Counter[str] = Counter()
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
        undisturbed: dict[str, list[float]] = {}
        for kind in kinds:
            out = Path(place) / f"undisturbed-{kind}"
            undisturbed[kind] = moments(command(sweep, out, kind, scheduler), out)
            print(f"undisturbed, {kind}: first block after {undisturbed[kind][0]:.1f} s, last of"
                  f" {len(undisturbed[kind])} after {undisturbed[kind][-1]:.1f} s", flush=True)  # fmt: skip
        sure = rows(Path(place) / "undisturbed-worker")
        while hits.total() < options.hits:
            kind = kinds[rounds % len(kinds)]
            out = Path(place) / f"round-{rounds}"
            line = command(sweep, out, kind, scheduler)
            what, hit = disturbed(line, out, kind, undisturbed[kind], rng)
            code = begun(line).wait()
            same = code == 0 and rows(out) == sure
            rounds, good = rounds + 1, good + same
            hits[kind] += hit
            verdict = "equal" if same else f"DIFFERS (exit {code})"
            print(f"{rounds:3d} {kind:8} {'hit ' if hit else 'miss'} {what}, then {verdict}", flush=True)
    print(f"{'PASS' if good == rounds else 'FAIL'}  {good} of {rounds} equal row for row; hits: {dict(hits)}")
    if good != rounds:
        sys.exit(1)


if __name__ == "__main__":
    main()
