"""Methods of identification, one file each. `METHODS` lists them.

To add one, write its file (a function of records and `Options`, and METHOD, which names the options that it uses) and
add its name to the tuple: the command line, `stickslip.identify` and the tests then include it.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from stickslip.core.errors import UnknownName

if TYPE_CHECKING:
    from stickslip.identification.methods.method import Method

METHODS = (
    "axis",
    "inertia",
    "sliding",
    "breakaway",
    "presliding",
    "attraction",
    "lugre",
    "hysteresis",
    "cogging",
)


def method_named(name: str) -> Method:
    """Return the method of that name.

    Raises
    ------
    UnknownName
    """
    if name not in METHODS:
        raise UnknownName("method", name, METHODS)
    found: Method = importlib.import_module(f"stickslip.identification.methods.{name}").METHOD
    return found


def methods_by_option() -> dict[str, list[str]]:
    """Return the names of the methods that use an option, by the option's name."""
    out: dict[str, list[str]] = {}
    for name in METHODS:
        for option in method_named(name).uses:
            out.setdefault(option, []).append(name)
    return out
