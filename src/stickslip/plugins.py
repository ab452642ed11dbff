"""Names to things: laws, control laws, kinds of reference, kinds of rig.

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

from stickslip import approval, trial
from stickslip.control_spec import ControlLaw
from stickslip.errors import InputError, LawError, UnknownName
from stickslip.spec import Law, ReferenceKind
from stickslip.subset import law_layouts, lower

if TYPE_CHECKING:
    from stickslip.rigs.rig import RigKind

__all__ = [
    "control_law",
    "control_law_names",
    "law",
    "law_names",
    "law_or_control_law",
    "reference_kind",
    "reference_names",
    "rig_kind",
    "rig_kind_names",
]


def law_names() -> tuple[str, ...]:
    """Every law's name: built in, installed, and from files named in STICKSLIP_LAWS."""
    builtin: tuple[str, ...] = importlib.import_module("stickslip.laws").LAWS
    return (*builtin, *_installed("stickslip.laws"), *_from_files())


def law(name: str, named_by: str = "") -> Law:
    """The law of that name, or of the file of that path.

    Parameters
    ----------
    name : str
    named_by : str
        The file and key where the name stands; empty where the user himself names it. Code named by a file runs only
        if it is allowed (`stickslip.approval`).

    Raises
    ------
    UnknownName, LawError, CodeRefused
    """
    if name.endswith(".py"):
        return _law_in(*_code_at(str(Path(name).resolve()), named_by))
    if name in importlib.import_module("stickslip.laws").LAWS:
        return completed(importlib.import_module(f"stickslip.laws.{name}").LAW)
    if name in (files := _from_files()):
        return files[name]
    if name in (installed := _installed("stickslip.laws")):
        return _tried(installed[name].load(), f"installed law {name!r}")
    raise UnknownName("law", name, law_names())


@functools.cache
def completed(law: Law) -> Law:
    """The law with the choices that any law has: other parameters for v < 0, modulations."""
    places = [name.split(".") for name in importlib.import_module("stickslip.laws").COMMON_CHOICES]
    common = [getattr(importlib.import_module(f"stickslip.laws.{module}"), name) for module, name in places]
    return law.offering(common)


def control_law_names() -> tuple[str, ...]:
    """The name of every control law and velocity estimator."""
    builtin = (name for names in _control_folders().values() for name in names)
    return (*builtin, *_installed("stickslip.control_laws"))


def control_law(name: str, named_by: str = "") -> ControlLaw:
    """The control law or velocity estimator of that name, or of the file of that path; `named_by` as in `law`.

    Raises
    ------
    UnknownName, LawError, CodeRefused
    """
    if name.endswith(".py"):
        return _control_law_in(*_code_at(str(Path(name).resolve()), named_by))
    for folder, names in _control_folders().items():
        if name in names:
            found: ControlLaw = importlib.import_module(f"{folder}.{name}").CONTROL_LAW
            return found
    if name in (installed := _installed("stickslip.control_laws")):
        return installed[name].load()
    raise UnknownName("control law", name, control_law_names())


def _control_folders() -> dict[str, tuple[str, ...]]:
    """Where control laws are, and their names."""
    laws, estimators = "stickslip.control.laws", "stickslip.control.estimators"
    return {
        laws: importlib.import_module(laws).CONTROL_LAWS,
        estimators: importlib.import_module(estimators).ESTIMATORS,
    }


def law_or_control_law(path: str, named_by: str = "") -> Law | ControlLaw:
    """What a file defines: a friction law or a control law; `named_by` and errors as in `law`."""
    file, code = _code_at(str(Path(path).resolve()), named_by)
    made = vars(_defined_in(file, code))
    return _control_law_in(file, code) if "CONTROL_LAW" in made else _law_in(file, code)


@functools.cache
def _defined_in(path: str, code: bytes) -> ModuleType:
    """The module of a file, run once: its law is one object, however often it is asked for."""
    return _module_of(path, code)


@functools.cache
def _control_law_in(path: str, code: bytes) -> ControlLaw:
    found = getattr(_defined_in(path, code), "CONTROL_LAW", None)
    if not isinstance(found, ControlLaw):
        raise LawError(f"{path} defines no control law; end it with `CONTROL_LAW = ControlLaw(...)`")
    return found


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


def rig_kind(name: str, named_by: str = "") -> RigKind:
    """The kind of rig of that name, or of the file of that path; `named_by` as in `law`.

    Raises
    ------
    UnknownName, InputError, CodeRefused
    """
    if name.endswith(".py"):
        if not Path(name).is_file():
            raise InputError(f"no file {name}; give the path of the rig's file")
        found = getattr(_module_of(*_code_at(str(Path(name).resolve()), named_by)), "RIG", None)
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
    laws = [_law_in(*_code_at(str(Path(p).resolve()))) for p in paths]
    return {found.name: found for found in laws}


@functools.cache
def _law_in(path: str, code: bytes) -> Law:
    found = getattr(_defined_in(path, code), "LAW", None)
    if not isinstance(found, Law):
        raise LawError(f"{path} defines no law; end it with `LAW = Law(...)`")
    return _tried(found, path)


@functools.cache
def _tried(law: Law, origin: str) -> Law:
    """A law from outside, with the choices that any law has: read in the scalar subset, and tried for some steps."""
    functions = ("step", "rate", "guards", "switch", "steady", "holding", "stored")
    lower({n: getattr(law, n) for n in functions if getattr(law, n)}, law_layouts(law))
    if wrong := trial.complaint(law):
        raise LawError(f"{origin}: law {law.name!r}: {wrong}; correct it (`stickslip law FILE.py --check`)")
    return completed(law)


def _code_at(path: str, named_by: str = "") -> tuple[str, bytes]:
    """Path and content of a file that may run."""
    if not os.path.isfile(path):
        raise LawError(f"no file {path}; give the path of the law's file")
    try:
        code = Path(path).read_bytes()
    except OSError as error:
        raise LawError(f"{path} cannot be read ({error.strerror}); give the path of the law's file") from None
    if named_by:
        approval.demand(path, code, named_by)
    else:
        approval.asked_for(path, code)
    return path, code


def _module_of(path: str, code: bytes) -> ModuleType:
    """Run these bytes: no other content of the file, and no compiled one that lies beside it."""
    name = f"stickslip_file_{Path(path).stem}_{abs(hash(path)):x}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        exec(compile(code, path, "exec", dont_inherit=True), module.__dict__)
    except InputError:
        raise
    except (Exception, SystemExit) as error:
        raise LawError(
            f"{path} cannot be imported: {type(error).__name__}: {error}; correct the file"
        ) from error
    return module
