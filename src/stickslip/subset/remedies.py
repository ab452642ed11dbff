"""What to write in place of what is outside the scalar subset."""

from __future__ import annotations

import ast
from collections.abc import Collection

REMEDY: dict[type[ast.AST], str] = {
    ast.While: "use `for i in range(n)` with a `break`",
    ast.ListComp: "use a `for` loop over the elements",
    ast.GeneratorExp: "use a `for` loop over the elements",
    ast.Tuple: "assign one name at a time",
    ast.List: "keep values in the state or in names",
    ast.Dict: "keep values in the state or in names",
    ast.Try: "test the value with `if` before using it",
    ast.Raise: "refuse bad parameters in `check`",
    ast.Lambda: "write a function at the top of the file",
    ast.With: "leave it out: a law only computes",
    ast.JoinedStr: "leave text out: a law only computes",
}
SAID_OTHERWISE = {
    "abs": "abs", "absolute": "abs", "fabs": "abs", "maximum": "max", "minimum": "min", "fmax": "max", "fmin": "min",
    "max": "max", "min": "min", "clip": "min(max(x, low), high)", "sign": "math.copysign(1.0, x), or if x > 0.0",
    "arctan": "math.atan", "arctan2": "math.atan2", "power": "**", "square": "x * x", "float64": "float",
    "where": "if/else",
}  # fmt: skip
"""What functions of numpy are in the subset, where `math` has no function of the same name."""


def instead_of(name: str, known: Collection[str]) -> str:
    """The remedy for a function of a module other than `math`, of whose functions `known` are in the subset."""
    inside = SAID_OTHERWISE.get(name, f"math.{name}" if name in known else "")
    return f"use {inside}" if inside else f"of modules only math is read: {', '.join(sorted(known))}"
