"""Messages: sentences that refer to options, columns and units, written once for every reader.

A sentence does not contain the name of an option. It contains a reference (`name_option`, `name_columns`, ...), which
`render` writes for whoever reads it: `--torque-is` on the command line, `torque_is=` in Python, the label of the field
in the page. A reference is data inside the text, between two noncharacters of Unicode. These are reserved for the
inside of a program, so no text of a user contains one: paths, names and columns are never rewritten.

Errors render themselves (`StickslipError.__str__`), results when they are made.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from enum import Enum, auto
from pathlib import PurePath
from typing import NamedTuple

START, SEPARATOR, END = "\ufdd0", "\ufdd1", "\ufdd2"
"""Noncharacters: a reference's start, the bounds of its parts, and its end."""
REFERENCE = re.compile(f"{START}([^{START}{END}]*){END}")


class Surface(Enum):
    """Where a message is read."""

    COMMAND_LINE = auto()
    PYTHON = auto()
    PAGE = auto()


_surface = Surface.PYTHON


@contextmanager
def shown_on(surface: Surface) -> Generator[None]:
    """Render the messages of this process, in all its threads, for a surface; outside of it they are for Python."""
    global _surface
    before, _surface = _surface, surface
    try:
        yield
    finally:
        _surface = before


class Reader(NamedTuple):
    """Who reads a message.

    Attributes
    ----------
    surface : Surface
    arrays : bool
        Whether signals were given as arrays, which have units and no columns (Python).
    motion : bool
        Whether the log is that of the motion of `recommend`.
    """

    surface: Surface
    arrays: bool = False
    motion: bool = False


# ---- references ----------------------------------------------------------------------------------------------------


def name_option(name: str, *values: object) -> str:
    """Refer to an option by its argument's name, perhaps with values.

    Parameters
    ----------
    name : str
        Of the argument in Python, such as ``"torque_is"``.
    *values : object
        A value or a placeholder in capitals, such as ``"SECONDS"``; several for an option that is repeated. True refers
        to a switch that is set.
    """
    return _reference("option", name, *values)


def name_options(**values: object) -> str:
    """Refer to several options that are given together, each with its value."""
    return _reference("options", *(part for pair in values.items() for part in pair))


def name_columns(**mapping: str) -> str:
    """Refer to the mapping of channels to columns, such as ``torque="COLUMN:UNIT"``."""
    return _reference("columns", *(part for pair in mapping.items() for part in pair))


def name_parameter(name: str, value: object = "..") -> str:
    """Refer to the value of a parameter (``--set NAME=VALUE``, in Python ``values={"NAME": VALUE}``)."""
    return _reference("parameter", name, value)


def name_frozen(name: str, value: object) -> str:
    """Refer to a parameter that is held at a value."""
    return _reference("frozen", name, value)


def name_setting(name: str, value: object = "") -> str:
    """Refer to a setting of an export target (``--set NAME=VALUE``, in Python ``settings={"NAME": VALUE}``)."""
    return _reference("setting", name, value)


def name_loop(gains: str) -> str:
    """Refer to the gains of the drive's loop, such as ``"kp=..,kd=.."``."""
    return _reference("loop", gains)


def ask_for_place(name: str = "folder") -> str:
    """Ask for another place to write to, which an option of the command line gives."""
    return _reference("place", name)


def name_command(verb: str) -> str:
    """Refer to a verb that is a command and a function, such as ``"simulate"``."""
    return _reference("command", verb)


def ask_for_code() -> str:
    """Refer to the permission to run code."""
    return _reference("code")


def name_file(path: object) -> str:
    """Refer to a file that the page calls by its name alone."""
    return _reference("file", path)


def _reference(kind: str, *parts: object) -> str:
    return f"{START}{SEPARATOR.join((kind, *map(str, parts)))}{END}"


class Note(str):
    """A message with a code, by which programs recognize it.

    Parameters
    ----------
    text : str
    code : str
        Stable, such as "timing-contradicted".
    """

    code: str

    def __new__(cls, text: str, code: str = "") -> Note:
        """Make a message of a text."""
        made = super().__new__(cls, text)
        made.code = code
        return made


def code_of(text: str) -> str:
    """Return the code of a message; empty for one without."""
    return text.code if isinstance(text, Note) else ""


# ---- rendering -----------------------------------------------------------------------------------------------------


def render(text: str, *, arrays: bool = False, motion: bool = False) -> str:
    """Return a message with its references written for the surface of this process (`shown_on`); a note stays a note.

    Parameters
    ----------
    text : str
    arrays, motion : bool
        As of `Reader`.
    """
    written = rendered_for(text, Reader(_surface, arrays, motion))
    return Note(written, text.code) if isinstance(text, Note) else written


def rendered_for(text: str, reader: Reader) -> str:
    """Return a message with its references written for a reader."""
    if START not in text:
        return text
    write = WRITERS[reader.surface]

    def written(found: re.Match[str]) -> str:
        kind, *parts = found[1].split(SEPARATOR)
        try:
            return write[kind](parts, reader)
        except (KeyError, IndexError, ValueError):  # a text of a user that imitates a reference
            return found[0]

    return REFERENCE.sub(written, text)


def rendered(texts: Iterable[str]) -> tuple[str, ...]:
    """Return messages written for the surface of this process."""
    return tuple(render(text) for text in texts)


Write = Callable[[Sequence[str], Reader], str]

FLAGS = {
    "start": "from", "end": "to", "frozen": "freeze", "values": "set", "folder": "out", "beside": "with",
    "position_map": "position", "torque_channel": "torque", "without_watchdog": "no-watchdog",
}  # fmt: skip
"""Arguments whose option has another name."""


def flag(name: str) -> str:
    """Return the option of an argument, such as ``--torque-is``."""
    return f"--{FLAGS.get(name, name).replace('_', '-')}"


def _command_line_option(parts: Sequence[str], _reader: Reader) -> str:
    name, *values = parts
    return " ".join(flag(name) if v == "True" else f"{flag(name)} {v}" for v in values) or flag(name)


def _command_line_columns(parts: Sequence[str], reader: Reader) -> str:
    name = "--motion-map" if reader.motion else "--map"
    return " ".join(f"{name} {_quoted(f'{role}={column}')}" for role, column in _pairs(parts))


def _quoted(text: str) -> str:
    """Return a word of a shell, in quotes if it needs them."""
    return text if re.fullmatch(r"[\w.:·%/@=-]+", text) else shlex.quote(text)


COMMAND_LINE: dict[str, Write] = {
    "option": _command_line_option,
    "options": lambda parts, reader: " ".join(_command_line_option(pair, reader) for pair in _pairs(parts)),
    "columns": _command_line_columns,
    "parameter": lambda parts, _: f"--set {parts[0]}={parts[1]}",
    "setting": lambda parts, _: f"--set {parts[0]}" + (f"={parts[1]}" if parts[1] else ""),
    "frozen": lambda parts, _: f"--freeze {parts[0]}={parts[1]}",
    "loop": lambda parts, _: f"--loop {parts[0]}",
    "place": lambda parts, _: f"choose another place with {flag(parts[0])}",
    "command": lambda parts, _: f"`stickslip {parts[0]}`",
    "code": lambda _parts, _: "give --allow-code (in Python: `with stickslip.allow_code():`)",
    "file": lambda parts, _: parts[0],
}

SIGNALS = {"time": "t", "position_reference": "reference", "motor_torque": "torque", "load": "normal_force"}
"""Arguments that arrays are given by, if their channel has another name."""
LISTS = ("accept", "free", "frozen", "leave_out", "law")


def _python_option(parts: Sequence[str], _reader: Reader) -> str:
    name, *values = parts
    if not values:
        return name
    if values == ["True"]:
        return f"{name}=True"
    if name == "lead":  # in mm on the command line, in m in Python
        values = ["METRES" if v == "MM" else f"{1e-3 * float(v):.10g}" for v in values]
    listed = ", ".join(_python_value(v) for v in values)
    return f"{name}=[{listed}]" if name in LISTS or len(values) > 1 else f"{name}={listed}"


def _python_value(value: str) -> str:
    """Return a value as Python writes it: numbers and placeholders without quotes."""
    plain = value[:1] in tuple("-0123456789.") or value in ("inf", "nan") or value.isupper()
    return value if plain and ":" not in value else f'"{value}"'


def _python_columns(parts: Sequence[str], reader: Reader) -> str:
    if not reader.arrays:
        listed = ", ".join(f'"{role}": "{column}"' for role, column in _pairs(parts))
        return f"{'motion_map' if reader.motion else 'map'}={{{listed}}}"
    out: list[str] = []
    for role, column in _pairs(parts):
        name, (head, _, unit) = SIGNALS.get(role, role), column.partition(":")
        given = {"COLUMN": "...", "none": "None"}.get(head)
        out += [f"{name}={given}"] if given else []
        out += [f'units={{"{name}": "{unit.rpartition(":")[2]}"}}'] if unit else []
    return ", ".join(out)


def _python_loop(parts: Sequence[str], _reader: Reader) -> str:
    items = (item.partition("=") for item in parts[0].split(","))
    return "loop={" + ", ".join(f'"{name}": {value}' for name, _, value in items) + "}"


PYTHON: dict[str, Write] = {
    "option": _python_option,
    "options": lambda parts, reader: ", ".join(_python_option(pair, reader) for pair in _pairs(parts)),
    "columns": _python_columns,
    "parameter": lambda parts, _: f'values={{"{parts[0]}": {parts[1]}}}',
    "setting": lambda parts, _: f'settings={{"{parts[0]}": {_python_value(parts[1] or "..")}}}',
    "frozen": lambda parts, _: f'frozen=["{parts[0]}"], values={{"{parts[0]}": {parts[1]}}}',
    "loop": _python_loop,
    "place": lambda _parts, _: "choose another place",
    "command": lambda parts, _: f"`ss.{parts[0]}(...)`",
    "code": lambda _parts, _: "use `with stickslip.allow_code():`",
    "file": lambda parts, _: parts[0],
}

FORM, OPTIONS = " under “Columns and units”", " under “Options”"
FIELDS = {
    "counts_per_rev": f"the counts a revolution{FORM}", "rated_torque": f"the rated torque{FORM}",
    "rated_current": f"the rated current{FORM}", "torque_constant": f"the torque constant{FORM}",
    "force_constant": f"the force constant{FORM}", "pole_pairs": f"the pole pairs{FORM}",
    "gear_ratio": f"the gear ratio{FORM}", "lead": f"the lead of the screw{FORM}",
    "sample_time": f"the time between rows{FORM}", "side": f"“Measured on the side of”{FORM}",
    "leave_out": "“Leave this part out”", "unwrap": "“Count the position on”", "rows": "the part that is used",
    "start": "the start of the part", "end": "its end", "inertia": f"“Inertia”{OPTIONS}",
    "law": f"“Laws to choose among”{OPTIONS}", "loop": f"“The drive's loop”{OPTIONS}",
    "drive_gain": f"“Torque for each unit of the drive's signal”{OPTIONS}", "method": f"“Method”{OPTIONS}",
    "pendulum": f"“Gravity of a pendulum”{OPTIONS}", "amplitude": f"“amplitude”{OPTIONS}",
    "frequency": f"“frequency”{OPTIONS}", "per_direction": f"“Friction of its own in each direction”{OPTIONS}",
    "nearest": "“Take the nearest that it can hold”", "bandwidth": "the bandwidth",
    "torque_limit": "the torque limit", "reference_velocity": f"“The drive's reference velocity”{OPTIONS}",
    "linear": f"“Linear controller”{OPTIONS}", "damping": f"“Damping of its poles”{OPTIONS}",
}  # fmt: skip
"""Labels of the page's fields, by argument."""


def _page_option(parts: Sequence[str], _reader: Reader) -> str:
    name, *values = parts
    label = FIELDS.get(name)
    if label is None:
        return f"`{_command_line_option(parts, _reader)}` on the command line"
    said = [v for v in values if v != "True" and not re.fullmatch(r"[A-Z][A-Z_:]*", v)]
    return f"{label} = {', '.join(said)}" if said else label


def _given(value: str) -> str:
    """Return a value that is given, and nothing for a placeholder."""
    return "" if value in ("", "..", "VALUE") else f" = {value}"


def _page_columns(parts: Sequence[str], _reader: Reader) -> str:
    out: list[str] = []
    for role, column in _pairs(parts):
        name, _, unit = column.rpartition(":") if ":" in column else (column, "", "")
        which = {"none": "none of them", "COLUMN": "its column", "": "its column"}.get(
            name, f"the column {name}"
        )
        measure = "" if not unit else " with its unit" if unit == "UNIT" else f" in {unit}"
        out.append(f"“{role.replace('_', ' ')}” = {which}{measure}")
    return f"{', '.join(out)}{FORM}"


PAGE: dict[str, Write] = {
    "option": _page_option,
    "options": lambda parts, reader: ", ".join(_page_option(pair, reader) for pair in _pairs(parts)),
    "columns": _page_columns,
    "parameter": lambda parts, _: f"the value of {parts[0]}" + _given(parts[1]),
    "setting": lambda parts, _: (
        f"the target's {parts[0]}" + (f" = {parts[1]}" if parts[1] not in ("", "VALUE") else "")
    ),
    "frozen": lambda parts, _: f"`{COMMAND_LINE['frozen'](parts, _)}` on the command line",
    "loop": lambda parts, _: f"{FIELDS['loop']} ({parts[0]})",
    "place": lambda _parts, _: "choose another place",
    "command": COMMAND_LINE["command"],
    "code": lambda _parts, _: "read it, and allow it",
    "file": lambda parts, _: PurePath(parts[0]).name,
}
WRITERS = {Surface.COMMAND_LINE: COMMAND_LINE, Surface.PYTHON: PYTHON, Surface.PAGE: PAGE}


def _pairs(parts: Sequence[str]) -> list[tuple[str, str]]:
    return list(zip(parts[::2], parts[1::2], strict=True))


# ---- units ---------------------------------------------------------------------------------------------------------

_linear: ContextVar[bool] = ContextVar("stickslip_linear", default=False)


@contextmanager
def units_of_axis(linear: bool) -> Generator[None]:
    """Write units in the messages, labels and comments made inside for a rotary axis or for a linear one."""
    token = _linear.set(linear)
    try:
        yield
    finally:
        _linear.reset(token)


LINEAR = (
    ("kg·m²", "kg"),
    ("kg*m^2", "kg"),
    ("kg.m2", "kg"),
    ("N·m", "N"),
    ("N*m", "N"),
    ("N.m", "N"),
    ("rad", "m"),
)
"""Units of a rotary axis, in the spellings of text, ASCII and Modelica, and those of a linear axis."""


def axis_unit(angular: str) -> str:
    """Return a unit of a rotary axis in the units of the present axis (`units_of_axis`): N·m/rad, or N/m."""
    return in_linear_units(angular) if _linear.get() else angular


def in_linear_units(angular: str) -> str:
    """Return a unit of a rotary axis as that of a linear one."""
    for rotary, own in LINEAR:
        angular = angular.replace(rotary, own)
    return angular
