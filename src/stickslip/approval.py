"""Code that came with a file runs only when asked for.

A law or rig that the user names (``Model("my_law.py")``, ``--law my_law.py``, STICKSLIP_LAWS) is asked for. One that a
TOML file names (``law = "x.py"``, ``plugins``, ``kind = "x.py"``) may come from somebody else: it runs inside
`allow_code`, with ``--allow-code`` on the command line, or if this user ran the same bytes before. The command line
remembers their SHA-256 in the file ``approved`` of the folder STICKSLIP_CONFIG, else the user's folder of settings.
What the code itself imports is not looked at. A pickle runs the text of a law's file that it holds without being asked,
as every pickle may run code: unpickle only what comes from somebody whose code you would run.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Collection, Generator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

from stickslip.arguments import arguments_checked
from stickslip.errors import CodeRefused

_allowed: ContextVar[bool | frozenset[str]] = ContextVar("stickslip_code_allowed", default=False)
_remember: ContextVar[bool] = ContextVar("stickslip_code_remember", default=False)
_ran: set[str] = set()
"""SHA-256 of what ran in this process."""


@arguments_checked
@contextmanager
def allow_code(allowed: bool | Collection[str] = True, *, remember: bool = False) -> Generator[None]:
    """Let code that TOML files name run: the laws and rigs of a model, study or rig that somebody sent.

    Parameters
    ----------
    allowed : bool or collection of str
        False refuses what nobody approved; so it is outside, too. A collection holds the SHA-256 of the codes that may
        run, and no other runs, whatever was approved before.
    remember : bool
        Whether what runs is known from now on, in other processes too.
    """
    chosen = allowed if isinstance(allowed, bool) else frozenset(allowed)
    before = _allowed.set(chosen), _remember.set(remember)
    try:
        yield
    finally:
        _allowed.reset(before[0])
        _remember.reset(before[1])


def approved_file() -> Path:
    """Where the command line keeps the SHA-256 of code that this user has let run: a line each, with its path."""
    own = os.environ.get("STICKSLIP_CONFIG")
    settings = os.environ.get("XDG_CONFIG_HOME") or os.path.expanduser("~/.config")
    return (Path(own) if own else Path(settings) / "stickslip") / "approved"


def asked_for(path: str, code: bytes) -> None:
    """Note that the user himself named this code."""
    _note(path, hashlib.sha256(code).hexdigest())


def demand(path: str, code: bytes, named_by: str) -> None:
    """Refuse code that came with a file, unless it is allowed.

    Parameters
    ----------
    path : str
        Of the code.
    code : bytes
        Its content: what is looked at here is what runs.
    named_by : str
        The file and key that name it.

    Raises
    ------
    CodeRefused
    """
    digest = hashlib.sha256(code).hexdigest()
    allowed = _allowed.get()
    known = digest in allowed if isinstance(allowed, frozenset) else digest in _ran or digest in _approved()
    if known:
        return
    if allowed is not True:
        raise CodeRefused(
            f"{named_by} would run the Python code of {path}, which nobody has approved here; read it, then give "
            "--allow-code (in Python: `with stickslip.allow_code():`)",
            path, code,
        )  # fmt: skip
    _note(path, digest)
    if _remember.get():
        print(f"stickslip: runs {path}; approved until it changes (SHA-256 {digest[:12]})", file=sys.stderr)


def _approved() -> set[str]:
    try:
        lines = approved_file().read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return set()
    return {line.partition(" ")[0] for line in lines}


def _note(path: str, digest: str) -> None:
    _ran.add(digest)
    if not _remember.get() or digest in _approved():
        return
    with suppress(OSError):  # Without a folder of settings it is asked for again.
        file = approved_file()
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with file.open("a", encoding="utf-8", errors="backslashreplace") as out:
            out.write(f"{digest}  {' '.join(path.split())}\n")
