"""Long compiled calls: who is told how far one has come, and how Ctrl-C ends it. Imports nothing heavy."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from queue import SimpleQueue
from typing import NamedTuple, TypeVar

Result = TypeVar("Result")
FIRST = 2.0
"""s until the first word; each later one comes after twice the time of the one before."""


class Reached(NamedTuple):
    """How far a run has come."""

    time: float
    """s of the motion"""
    of: float
    """s"""
    steps: float


Listener = Callable[[str], None]
_listeners: list[Listener] = []


def listen(listener: Listener) -> None:
    """Tell this one from now on: it gets a line."""
    _listeners.append(listener)


class Watch:
    """Looks at a run now and then; says how far it is and, at the pace since it was last looked at, what is left.

    Parameters
    ----------
    reached : callable
        Gives the `Reached` of now.
    clock : callable
        s, ascending.
    """

    def __init__(self, reached: Callable[[], Reached], clock: Callable[[], float] = time.monotonic) -> None:
        self.reached, self.clock = reached, clock
        self.begin = self.last = clock()
        self.wait = FIRST
        self.before = 0.0

    def look(self) -> str:
        """A line; "" before the first step (what runs is still compiled)."""
        now, here = self.clock(), self.reached()
        if here.steps <= 0.0:
            self.begin = self.last = now
            return ""
        pace = (here.time - self.before) / max(now - self.last, 1e-9)
        left = f"about {span(here.of / pace - here.time / pace)} more" if pace > 0.0 else "no end in sight"
        self.wait, self.last, self.before = 2.0 * self.wait, now, here.time
        return (
            f"simulated {here.time:.3g} of {here.of:.3g} s in {span(now - self.begin)} ({here.steps:,.0f} steps), "
            f"{left}; Ctrl-C ends it"
        )


def span(seconds: float) -> str:
    """A time for people."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    if seconds < 5400.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.0f} h" if seconds < 1e5 else f"{seconds / 86400.0:.3g} days"


_idle: list[SimpleQueue[Callable[[], None]]] = []
"""Threads beside the main one that wait for work, by their queues: starting one takes as long as a short run. Several,
as a signal's handler may run a case while the main thread waits for another one."""
if hasattr(os, "register_at_fork"):
    # Threads do not cross a fork.
    os.register_at_fork(after_in_child=_idle.clear)


def _beside() -> SimpleQueue[Callable[[], None]]:
    """A thread that does what is put into its queue, one after another."""
    works: SimpleQueue[Callable[[], None]] = SimpleQueue()

    def serve() -> None:
        while True:
            # No name holds a work, whose arrays may be large, until the next one comes.
            works.get()()

    threading.Thread(target=serve, name="stickslip run", daemon=True).start()
    return works


def watched(
    work: Callable[[], Result],
    reached: Callable[[], Reached],
    stop: Callable[[], None],
    watch: Callable[[Callable[[], Reached]], Watch] = Watch,
) -> Result:
    """What `work` returns, a call of compiled code that hears no signal.

    Called in the main thread it runs beside that, which tells how far it has come, and ends it where a signal's handler
    raises (Ctrl-C): ``stop`` makes it return soon.
    """
    if threading.current_thread() is not threading.main_thread():
        return work()
    found: list[Result] = []
    failed: list[BaseException] = []
    done = threading.Event()

    def run() -> None:
        try:
            found.append(work())
        except BaseException as error:
            failed.append(error)
        finally:
            done.set()

    looks = watch(reached)
    beside = _idle.pop() if _idle else _beside()
    beside.put(run)
    try:
        while not done.wait(looks.wait):
            if line := looks.look():
                for listener in _listeners:
                    listener(line)
    except BaseException:
        stop()
        done.wait()
        raise
    finally:
        _idle.append(beside)
    if failed:
        raise failed[0]
    return found[0]
