"""Who is told while functions are compiled: `stickslip.jit` tells, the command line listens. Imports nothing heavy."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TextIO

SOON = 1.0
"""s of compiling before a word is said of it."""
WORDS = "compiling for this machine, some 20 s, once after an installation; `stickslip warm-up` does it beforehand"
OWN_WORDS = "compiling this controller or law for this machine, once: the result is kept"
"""Of what warm-up does not know: a file of one's own, laws that nobody has put together before."""
_listeners: list[Notice] = []


class Notice:
    """Says on a stream, once, that functions are being compiled; on a terminal it counts them too.

    Parameters
    ----------
    stream : TextIO
    clock : callable
        Makes a timer of a delay (s) and of what to call then, with ``start`` and ``cancel``.
    """

    def __init__(
        self, stream: TextIO, clock: Callable[[float, Callable[[], None]], threading.Timer] = threading.Timer
    ) -> None:
        self.stream, self.clock = stream, clock
        self.depth = self.count = 0
        self.said = False
        self.words = WORDS
        self.timer: threading.Timer | None = None
        self.lock = threading.RLock()

    def started(self, words: str = WORDS) -> None:
        """A function begins to be compiled, perhaps for another one; ``words`` are said of it if it takes long."""
        with self.lock:
            self.depth += 1
            if self.depth == 1:
                self.words = words
            if self.depth == 1 and not self.said:
                self.timer = self.clock(SOON, self.say)
                self.timer.daemon = True
                self.timer.start()

    def ended(self) -> None:
        """A function is compiled."""
        with self.lock:
            self.depth -= 1
            self.count += 1
            if self.depth == 0 and self.timer:
                self.timer.cancel()
                self.timer = None
            if self.said and self.stream.isatty():
                print(f"\rstickslip: {self.count} functions compiled ", end="", file=self.stream, flush=True)

    def say(self) -> None:
        """The one line."""
        with self.lock:
            if not self.said:
                self.said = True
                print(f"stickslip: {self.words}", file=self.stream, flush=True)

    def close(self) -> None:
        """End the line of the count."""
        with self.lock:
            if self.said and self.stream.isatty():
                print(file=self.stream, flush=True)


def listen(notice: Notice) -> None:
    """Tell this one from now on."""
    _listeners.append(notice)


def silence() -> None:
    """Tell nobody any more."""
    _listeners.clear()


def started(words: str = WORDS) -> None:
    """Tell everyone that a function begins to be compiled, and what is to be said of it."""
    for notice in _listeners:
        notice.started(words)


def ended() -> None:
    """Tell everyone that a function is compiled."""
    for notice in _listeners:
        notice.ended()
