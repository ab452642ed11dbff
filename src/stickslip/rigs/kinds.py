"""Names to kinds of rig: built in (`stickslip.rigs.RIGS`), installed, or in a file of one's own."""

from __future__ import annotations

import importlib
import os
from pathlib import Path

from stickslip import plugins
from stickslip.errors import InputError, UnknownName
from stickslip.rigs import RIGS
from stickslip.rigs.rig import RigKind


def rig_kind_names() -> tuple[str, ...]:
    """The name of every kind of rig."""
    return (*RIGS, *plugins.installed("stickslip.rigs"))


def rig_kind(name: str, named_by: str = "") -> RigKind:
    """The kind of rig of that name, or of the file of that path; `named_by` as in `law`.

    Raises
    ------
    UnknownName, InputError, CodeRefused
    """
    if name.endswith(".py"):
        if not Path(name).is_file():
            raise InputError(f"no file {name}; give the path of the rig's file")
        found = getattr(plugins.module_of(*plugins.code_at(os.path.realpath(name), named_by)), "RIG", None)
        if found is None:
            raise InputError(f"{name} defines no rig; end it with `RIG = RigKind(...)`")
        return found
    if name in RIGS:
        return importlib.import_module(f"stickslip.rigs.{name}").RIG
    if name in (others := plugins.installed("stickslip.rigs")):
        return others[name].load()
    raise UnknownName("rig", name, rig_kind_names())
