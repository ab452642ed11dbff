"""A function in words, where nothing but its text is shown: its call, an argument a line, within its docstring."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any


def call_in(function: Callable[..., Any]) -> str:
    """The docstring of a function, its call behind the first line."""
    first, _, rest = (inspect.getdoc(function) or "").partition("\n")
    signature = inspect.signature(function)
    lines = [f"    {function.__name__}(", *(f"        {said(p)}," for p in signature.parameters.values())]
    end = f"    ) -> {signature.return_annotation}"
    return "\n".join([first, "", "Called as::", "", *lines, end, rest])


def said(parameter: inspect.Parameter) -> str:
    """A parameter as it is written in the code."""
    star = {parameter.VAR_POSITIONAL: "*", parameter.VAR_KEYWORD: "**"}.get(parameter.kind, "")
    kind, default = parameter.annotation, parameter.default
    text = f"{star}{parameter.name}" + ("" if kind is parameter.empty else f": {kind}")
    if default is parameter.empty:
        return text
    return f"{text} = {default.__name__ if inspect.isroutine(default) else repr(default)}"
