"""Names to things: friction laws and kinds of reference; and the files of one's own in which any such thing may stand.

Built-in ones are named in their family's tuple (``stickslip.laws.LAWS`` and so on) and imported when asked for.
Others come from installed packages (entry points ``stickslip.laws``, ``stickslip.references``, ...) or from files: a
name that ends in ``.py`` is a law's file, and the environment variable STICKSLIP_LAWS lists such files. Control laws
are looked up in `stickslip.control.registry`, kinds of rig in `stickslip.rigs.kinds`.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.util
import os
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, ParamSpec, TypeVar

from stickslip.core import code_approval, smoke_test
from stickslip.core.arguments import arguments_checked
from stickslip.core.errors import InputError, LawError, UnknownName, suggestion
from stickslip.core.pickling import TEXT
from stickslip.core.spec import COMPILED, Law, ReferenceKind
from stickslip.subset import law_layouts, lower

P = ParamSpec("P")
T = TypeVar("T")
_looking_up = threading.RLock()
"""Held while a law is made: one lock, since looking one up may look up others."""


def made_once(make: Callable[P, T]) -> Callable[P, T]:
    """`functools.cache` that gives every thread the same object: laws are equal where they are the same one."""
    kept = functools.cache(make)

    @functools.wraps(make)
    def once(*args: P.args, **kwargs: P.kwargs) -> T:
        with _looking_up:
            return kept(*args, **kwargs)

    return once


def law_names() -> tuple[str, ...]:
    """Every law's name: built in, installed, and from files named in STICKSLIP_LAWS."""
    builtin: tuple[str, ...] = importlib.import_module("stickslip.laws").LAWS
    return (*builtin, *installed("stickslip.laws"), *_from_files())


@arguments_checked
def law(name: str, named_by: str = "") -> Law:
    """The law of that name, or of the file of that path.

    Parameters
    ----------
    name : str
    named_by : str
        The file and key where the name stands; empty where the user himself names it. Code named by a file runs only
        if it is allowed (`stickslip.core.code_approval`).

    Raises
    ------
    UnknownName, LawError, CodeRefused
    """
    if name.endswith(".py"):
        return law_in(*code_at(os.path.realpath(name), named_by))
    if name in importlib.import_module("stickslip.laws").LAWS:
        return completed(importlib.import_module(f"stickslip.laws.{name}").LAW).coming_from(law, name)
    if name in (files := _from_files()):
        return files[name]
    if name in (others := installed("stickslip.laws")):
        return _tried(others[name].load(), f"installed law {name!r}").coming_from(law, name)
    raise unknown_law("law", name, law_names())


def unknown_law(family: str, name: str, known: Sequence[str]) -> UnknownName:
    """The error of a law's name that nobody knows; the name of a file of one's own has its ending."""
    file = f"{name}.py"
    if os.path.isfile(file):  # `Path.is_file` raises of a name that is too long for a file
        return UnknownName(family, name, (*known, file), file)
    if suggestion(name, known).startswith("did you mean"):
        return UnknownName(family, name, known)
    hint = f"(The name of a file of your own has its ending, {file!r}, and the folder where it lies.)"
    return UnknownName(family, name, known, further=hint)


@made_once
def completed(law: Law) -> Law:
    """The law with the choices that any law has: other parameters for v < 0, modulations."""
    plain = law.variants.get((), law)
    if plain is not law:  # Its options are those of the one family, in which equal options are one law.
        return completed(plain).having(**law.chosen)
    places = [name.split(".") for name in importlib.import_module("stickslip.laws").COMMON_CHOICES]
    common = [getattr(importlib.import_module(f"stickslip.laws.{module}"), name) for module, name in places]
    made = law.offering(common)
    return made if made is law else made.coming_from(completed, law)


@made_once
def defined_in(path: str, code: bytes) -> ModuleType:
    """The module of a file, run once: its law is one object, however often it is asked for."""
    return module_of(path, code)


def reference_names() -> tuple[str, ...]:
    """The name of every kind of reference."""
    builtin: tuple[str, ...] = importlib.import_module("stickslip.references").REFERENCES
    return (*builtin, *installed("stickslip.references"))


@arguments_checked
def reference_kind(name: str) -> ReferenceKind:
    """The kind of reference of that name.

    Raises
    ------
    UnknownName
    """
    if name in importlib.import_module("stickslip.references").REFERENCES:
        found: ReferenceKind = importlib.import_module(f"stickslip.references.{name}").REFERENCE
        return found.coming_from(reference_kind, name)
    if name in (others := installed("stickslip.references")):
        return others[name].load().coming_from(reference_kind, name)
    raise UnknownName("reference", name, reference_names())


@functools.cache
def installed(group: str) -> Mapping[str, Any]:
    """The entry points of installed packages in that group, by name."""
    return {entry.name: entry for entry in entry_points(group=group)}


def _from_files() -> dict[str, Law]:
    paths = [p for p in os.environ.get("STICKSLIP_LAWS", "").split(os.pathsep) if p]
    laws = [law_in(*code_at(os.path.realpath(p))) for p in paths]
    return {found.name: found for found in laws}


@made_once
def law_in(path: str, code: bytes) -> Law:
    """The friction law in a file of this content, which the file may not have any more; `LawError` if there is none, or
    it is wrong."""
    found = getattr(defined_in(path, code), "LAW", None)
    if not isinstance(found, Law):
        raise LawError(f"{path} defines no law; end it with `LAW = Law(...)`")
    made = _tried(found, path)
    plain: Law = made.variants.get((), made)
    if plain is made:
        return made.coming_from(law_in, path, code, path=path)
    if plain.Params.__module__ == defined_in(path, code).__name__:
        plain.coming_from(_without_options, path, code, path=path)
    return made


def _without_options(path: str, code: bytes) -> Law:
    """What `law_in` finds in a file whose law has options, with none of them."""
    made = law_in(path, code)
    return made.variants.get((), made)


@made_once
def _tried(law: Law, origin: str) -> Law:
    """A law from outside, with the choices that any law has: read in the scalar subset, and tried for some steps."""
    lower({n: getattr(law, n) for n in COMPILED if getattr(law, n)}, law_layouts(law))
    if wrong := smoke_test.complaint(law):
        raise LawError(f"{origin}: law {law.name!r}: {wrong}; correct it (`stickslip law FILE.py --check`)")
    return completed(law)


def code_at(path: str, named_by: str = "") -> tuple[str, bytes]:
    """Path and content of a file that may run."""
    if not os.path.isfile(path):
        raise LawError(f"no file {path}; give the path of the law's file")
    try:
        code = Path(path).read_bytes()
    except OSError as error:
        raise LawError(f"{path} cannot be read ({error.strerror}); give the path of the law's file") from None
    if named_by:
        code_approval.demand(path, code, named_by)
    else:
        code_approval.asked_for(path, code)
    return path, code


def module_of(path: str, code: bytes) -> ModuleType:
    """Run these bytes: no other content of the file, and no compiled one that lies beside it."""
    digest = hashlib.sha256(path.encode(errors="surrogateescape") + b"\0" + code).hexdigest()
    name = f"stickslip_file_{Path(path).stem}_{digest[:16]}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    module.__dict__[TEXT] = (
        code  # What is compiled is what ran, though the file may be another one by then, or gone.
    )
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
