"""Names to things: laws, kinds of reference, compensators, kinds of rig.

Built-in ones are named in their family's tuple (``stickslip.laws.LAWS`` and so on) and imported when asked for.
Others come from installed packages (entry points ``stickslip.laws``, ``stickslip.references``, ``stickslip.rigs``)
or from files: a name that ends in ``.py`` is a law's file, and the environment variable STICKSLIP_LAWS lists such
files.
"""

from __future__ import annotations

import functools
import importlib
import importlib.util
import os
import sys
from collections.abc import Mapping
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from stickslip.errors import InputError, LawError, UnknownName
from stickslip.spec import Law, ReferenceKind
from stickslip.subset import law_layouts, lower

if TYPE_CHECKING:
    from stickslip.rigs.rig import RigKind

__all__ = ["law", "law_names", "reference_kind", "reference_names", "rig_kind", "rig_kind_names"]


def law_names() -> tuple[str, ...]:
    """Every law's name: built in, installed, and from files named in STICKSLIP_LAWS."""
    builtin: tuple[str, ...] = importlib.import_module("stickslip.laws").LAWS
    return (*builtin, *_installed("stickslip.laws"), *_from_files())


def law(name: str) -> Law:
    """The law of that name, or of the file of that path.

    Raises
    ------
    UnknownName, LawError
    """
    if name.endswith(".py"):
        return _law_in(str(Path(name).resolve()))
    if name in importlib.import_module("stickslip.laws").LAWS:
        return completed(importlib.import_module(f"stickslip.laws.{name}").LAW)
    if name in (files := _from_files()):
        return files[name]
    if name in (installed := _installed("stickslip.laws")):
        return completed(installed[name].load())
    raise UnknownName("law", name, law_names())


@functools.cache
def completed(law: Law) -> Law:
    """The law with the choices that any law has: other parameters for v < 0, modulations."""
    places = [name.split(".") for name in importlib.import_module("stickslip.laws").COMMON_CHOICES]
    common = [getattr(importlib.import_module(f"stickslip.laws.{module}"), name) for module, name in places]
    return law.offering(common)


def reference_names() -> tuple[str, ...]:
    """The name of every kind of reference."""
    builtin: tuple[str, ...] = importlib.import_module("stickslip.references").REFERENCES
    return (*builtin, *_installed("stickslip.references"))


def reference_kind(name: str) -> ReferenceKind:
    """The kind of reference of that name.

    Raises
    ------
    UnknownName
    """
    if name in importlib.import_module("stickslip.references").REFERENCES:
        found: ReferenceKind = importlib.import_module(f"stickslip.references.{name}").REFERENCE
        return found
    if name in (installed := _installed("stickslip.references")):
        return installed[name].load()
    raise UnknownName("reference", name, reference_names())


def rig_kind_names() -> tuple[str, ...]:
    """The name of every kind of rig."""
    builtin: tuple[str, ...] = importlib.import_module("stickslip.rigs").RIGS
    return (*builtin, *_installed("stickslip.rigs"))


def rig_kind(name: str) -> RigKind:
    """The kind of rig of that name, or of the file of that path.

    Raises
    ------
    UnknownName, InputError
    """
    if name.endswith(".py"):
        if not Path(name).is_file():
            raise InputError(f"no file {name}; give the path of the rig's file")
        found = getattr(_module_at(str(Path(name).resolve())), "RIG", None)
        if found is None:
            raise InputError(f"{name} defines no rig; end it with `RIG = RigKind(...)`")
        return found
    if name in importlib.import_module("stickslip.rigs").RIGS:
        return importlib.import_module(f"stickslip.rigs.{name}").RIG
    if name in (installed := _installed("stickslip.rigs")):
        return installed[name].load()
    raise UnknownName("rig", name, rig_kind_names())


@functools.cache
def _installed(group: str) -> Mapping[str, Any]:
    return {entry.name: entry for entry in entry_points(group=group)}


def _from_files() -> dict[str, Law]:
    paths = [p for p in os.environ.get("STICKSLIP_LAWS", "").split(os.pathsep) if p]
    laws = [_law_in(str(Path(p).resolve())) for p in paths]
    return {found.name: found for found in laws}


@functools.cache
def _law_in(path: str) -> Law:
    module = _module_at(path)
    found = getattr(module, "LAW", None)
    if not isinstance(found, Law):
        raise LawError(f"{path} defines no law; end it with `LAW = Law(...)`")
    functions = ("step", "rate", "guards", "switch", "steady", "holding", "stored")
    lower({n: getattr(found, n) for n in functions if getattr(found, n)}, law_layouts(found))
    return completed(found)


def _module_at(path: str) -> ModuleType:
    if not os.path.isfile(path):
        raise LawError(f"no file {path}; give the path of the law's file")
    name = f"stickslip_file_{Path(path).stem}_{abs(hash(path)):x}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except InputError:
        raise
    except Exception as error:
        raise LawError(
            f"{path} cannot be imported: {type(error).__name__}: {error}; mend the file"
        ) from error
    return module
