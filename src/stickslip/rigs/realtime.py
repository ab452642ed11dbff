"""Keeping pace with the clock from Python, and the account of how well that went.

What a soft real-time loop in Python can do, it does: the garbage collector is stopped, other threads of the process
give way within 50 µs, the process gets a real-time priority and its memory stays in RAM where the system permits it,
sleeps end on time instead of up to 50 µs late, and the last stretch before a deadline is waited for awake. What was
granted is in the account. See docs/howto/loop.md.
"""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import time
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

TIMES = ("lateness", "own", "control", "empty")
"""What is timed of every sample, in ns."""

AWAKE = 80_000
"""ns before a deadline that are waited for awake: what a sleep may come late on an ordinary kernel"""
PRIORITY = 50  # of SCHED_FIFO: above everything ordinary, below the kernel's own threads
PR_SET_TIMERSLACK = 29
MCL_CURRENT, MCL_ONFAULT = 1, 4
PERCENTILES = (50.0, 99.0, 99.9, 100.0)


@dataclass(frozen=True)
class Account:
    """How a loop kept its time; distributions are the 50th, 99th and 99.9th percentile and the greatest, s.

    Attributes
    ----------
    samples : int
    missed : int
        Deadlines missed: the loop was not ready for a sample when it was due. The schedule then begins anew there.
    lateness : tuple of float
        From when a sample was due until its torque was handed over.
    own : tuple of float
        What the loop itself does in a sample, by the clock: limits, control, recording.
    control : tuple of float
        CPU time of the compiled control step (limits, controller and safety).
    empty : tuple of float
        CPU time of a compiled function that does nothing, by the same clock in the same samples: what calling it, the
        clock itself and the machine's interrupts take, which are in `control` too. Only in real time.
    faults, preempted : int
        Pages that the loop's thread had to fetch during its samples, and how often the processor was taken from it.
    granted : tuple of str
        What the system granted: real-time priority, locked memory, precise sleeps.
    """

    samples: int
    missed: int
    lateness: tuple[float, ...]
    own: tuple[float, ...]
    control: tuple[float, ...]
    granted: tuple[str, ...]
    empty: tuple[float, ...] = ()
    faults: int = 0
    preempted: int = 0

    def plain(self) -> dict[str, Any]:
        """As plain data, for a record's meta."""
        return asdict(self)

    def lines(self) -> list[str]:
        """For people, a line each."""
        out = [f"{self.samples} samples, {self.missed} deadlines missed"]
        for name, values in (
            ("late", self.lateness),
            ("own time", self.own),
            ("control, CPU", self.control),
            ("  empty step", self.empty),
        ):
            if values:
                figures = ", ".join(
                    f"{label} {1e6 * value:.1f}"
                    for label, value in zip(("median", "99 %", "99.9 %", "greatest"), values, strict=True)
                )
                out.append(f"{name:<13} {figures} µs")
        if self.empty:
            out.append(f"{self.faults} pages fetched, {self.preempted} times preempted")
        return out


class Pace:
    """Deadlines a sample time apart."""

    def __init__(self, sample_time: float) -> None:
        self._period = round(1e9 * sample_time)
        self._due = 0
        self.missed = 0
        self.granted: tuple[str, ...] = ()
        self._taken: list[np.ndarray[Any, np.dtype[np.int64]]] = []
        self._faults = self._preempted = 0

    def restart(self) -> None:
        """The next deadline is a sample time from now: what took long before is no miss."""
        self._due = 0

    @contextmanager
    def counting(self) -> Generator[None]:
        """Count page faults and preemptions while the samples run."""
        faults, preempted = usage()
        try:
            yield
        finally:
            now = usage()
            self._faults += now[0] - faults
            self._preempted += now[1] - preempted

    def room(self, count: int) -> np.ndarray[Any, np.dtype[np.int64]]:
        """Where the times of the next `count` samples go: `TIMES`, in ns."""
        table = np.full((count, len(TIMES)), -1, dtype=np.int64)
        self._taken.append(table)
        return table

    def wait(self, rehearse: Callable[[], object]) -> int:
        """Wait for the deadline; returns by how much it is late, ns.

        While it is waited for awake, `rehearse` is called: what the sample will run is then in the processor's caches,
        which other processes have used meanwhile.
        """
        now = time.monotonic_ns()
        if self._due == 0:
            self._due = now + self._period
        if now > self._due:
            self.missed += 1
            self._due = now
        elif self._due - now > AWAKE:
            time.sleep(1e-9 * (self._due - now - AWAKE))
            rehearse()
        while now < self._due:
            now = time.monotonic_ns()
        late = now - self._due
        self._due += self._period
        return late

    def account(self) -> Account:
        """What has been measured so far."""
        taken = np.concatenate(self._taken) if self._taken else np.zeros((0, len(TIMES)), dtype=np.int64)
        columns = [column[column >= 0] for column in taken.T]
        late, own, control, empty = (
            tuple(float(1e-9 * x) for x in np.percentile(c, PERCENTILES)) if c.size else () for c in columns
        )
        return Account(
            columns[1].size,
            self.missed,
            late,
            own,
            control,
            self.granted,
            empty,
            self._faults,
            self._preempted,
        )


def usage() -> tuple[int, int]:
    """Page faults of this thread so far, and how often it was preempted; zeros where the system does not say."""
    try:
        import resource

        found = resource.getrusage(getattr(resource, "RUSAGE_THREAD", resource.RUSAGE_SELF))
    except ImportError:
        return 0, 0
    return found.ru_minflt + found.ru_majflt, found.ru_nivcsw


# ---- what the system can be asked for -----------------------------------------------------------------------


@contextmanager
def soft_real_time() -> Generator[tuple[str, ...]]:
    """Ask for everything that keeps a Python loop on time; gives what was granted, undoes it at the end."""
    with ExitStack() as undo:
        granted = ["garbage collector off"]
        gc.collect()
        gc.freeze()
        gc.disable()
        undo.callback(gc.unfreeze)
        undo.callback(gc.enable)
        undo.callback(sys.setswitchinterval, sys.getswitchinterval())
        sys.setswitchinterval(5e-5)
        for title, request in (
            ("real-time priority", _priority),
            ("precise sleeps", _slack),
            ("locked memory", _lock),
        ):
            restore = request()
            if restore is not None:
                undo.callback(restore)
                granted.append(title)
        yield tuple(granted)


def _priority() -> Callable[[], None] | None:
    if not hasattr(os, "sched_setscheduler"):
        return None
    policy, parameter = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except OSError:
        return None
    return lambda: os.sched_setscheduler(0, policy, parameter)


def _libc() -> Any:
    return ctypes.CDLL(None, use_errno=True) if sys.platform == "linux" else None


def _slack() -> Callable[[], None] | None:
    """Sleeps may by default end up to 50 µs late."""
    libc = _libc()
    if libc is None or libc.prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0) != 0:
        return None
    return lambda: libc.prctl(PR_SET_TIMERSLACK, 0, 0, 0, 0)  # 0: the default again


def _lock() -> Callable[[], None] | None:
    """Keep what is in memory there: no page comes back from the disk inside the loop."""
    libc = _libc()
    if libc is None or libc.mlockall(MCL_CURRENT | MCL_ONFAULT) != 0:
        return None
    return libc.munlockall
