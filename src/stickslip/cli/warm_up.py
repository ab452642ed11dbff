"""Compile everything in advance, so that the first calls after an installation start without delay.

stickslip warm-up

Runs small examples of the other verbs in a temporary folder; the compiled code is kept in the user's cache folder (or
STICKSLIP_CACHE). Takes a minute or two after an installation, and some seconds if nothing is left to compile.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import tempfile
import time
from collections.abc import Generator, Sequence
from pathlib import Path

SUMMARY = "compile everything once after installation"
STEPS: dict[str, Sequence[str]] = {
    "simulation": ("study", "thesis", "--only", "low,signed,nominal", "--no-report"),
    "a drive's controller": ("simulate", "drive.toml"),
    "a machine of elements": ("simulate", "machine.toml"),
    "pictures": ("law", "lugre", "--plot"),
    "identification and recommendation": ("demo",),
    "friction by direction": [
        "identify",
        "stickslip-demo/demo.csv",
        "--per-direction",
        "--no-report",
        "--out",
        "two.toml",
    ],
    "a cascade": [
        "recommend",
        "stickslip-demo/model.toml",
        "--loop",
        "kv=60,kvp=0.08,kvi=2",
        "--axes",
        "2",
        "--confirm",
        "3",
    ],
    "rigs": ("rig", "run", "breakaway", "--rig", "thesis-dry"),
    "sweeps": ("sweep", "thesis-robustness", "--cases", "1", "--jobs", "1", "--no-report"),
}
"""What is compiled, and the command that needs it."""
LOOP = """[reference]
kind = "sine"
amplitude = 0.01
frequency = 2.0
duration = 0.2
[controller]
linear = "PD"
placement = {bandwidth_hz = 20.0, damping = 1.0}
"""
AXIS = """[axis]
inertia = 4e-4
[friction]
law = "coulomb"
fc = 0.285
sigma2 = 0.018
"""
FILES = {
    "drive.toml": f"{AXIS}{LOOP}sample_time = 1e-3\nencoder_counts = 65536.0\n",
    "machine.toml": f'[machine]\nmachine = "ideal"\n{LOOP}',
}
"""A controller that takes samples has an engine of its own; so has a machine that moves along a located flow, which the
library's others do not."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """None."""


def run(args: argparse.Namespace) -> int:
    """Run the steps; say what each took. 1 if one failed."""
    from stickslip import compiling
    from stickslip.cli import main

    compiling.silence()  # it is what this verb says itself
    failed = 0
    with tempfile.TemporaryDirectory(prefix="stickslip-warm-up-") as folder, inside(folder):
        for name, text in FILES.items():
            Path(name).write_text(text, encoding="utf-8")
        for i, (what, words) in enumerate(STEPS.items(), 1):
            print(f"{i}/{len(STEPS)} {what} ...", end=" ", flush=True)
            begin, heard = time.perf_counter(), io.StringIO()
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(heard):
                code = main(words)
            print(
                f"{time.perf_counter() - begin:.0f} s" if code == 0 else f"failed: {heard.getvalue().strip()}"
            )
            failed += code != 0
    return 1 if failed else 0


@contextlib.contextmanager
def inside(folder: str) -> Generator[None]:
    """Work in a folder."""
    before = os.getcwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
