"""Functions whose names are bound anew: how a law's text calls the options that were chosen for it.

A function is copied with other globals; its text stays the one in its file, so that compilation and export read
what the author wrote.
"""

from __future__ import annotations

import functools
import operator
import types
from collections.abc import Callable, Mapping, Sequence
from typing import Any

NEGATIVE = "_negative"
"""Ending of the names of parameters that hold for v < 0 alone."""


def negative(p: Any) -> Any:
    """The parameters as they hold for v < 0; in the scalar subset, the callee reads the doubled parameters."""
    kind = p.__class__
    return kind._make(_for_negative(kind)(p))


@functools.cache
def _for_negative(kind: Any) -> Callable[[Any], Any]:
    """What picks from parameters of a kind those that hold for v < 0, in the kind's order."""
    names: tuple[str, ...] = kind._fields
    places = [names.index(n + NEGATIVE) if n + NEGATIVE in names else i for i, n in enumerate(names)]
    return operator.itemgetter(*places) if len(places) > 1 else tuple


def rescoped(function: types.FunctionType, scope: dict[str, Any]) -> types.FunctionType:
    """Return `function` with other globals."""
    copy = types.FunctionType(
        function.__code__, scope, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__doc__ = function.__doc__
    copy.__module__ = function.__module__
    return copy


def bound(function: Any, names: Mapping[str, Any]) -> Any:
    """Let `function`, and the functions of its file that it calls, see `names` instead of the file's own."""
    if not names or not isinstance(function, types.FunctionType):
        return function
    home = function.__globals__
    scope = dict(home)
    for name, value in home.items():
        if isinstance(value, types.FunctionType) and value.__globals__ is home:
            scope[name] = rescoped(value, scope)
    scope.update(names)
    return rescoped(function, scope)


def wrapped(name: str, inner: Any, wrapper: Any, names: Mapping[str, Any]) -> Any:
    """The function `wrapper`, which calls `inner` as ``inner_name``."""
    return bound(wrapper, {**names, f"inner_{name}": inner})


def distinct(tables: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The tables that are not empty, each once."""
    return list({id(table): table for table in tables if table}.values())


def first_complaint(checks: Sequence[Callable[[Any], str]]) -> Callable[[Any], str] | None:
    """One check made of several."""
    if len(checks) < 2:
        return checks[0] if checks else None
    return lambda p: next((complaint for check in checks if (complaint := check(p))), "")


def least(functions: Sequence[Callable[[Any], float]]) -> Callable[[Any], float] | None:
    """The smallest of several values."""
    if len(functions) < 2:
        return functions[0] if functions else None
    return lambda p: min(function(p) for function in functions)
