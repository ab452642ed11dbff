"""Where compiled code is kept: a folder named after the content of the package's own kernels."""

# numba and llvmlite carry no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportMissingTypeStubs=false
# pyright: reportAttributeAccessIssue=false, reportUnknownLambdaType=false, reportUnknownArgumentType=false

from __future__ import annotations

import functools
import hashlib
import importlib.util
import os
import platform
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

import numba
from numba import config
from numba.core import event
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator
from numba.core.runtime.nrt import rtsys

from stickslip import compiling

__all__ = ["cache_folder", "cached", "decorating", "loaded"]


def _kernel_files() -> tuple[Path, ...]:
    """The files that kernels are made of, and those whose constants they hold: all of the rooms that have kernels."""
    package = Path(__file__).parent.parent
    found = (package.glob(f"{room}/**/*.py") for room in ("jit", "simulation", "machines", "rigs"))
    return tuple(sorted(file for files in found for file in files))


@functools.cache
def cache_folder() -> Path:
    """The folder for compiled code: STICKSLIP_CACHE, else the user's cache folder, else a temporary one."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version} {platform.machine()}".encode())
    for file in _kernel_files():
        digest.update(file.read_bytes())
    home = os.environ.get("STICKSLIP_CACHE") or os.path.join(
        os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "stickslip"
    )
    folder = Path(home) / digest.hexdigest()[:16]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return Path(tempfile.mkdtemp(prefix="stickslip-"))


class _Told(event.Listener):
    """Passes on that a function is compiled, other than read from the cache."""

    def on_start(self, event: Any) -> None:
        compiling.started()

    def on_end(self, event: Any) -> None:
        compiling.ended()


event.register("numba:compile", _Told())


class _Located(UserProvidedCacheLocator):
    """numba's folder of a file, which it names after where the file lies: here after its place in the package."""

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        """A room of the package, or what is generated, by its name: found wherever package and cache have moved."""
        folder = Path(py_file).absolute().parent
        if folder == cache_folder().absolute():
            return "generated"
        package = Path(__file__).parent.parent
        if folder.is_relative_to(package):
            return ".".join(folder.relative_to(package.parent).parts)
        return super().get_suitable_cache_subpath(py_file)


class _InOurFolder(CompileResultCacheImpl):
    _locator_classes = (_Located,)


class _Kept(FunctionCache):
    """numba's cache, read without what only compiling needs: its tables of all that it knows, with SciPy, 0.35 s."""

    _impl_class = _InOurFolder

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            if (found := self._load_overload(sig, target_context)) is not None:
                return found
        return super().load_overload(sig, target_context)


decorating = threading.RLock()


def cached(compiled: Any, function: Any) -> Any:
    """Keep what numba compiles of a function in our folder; numba asks for the folder when its cache is made."""
    with decorating:
        before = config.CACHE_DIR
        config.CACHE_DIR = str(cache_folder())
        try:
            compiled._cache = _Kept(function)
        finally:
            config.CACHE_DIR = before
    return compiled


def loaded(name: str, text: str) -> Any:
    """Import a generated module, written to a file so that its compiled code can be cached."""
    path = cache_folder() / f"{name}.py"
    if not path.exists():
        # Written aside and renamed, so that no other process or thread reads half a file.
        draft = path.with_suffix(f".{os.getpid()}.{threading.get_ident()}.tmp")
        draft.write_text(text)
        os.replace(draft, path)
    spec = importlib.util.spec_from_file_location(f"stickslip._compiled.{name}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
