"""What tests of exports share."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope="session", autouse=True)
def names_of_variables_read_once() -> Iterator[None]:
    """FMPy's grammar takes 5 ms for a name, and units have the same names over and over: each is judged once."""
    try:
        validation: Any = importlib.import_module("fmpy.validation")
        lark: Any = importlib.import_module("lark")
    except ImportError:
        yield
        return
    real, judged = lark.Lark, validation._validate_variable_names

    @functools.cache
    def kept(grammar: str, **options: Any) -> Any:
        parser = real(grammar, **options)
        parser.parse = functools.cache(parser.parse)  # what it refuses is refused anew
        return parser

    def judged_once(description: Any) -> list[str]:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(lark, "Lark", kept)
            return judged(description)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(validation, "_validate_variable_names", judged_once)
        yield
