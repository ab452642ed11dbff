"""Fuzz the readers and the doctor: damaged and invented files end in a record or in one line, never otherwise.

python tests/fuzz/readers.py --minutes 5 [--seed 0]
"""

from __future__ import annotations

import argparse
import contextlib
import io
import random
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "readers"))

from test_formats import SCOPE, WRITERS

from stickslip.cli import main

PIECES = (
    b"nan",
    b"inf",
    b"-",
    b"1e999",
    b",",
    b";",
    b"\t",
    b'"',
    b"\n",
    b"\r",
    b"\x00",
    b"\xff\xfe",
    b"[",
    b"{",
    b"}",
    b"]",
    b"null",
    b"time",
    b"position",
    b"1,5",
    b"2024-05-01 12:00:00",
    b"0x10",
    b"1_0",
    b"EOF",
    b"#",
    b"%",
    b":",
    b"@load",
    b"[deg]",
    b"\xc2\xb0",
    "N·m".encode(),
    b"9" * 400,
    b"-0",
    b"1.2.3",
)
WORDS = (
    "time",
    "t",
    "position [deg]",
    "pos1",
    "pos2",
    "velocity",
    "torque [%]",
    "torque [Nm]",
    "I_q [mA]",
    "Zeit;",
    "",
    "Name",
    'a"b',
    "load",
)
OPTIONS = (
    [],
    [],
    ["--map", "position=position:deg"],
    ["--sample-time", "1e-3"],
    ["--rated-torque", "2"],
    ["--counts-per-rev", "4096"],
    ["--torque-constant", "0.1"],
    ["--map", "time=column 1:ms", "--map", "position=column 2"],
)


def seeds(folder: Path) -> list[bytes]:
    """One good file of every format."""
    out = []
    for name, write in WRITERS:
        write(folder / name)
        out.append((folder / name).read_bytes())
    out.append((SCOPE + "\n".join(f"{i}\t{i}\t{i}\t{i}" for i in range(40))).encode())
    return out


def damaged(rng: random.Random, data: bytes) -> bytes:
    """A file with a few bytes changed, pieces put in or taken out, or an end cut off."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5, 20))):
        at = rng.randrange(len(out)) if out else 0
        if rng.random() < 0.5:  # the beginning is where formats are decided
            at = min(at, rng.randrange(600))
        what = rng.random()
        if what < 0.4 and out:
            out[at] = rng.randrange(256)
        elif what < 0.65:
            out[at:at] = rng.choice(PIECES)
        elif what < 0.8:
            del out[at : at + rng.choice((1, 4, 50, 1000))]
        elif what < 0.9:
            out[at:at] = out[at : at + rng.randrange(200)]
        else:
            del out[rng.randrange(len(out) + 1) :]
    return bytes(out)


def invented(rng: random.Random) -> bytes:
    """A text table of odd names and odd numbers."""
    delimiter = rng.choice((",", ";", "\t", " ", "|"))
    width, length = rng.randrange(1, 8), rng.choice((0, 1, 2, 19, 40, 300))
    kinds = [rng.randrange(7) for _ in range(width)]
    lines = [delimiter.join(rng.choice(WORDS) for _ in range(width))] if rng.random() < 0.8 else []
    for i in range(length):
        cells = [_cell(rng, kind, i) for kind in kinds]
        if rng.random() < 0.01:
            cells = cells[: rng.randrange(width + 1)]
        lines.append(delimiter.join(cells))
    return "\n".join(lines).encode(rng.choice(("utf-8", "utf-16", "utf-8-sig")))


def _cell(rng: random.Random, kind: int, i: int) -> str:
    if rng.random() < 0.01:
        return rng.choice(PIECES).decode("latin-1")
    with np.errstate(all="ignore"):
        return (
            str(i * 1e-3),
            str(np.sin(i * 0.1) * 10.0 ** rng.choice((-300, 0, 0, 0, 300))),
            "1",
            str(rng.randrange(-500, 500)),
            str(rng.random()),
            "",
            str(i * 10**15),
        )[kind]


def attempt(path: Path, options: list[str]) -> int | str:
    """The doctor's exit code, or the traceback."""
    out, err = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = main(
                ["doctor", str(path), "--json", "--profile", str(path.parent / "none.toml"), *options]
            )
    except BaseException:
        return traceback.format_exc()
    (path.parent / "none.toml").unlink(missing_ok=True)
    if code not in (0, 2) or (code == 2 and err.getvalue().count("\n") > 1):
        return f"exit code {code}: {err.getvalue()}"
    return code


def run(minutes: float, seed: int) -> int:
    """Fuzz for so long; prints what crashed and returns how often."""
    rng = random.Random(seed)
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        good = seeds(folder)
        end = time.monotonic() + 60.0 * minutes
        while time.monotonic() < end:
            data = invented(rng) if rng.random() < 0.3 else damaged(rng, rng.choice(good))
            path = folder / f"fuzz{rng.choice(('.csv', '.mat', '.json', '.npz', '.dat', ''))}"
            path.write_bytes(data)
            outcome = attempt(path, rng.choice(OPTIONS))
            path.unlink()
            if isinstance(outcome, str):
                counts["crashed"] += 1
                kept = Path(tempfile.gettempdir()) / f"crash{counts['crashed']}{path.suffix}"
                kept.write_bytes(data)
                print(f"{kept}\n{outcome}", flush=True)
                if counts["crashed"] >= 20:
                    break
            counts["files"] += 1
            counts[f"exit code {outcome}" if isinstance(outcome, int) else "crashed files"] += 1
    print(dict(counts))
    return counts["crashed"]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    sys.exit(1 if run(arguments.minutes, arguments.seed) else 0)
