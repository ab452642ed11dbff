"""Methods of identification: one file a method. `METHODS` names them.

To add one, write its file (a function of records and `Options`, and METHOD) and add its name to the tuple: the command
line, `stickslip.identify` and the tests then include it.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from stickslip.errors import UnknownName

if TYPE_CHECKING:
    from stickslip.identify.methods.method import Method

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
    """The method of that name.

    Raises
    ------
    UnknownName
    """
    if name not in METHODS:
        raise UnknownName("method", name, METHODS)
    found: Method = importlib.import_module(f"stickslip.identify.methods.{name}").METHOD
    return found
