"""Look up kinds of rigs by name: built in (`stickslip.rigs.RIGS`), installed, or in your own file."""

from __future__ import annotations

import importlib
import os
from pathlib import Path

from stickslip.core.errors import InputError, UnknownName
from stickslip.models import plugins
from stickslip.rigs import RIGS
from stickslip.rigs.rig import RigKind


def rig_kind_names() -> tuple[str, ...]:
    """Return the names of all kinds of rigs."""
    return (*RIGS, *plugins.installed("stickslip.rigs"))


def rig_kind(name: str, named_by: str = "") -> RigKind:
    """Return the kind of rig with a name, or from the file at a path; `named_by` as in `law`.

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
