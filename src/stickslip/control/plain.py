"""Samples of a controller in plain Python, where a law's own text may end in an error: it is told with its line."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from typing import Any

from stickslip.core.errors import LawError


def plain_sample(sample: Callable[..., float], *given: Any) -> float:
    """What ``sample(*given)`` returns, N·m; the first of ``given`` is the measured position, rad.

    Raises
    ------
    LawError
        Where the law divides by 0, or takes a root or logarithm of what has none: compiled, that is no number.
    """
    try:
        return sample(*given)
    except (ArithmeticError, ValueError) as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        raise LawError(
            f"{last.filename}, line {last.lineno}: {type(error).__name__} ({error}) at a position of {given[0]:g} rad; "
            "test the value with `if` before using it"
        ) from error
