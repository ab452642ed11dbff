"""Atomic writing: a draft replaces the file when it is complete.

After a full disk or a killed process there is the old file or the new one, never a part. The draft's name is random and
never collides with a file of the user.
"""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Generator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from stickslip.core.errors import InputError, refuse_nul, unwritable

DRAFTS = ".stickslip-*.part"
"""Pattern of the names of drafts, to remove those that a killed process left behind."""


@contextmanager
def draft_of(target: Path, option: str = "folder") -> Generator[Path]:
    """Yield an empty draft in the folder of `target`; it replaces `target` at the end, or is removed after an error.

    A symbolic link stays one: the file that it points to is replaced.

    Parameters
    ----------
    target : Path
    option : str
        The option with which the user chooses another place.

    Raises
    ------
    InputError
        If the file cannot be written, or `target` is a folder, a pipe or a device.
    """
    refuse_nul(target, f"choose another place with {option}")
    try:
        final = Path(os.path.realpath(target))
        exists = final.exists()
        if exists and not final.is_file():
            what = "a folder" if final.is_dir() else "a pipe or device"
            raise InputError(f"{target} is {what}, not a file; choose another place with {option}")
        if exists and not os.access(final, os.W_OK):
            raise PermissionError(0, "it is read-only")
        draft = final.with_name(DRAFTS.replace("*", secrets.token_hex(8)))
        os.close(os.open(draft, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        try:
            yield draft
            if exists:
                shutil.copymode(final, draft)
            os.replace(draft, final)
        except BaseException:
            with suppress(OSError):
                draft.unlink()
            raise
    except OSError as error:
        raise unwritable(target, error, option) from None


def write_whole(target: Path, content: str | bytes, option: str = "folder") -> Path:
    """Write text (UTF-8, line ends as they are) or bytes to a file, as `draft_of` does; return `target`.

    Raises
    ------
    InputError
    """
    write_together({target: content}, option)
    return target


def write_together(contents: Mapping[Path, str | bytes], option: str = "folder") -> None:
    """Write several files as `write_whole` does: all of them or, if one cannot be written, none.

    Raises
    ------
    InputError
    """
    with ExitStack() as drafts:
        for target, content in contents.items():
            data = content if isinstance(content, bytes) else _encoded(content, target)
            drafts.enter_context(draft_of(target, option)).write_bytes(data)


def _encoded(text: str, target: Path) -> bytes:
    try:
        return text.encode()
    except UnicodeEncodeError as error:
        odd = error.object[error.start : error.end]
        raise InputError(
            f"cannot write {target}: {odd!r} in its text is not Unicode; correct that text"
        ) from None


def prepared_folder(folder: Path, option: str = "folder") -> Path:
    """Make the folder and check that files can be made in it, before anything is computed; return it.

    Raises
    ------
    InputError
    """
    refuse_nul(folder, f"choose another place with {option}")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / DRAFTS.replace("*", secrets.token_hex(8))
        os.close(os.open(probe, os.O_CREAT | os.O_EXCL | os.O_WRONLY))
        probe.unlink()
    except OSError as error:
        raise unwritable(folder, error, option) from None
    return folder
