"""Run a loop in real time from Python, and record its timing statistics.

The garbage collector is stopped, other threads of the process yield within 50 µs, the process gets a real-time priority
and its memory stays in RAM if the system permits it, sleeps end on time instead of up to 50 µs late, and the time just
before a deadline is a busy wait. The account lists what was granted. See docs/howto/loop.md.
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
"""Times measured in every sample, ns."""

AWAKE = 80_000
"""Busy wait before a deadline, ns: the delay of a sleep on an ordinary kernel"""
PRIORITY = 50  # of SCHED_FIFO: above ordinary processes, below the kernel's own threads
PR_SET_TIMERSLACK = 29
MCL_CURRENT, MCL_ONFAULT = 1, 4
PERCENTILES = (50.0, 99.0, 99.9, 100.0)


@dataclass(frozen=True)
class Account:
    """Timing statistics of a loop; distributions are the 50th, 99th and 99.9th percentile and the maximum, s.

    Attributes
    ----------
    samples : int
    missed : int
        Deadlines missed: the loop was not ready for a sample when it was due. The schedule then restarts there.
    lateness : tuple of float
        From the due time of a sample until its torque was sent.
    own : tuple of float
        Time of the loop itself in a sample: limits, control, recording.
    control : tuple of float
        CPU time of the compiled control step (limits, controller and safety).
    empty : tuple of float
        CPU time of a compiled function that does nothing, in the same samples: call, clock and interrupts, which
        `control` contains too. Only in real time.
    faults, preempted : int
        Page faults of the loop's thread during its samples, and number of preemptions.
    granted : tuple of str
        Granted by the system: real-time priority, locked memory, precise sleeps.
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
        """Return plain data for a record's meta."""
        return asdict(self)

    def lines(self) -> list[str]:
        """Return lines of text."""
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
        """Set the next deadline a sample time from now, so earlier delays are not counted as missed."""
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
        """Return the array for the times of the next `count` samples: `TIMES`, in ns."""
        table = np.full((count, len(TIMES)), -1, dtype=np.int64)
        self._taken.append(table)
        return table

    def wait(self, rehearse: Callable[[], object]) -> int:
        """Wait for the deadline; return the delay, ns.

        During the busy wait `rehearse` is called, which loads the code of the sample into the processor's caches again.
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
        """Return the statistics so far."""
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
    """Return page faults and preemptions of this thread so far; zeros if the system does not report them."""
    try:
        import resource

        found = resource.getrusage(getattr(resource, "RUSAGE_THREAD", resource.RUSAGE_SELF))
    except ImportError:
        return 0, 0
    return found.ru_minflt + found.ru_majflt, found.ru_nivcsw


# ---- what the system can be asked for -----------------------------------------------------------------------


@contextmanager
def soft_real_time() -> Generator[tuple[str, ...]]:
    """Request everything that keeps a Python loop on time; yield what was granted, and undo it at the end."""
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
    """Set the timer slack: by default sleeps may end up to 50 µs late."""
    libc = _libc()
    if libc is None or libc.prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0) != 0:
        return None
    return lambda: libc.prctl(PR_SET_TIMERSLACK, 0, 0, 0, 0)  # 0: the default again


def _lock() -> Callable[[], None] | None:
    """Lock memory, so no page is loaded from disk inside the loop."""
    libc = _libc()
    if libc is None or libc.mlockall(MCL_CURRENT | MCL_ONFAULT) != 0:
        return None
    return libc.munlockall
