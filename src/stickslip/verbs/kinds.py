"""What kind of file somebody gives, so that who wants another one says which it is and what takes it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from stickslip.core.config import toml_in

WORDS = {
    "record": ("a record", "a record (CSV, MAT, HDF5, Parquet, ...)"),
    "model": ("a model", "a model (what `stickslip identify` wrote)"),
    "map": (
        "a torque over the angle",
        "a torque over the angle (what `stickslip identify --method cogging` wrote)",
    ),
    "study": ("a study", "a study (tables [friction.NAME], [references.NAME], ...)"),
    "sweep": ("a sweep", "a sweep (`study` and tables [vary.NAME])"),
    "tuning": ("a sweep with a table [tune]", "a sweep with a table [tune]"),
    "simulation": ("a simulation", "a simulation (tables [friction], [reference], [controller])"),
    "rig": ("a rig", "a rig (a machine's name, its TOML file, or one with a table [rig])"),
    "machine": (
        "a machine",
        "a machine (`inertia`, a table [friction] and more: `stickslip machine --template`)",
    ),
    "report": ("a report", "a report"),
}
"""Each kind in two or three words, and how one that is asked for is described."""
TAKEN_BY = {
    "record": "`stickslip identify {0}` makes a model of it, `stickslip doctor {0}` checks it",
    "model": "`stickslip recommend {0}`, `stickslip export {0} --to ...` and `stickslip compare A.toml B.toml` take it",
    "map": "`stickslip export {0} --to moteus` and other targets of a map take it",
    "study": "`stickslip study {0}` runs it",
    "sweep": "`stickslip sweep {0}` runs it",
    "tuning": "`stickslip tune {0}` runs it",
    "simulation": "`stickslip simulate {0}` runs it",
    "rig": "`stickslip rig run NAME --rig {0}` runs a procedure on it",
    "machine": '`stickslip machine {0}` says what it is, and a table [machine] with `machine = "{0}"` runs it',
    "report": "a browser shows it",
}
RECORDS = {
    ".csv", ".tsv", ".txt", ".dat", ".log", ".asc", ".mat", ".h5", ".hdf5", ".parquet", ".npy", ".npz", ".tdms",
    ".mf4", ".mdf", ".bag", ".mcap", ".db3", ".wpilog", ".ulg",
}  # fmt: skip
REPORTS = {".html", ".htm", ".png", ".svg", ".pdf"}


def kind_of(path: Path) -> str:
    """One of `WORDS`, from the name and, of TOML, from the tables; "" where these do not tell."""
    suffix = path.suffix.lower()
    if suffix in RECORDS | REPORTS:
        return "record" if suffix in RECORDS else "report"
    if suffix != ".toml" or not path.is_file():
        return ""
    try:
        return kind_of_toml(toml_in(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, RecursionError):
        return ""


def kind_of_toml(table: Mapping[str, Any]) -> str:
    """One of `WORDS`; "" where the tables do not tell."""
    if "law" in table and ("parameters" in table or "format" in table):
        return "model"
    if "position_map" in table:
        return "map"
    if "study" in table:
        return "tuning" if "tune" in table else "sweep"
    if "rig" in table:
        return "rig"
    friction = table.get("friction")
    if isinstance(friction, dict) and "inertia" in table:
        return "machine"
    if "reference" in table and "controller" in table:
        return "simulation"
    return "study" if isinstance(friction, dict) and {"references", "controllers"} & table.keys() else ""


def require(path: object, *wanted: str) -> None:
    """Refuse a file that is clearly of another kind; one that is not there, or not known, is left to its reader.

    Parameters
    ----------
    path : path
        Anything else is refused.
    *wanted : str
        Kinds that will do (`WORDS`), the usual one first.

    Raises
    ------
    InputError
        That names both kinds and the verb that takes the file.
    """
    from stickslip.core.errors import InputError
    from stickslip.core.type_rules import with_article

    if not isinstance(path, (str, os.PathLike)):
        raise InputError(
            f"{WORDS[wanted[0]][1]}, or its path, is wanted, not {with_article(type(path).__name__)}"
        )
    file = Path(cast("str | os.PathLike[str]", path))
    kind = kind_of(file)
    if not kind or kind in wanted or not file.exists():
        return
    raise InputError(f"{file} is {WORDS[kind][0]}, not {WORDS[wanted[0]][1]}: {TAKEN_BY[kind].format(file)}")
