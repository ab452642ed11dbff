"""A mapping in the place of a TOML file: its values as that file has them, and the file, for as long as it is read."""

from __future__ import annotations

import datetime
import os
import tempfile
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from stickslip.core.arguments import refusal
from stickslip.core.config import BARE_KEY
from stickslip.core.errors import ConfigError, InputError, unwritable
from stickslip.core.type_rules import Wrong

PLAIN = "a number, text, True or False, a list or a mapping"
FILES = {"law": ".py", "machine": ".toml", "model": ".toml"}
"""Keys whose text is the path of a file where it ends so."""


@dataclass(frozen=True)
class Place:
    """Where in a mapping something stands.

    Attributes
    ----------
    document : str
        How messages call the mapping: "study".
    name : str
        Dotted keys.
    last : str
        The last of them.
    """

    document: str
    name: str = ""
    last: str = ""

    def __str__(self) -> str:
        return f"{self.document}: {self.name}" if self.name else self.document

    def key(self, key: str) -> Place:
        """What stands there under a key."""
        shown = key if BARE_KEY.fullmatch(key) else repr(key)
        return Place(self.document, f"{self.name}.{shown}" if self.name else shown, key)

    def entry(self, number: int) -> Place:
        """What stands there in a list."""
        return Place(self.document, f"{self.name}[{number}]", self.last)

    def wrong(self, value: object, words: str) -> InputError:
        """The error of a value that is not what it must be."""
        return refusal(self.document, self.name or "the mapping", Wrong("", value, words))

    @contextmanager
    def blamed(self) -> Generator[None]:
        """Let an `InputError` raised inside name this place."""
        try:
            yield
        except ConfigError:
            raise
        except InputError as error:
            raise ConfigError(f"{self}: {error}") from None


def mapping_at(value: object, at: Place, words: str) -> dict[str, Any]:
    """A mapping whose keys are texts; `words` say what else would do."""
    if not isinstance(value, Mapping):
        raise at.wrong(value, words)
    found = cast("Mapping[Any, Any]", value)
    for key in found:
        if not isinstance(key, str):
            raise ConfigError(f"{at}: the key {key!r} must be text")
    return dict(found)


def plain(value: Any, at: Place, key: str = "") -> Any:
    """A value as a TOML file has it: of NumPy's numbers Python's, of arrays lists, of paths absolute ones."""
    if hasattr(value, "to_numpy"):
        value = value.to_numpy()
    if isinstance(value, (np.ndarray, np.generic)):
        value = cast("Any", value).tolist()
    if isinstance(value, (bool, int, float, datetime.date, datetime.time)):
        return value
    if isinstance(value, str):
        return absolute(value) if value.endswith(FILES.get(key, "\0")) else value
    if isinstance(value, os.PathLike):
        return absolute(cast("os.PathLike[str]", value))
    if isinstance(value, Mapping):
        return {k: plain(v, at.key(k), k) for k, v in mapping_at(cast("Any", value), at, PLAIN).items()}
    if isinstance(value, (list, tuple)) and not hasattr(cast("Any", value), "_fields"):
        return [plain(v, at.entry(i), key) for i, v in enumerate(cast("list[Any]", value))]
    raise at.wrong(cast("object", value), PLAIN)


def absolute(path: str | os.PathLike[str]) -> str:
    """A path that means the same file in a TOML file, wherever that lies; one that cannot be is left to the reader."""
    text = os.fspath(path)
    return os.path.abspath(text) if text.strip() and text.isprintable() else text


@contextmanager
def file_of(
    given: Any,
    folder: str | os.PathLike[str] | None,
    verb: str,
    tables: Callable[[Any, Place], dict[str, Any]],
) -> Generator[tuple[Any, str]]:
    """What a verb was given, in the form that its reader takes, and how messages call it.

    Parameters
    ----------
    given : mapping or what the reader takes itself
        A mapping becomes a file that is there until the end; its name is that of `folder`, for results to be found
        again.
    folder : path, optional
        Of the results.
    verb : str
    tables : callable
        Gives the content of the file.

    Raises
    ------
    InputError
        If something cannot stand in a file.
    """
    if not isinstance(given, Mapping):
        yield given, ""
        return
    if not given:
        raise InputError(
            f"{verb}: file = {{}} is empty; give the path of a TOML file, or a mapping with the content of one"
        )
    import tomli_w

    text = tomli_w.dumps(tables(given, Place(verb)))
    name = Path(os.path.realpath(folder)).name if folder is not None else ""
    with tempfile.TemporaryDirectory(prefix="stickslip-") as temporary:
        path = Path(temporary) / f"{name or verb}.toml"
        try:
            path.write_text(text, encoding="utf-8")
        except UnicodeEncodeError as error:
            raise InputError(
                f"{verb}: {error.object[error.start]!r} is not Unicode; correct that text"
            ) from None
        except OSError as error:
            raise unwritable(path, error) from None
        yield path, verb


def insist_on_folder(given: object, folder: object, verb: str) -> None:
    """Refuse a mapping without a folder: what is computed is found again by the folder's name.

    Raises
    ------
    InputError
    """
    if isinstance(given, Mapping) and given and folder is None:
        raise InputError(
            f"{verb}: folder is missing, and a {verb} that is given as a mapping is named after it; give one, "
            f"folder='my-{verb}'"
        )
