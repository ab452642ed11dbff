"""Compile everything in advance, so the first calls after an installation start without delay.

stickslip warm-up

Runs small examples of the other verbs in a temporary folder; the compiled code is kept in the user's cache folder (or
STICKSLIP_CACHE). Takes a few minutes after an installation, and some seconds if nothing is left to compile.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import tempfile
import time
from collections.abc import Callable, Generator, Sequence
from pathlib import Path

from stickslip.cli.demo import LOOP as LOOP_OF_LOG
from stickslip.core.arguments import arguments_checked
from stickslip.core.errors import StickslipError

SUMMARY = "compile everything once after installation"
LOOPS = {
    "a PD with a filter": "kp=1.6,kd=0.05,kr=0.05,filter=300",
    "a PID": "kp=1.6,ki=8,kd=0.05,kr=0.05",
    "a PID with a filter": "kp=1.6,ki=8,kd=0.05,kr=0.05,filter=300",
    "a cascade": "kv=60,kvp=0.08,kvi=2",
    "a cascade with a filter": "kv=60,kvp=0.08,kvi=2,filter=300",
}
"""Typical loops of drives, in addition to the PD of the demonstration: each is compiled with its control laws."""
IDENTIFY = ("identify", "demo.csv")
# The fewest axes: more of them compile nothing.
RECOMMEND = ("recommend", "axis/model.toml", "--axes", "1", "--confirm", "1")
STEPS: dict[str, Sequence[str]] = {
    "simulation": ("study", "thesis", "--only", "low,signed,nominal", "--no-report"),
    "a drive's controller": ("simulate", "drive.toml"),
    "a machine of elements": ("simulate", "machine.toml"),
    "pictures": ("law", "lugre", "--plot"),
    "a log": ("demo", "--log", "demo.csv"),
    "the doctor": ("doctor", "demo.csv"),
    "identification": (
        *IDENTIFY,
        "--law",
        "coulomb",
        "--law",
        "stribeck",
        "--loop",
        LOOP_OF_LOG,
        "--out",
        "axis",
    ),
    "friction by direction": (*IDENTIFY, "--per-direction", "--no-report", "--out", "two.toml"),
    "recommendation": (*RECOMMEND, "--bandwidth", "20", "--counts-per-rev", "65536", "--torque-limit", "3"),
    **{what: (*RECOMMEND, "--loop", gains) for what, gains in LOOPS.items()},
    "rigs": ("rig", "run", "breakaway", "--rig", "thesis-dry"),
    "sweeps": ("sweep", "thesis-robustness", "--cases", "1", "--jobs", "1", "--no-report"),
}
"""Compiled parts, and the commands that need them."""
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
"""A sampled controller has its own engine; so has a machine that moves along a located flow, unlike the others of the
library."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """None."""


def run(args: argparse.Namespace) -> int:
    """Run the steps and print their durations; return 1 if one failed."""
    from stickslip.core import compile_notice

    compile_notice.silence()  # printed by this verb itself
    return 1 if failures(lambda text, end: print(text, end=end, flush=True)) else 0


@arguments_checked
def warm_up(tell: Callable[[str], None] = print) -> None:
    """Compile everything in advance, as `stickslip warm-up` does, so later calls start without delay.

    The compiled code is kept in the user's cache folder (or STICKSLIP_CACHE), for later processes too. It takes a
    minute or two after an installation, and some seconds if nothing is left to compile. Until it returns, the process
    works in a temporary folder.

    Parameters
    ----------
    tell : callable
        Called with a line for each compiled part and its duration.

    Raises
    ------
    StickslipError
        If something could not be compiled; names it and the reason.
    """
    line = ""

    def say(text: str, end: str) -> None:
        nonlocal line
        line += text + end
        if end == "\n":
            tell(line.rstrip())
            line = ""

    if failed := failures(say):
        raise StickslipError(f"not everything is compiled: {'; '.join(failed)}")


def failures(say: Callable[[str, str], None]) -> list[str]:
    """Run the steps; return those that failed. `say` gets a text and its line end."""
    from stickslip.cli import main

    failed: list[str] = []
    with tempfile.TemporaryDirectory(prefix="stickslip-warm-up-") as folder, inside(folder):
        for name, text in FILES.items():
            Path(name).write_text(text, encoding="utf-8")
        for i, (what, words) in enumerate(STEPS.items(), 1):
            say(f"{i}/{len(STEPS)} {what} ...", " ")
            begin, heard = time.perf_counter(), io.StringIO()
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(heard):
                code = main(words)
            why = heard.getvalue().strip()
            say(f"{time.perf_counter() - begin:.0f} s" if code == 0 else f"failed: {why}", "\n")
            failed += [f"{what}: {why}"] if code else []
    return failed


@contextlib.contextmanager
def inside(folder: str) -> Generator[None]:
    """Work in a folder."""
    before = os.getcwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
