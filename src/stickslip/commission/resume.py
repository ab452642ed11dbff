"""Records of an interrupted commissioning: what was measured with the same settings is not measured again."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.record import Record
from stickslip.rigs.procedures.base import Check, Performed, Procedure
from stickslip.rigs.rig import Rig

RESULTS = ("model.toml", "machine.toml", "recommended.toml", "report.html")
"""What a commissioning writes at its end."""


def claimed(folder: Path, rig: Rig, *, anew: bool) -> None:
    """Claim a folder for a commissioning of a rig; the records of an interrupted one of the same rig may lie in it.

    Parameters
    ----------
    folder : Path
    rig : Rig
    anew : bool
        Whether results that lie there give way.

    Raises
    ------
    InputError
        If it holds results, or records of another rig, and not `anew`.
    """
    results = [folder / name for name in RESULTS if (folder / name).exists()]
    if anew:
        for path in results:
            path.unlink()
        return
    remedy = "give another folder with --out, or --force to measure all of it again"
    if results:
        raise InputError(f"{folder} holds {', '.join(p.name for p in results)} already; {remedy}")
    for path in sorted(folder.glob("*.npz")):
        owner = _meta(path).get("rig", rig.name)
        if owner != rig.name:
            raise InputError(f"{path} is a record of {owner!r}, and this is {rig.name!r}; {remedy}")


def stamped(record: Record, procedure: Procedure, rig: Rig) -> Record:
    """The record with the settings that it was made with."""
    return Record(
        record.time, record.channels, record.units, {**record.meta, "settings": settings(procedure, rig)}
    )


def kept(path: Path, procedure: Procedure, rig: Rig, *, insist: bool) -> Performed | None:
    """What was recorded in a file, if that was done with the same settings; None else.

    With `insist`, a record that failed a check is none: it would fail at the same place for ever.
    """
    if not path.is_file() or _meta(path).get("settings") != settings(procedure, rig):
        return None
    try:
        record = Record.load(path)
    except InputError:
        return None
    checks = tuple(Check(**c) for c in record.meta["checks"])
    segments = tuple((str(label), int(begin), int(end)) for label, begin, end in record.meta["segments"])
    done = Performed(record, checks, procedure.plan(rig), segments)
    return done if done.passed or not insist else None


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


def _meta(path: Path) -> dict[str, Any]:
    """The meta of a record's file, without its channels; nothing where it is none."""
    try:
        with np.load(path, allow_pickle=False) as data:
            found: dict[str, Any] = json.loads(str(data["__header__"]))["meta"]
            return found
    except Exception:  # NumPy, zip, zlib and JSON each raise their own on a damaged file
        return {}
