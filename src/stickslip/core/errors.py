"""What can go wrong, and who is meant by it.

The tree of exceptions::

    StickslipError                    everything this package raises on purpose
    ├── InputError                    the user can correct it; the command line prints one line and exits with 2
    │   ├── ParameterError            a parameter is missing, unknown or out of bounds
    │   ├── UnknownName               a law, compensator, reference, integrator, ... that is not registered
    │   ├── ConfigError               a key or value of a TOML file
    │   │   └── CodeRefused           a file names code that nobody has approved
    │   └── LawError                  a law's file says something that cannot be run (outside the scalar subset, say)
    ├── RigError                      a run on a rig was stopped: when, why, and the record of what was measured
    │   ├── LimitCrossed              position, speed, torque, temperature or following error
    │   ├── MessageLost               a message to or from the rig did not arrive in time
    │   ├── DriveFault                the rig itself reported a fault
    │   ├── MeasurementFault          readings or clock of the rig freeze, jump or contradict the torque
    │   ├── Overrun                   a controller in Python took more than its time
    │   ├── RecordFault               the record could not be written: a full disk
    │   └── Interrupted               a signal requested the end
    └── SimulationError               a run ended early: when, why, and the record of what was computed
        ├── Divergence                position or velocity left every reasonable bound, or is not a number
        ├── EventStorm                more switches than the limit in a short time
        └── StepFailure               no step that meets the tolerance was found

and two warnings: ``ModelRemark``, a model that runs as it is, but is seldom what was meant, and ``UnusedPlace``, a
folder for compiled code or approvals that other users can change.
"""

from __future__ import annotations

import difflib
import math
import os
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip.core.messages import ask_for_place, render

if TYPE_CHECKING:
    from stickslip.core.record import Record

__all__ = [
    "CodeRefused",
    "ConfigError",
    "Divergence",
    "DriveFault",
    "EventStorm",
    "InputError",
    "Interrupted",
    "LawError",
    "LimitCrossed",
    "MeasurementFault",
    "MessageLost",
    "ModelRemark",
    "Overrun",
    "ParameterError",
    "RecordFault",
    "RigError",
    "SimulationError",
    "StepFailure",
    "StickslipError",
    "UnknownName",
    "UnusedPlace",
    "suggestion",
]


class StickslipError(Exception):
    """Base of every error this package raises on purpose.

    Its text is written for who reads it (`stickslip.core.messages`): on the command line, in Python or in the page.
    """

    @property
    def message(self) -> str:
        """The message as data, its references not yet written, to be part of another message."""
        return str(self.args[0]) if self.args else ""

    def __str__(self) -> str:
        return render(self.message)

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any]]:
        # Constructors of some take more than the message: a pool of processes could not hand these back, and hang.
        return _error, (type(self), self.args), vars(self)


class InputError(StickslipError):
    """Something the user gave; the message names the thing, the value and the remedy in one line."""


class ParameterError(InputError):
    """A parameter is missing, unknown or out of bounds."""


class UnknownName(InputError):
    """A name that is not registered in its family; `meant`, if it is one of the known, is what it stands for.

    ``further`` is said besides: what else there is.
    """

    def __init__(
        self, family: str, name: object, known: Iterable[str], meant: str = "", further: str = ""
    ) -> None:
        names = sorted(known)
        remedy = f"did you mean {meant!r}?" if meant in names else suggestion(str(name), names)
        super().__init__(f"unknown {family} {name!r}; {remedy}{f' {further}' if further else ''}")


class ModelRemark(UserWarning):
    """A model that runs as it is, but is seldom what was meant."""

    def __str__(self) -> str:
        return render(super().__str__())


class UnusedPlace(UserWarning):
    """A folder for compiled code or approvals that is not used: others can change it, or nothing more fits into it."""


class ConfigError(InputError):
    """A key or value of a TOML file."""


class CodeRefused(ConfigError):
    """A TOML file names Python code that nobody has approved (`stickslip.allow_code`).

    Attributes
    ----------
    path : str
        Of the code.
    code : bytes
        Its content.
    """

    def __init__(self, message: str, path: str = "", code: bytes = b"") -> None:
        super().__init__(message)
        self.path, self.code = path, code


class LawError(InputError):
    """A law's file cannot be run."""


class RigError(StickslipError):
    """A run on a rig was stopped, its torque ramped to zero.

    Attributes
    ----------
    time : float
        By the rig's clock, s; NaN where it has none yet.
    record : Record or None
        What was measured until then.
    """

    def __init__(self, message: str, time: float = math.nan, record: Record | None = None) -> None:
        super().__init__(message)
        self.time = time
        self.record = record


class LimitCrossed(RigError):
    """Position, speed, torque, temperature or following error left its limits, or was not a number."""


class MessageLost(RigError):
    """A message to or from the rig did not arrive in time."""


class DriveFault(RigError):
    """The rig itself reported a fault."""


class MeasurementFault(RigError):
    """The rig's readings or its clock freeze, jump or contradict the torque command."""


class Overrun(RigError):
    """A controller written in Python took more time than its budget."""


class RecordFault(RigError):
    """The record could not be written."""


class Interrupted(RigError):
    """A signal requested the end of the run."""


class SimulationError(StickslipError):
    """A run ended early.

    Attributes
    ----------
    time : float
        When it ended, s.
    record : Record or None
        What was computed until then.
    """

    def __init__(self, message: str, time: float, record: Record | None = None) -> None:
        super().__init__(message)
        self.time = time
        self.record = record


class Divergence(SimulationError):
    """Position or velocity left every reasonable bound, or is not a number."""


class EventStorm(SimulationError):
    """More switches than the limit in a short time."""


class StepFailure(SimulationError):
    """No step that meets the tolerance was found."""


def _error(kind: type[StickslipError], args: tuple[Any, ...]) -> StickslipError:
    """An error as a pickle says it."""
    return kind.__new__(kind, *args)


def suggestion(
    name: str, known: Iterable[str], otherwise: str = "", tables: Mapping[str, str] | None = None
) -> str:
    """Return the remedy for a misspelt `name`: up to three near ones, or else `otherwise` or all of them.

    Parameters
    ----------
    name : str
    known : iterable of str
    otherwise : str
    tables : mapping of str to str, optional
        Further names, and the tables of the file in which these are keys.
    """
    names, places = list(known), tables or {}
    found = difflib.get_close_matches(name, [*names, *places], n=3, cutoff=0.6)
    if name in found:
        found = [name]
    near = [repr(n) if n in names else f"{n!r} in [{places[n]}]" for n in dict.fromkeys(found)]
    if near:
        *others, last = near
        return f"did you mean {', '.join(others)} or {last}?" if others else f"did you mean {last}?"
    return otherwise or (f"choose from {', '.join(names)}" if names else "none is registered")


def unwritable(path: Path, error: OSError, option: str = "folder") -> InputError:
    """Return the error that states that a path cannot be written, and why; `option` gives another."""
    why = error.strerror or str(error)
    if isinstance(error, FileExistsError | NotADirectoryError):
        why = "a file is where a folder is needed"
    return InputError(f"cannot write {shown_path(path)} ({why}); {ask_for_place(option)}")


def refuse_nul(path: Path, remedy: str) -> None:
    """Refuse a path with a NUL character, which no file system takes.

    Raises
    ------
    InputError
    """
    if "\0" in str(path):
        raise InputError(f"{str(path)!r} contains a NUL character; {remedy}")


def one_line(message: str) -> str:
    """Return a message in one line, the middle of very long names left out."""
    return OVERLONG.sub(r"\1...\2", " ".join(message.split()))


def shown_path(path: object) -> str:
    """Return a path as messages show it, escaped if it does not print."""
    return one_line(str(path) if str(path).isprintable() else repr(str(path)))


OVERLONG = re.compile(r"(\S{100})\S{100,}(\S{50})")
"""A path, name or value too long for a message."""
BEYOND = (OSError, OverflowError, RecursionError, MemoryError, UnicodeError)
"""Errors that Python raises for a path, number, nesting, size or text out of range."""


def beyond(error: BaseException) -> InputError:
    """Return the package's error for one of `BEYOND`: input out of the range of files, numbers or memory."""
    said = " ".join(str(error).split())[:200]
    if isinstance(error, OSError):
        why = error.strerror or said
        if error.filename is None:
            return InputError(f"the system refused a file or device ({why})")
        return InputError(f"cannot use {shown_path(os.fsdecode(error.filename))} ({why}); give another path")
    if isinstance(error, OverflowError):
        return InputError(
            f"a number is out of range ({said}); give numbers of a size that occurs on a machine"
        )
    if isinstance(error, RecursionError):
        return InputError("an argument contains itself, or is nested too deeply; flatten it")
    if isinstance(error, MemoryError):
        return InputError(
            f"this needs more memory than there is ({said or 'out of memory'}); reduce the numbers or the data"
        )
    return InputError(f"a text or a name is not Unicode ({said}); correct it")
