"""Handle signals that would end or halt the process between two samples, so the loop ends with its ramp.

In the main thread Python's own handlers note the signal, and the loop's `Interrupted` reports it. Python handles
signals in no other thread, and an unhandled one ends the process at once. For a loop in another thread the system
therefore calls a compiled handler; when its torque is zero and its record closed, the signal is sent once more to its
original handler. All loops of a process get the same signal.

Some signals cannot be handled, so only the drive's watchdog removes the torque: SIGKILL and SIGSTOP, which the system
never delivers to a program, and those of a crash (`CRASHES`), after which no code is reliable.
"""

from __future__ import annotations

import ctypes
import functools
import math
import os
import signal
import threading
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np

from stickslip.core.errors import Interrupted
from stickslip.jit import compiled_notice

ALWAYS = ("SIGINT", "SIGTERM", "SIGBREAK")
"""Always handled, even if the program has its own handlers"""
CRASHES = ("SIGSEGV", "SIGBUS", "SIGILL", "SIGFPE")
"""After a handler the instruction that raised one of them would run again and raise it again."""
NEVER = ("SIGKILL", "SIGSTOP", *CRASHES, "SIGCHLD", "SIGCONT", "SIGURG", "SIGWINCH")
"""Not handled: this is impossible, or they neither end nor halt the process."""
TERMINAL = ("SIGTTIN", "SIGTTOU")
"""Signals of a background process that uses its terminal. They are ignored after the first, because the same call would
raise them forever."""


class Signals:
    """The signal that requested the end; 0 if none."""

    def __init__(self) -> None:
        self._hearing = False
        self._number = 0
        self._before: dict[int, Any] = {}
        self._released = False
        self._patience = math.inf
        self._error: BaseException | None = None

    @property
    def number(self) -> int:
        """The signal, or 0."""
        return int(NOTED[0]) if self._hearing else self._number

    def quieten(self) -> None:
        """Ignore further signals of the terminal (`TERMINAL`) if the loop is not in the main thread."""
        number = self.number
        if not self._before and number in _replaced and number in _numbers(TERMINAL) and number not in _quiet:
            _quiet.add(number)
            _library().signal(number, int(signal.SIG_IGN))

    @property
    def error(self) -> Interrupted:
        """Return the error that reports the signal."""
        return Interrupted(f"{name_of(self.number)} requested the end")

    def hear(self, undo: ExitStack) -> None:
        """Handle signals until `undo`. Outside the main thread this requires POSIX signals."""
        main = threading.current_thread() is threading.main_thread()
        if not main and os.name != "posix":
            return
        self._released = False
        with _changing:
            if not _loops:
                NOTED[0] = 0
            _loops.add(id(self))
        undo.callback(self._hear_main() if main else self._hear_elsewhere())
        undo.callback(self._keep)
        self._hearing = True

    def release(self) -> None:
        """Restore the signals before the end: the loop is blocked and checks none, but its torque is zero."""
        if self._hearing and not self._released:
            self._released = True
            if not self._before:
                _end_elsewhere(self)
            elif self.number:
                os.kill(os.getpid(), self.number)

    @contextmanager
    def at_once(self) -> Generator[None]:
        """Let a signal interrupt the main thread in this block, in which no torque acts."""
        self._patience = 0
        try:
            yield
        finally:
            self._patience = math.inf

    @contextmanager
    def at_the_second(self) -> Generator[None]:
        """Let the second signal interrupt the main thread in this block."""
        self._patience = 1
        try:
            yield
        finally:
            self._patience = math.inf

    def interrupt(self, error: BaseException) -> bool:
        """Raise an error in the main thread, from another one, if the loop runs there; return whether it does."""
        if not self._before or not hasattr(signal, "pthread_kill"):
            return False
        self._error = error
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        return True

    def _keep(self) -> None:
        self._number, self._hearing = int(NOTED[0]), False

    def _hear_main(self) -> Any:
        """Start in the main thread; return the function that ends it."""
        found = {number: signal.getsignal(number) for number in (*_numbers(ALWAYS), *_unless_used())}
        always = _numbers(ALWAYS)
        self._before = {
            # None means a handler that was not set from Python and cannot be restored.
            n: old
            for n, old in found.items()
            if old is not None and (n in always or (old is signal.SIG_DFL and not _used_by_code(n)))
        }
        for number in self._before:
            signal.signal(number, self._note)
        return self._end_main

    def _end_main(self) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        with _changing:
            _loops.discard(id(self))
            if _elsewhere:
                _take()  # from the handler that was just restored

    def _note(self, number: int, frame: Any) -> None:
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        NOTED[0] = number
        if number in _numbers(TERMINAL):
            signal.signal(number, signal.SIG_IGN)
        if self._patience < 1:
            raise self.error
        self._patience -= 1
        if self._released:
            signal.signal(number, self._before[number])
            signal.raise_signal(number)

    def _hear_elsewhere(self) -> Any:
        """Start in another thread; return the function that ends it."""
        with _changing:
            _elsewhere.add(id(self))
            if len(_elsewhere) == 1:
                _take()
        return functools.partial(_end_elsewhere, self)


# ---- handlers of the process, for loops off its main thread --------------------------------------------------------

NOTED = np.zeros(1)
"""The last signal that a loop has handled; 0: none"""
_changing = threading.Lock()
_loops: set[int] = set()
_elsewhere: set[int] = set()
_replaced: dict[int, Any] = {}
"""Previous handlers, as the system's ``struct sigaction``"""
_quiet: set[int] = set()
"""Signals that are ignored for the rest of the loop"""
DEFAULT = None
"""SIG_DFL, as ctypes shows a null pointer"""


def _numbers(names: tuple[str, ...]) -> tuple[int, ...]:
    return tuple(int(getattr(signal, name)) for name in names if hasattr(signal, name))


def _unless_used() -> tuple[int, ...]:
    """Return the signals that would end or halt the process, without those that the program ignores (`nohup`) or
    uses."""
    return tuple(
        sorted(int(n) for n in signal.valid_signals() if n not in (*_numbers(ALWAYS), *_numbers(NEVER)))
    )


def name_of(number: int) -> str:
    """Return a signal's name; real-time signals are counted from the first."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"SIGRTMIN+{number - int(signal.SIGRTMIN)}"


@functools.cache
def _library() -> Any:
    """Return the C library."""
    library: Any = ctypes.CDLL(None)
    library.signal.argtypes, library.signal.restype = [ctypes.c_int, ctypes.c_void_p], ctypes.c_void_p
    library.sigaction.argtypes = [ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p]
    return library


@functools.cache
def _notice() -> Any:
    """Return the compiled handler."""
    return compiled_notice(NOTED)


def _take() -> None:
    """Install the compiled handler."""
    library, notice = _library(), _notice()
    for number in (*_numbers(ALWAYS), *_unless_used()):
        old = _action(number)
        if _handler(old) == notice.address or (
            number not in _numbers(ALWAYS) and _handler(old) is not DEFAULT
        ):
            continue
        _replaced[number] = old
        library.signal(number, notice.address)


def _end_elsewhere(heard: Signals) -> None:
    """Restore the signals that no other loop needs, and send a received one once more."""
    with _changing:
        if id(heard) not in _elsewhere:
            return
        _elsewhere.discard(id(heard))
        _loops.discard(id(heard))
        if _elsewhere:
            return
        library, notice = _library(), _notice()
        for number, old in _replaced.items():
            # Any other handler was set by the program meanwhile.
            if _handler(_action(number)) == notice.address or number in _quiet:
                library.sigaction(number, old, None)
        _replaced.clear()
        _quiet.clear()
        came = int(NOTED[0])
    if came:
        os.kill(os.getpid(), came)


def _used_by_code(number: int) -> bool:
    """Whether compiled code handles a signal (`faulthandler` handles some), which Python does not know."""
    if os.name != "posix":
        return False
    handler = _handler(_action(number))
    return handler is not DEFAULT and not (_elsewhere and handler == _notice().address)


def _action(number: int) -> Any:
    """Return the system's action for a signal: its ``struct sigaction``, whose first member is the handler."""
    found = ctypes.create_string_buffer(256)
    _library().sigaction(number, None, found)
    return found


def _handler(action: Any) -> int | None:
    return ctypes.c_void_p.from_buffer(action).value
