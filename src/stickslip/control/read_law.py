"""Control laws from outside, read in the scalar subset when they are first used: errors name the author's own line.

Later, in a controller, a law is a part of a longer text.
"""

from __future__ import annotations

import types
from collections.abc import Callable
from typing import Any

from stickslip.core.control_spec import ControlLaw, Signals
from stickslip.core.errors import LawError
from stickslip.core.pickling import TEXT
from stickslip.core.spec import Surroundings, fields_of
from stickslip.subset import Layout, lower
from stickslip.subset.layout import INPUT, PARAMETER, SURROUNDINGS
from stickslip.subset.source import arguments_of, source_of

TAKES = {
    "sample": ("y", "z", "p", "u"),
    "take_over": ("missing", "y", "z", "p", "u"),
    "accelerating": ("y", "z", "p", "u"),
}
"""The functions that are written in the subset, and their arguments."""
DEVIATION = ("z", "p", "sample_time")
OURS = "stickslip.control."
"""Where the laws of the package are: they are read in its tests."""


_read: set[Any] = set()
"""The texts that were read."""


def read(law: ControlLaw) -> ControlLaw:
    """The law, where its functions are in the scalar subset.

    Raises
    ------
    LawError
        With the file and line of the author, and what to write instead.
    """
    if str(getattr(law.written["sample"], "__module__", "")).startswith(OURS):
        return law
    # By their texts: with other sines in the place of `math`'s, as its contract tries it, a law is the same.
    functions = [*(getattr(law, n) for n in TAKES), *law.deviations.values(), *law.option_scope().values()]
    # Of a file its whole text, which holds what the functions call.
    files = {getattr(f, "__globals__", {}).get(TEXT) for f in functions}
    texts = [getattr(f, "__code__", f) for f in functions]
    fields = ((f.name, f.per_element) for f in (*law.fields, *law.state_fields))
    key = (frozenset(files), *texts, *fields, law.holds_friction)
    if key not in _read:
        insist_on_subset(law)
        _read.add(key)
    return law


def insist_on_subset(law: ControlLaw) -> None:
    """Read every function of a law; errors as of `read`."""
    for name, takes in TAKES.items():
        if function := getattr(law, name):
            _insist(law, name, function, takes)
    for name, function in law.deviations.items():
        _insist(law, f"the deviation of {name}", function, DEVIATION)


def _insist(law: ControlLaw, name: str, function: Callable[..., Any], takes: tuple[str, ...]) -> None:
    wanted = (
        f"write it as `def {getattr(function, '__name__', name)}({', '.join(takes)}):` at the top of the file"
    )
    if not isinstance(function, types.FunctionType):
        kind = "a method" if isinstance(function, types.MethodType) else f"no function but {function!r}"
        raise LawError(f"{_place(law, function)}: {name} is {kind}; {wanted}")
    names = arguments_of(function)
    if len(names) != len(takes):
        raise LawError(f"{_place(law, function)}: {name} takes ({', '.join(names)}); {wanted}")
    known = _layouts(law)
    lower(
        {function.__name__ if name not in TAKES else name: function},
        {given: known[role] for given, role in zip(names, takes) if role in known},
    )


def _place(law: ControlLaw, function: Callable[..., Any]) -> str:
    """File and line of a function, or the law's name where it has none."""
    try:
        where = source_of(function)[1]
    except LawError:
        return f"control law {law.name!r}"
    return f"{where.file}, line {where.first_line}"


def _layouts(law: ControlLaw) -> dict[str, Layout]:
    """The layouts of a law's arguments by their roles: only the state is its own to write."""
    held = ("friction_",) if law.holds_friction else ()
    return {
        "y": Layout.of(fields_of(Signals), counted=False, fixed=INPUT),
        "z": Layout.of(law.state_fields, counted=False, parts=held),
        "p": Layout.of(law.fields, counted=True, parts=held, fixed=PARAMETER),
        "u": Layout(Surroundings._fields, fixed=SURROUNDINGS),
    }
