"""Projects: folders with logs, models and settings. Names given by people are stored in files and never used as paths.

PROJECT/project.json                      name, when it was made
PROJECT/logs/log-ID/about.json            name of the file, how it was read, what the doctor found
PROJECT/logs/log-ID/upload.csv, record.npz, view/
PROJECT/models/model-ID/about.json, result.json, model.toml, report.html
PROJECT/settings/setting-ID/about.json, result.json, recommended.toml
PROJECT/studies/study-ID/about.json, result.json, study.toml, out/, report.html
PROJECT/rigs/rig-ID/about.json, rig.toml, and what it names

A project may come from somebody else, so its JSON contains only facts about its data. Approvals of code are kept per
user (`stickslip.core.code_approval`), whether a rig is real is read from its file when it is armed, whether a job is
running is known from the jobs of this server, and links that lead out of a project are refused.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import secrets
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, cast

from stickslip.core.errors import InputError
from stickslip.core.whole_files import prepared_folder, write_whole

KINDS = {"logs": "log", "models": "model", "settings": "setting", "studies": "study", "rigs": "rig"}
"""Kinds of items, and the prefixes of their identifiers."""
PROJECT_ID = re.compile(r"\d{4}-\d{2}-\d{2}-[0-9a-f]{8}")
LONGEST_NAME = 120
UPLOAD = re.compile(r"upload\.[a-z0-9]{1,8}|live\.stream")
"""Names of the file of a log, independent of its original name."""
KNOWN: Mapping[str, type] = {
    "name": str, "state": str, "problem": str, "file": str, "model": str, "law": str, "verdict": str, "rig": str,
    "sentence": str, "size": int, "rows": int, "readable": bool, "real": bool, "reading": dict, "view": dict,
    "limits": dict, "asks": dict, "options": dict, "chosen": object, "columns": list, "findings": list, "facts": list,
    "sent": list, "logs": list,
}  # fmt: skip
"""Type of each value of an item's JSON; values of other types are ignored."""
EMPTY: Mapping[str, Mapping[str, Any]] = {"rigs": {"facts": [], "sent": []}, "studies": {"sent": []}}
"""Defaults for the page, by kind of item; a model without `sent` was identified here."""


class NotThere(InputError):
    """There is no such project or item."""


def words(name: object, otherwise: str) -> str:
    """Return a name without unprintable characters; `otherwise` if it is empty."""
    kept = "".join(c if c.isprintable() else " " for c in str(name))
    return " ".join(kept.split())[:LONGEST_NAME] or otherwise


def written_whole(path: Path, data: Mapping[str, Any]) -> None:
    """Write JSON atomically: a reader gets the old or the new file."""
    write_whole(path, json.dumps(data, ensure_ascii=False, allow_nan=False), "projects")


def read_whole(path: Path) -> dict[str, Any]:
    """Read the JSON of `written_whole`; empty if there is none. NaN becomes None."""
    try:
        if not path.is_file():  # reading a pipe would never end
            return {}
        # An unpaired surrogate, which JSON can contain, cannot be sent to the page.
        text = path.read_text(encoding="utf-8")
        found: Any = json.loads(text, parse_constant=lambda _: None)
        if "\\ud" in text.lower():
            found = json.loads(json.dumps(found, ensure_ascii=False).encode("utf-8", "replace"))
    except (OSError, ValueError, RecursionError):
        return {}
    return cast("dict[str, Any]", found) if isinstance(found, dict) else {}


def refuse_links(folder: Path, root: Path, shallow: bool = False) -> None:
    """Refuse a folder with a link to a place outside of `root`.

    Parameters
    ----------
    folder : Path
    root : Path
    shallow : bool
        Whether the content of the folder is not checked.

    Raises
    ------
    InputError
        Names the link.
    """
    real = Path(os.path.realpath(root))
    inside = (
        ()
        if shallow
        else (Path(at, name) for at, *names in os.walk(folder) for part in names for name in part)
    )
    for place in (folder, *inside):
        if (shallow or place.is_symlink()) and not Path(os.path.realpath(place)).is_relative_to(real):
            raise InputError(
                f"{place.relative_to(root)} is a link that leads out of {root.name}; it is not followed: put the file "
                "itself there, or delete the link"
            )


def digest_of(code: str) -> str:
    """Return the SHA-256 of code as it is shown, for `stickslip.core.code_approval`."""
    return hashlib.sha256(code.encode()).hexdigest()


@dataclass(frozen=True)
class Item:
    """A log, model or setting: its folder."""

    folder: Path

    @property
    def id(self) -> str:
        """Its identifier in the project."""
        return self.folder.name

    @property
    def about(self) -> dict[str, Any]:
        """Facts about the item, without values of a wrong type."""
        found = read_whole(self.folder / "about.json")
        kept = {k: v for k, v in found.items() if k not in KNOWN or isinstance(v, KNOWN[k])}
        if not UPLOAD.fullmatch(kept.get("file", "upload.dat")):
            del kept["file"]
        asks = cast("dict[str, Any]", kept.pop("asks", {}))
        name, code = asks.get("name"), asks.get("text")
        if isinstance(name, str) and isinstance(code, str):
            kept["asks"] = {"name": words(name, "code"), "text": code, "sha256": digest_of(code)}
        elif kept.get("state") == "asks":
            kept |= {"state": "failed", "problem": "its code is missing; delete it and drop its files again"}
        empty = EMPTY.get(self.folder.parent.name, {})
        return {**empty, **kept, "id": self.id, "name": words(kept.get("name", ""), self.id)}

    def update(self, **changes: Any) -> dict[str, Any]:
        """Update its facts; return all of them."""
        said = {**self.about, **changes}
        written_whole(self.folder / "about.json", said)
        return said

    @property
    def result(self) -> dict[str, Any]:
        """Result of its job."""
        return read_whole(self.folder / "result.json")


@dataclass(frozen=True)
class Project:
    """A folder with logs, models and settings."""

    folder: Path

    @property
    def id(self) -> str:
        """Its identifier."""
        return self.folder.name

    @property
    def name(self) -> str:
        """The name given by people."""
        return words(read_whole(self.folder / "project.json").get("name", ""), self.id)

    def add(self, kind: str, **about: Any) -> Item:
        """Create the folder of a log, model or setting."""
        folder = self.folder / kind / f"{KINDS[kind]}-{secrets.token_hex(4)}"
        folder.mkdir(parents=True)
        item = Item(folder)
        item.update(id=item.id, made=now(), **about)
        return item

    def item(self, kind: str, identifier: object) -> Item:
        """Return the log, model or setting with an identifier.

        Raises
        ------
        NotThere
        InputError
            If a link in it leads out of the project.
        """
        word = KINDS.get(kind, "")
        if word and isinstance(identifier, str) and re.fullmatch(rf"{word}-[0-9a-f]{{8}}", identifier):
            folder = self.folder / kind / identifier
            if folder.is_dir():
                refuse_links(folder, self.folder)
                return Item(folder)
        raise NotThere(f"no such {word or 'thing'} in this project; it may have been deleted")

    def items(self, kind: str) -> list[Item]:
        """Return all items of a kind, oldest first."""
        found = [
            Item(f) for f in (self.folder / kind).glob(f"{KINDS[kind]}-*") if (f / "about.json").is_file()
        ]
        return sorted(found, key=lambda item: (str(item.about.get("made", "")), item.id))

    def free_name(self, kind: str, name: str) -> str:
        """Return the name, with a number if another item of the kind has it."""
        taken = {item.about.get("name") for item in self.items(kind)}
        numbered = (f"{name} ({n})" for n in range(2, len(taken) + 3))
        return name if name not in taken else next(n for n in numbered if n not in taken)

    def remove(self, kind: str, identifier: object) -> None:
        """Delete a log, model or setting with its files.

        Raises
        ------
        NotThere
        """
        shutil.rmtree(self.item(kind, identifier).folder)


class Projects:
    """The folder of projects.

    Parameters
    ----------
    folder : Path
        Created if missing.

    Raises
    ------
    InputError
        If it cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        prepared_folder(folder, "projects")

    def add(self, name: object = "") -> Project:
        """Create a project."""
        folder = self.folder / f"{datetime.now(UTC):%Y-%m-%d}-{secrets.token_hex(4)}"
        folder.mkdir()
        said = words(name, f"Project of {datetime.now():%d %B %Y, %H:%M}")
        written_whole(folder / "project.json", {"name": said, "made": now()})
        return Project(folder)

    def find(self, identifier: object) -> Project:
        """Return the project with an identifier.

        Raises
        ------
        NotThere
        InputError
            If its folder is a link to another place.
        """
        if isinstance(identifier, str) and PROJECT_ID.fullmatch(identifier):
            folder = self.folder / identifier
            if (folder / "project.json").is_file():
                refuse_links(folder, self.folder, shallow=True)
                for name in (*KINDS, "project.json"):
                    refuse_links(folder / name, folder, shallow=True)
                return Project(folder)
        raise NotThere("no such project; it may have been moved or deleted")

    def all(self) -> list[dict[str, Any]]:
        """Return identifier, name and number of items of each project, newest first."""
        out: list[dict[str, Any]] = []
        for path in sorted(self.folder.glob("*/project.json"), reverse=True):
            if not PROJECT_ID.fullmatch(path.parent.name):
                continue
            project = Project(path.parent)
            counts = {kind: len(project.items(kind)) for kind in ("logs", "models", "settings")}
            out.append({"id": project.id, "name": project.name, **counts})
        return out


def now() -> str:
    """Return the current time in UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")
