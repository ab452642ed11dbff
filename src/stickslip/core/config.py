"""Reading the TOML files people write: values are asked for by name, checked, and what nobody asked for is refused.

Every complaint is a `ConfigError` of one line that names the file, the key, its value and what is allowed.
"""

from __future__ import annotations

import difflib
import math
import os
import re
import tomllib
import warnings
from collections.abc import Generator, Iterable, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self, cast

from stickslip.core.errors import ConfigError, InputError, ModelRemark, refuse_nul, suggestion
from stickslip.core.messages import name_file

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
SHOWN = 5
"""Unknown keys of a table that are named, at most."""
RUN_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,63}")


@dataclass
class Document:
    """A TOML file and the files it refers to.

    Attributes
    ----------
    name : str
        How messages call it.
    folder : Path
        The folder to which the paths written in it are relative.
    moved : mapping of str to Path
        Where a path as written lies now, if not there (a study that is run again from its copies).
    files : mapping of str to Path
        Files referred to so far, by the path as written.
    """

    name: str
    folder: Path
    moved: Mapping[str, Path] = field(default_factory=dict[str, Path])
    files: dict[str, Path] = field(default_factory=dict[str, Path])

    def locate(self, written: str) -> Path:
        """Where the file written as `written` lies; it is remembered as an input."""
        if not written.isprintable() or not written.strip():
            raise ConfigError(f"{self.name}: {written!r} is not a valid file path; correct it")
        path = self.moved.get(written, self.folder / written)
        root = _root.get()
        if root is not None and not Path(os.path.realpath(path)).is_relative_to(root):
            raise ConfigError(
                f"{self.name}: {written!r} is outside of {root.name}; copy that file into it, and name the copy"
            )
        self.files[written] = path
        return path


_root: ContextVar[Path | None] = ContextVar("stickslip_config_root", default=None)


@contextmanager
def confined_to(folder: Path) -> Generator[None]:
    """Let TOML files that somebody may have sent name files of one folder only, links resolved."""
    before = _root.set(Path(os.path.realpath(folder)))
    try:
        yield
    finally:
        _root.reset(before)


def refuse_endless(path: Path) -> None:
    """Refuse a pipe or device: reading it may wait for ever, or never come to an end; and a name that no file has.

    Raises
    ------
    InputError
    """
    refuse_nul(path, "correct the path")
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise InputError(f"{path} is a pipe or device, not a file; save its content to a file and give that")


DEEP_KEY = re.compile(r"""^\s*\[*(?:[\w"'-]+\s*\.\s*){100}""", re.MULTILINE)
"""A key of over a hundred parts: tomllib takes quadratic time for it, and no file of this package has one"""


def toml_in(text: str) -> dict[str, Any]:
    """Parse a TOML text.

    Raises
    ------
    tomllib.TOMLDecodeError
    RecursionError
        If a key, an array or a table is nested too deeply.
    """
    if DEEP_KEY.search(text):
        raise RecursionError("a key of more than 100 parts")
    return tomllib.loads(text)


def read_toml(path: Path, name: str = "", moved: Mapping[str, Path] | None = None) -> Table:
    """Read a TOML file.

    Raises
    ------
    InputError
        If it cannot be read, or is not TOML; with line and column.
    """
    shown = name or str(path)
    refuse_endless(path)
    try:
        values = toml_in(path.read_bytes().decode())
    except FileNotFoundError:
        raise ConfigError(f"no file {shown}; check the path") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{shown}: byte {error.start} is not UTF-8; save the file as UTF-8 text") from None
    except OSError as error:
        raise ConfigError(f"{shown} cannot be read: {error.strerror}; give the path of a TOML file") from None
    except RecursionError:
        raise ConfigError(f"{shown}: arrays or tables are nested too deeply; flatten them") from None
    except ValueError as error:
        raise ConfigError(f"{shown}: invalid TOML: {error}; correct the file") from None
    return Table(values, Document(shown, path.parent, moved or {}))


class Table:
    """One table of a TOML file.

    A getter without ``default`` demands its key. Used as a context manager, it refuses at the end every key
    that was not asked for.

    Parameters
    ----------
    values : mapping
        The table as parsed.
    document : Document
    path : tuple of str
        The keys that lead to it.
    """

    def __init__(self, values: Mapping[str, Any], document: Document, path: tuple[str, ...] = ()) -> None:
        self.values = values
        self.document = document
        self.path = path
        self._known: dict[str, None] = {}

    # ---- complaints ------------------------------------------------------------------------------------

    def label(self, key: str = "") -> str:
        """File and dotted key, as messages begin."""
        keys = [k if BARE_KEY.fullmatch(k) else _show(k) for k in (*self.path, *([key] if key else []))]
        name = name_file(self.document.name)
        return f"{name}: {'.'.join(keys)}" if keys else name

    def error(self, key: str, complaint: str) -> ConfigError:
        """The error that says ``file: path.key = value complaint``."""
        return ConfigError(f"{self.label(key)} = {_show(self.values.get(key))} {complaint}")

    @contextmanager
    def blamed(self) -> Generator[None]:
        """Let an `InputError` raised inside name this table."""
        try:
            yield
        except ConfigError:
            raise
        except InputError as error:
            raise ConfigError(f"{self.label()}: {error}") from None

    def close(self, elsewhere: Mapping[str, str] | None = None) -> None:
        """Refuse the keys that were not asked for, all in one line.

        Parameters
        ----------
        elsewhere : mapping of str to str, optional
            Keys of other tables of this file and their tables: a key in the wrong place gets the right one.
        """
        unknown = [key for key in self.values if key not in self._known]
        if not unknown:
            return
        otherwise = f"allowed are {', '.join(self._known) or 'none'}"
        said = [f"unknown key; {suggestion(k, self._known, otherwise, elsewhere)}" for k in unknown[:SHOWN]]
        first, *others = zip(unknown, said, strict=False)
        more = [f"{key}: {words}" for key, words in others]
        if len(unknown) > SHOWN:
            more.append(f"and {len(unknown) - SHOWN} more unknown keys")
        raise ConfigError("; ".join([f"{self.label(first[0])}: {first[1]}", *more]))

    def refuse_unknown(self, known: Iterable[str], elsewhere: Mapping[str, str] | None = None) -> None:
        """Refuse every key that is not `known`; `elsewhere` as in `close`."""
        for key in known:
            self.has(key)
        self.close(elsewhere)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()

    # ---- getters ---------------------------------------------------------------------------------------

    def has(self, key: str) -> bool:
        """Whether the key is there; it counts as asked for."""
        self._known[key] = None
        return key in self.values

    def _get(self, key: str, what: str) -> Any:
        if not self.has(key):
            near = difflib.get_close_matches(key, [k for k in self.values if k not in self._known], n=1)
            hint = f"did you misspell it as {near[0]!r}?" if near else f"give {what}"
            raise ConfigError(f"{self.label(key)} is missing; {hint}")
        return self.values[key]

    def number(self, key: str, unit: str, default: float | None = None, lower: float = -math.inf) -> float:
        """A finite number of at least `lower`; `unit` is empty where it has none."""
        if default is not None and not self.has(key):
            return default
        value = self._number(key, self._get(key, _number_in(unit)), unit)
        if value < lower:
            raise self.error(key, f"must be at least {lower:g} {unit}".rstrip())
        return value

    def positive(self, key: str, unit: str, default: float | None = None) -> float:
        """A finite number greater than 0."""
        value = self.number(key, unit, default)
        if value <= 0.0:
            raise self.error(key, f"must be greater than 0 {unit}".rstrip())
        return value

    def _number(self, key: str, value: Any, unit: str) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.error(key, f"must be {_number_in(unit)}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.error(key, f"must be {_number_in(unit, 'a finite number')}")
        return number

    def text(self, key: str, default: str | None = None) -> str:
        """A string."""
        if default is not None and not self.has(key):
            return default
        value = self._get(key, "a string")
        if not isinstance(value, str):
            raise self.error(key, "must be a string in quotes")
        return value

    def flag(self, key: str, default: bool) -> bool:
        """true or false; "yes" and "no" are read too, with a remark."""
        if not self.has(key):
            return default
        value = self.values[key]
        if value in ("yes", "no"):
            meant = "true" if value == "yes" else "false"
            said = f"{self.label(key)} = {_show(value)} is read as {meant}; write {key} = {meant}"
            warnings.warn(said, ModelRemark, stacklevel=2)
            return value == "yes"
        if not isinstance(value, bool):
            raise self.error(key, "must be true or false")
        return value

    def choice(self, key: str, allowed: Iterable[str], default: str | None = None, family: str = "") -> str:
        """One of the allowed strings; where the file defines them, `family` is the table it does so in."""
        names = list(allowed)
        if default is None and not self.has(key) and not names:
            thing = family.split(".")[-1].rstrip("s") or "one"
            raise ConfigError(
                f"{self.label(key)} is missing; define the {thing} in a table [{family}.NAME] and name it here"
            )
        if default is None and key not in self.values:
            self._get(key, f"one of {', '.join(names)}")
        return self._one_of(key, self.text(key, default), names, family)

    def texts(self, key: str, allowed: Iterable[str], family: str = "") -> list[str]:
        """A list of at least one string, each allowed, none twice; `family` as in `choice`."""
        names = list(allowed)
        values = self._list(key, "a list of strings")
        for i, value in enumerate(values):
            if not isinstance(value, str):
                raise self.error(f"{key}", f"must be a list of strings; entry {i} is {_show(value)}")
            self._one_of(key, value, names, family)
        if len(set(values)) < len(values):
            raise self.error(key, "names one twice; name each once")
        return values

    def files(self, key: str) -> list[Path]:
        """A list of paths, relative to the file; empty where the key is missing."""
        if not self.has(key):
            return []
        values = self._list(key, "a list of paths")
        if not all(isinstance(v, str) for v in values):
            raise self.error(key, "must be a list of paths in quotes")
        return [self.document.locate(v) for v in values]

    def _list(self, key: str, what: str) -> list[Any]:
        values = self._get(key, what)
        if not isinstance(values, list):
            raise self.error(key, f"must be {what}")
        if not values:
            raise self.error(key, "is empty; give at least one entry")
        return cast("list[Any]", values)

    def _one_of(self, key: str, value: str, names: list[str], family: str) -> str:
        if value not in names:
            define = f"define it in a table [{family}.{value if BARE_KEY.fullmatch(value) else 'NAME'}]"
            either = f"choose from {', '.join(names)}, or {define}" if names else define
            remedy = suggestion(value, names, either if family else "")
            if isinstance(self.values.get(key), list):  # of several entries the one that is meant
                raise ConfigError(f"{self.label(key)}: {value!r} is not known; {remedy}")
            raise self.error(key, f"is not known; {remedy}")
        return value

    def table(self, key: str) -> Table:
        """The table under the key."""
        value = self._get(key, f"a table [{'.'.join((*self.path, key))}]")
        if not isinstance(value, dict):
            raise self.error(key, f"must be a table [{'.'.join((*self.path, key))}]")
        return Table(cast("dict[str, Any]", value), self.document, (*self.path, key))

    def tables(self, key: str) -> dict[str, Table]:
        """The named tables under the key; empty where it is missing. Names become names of files."""
        if not self.has(key):
            return {}
        family = self.table(key)
        for name in family.values:
            if not RUN_NAME.fullmatch(name):
                raise ConfigError(f"{family.label(name)}: names are letters, digits and -_.+ (at most 64)")
        return {name: family.table(name) for name in family.values}

    def rest(self) -> dict[str, Any]:
        """Everything not asked for yet: numbers, lists of numbers and strings."""
        return {key: self._plain(key, self._get(key, "")) for key in self.values if key not in self._known}

    def _plain(self, key: str, value: Any) -> Any:
        if isinstance(value, str):
            return value
        if isinstance(value, list):
            return [self._number(key, v, "SI units") for v in cast("list[Any]", value)]
        return self._number(key, value, "SI units")


def _number_in(unit: str, number: str = "a number") -> str:
    return f"{number} in {unit}" if unit else number


def _show(value: Any) -> str:
    """A value as a message shows it: in one line, not too long."""
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def named_values(
    pairs: Iterable[str], option: str, value: str = "VALUE", *, nameless: bool = False
) -> dict[str, str]:
    """Read what an option gives as NAME=VALUE.

    Parameters
    ----------
    pairs : iterable of str
    option : str
        A reference to it, for messages.
    value : str
        What stands for the value in its help.
    nameless : bool
        Whether a value may have no name; its name is then empty.

    Raises
    ------
    InputError
        If a pair has no name or no value, or one name has two values.
    """
    out: dict[str, str] = {}
    form = f"[NAME=]{value}" if nameless else f"NAME={value}"
    for pair in pairs:
        name, equals, text = (part.strip() for part in pair.partition("="))
        if nameless and not equals:
            name, text = "", name
        if not text or not (name or nameless):
            raise InputError(f"{option} {pair!r} must be {form}")
        if out.get(name, text) != text:
            remedy = f"give {name} once" if name else f"give each a name, {option} NAME={value}"
            raise InputError(f"{option} gives both {out[name]} and {text}; {remedy}")
        out[name] = text
    return out


def named_numbers(
    pairs: Iterable[str], option: str, unit: str = "SI units", *, value: str = "VALUE", nameless: bool = False,
    infinite: Iterable[str] = (),
) -> dict[str, float]:  # fmt: skip
    """Read what an option gives as NAME=NUMBER; `infinite` are names whose number may be infinite.

    Raises
    ------
    InputError
        As `named_values`, or if a value is no number or not finite.
    """
    given = named_values(pairs, option, value, nameless=nameless)
    return {
        name: _number_of(
            text, f"{option} {name}={text}" if name else f"{option} {text}", unit, name in infinite
        )
        for name, text in given.items()
    }


def listed_numbers(text: str, option: str, unit: str) -> list[float]:
    """Read the numbers between commas of an option.

    Raises
    ------
    InputError
        If a part is no number or not finite.
    """
    return [_number_of(part, f"{option} {text}", unit) for part in text.split(",")]


def _number_of(text: str, said: str, unit: str, infinite: bool = False) -> float:
    try:
        number = float(text)
    except ValueError:
        raise InputError(f"{said}: {text.strip()!r} must be a number in {unit}") from None
    if math.isnan(number) or (math.isinf(number) and not infinite):
        raise InputError(f"{said}: {text.strip()} must be a finite number in {unit}")
    return number
