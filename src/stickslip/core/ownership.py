"""Ownership of files: kept code runs only if no other user can change its file."""

from __future__ import annotations

import os
import stat
from pathlib import Path


def exposure_of(path: Path) -> str:
    """Return how another user could change a file or folder, as a clause; empty if none could.

    Every folder above it counts too, since whoever may rename it may replace it. The administrator (root) and a group
    that has this user's own name count as this user. Windows keeps such rights elsewhere; nothing is checked there.

    Raises
    ------
    OSError
        If the path does not exist.
    """
    if os.name == "nt":
        return ""
    whole = Path(os.path.abspath(path))
    real = Path(os.path.realpath(path))
    for place in dict.fromkeys((real, *real.parents, *whole.parents)):
        status = place.stat()
        if status.st_uid not in (os.geteuid(), 0):
            return f"{place} belongs to another user (number {status.st_uid})"
        open_to_all = status.st_mode & stat.S_IWOTH
        open_to_group = status.st_mode & stat.S_IWGRP and not _is_own_group(status.st_gid)
        # In a sticky folder such as /tmp others may add files, but not replace those of this user.
        if (open_to_all or open_to_group) and (place == real or not status.st_mode & stat.S_ISVTX):
            return f"other users can write to {place}"
    return ""


def _is_own_group(group: int) -> bool:
    """Whether a group is the one that the system made for this user alone: it has the user's name."""
    import grp
    import pwd

    try:
        user = pwd.getpwuid(os.geteuid())
        found = grp.getgrgid(group)
    except KeyError:
        return False
    return (
        found.gr_gid == user.pw_gid and found.gr_name == user.pw_name and set(found.gr_mem) <= {user.pw_name}
    )
