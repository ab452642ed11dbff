"""Where a law or a kind of reference comes from: what its pickle says, so that another process finds the same one.

A registered one travels by its name, one of a file by the file's path and text, any other by the name that it has in
its module. None travels by value: its functions are copies that see its chosen options, and a process compiles a law
once for all models that have it.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from typing import Any, Self

from stickslip.core.errors import LawError

TEXT = "__source_text__"
"""Global of a module made of a law's file: the bytes that ran, whatever the file holds by now."""


class Findable:
    """What is found again where it came from; a copy of it is itself."""

    name: str
    home: tuple[Callable[..., Any], tuple[Any, ...]] | None = None
    """A function that finds it, and its arguments."""
    path: str = ""
    """Of its file; empty where it has a name or stands in a module."""

    def coming_from(self, find: Callable[..., Any], *arguments: Any, path: str = "") -> Self:
        """This, which `find` finds again with these `arguments`; `path` is that of its file."""
        object.__setattr__(self, "home", (find, arguments))
        object.__setattr__(self, "path", path)
        return self

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return self.home or (in_module, _place_of(self))

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: Any) -> Self:
        return self


def _place_of(thing: Findable) -> tuple[str, str, str]:
    """Module, name there and own name of what a module defines.

    Raises
    ------
    LawError
    """
    homes = {getattr(value, "__module__", None) for value in vars(thing).values() if callable(value)}
    for module in sorted(name for name in homes if isinstance(name, str)):
        for name, value in vars(sys.modules.get(module, object)).items():
            if value is thing:
                return module, name, thing.name
    raise LawError(
        f"{thing.name!r} cannot be sent to another process or kept: it is no global of the module of its functions; "
        "write it in a file of its own, and give the file's path"
    )


def in_module(module: str, name: str, called: str) -> Any:
    """What has that name in a module.

    Raises
    ------
    LawError
        If there is none here.
    """
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError):
        raise LawError(
            f"{called!r} was {name} of the module {module!r}, which has none here; write it in a file of its own, and "
            "give the file's path"
        ) from None
