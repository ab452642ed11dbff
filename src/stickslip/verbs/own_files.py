"""Files that the package writes: the command line replaces one only where stickslip wrote it and nobody changed it.

What was written stands by name and SHA-256 in the file `LEDGER` of its folder, so that the same command may be run
again, and a file of somebody else, or one edited since, is refused without ``--force``.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from stickslip.core.errors import InputError
from stickslip.core.messages import name_option
from stickslip.core.whole_files import write_whole

LEDGER = ".stickslip-written"


def refuse_foreign(paths: Iterable[Path], force: bool = False) -> None:
    """Refuse, before anything is computed, to write over a file that is not stickslip's own.

    Parameters
    ----------
    paths : iterable of Path
        What will be written.
    force : bool
        Of ``--force``.

    Raises
    ------
    InputError
        That names the file and the option.
    """
    for path in paths:
        if not path.exists():
            continue
        if path.is_dir():
            raise InputError(f"{path} is a folder; give the name of a file")
        if not path.is_file():
            raise InputError(f"{path} is not a regular file; give another name")
        if not force and not ours(path):
            raise InputError(
                f"{path} exists and was not written by stickslip, or was edited since; use "
                f"{name_option('force')} to overwrite "
                "it, or give another name"
            )


def ours(path: Path) -> bool:
    """Whether the file is as stickslip wrote it last."""
    return _ledger(path.parent).get(path.name) == _hash(path)


def listed(path: Path) -> bool:
    """Whether stickslip wrote a file of that name in this folder, edited since or not."""
    return path.name in _ledger(path.parent)


def written(paths: Iterable[Path]) -> None:
    """Note that these files are stickslip's own, as they are now."""
    folders: dict[Path, dict[str, str]] = {}
    for path in paths:
        folders.setdefault(path.parent, _ledger(path.parent))[path.name] = _hash(path)
    for folder, known in folders.items():
        lines = [f"{digest}  {name}\n" for name, digest in known.items() if (folder / name).exists()]
        with suppress(InputError):  # Then the next call requires --force.
            write_whole(folder / LEDGER, "".join(lines))


def _ledger(folder: Path) -> dict[str, str]:
    """SHA-256 by name; empty where none is kept."""
    try:
        lines = (folder / LEDGER).read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return {}
    return {name: digest for digest, _, name in (line.partition("  ") for line in lines)}


def _hash(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""
