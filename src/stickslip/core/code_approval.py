"""Code that came with a file runs only when asked for.

A law or rig that the user names (``Model("my_law.py")``, ``--law my_law.py``, STICKSLIP_LAWS) is asked for. One that a
TOML file names (``law = "x.py"``, ``plugins``, ``kind = "x.py"``) may come from somebody else: it runs inside
`allow_code`, with ``--allow-code`` on the command line, after its text was confirmed in the page, or if this user
approved the same bytes before. Approvals are kept per user, as SHA-256 of the bytes, in the file ``approved`` of the
folder STICKSLIP_CONFIG, else the user's folder of settings: one store for the command line and the page, outside of
every folder that somebody may send. What the code itself imports is not looked at. A pickle runs the text of a law's
file that it holds without being asked, as every pickle may run code: unpickle only what comes from somebody whose code
you would run.
"""

from __future__ import annotations

import hashlib
import os
import sys
import warnings
from collections.abc import Generator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

from stickslip.core.arguments import arguments_checked
from stickslip.core.errors import CodeRefused, InputError, UnusedPlace, unwritable
from stickslip.core.messages import ask_for_code
from stickslip.core.ownership import exposure_of

_allowed: ContextVar[bool] = ContextVar("stickslip_code_allowed", default=False)
_remember: ContextVar[bool] = ContextVar("stickslip_code_remember", default=False)
_ran: set[str] = set()
"""SHA-256 of what ran in this process."""


@arguments_checked
@contextmanager
def allow_code(allowed: bool = True, *, remember: bool = False) -> Generator[None]:
    """Let code that TOML files name run: the laws and rigs of a model, study or rig that somebody sent.

    Parameters
    ----------
    allowed : bool
        False refuses code that is not approved, as outside of it.
    remember : bool
        Whether what runs is known from now on, in other processes too.
    """
    before = _allowed.set(allowed), _remember.set(remember)
    try:
        yield
    finally:
        _allowed.reset(before[0])
        _remember.reset(before[1])


def approved_file() -> Path:
    """Return the file that keeps the SHA-256 of code that this user has let run: a line each, with its path."""
    own = os.environ.get("STICKSLIP_CONFIG")
    settings = os.environ.get("XDG_CONFIG_HOME") or os.path.expanduser("~/.config")
    return (Path(own) if own else Path(settings) / "stickslip") / "approved"


def approve(path: str, digest: str) -> None:
    """Keep the SHA-256 of code that this user lets run, for every later process.

    Parameters
    ----------
    path : str
        Of the code, for people who read the list.
    digest : str

    Raises
    ------
    InputError
        If it cannot be kept.
    """
    file = approved_file()
    try:
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        if exposure := exposure_of(file if file.exists() else file.parent):
            raise InputError(
                f"an approval is not kept in {file}, as {exposure}; correct the owner and the mode"
            )
        with os.fdopen(os.open(file, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600), "ab") as out:
            # One write, so that approvals of two processes do not mix; after a line that was cut short, a new one.
            line = f"{digest}  {' '.join(path.split())}\n".encode("utf-8", "backslashreplace")
            out.write(line if _ends_with_newline(file) else b"\n" + line)
    except OSError as error:
        raise unwritable(file, error, "STICKSLIP_CONFIG") from None


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
    if digest in _ran or digest in _approved():
        return
    if not _allowed.get():
        raise CodeRefused(
            f"{named_by} would run the Python code of {path}, which is not approved on this computer; read it, then "
            f"{ask_for_code()}",
            path, code,
        )  # fmt: skip
    _note(path, digest)
    if _remember.get():
        print(f"stickslip: runs {path}; approved until it changes (SHA-256 {digest[:12]})", file=sys.stderr)


def _approved() -> set[str]:
    file = approved_file()
    try:
        if exposure := exposure_of(file):
            warnings.warn(
                f"approvals in {file} are ignored, as {exposure}; correct the owner and the mode (chmod go-w)",
                UnusedPlace,
                stacklevel=2,
            )
            return set()
        lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return set()
    return {line.partition(" ")[0] for line in lines}


def _note(path: str, digest: str) -> None:
    _ran.add(digest)
    if _remember.get() and digest not in _approved():
        with suppress(InputError):  # Without a folder of settings the next run requires it again.
            approve(path, digest)


def _ends_with_newline(file: Path) -> bool:
    content = file.read_bytes()
    return not content or content.endswith(b"\n")
