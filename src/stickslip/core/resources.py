"""What this machine can hold and do: what is asked for is estimated before it starts, and refused with its numbers."""

from __future__ import annotations

import contextlib
import math
import os
from pathlib import Path

from stickslip.core.errors import InputError

MOST_JOBS = 32
"""Workers per processor"""
LITTLE = 1e6
"""Bytes that are taken unasked: to look up what is free takes longer than a run of so few samples"""
LARGEST = 1e15
"""Of a count: beyond it neither memory nor a lifetime are enough, whatever is counted"""


def free_memory() -> float:
    """Memory that this process can still take, bytes: of the machine, its control group and its own limit."""
    found = [_of_machine(), _of_group(), _of_process()]
    return max(0.0, min(found))


def insist_on_memory(needed: float, what: str, remedy: str = "ask for less") -> None:
    """Refuse what does not fit into memory.

    Parameters
    ----------
    needed : float
        Bytes; infinite and NaN do not fit.
    what : str
        That needs them: "1e+12 samples of 0.001 s".
    remedy : str

    Raises
    ------
    InputError
        With both numbers.
    """
    if needed <= LITTLE:
        return
    free = free_memory()
    if not needed <= free:
        raise InputError(f"{what} need {size_text(needed)} of memory, {size_text(free)} are free; {remedy}")


def limit_memory(most: int) -> None:
    """Let this process hold that many bytes; where the system cannot, nothing is limited.

    What counts is memory that can be written: libraries reserve addresses far beyond what they ever use.
    """
    try:
        import resource
    except ModuleNotFoundError:  # Windows
        return
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    resource.setrlimit(
        resource.RLIMIT_DATA, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard)
    )


def insist_on_jobs(jobs: int) -> None:
    """Refuse numbers of workers that are none, or so many that starting them takes longer than the work.

    Raises
    ------
    InputError
    """
    cores = os.cpu_count() or 1
    if not 1 <= jobs <= MOST_JOBS * cores:
        raise InputError(
            f"jobs = {jobs} must be 1 to {MOST_JOBS * cores}, {MOST_JOBS} for each of {cores} processors"
        )


def number_of(length: float, step: float, each: float, what: str, remedy: str = "ask for less") -> int:
    """How many steps a length has, at least 1, each of which takes `each` bytes.

    Raises
    ------
    InputError
        If they do not fit into memory.
    """
    count = length / step if step > 0.0 else math.inf
    if not count < LARGEST:
        count = math.inf
    insist_on_memory(count * each, f"{what}: {count:.3g} steps of {step:.3g}", remedy)
    return max(1, round(count))


def size_text(size: float) -> str:
    """Bytes for people."""
    if not math.isfinite(size):
        return "more than any number of bytes"
    for unit in ("B", "kB", "MB", "GB", "TB", "PB"):
        if size < 999.5 or unit == "PB":
            return f"{size:.3g} {unit}"
        size /= 1000.0
    raise AssertionError


def _of_machine() -> float:
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        known = dict(line.split(":", 1) for line in lines if ":" in line)
        return 1024.0 * float(known["MemAvailable"].split()[0])
    except (OSError, KeyError, ValueError):
        pass
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, OSError, ValueError):
        return 8e9  # where the system does not say


def _of_group() -> float:
    """What a container leaves."""
    for most, used in (
        ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
        ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes"),
    ):
        with contextlib.suppress(OSError, ValueError):
            return float(Path(most).read_text()) - float(Path(used).read_text())
    return math.inf


def _of_process() -> float:
    try:
        import resource

        most = resource.getrlimit(resource.RLIMIT_AS)[0]
        used = float(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        return math.inf if most == resource.RLIM_INFINITY else most - used
    except (ImportError, OSError, ValueError):
        return math.inf
