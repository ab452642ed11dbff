"""Procedures for rigs, one per file. `PROCEDURES` lists them; `procedure` looks one up.

To add one, write its file with ``PROCEDURE = YourProcedure`` (`stickslip.rigs.procedures.base` defines the interface)
and add its name to this tuple.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from stickslip.core.errors import UnknownName

if TYPE_CHECKING:
    from stickslip.rigs.procedures.base import Procedure

PROCEDURES = (
    "inertia", "resonance", "breakaway", "sliding", "presliding", "stickslip", "attraction", "cogging",
    "standstill", "track", "repeat", "learn",
)  # fmt: skip


def procedure(name: str) -> type[Procedure]:
    """Return the procedure of that name.

    Raises
    ------
    UnknownName
    """
    if name not in PROCEDURES:
        raise UnknownName("procedure", name, PROCEDURES)
    found: type[Procedure] = importlib.import_module(f"stickslip.rigs.procedures.{name}").PROCEDURE
    return found
