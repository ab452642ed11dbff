"""What numbers come from: hashes of sources and inputs, versions."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import platform
import sys
from collections.abc import Mapping
from pathlib import Path

import stickslip
from stickslip.core.pickling import TEXT

WITHOUT_PHYSICS = ("analyse", "cli", "report", "study", "sweep")
"""Folders of the package that cannot change a run's numbers."""


def file_hash(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


@functools.cache
def engine_hash() -> str:
    """A hash of everything in the package that a run's numbers depend on, and of what compiles it."""
    package = Path(stickslip.__file__).parent
    digest = hashlib.sha256(repr(versions()).encode())
    for file in sorted(package.rglob("*.py")):
        inside = file.relative_to(package)
        if inside.parts[0] not in WITHOUT_PHYSICS:
            digest.update(inside.as_posix().encode() + file.read_bytes())
    return digest.hexdigest()


@functools.cache
def source_hash(module: str) -> str:
    """SHA-256 of the file of an imported module (a law's file, say); empty where it has none."""
    found = sys.modules.get(module)
    text, path = getattr(found, TEXT, None), getattr(found, "__file__", None)
    if text is not None:
        return hashlib.sha256(text).hexdigest()
    return file_hash(Path(path)) if path else ""


@functools.cache
def versions() -> dict[str, str]:
    """Versions of all that takes part in the numbers, and the processor's kind."""
    found = {"stickslip": stickslip.__version__, "python": platform.python_version()}
    found.update({name: importlib.metadata.version(name) for name in ("numpy", "numba", "llvmlite")})
    return found | {"machine": platform.machine(), "system": platform.system()}


def other_versions(then: Mapping[str, str]) -> list[str]:
    """A line for everything whose version is another one now."""
    now = versions()
    return [f"{n} {now.get(n)}, was {then.get(n)}" for n in {**then, **now} if now.get(n) != then.get(n)]
