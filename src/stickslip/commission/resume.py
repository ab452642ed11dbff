"""Records of an interrupted commissioning: what was measured with the same settings is not measured again."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from stickslip.core.errors import InputError
from stickslip.core.messages import name_option
from stickslip.core.record import Record
from stickslip.rigs.procedures.base import Check, Performed, Procedure
from stickslip.rigs.rig import Rig

RESULTS = ("model.toml", "machine.toml", "recommended.toml", "report.html")
"""What a commissioning writes at its end."""
RECORDS = (
    "inertia", "breakaway", "sliding", "presliding", "attraction", "stickslip", "cogging", "resonance", "track-*",
)  # fmt: skip
"""Names of its records, without `.npz`."""


def claimed(folder: Path, rig: Rig, *, anew: bool, own: Callable[[Path], bool]) -> None:
    """Claim a folder for a commissioning of a rig; it may contain the records of an interrupted one of the same rig.

    Parameters
    ----------
    folder : Path
    rig : Rig
    anew : bool
        Whether earlier results are removed.
    own : callable
        Whether a result was written by this package.

    Raises
    ------
    InputError
        If it contains results or records of another rig, and not `anew`; or, under a name that a commissioning
        writes, a file of somebody else or a damaged record.
    """
    results = [folder / name for name in RESULTS if (folder / name).exists()]
    for path in results:
        if not own(path):
            raise InputError(
                f"{path} was not written by a commissioning, which would overwrite it; move it, or give another folder "
                f"({name_option('folder')})"
            )
    records = [path for name in RECORDS for path in sorted(folder.glob(f"{name}.npz"))]
    owners = {path: loaded(path).meta.get("rig", rig.name) for path in records}
    if anew:
        for path in results:
            path.unlink()
        return
    remedy = (
        f"give another folder ({name_option('folder')}), or {name_option('force')} to measure all of it again"
    )
    if results:
        raise InputError(f"{folder} holds {', '.join(p.name for p in results)} already; {remedy}")
    for path, owner in owners.items():
        if owner != rig.name:
            raise InputError(f"{path} is a record of {owner!r}, and this is {rig.name!r}; {remedy}")


def loaded(path: Path) -> Record:
    """A record that a commissioning has saved.

    Raises
    ------
    InputError
        If it is none, or damaged.
    """
    try:
        record = Record.load(path)
    except InputError as error:
        raise InputError(
            f"{str(error).rstrip('.')}; move it away, so that this stage is measured again, or give another folder "
            f"({name_option('folder')})"
        ) from None
    if "settings" not in record.meta:
        raise InputError(
            f"{path} was not written by a commissioning, which would overwrite it; move it, or give another folder "
            f"({name_option('folder')})"
        )
    return record


def stamped(record: Record, procedure: Procedure, rig: Rig) -> Record:
    """The record with the settings that it was made with."""
    return Record(
        record.time, record.channels, record.units, {**record.meta, "settings": settings(procedure, rig)}
    )


def kept(path: Path, procedure: Procedure, rig: Rig, *, insist: bool) -> Performed | str:
    """Return the record in a file, or the reason to measure it again; an empty text if there is no file.

    With `insist`, a record that failed a check is none: it would fail at the same place for ever.

    Raises
    ------
    InputError
        If the file is damaged, or not of a commissioning.
    """
    if not path.is_file():
        return ""
    record = loaded(path)
    if record.meta["settings"] != settings(procedure, rig):
        return "with other settings"
    checks = tuple(Check(**c) for c in record.meta["checks"])
    segments = tuple((str(label), int(begin), int(end)) for label, begin, end in record.meta["segments"])
    done = Performed(record, checks, procedure.plan(rig), segments)
    return done if done.passed or not insist else "with a check that failed"


def settings(procedure: Procedure, rig: Rig) -> str:
    """All that a record depends on, as text."""
    machine: Any = getattr(rig, "machine", None)
    return json.dumps(
        {
            "procedure": procedure.name, "options": procedure.options(), "rig": rig.name,
            "sample_time": rig.sample_time, "limits": dataclasses.asdict(rig.limits),
            "machine": machine.as_dict() if machine is not None else None,
        },
        sort_keys=True,
    )  # fmt: skip
