"""Where compiled code is kept: a folder named after the content of the package's own kernels."""

# numba and llvmlite carry no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportMissingTypeStubs=false
# pyright: reportAttributeAccessIssue=false, reportUnknownLambdaType=false, reportUnknownArgumentType=false

from __future__ import annotations

import atexit
import functools
import hashlib
import importlib.util
import os
import platform
import re
import shutil
import sys
import tempfile
import threading
import warnings
from pathlib import Path
from typing import Any

import numba
from numba.core import event
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.runtime.nrt import rtsys

from stickslip.core import compile_notice
from stickslip.core.errors import UnusedPlace
from stickslip.core.ownership import exposure_of

ROOMS = ("jit", "simulation", "machines", "rigs")
"""Rooms of the package that have kernels: what these are made of, with the constants that they hold."""
PACKAGE = Path(__file__).parent.parent


@functools.cache
def cache_folder(rooms: tuple[str, ...] = ROOMS) -> Path:
    """Return the folder for compiled code of some rooms: STICKSLIP_CACHE, else the user's cache folder.

    It is named after the content of these rooms. Its content is executed, so a folder that another user can change is
    not used, with a warning: a temporary one takes its place, as for a folder that cannot be written.
    """
    digest = hashlib.sha256(f"{numba.__version__} {sys.version} {platform.machine()}".encode())
    for file in sorted(file for room in rooms for file in (PACKAGE / room).glob("**/*.py")):
        digest.update(file.read_bytes())
    home = os.environ.get("STICKSLIP_CACHE") or os.path.join(
        os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "stickslip"
    )
    folder = Path(home) / digest.hexdigest()[:16]
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        exposure = exposure_of(folder)
        if exposure:
            warnings.warn(
                f"compiled code is not read from {home}, as {exposure}; correct the owner and the mode (chmod go-w), "
                "or set STICKSLIP_CACHE to a folder of your own",
                UnusedPlace,
                stacklevel=2,
            )
        elif os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return _temporary_folder()


@functools.cache
def _temporary_folder() -> Path:
    """Make a folder that only this user can read and that ends with this process."""
    folder, owner = Path(tempfile.mkdtemp(prefix="stickslip-")), os.getpid()
    # Processes that were forked from this one leave it alone.
    atexit.register(lambda: shutil.rmtree(folder, ignore_errors=True) if os.getpid() == owner else None)
    return folder


class _Told(event.Listener):
    """Passes on that a function is compiled, other than read from the cache."""

    def on_start(self, event: Any) -> None:
        # Kernels of the package are what warm-up compiles; the translated texts of laws are made in `entries`.
        module = str(event.data["dispatcher"].py_func.__module__)
        compile_notice.started(
            compile_notice.OWN_WORDS if module.startswith(TRANSLATED) else compile_notice.WORDS
        )

    def on_end(self, event: Any) -> None:
        compile_notice.ended()


event.register("numba:compile", _Told())


class _Place:
    """Where numba keeps what it compiles of a function: named after the file's place in the package and its content.

    numba's own are named after where the file lies, and older ones after when it was written: a kept cache would be
    of no use to another checkout.
    """

    def __init__(self, function: Any, file: str) -> None:
        self._py_file, self._line = file, function.__code__.co_firstlineno
        self._generated = function.__module__.startswith(GENERATED)

    @classmethod
    def from_function(cls, function: Any, file: str) -> _Place:
        return cls(function, file)

    def get_cache_path(self) -> str:
        folder = Path(self._py_file).absolute().parent
        if self._generated:
            return str(folder)
        if folder.is_relative_to(PACKAGE):
            return str(cache_folder() / ".".join(folder.relative_to(PACKAGE.parent).parts))
        return str(cache_folder() / f"{folder.name}_{hashlib.sha256(str(folder).encode()).hexdigest()[:16]}")

    def get_source_stamp(self) -> bytes:
        return _content(self._py_file)

    def get_disambiguator(self) -> str:
        return str(self._line)

    def ensure_cache_path(self) -> None:
        os.makedirs(self.get_cache_path(), exist_ok=True)


@functools.cache
def _content(file: str) -> bytes:
    return hashlib.sha256(Path(file).read_bytes()).digest()


class _InPlace(CompileResultCacheImpl):
    _locator_classes = (_Place,)


class _Kept(FunctionCache):
    """numba's cache, read without what only compiling needs: its tables of all that it knows, with SciPy, 0.35 s."""

    _impl_class = _InPlace

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            if (found := self._load_overload(sig, target_context)) is not None:
                return found
        return super().load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError as error:
            _warn_not_kept(cache_folder(), error)


def _warn_not_kept(folder: Path, error: OSError) -> None:
    """Warn that code has to be compiled again by the next process."""
    why = error.strerror or str(error)
    warnings.warn(f"compiled code is not kept in {folder.parent} ({why})", UnusedPlace, stacklevel=3)


decorating = threading.RLock()
GENERATED = "stickslip._compiled."
"""Before the names of generated modules."""
TRANSLATED = (GENERATED, "stickslip.jit.entries")
"""Before the names of modules of functions that are translated from laws."""
_CALLED = re.compile(r"^from (stickslip[\w.]*) import ", re.MULTILINE)


def cached(compiled: Any, function: Any) -> Any:
    """Keep what numba compiles of a function in our folder."""
    compiled._cache = _Kept(function)
    return compiled


def _write_module(path: Path, text: str) -> None:
    """Write a module through a separate draft: no other process or thread reads half a file."""
    draft = path.with_suffix(f".{os.getpid()}.{threading.get_ident()}.tmp")
    try:
        draft.write_text(text)
        os.replace(draft, path)
    except OSError:
        draft.unlink(missing_ok=True)
        raise


def loaded(name: str, text: str) -> Any:
    """Import a generated module, written to a file so that its compiled code can be cached.

    A text that calls nothing of the package but `stickslip.jit`, as those of laws and controllers, is as good after
    any change of the engines: it has a folder that such a change leaves as it is.
    """
    alone = set(_CALLED.findall(text)) <= {"stickslip.jit"}
    folder = cache_folder(ROOMS[:1] if alone else ROOMS)
    path = folder / f"{name}.py"
    if not path.exists():
        try:
            _write_module(path, text)
        except OSError as error:
            _warn_not_kept(folder, error)
            path = _temporary_folder() / path.name
            _write_module(path, text)
    spec = importlib.util.spec_from_file_location(f"{GENERATED}{name}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
