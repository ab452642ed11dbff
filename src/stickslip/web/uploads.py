"""Receive files from the page: write them in parts, up to a limit, under generated names."""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

from starlette.requests import Request

from stickslip.verbs.kinds import RECORDS
from stickslip.web.asking import Refused

KNOWN = RECORDS | {".json", ".jsonl", ".ndjson", ".toml"}
SPARE = 256 * 2**20
"""Share of the disk that stays free."""


def suffix_of(name: str) -> str:
    """Return the suffix for the format: a known one, whatever else is in the name."""
    ending = "." + name.rpartition(".")[2].lower() if "." in name else ""
    return ending if ending in KNOWN else ".dat"


async def received(request: Request, path: Path, most: int) -> tuple[int, str]:
    """Write the request's body to a file; return its size and SHA-256.

    Raises
    ------
    Refused
        If it is larger than `most` bytes, empty, or the disk is full; the file is then removed.
    """
    said = request.headers.get("content-length", "0")
    size, digest = 0, hashlib.sha256()
    too_large = Refused(
        413,
        f"the file is larger than the {most / 2**20:.0f} MB that are taken; start `stickslip web "
        "--max-upload MB` for more",
    )
    if not said.isdecimal() or len(said) > 15 or int(said) > most:
        raise too_large
    if shutil.disk_usage(path.parent).free < int(said) + SPARE:
        raise Refused(507, "there is no space for this file on the disk")
    try:
        with path.open("xb") as file:
            async for chunk in request.stream():
                size += len(chunk)
                if size > most:
                    raise too_large
                digest.update(chunk)
                file.write(chunk)
        if not size:
            raise Refused(400, "the file is empty; give one with samples")
    except BaseException as error:
        path.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise Refused(507, f"the file cannot be stored ({error.strerror})") from None
        raise
    return size, digest.hexdigest()


def time_for(size: int) -> float:
    """Return the time limit for reading a file, s."""
    return 240.0 + 240.0 * size / 100e6
