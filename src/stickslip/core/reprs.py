"""Things by their values: the text that makes one again, and whether two hold the same."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from stickslip.core.type_rules import NUMBERS

Vector = Annotated[ArrayLike, NUMBERS]
"""An array, a list, a data frame's column, ..., of numbers: an annotation that type checkers take for `ArrayLike`."""


def is_masked(values: object) -> bool:
    """Whether it is a masked array of NumPy's."""
    return isinstance(values, np.ma.MaskedArray)


def unmasked(values: Any) -> np.ndarray[Any, Any]:
    """An array, what is masked of it being missing: NaN, or a date that is none.

    Raises
    ------
    TypeError, ValueError
        If something is masked of what is no number and no date.
    """
    if not is_masked(values) or not np.ma.getmaskarray(values).any():
        return np.asarray(values)
    masked: Any = values
    if masked.dtype.kind in "mM":
        return np.asarray(masked.filled(np.array("NaT", masked.dtype)))
    return np.asarray(masked.astype(complex if masked.dtype.kind == "c" else float).filled(np.nan))


def call_of(name: str, first: Sequence[object], named: Iterable[tuple[str, object]]) -> str:
    """A call as code: what is given by its place, then by its name."""
    said = [*(text_of(value) for value in first), *(f"{key}={text_of(value)}" for key, value in named)]
    return f"{name}({', '.join(said)})"


def text_of(value: object) -> str:
    """A value as code; NumPy's numbers as Python's."""
    return repr(cast("Any", value).item()) if isinstance(value, np.generic) else repr(value)


def making(thing: Any, standard: Mapping[str, object]) -> str:
    """A dataclass or named tuple as the call that makes it, without what is `standard`."""
    names: Iterable[str] = getattr(thing, "_fields", None) or [f.name for f in dataclasses.fields(thing)]
    named = ((name, getattr(thing, name)) for name in names)
    return call_of(
        type(thing).__name__, (), [(k, v) for k, v in named if k not in standard or v != standard[k]]
    )


def standard_of(kind: Any) -> dict[str, object]:
    """The defaults of a dataclass's fields."""
    return {f.name: f.default for f in dataclasses.fields(kind) if f.default is not dataclasses.MISSING}


def same(one: object, other: object) -> bool:
    """Whether two hold the same: arrays element by element, NaN and NaN, mappings whatever their order."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        a, b = cast("Mapping[Any, Any]", one), cast("Mapping[Any, Any]", other)
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(one, (list, tuple)) and isinstance(other, (list, tuple)):
        x, y = cast("Sequence[Any]", one), cast("Sequence[Any]", other)
        return len(x) == len(y) and all(same(v, w) for v, w in zip(x, y))
    # Columns of a data frame are no arrays of NumPy.
    if hasattr(cast("Any", one), "shape") or hasattr(cast("Any", other), "shape"):
        v, w = np.asarray(cast("Any", one)), np.asarray(cast("Any", other))
        return v.shape == w.shape and bool(np.all((v == w) | ((v != v) & (w != w))))
    return bool(one == other) or bool(one != one and other != other)
