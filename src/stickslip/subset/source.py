"""The text of a function of the scalar subset, where it stands, and its arguments."""

from __future__ import annotations

import ast
import functools
import inspect
import textwrap
import tokenize
import types
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import decode_source
from typing import Any

from stickslip.core.errors import LawError
from stickslip.core.pickling import TEXT

UNREADABLE = (AttributeError, IndexError, OSError, SyntaxError, TypeError, tokenize.TokenError)
"""What Python raises of code whose text is elsewhere, or another one."""
VARIADIC = inspect.CO_VARARGS | inspect.CO_VARKEYWORDS


@dataclass(frozen=True)
class Place:
    file: str
    first_line: int

    def at(self, node: ast.AST) -> str:
        return f"{self.file}, line {self.first_line + getattr(node, 'lineno', 1) - 1}"


def source_of(function: Callable[..., Any]) -> tuple[str, Place]:
    """The text of a function and where it stands."""
    try:
        code, around = function.__code__, function.__globals__
        # Only of what stands in the file: code that the file makes with `exec` has lines of its own.
        text = around.get(TEXT) if code.co_filename == around.get("__file__") else None
        return _source_of(code, code.co_filename, text)
    except UNREADABLE as error:
        raise _unreadable(function) from error


def _unreadable(function: Callable[..., Any]) -> LawError:
    name = getattr(function, "__name__", str(function))
    return LawError(f"the source of {name!r} cannot be read; write the law in a file of its own")


@functools.lru_cache(maxsize=4096)
def _source_of(code: types.CodeType, file: str, text: bytes | None) -> tuple[str, Place]:
    """By the code, which copies with other globals share: to find its end, Python reads it token by token.

    Code of two files may be equal, and their comments and places are not. Of a law's file it is the `text` that ran.
    """
    if text is not None:
        lines = [f"{line}\n" for line in decode_source(text).split("\n")[code.co_firstlineno - 1 :]]
        return textwrap.dedent("".join(inspect.getblock(lines))), Place(file, code.co_firstlineno)
    lines, first = inspect.getsourcelines(code)
    return textwrap.dedent("".join(lines)), Place(inspect.getsourcefile(code) or "<unknown>", max(first, 1))


def arguments_of(function: Callable[..., Any]) -> tuple[str, ...]:
    """The names of a function's arguments, read off its code where it has only those that the subset knows."""
    code = getattr(function, "__code__", None)
    if code is None or code.co_kwonlyargcount or code.co_flags & VARIADIC or hasattr(function, "__wrapped__"):
        return tuple(inspect.signature(function).parameters)
    return code.co_varnames[: code.co_argcount]


def parsed(function: Callable[..., Any]) -> tuple[ast.FunctionDef, Place]:
    """The tree of a function, for the caller to change, and where it stands."""
    text, where = source_of(function)
    try:
        tree = ast.parse(text).body[0]
    except UNREADABLE as error:
        raise _unreadable(function) from error
    if not isinstance(tree, ast.FunctionDef):
        raise LawError(f"{where.at(tree)}: a law's function is a `def`; write it as one")
    if tree.name != function.__code__.co_name:  # Its lines hold something else by now.
        raise _unreadable(function)
    return tree, where
