"""Projects: folders with logs, models and settings. Names that people gave stand in files, and are never paths.

PROJECT/project.json                      name, when it was made
PROJECT/logs/log-ID/about.json            name of the file, how it was read, what the doctor found
PROJECT/logs/log-ID/upload.csv, record.npz, view/
PROJECT/models/model-ID/about.json, result.json, model.toml, report.html
PROJECT/settings/setting-ID/about.json, result.json, recommended.toml
PROJECT/studies/study-ID/about.json, result.json, study.toml, out/, report.html
PROJECT/rigs/rig-ID/about.json, rig.toml, and what it names
"""

from __future__ import annotations

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

from stickslip.errors import InputError

KINDS = {"logs": "log", "models": "model", "settings": "setting", "studies": "study", "rigs": "rig"}
"""What a project holds, and how the identifiers of each begin."""
PROJECT_ID = re.compile(r"\d{4}-\d{2}-\d{2}-[0-9a-f]{8}")
LONGEST_NAME = 120


class NotThere(InputError):
    """There is no such project, or nothing of that identifier in it."""


def words(name: object, otherwise: str) -> str:
    """A name as people gave it, without what does not print; `otherwise` where nothing is left."""
    kept = "".join(c if c.isprintable() else " " for c in str(name))
    return " ".join(kept.split())[:LONGEST_NAME] or otherwise


def written_whole(path: Path, data: Mapping[str, Any]) -> None:
    """Write JSON so that a reader sees the file before or after, never half of it."""
    draft = path.with_name(f"{path.name}.{secrets.token_hex(4)}.part")
    draft.write_text(json.dumps(data, ensure_ascii=False, allow_nan=False), encoding="utf-8")
    os.replace(draft, path)


def read_whole(path: Path) -> dict[str, Any]:
    """What `written_whole` wrote; empty where there is nothing of the kind."""
    try:
        found: Any = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return cast("dict[str, Any]", found) if isinstance(found, dict) else {}


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
        """What is known of it."""
        return read_whole(self.folder / "about.json")

    def update(self, **changes: Any) -> dict[str, Any]:
        """Change what is known of it. Returns all of it."""
        said = {**self.about, **changes}
        written_whole(self.folder / "about.json", said)
        return said

    @property
    def result(self) -> dict[str, Any]:
        """What a job found."""
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
        """As people gave it."""
        return str(read_whole(self.folder / "project.json").get("name", self.id))

    def add(self, kind: str, **about: Any) -> Item:
        """Make room for a log, model or setting."""
        folder = self.folder / kind / f"{KINDS[kind]}-{secrets.token_hex(4)}"
        folder.mkdir(parents=True)
        item = Item(folder)
        item.update(id=item.id, made=now(), **about)
        return item

    def item(self, kind: str, identifier: object) -> Item:
        """The log, model or setting of that identifier.

        Raises
        ------
        NotThere
        """
        word = KINDS.get(kind, "")
        if word and isinstance(identifier, str) and re.fullmatch(rf"{word}-[0-9a-f]{{8}}", identifier):
            folder = self.folder / kind / identifier
            if folder.is_dir():
                return Item(folder)
        raise NotThere(f"no such {word or 'thing'} in this project; it may have been deleted")

    def items(self, kind: str) -> list[Item]:
        """All of a kind, the oldest first."""
        found = [
            Item(f) for f in (self.folder / kind).glob(f"{KINDS[kind]}-*") if (f / "about.json").is_file()
        ]
        return sorted(found, key=lambda item: (str(item.about.get("made", "")), item.id))

    def free_name(self, kind: str, name: str) -> str:
        """The name, with a number behind it where something of the kind has it already."""
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

    def summary(self) -> dict[str, Any]:
        """Name and what it holds, as the page lists it."""
        held = {kind: [item.about for item in self.items(kind)] for kind in KINDS}
        return {"id": self.id, "name": self.name, "folder": str(self.folder), **held}


class Projects:
    """The folder of projects.

    Parameters
    ----------
    folder : Path
        It is made.

    Raises
    ------
    InputError
        If it cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            probe = folder / ".stickslip"
            probe.write_text("")
            probe.unlink()
        except OSError as error:
            raise InputError(
                f"cannot write {folder} ({error.strerror or error}); choose another place with --projects"
            ) from None

    def add(self, name: object = "") -> Project:
        """A new project."""
        folder = self.folder / f"{datetime.now(UTC):%Y-%m-%d}-{secrets.token_hex(4)}"
        folder.mkdir()
        said = words(name, f"Project of {datetime.now():%d %B %Y, %H:%M}")
        written_whole(folder / "project.json", {"name": said, "made": now()})
        return Project(folder)

    def find(self, identifier: object) -> Project:
        """The project of that identifier.

        Raises
        ------
        NotThere
        """
        if isinstance(identifier, str) and PROJECT_ID.fullmatch(identifier):
            folder = self.folder / identifier
            if (folder / "project.json").is_file():
                return Project(folder)
        raise NotThere("no such project; it may have been moved or deleted")

    def all(self) -> list[dict[str, Any]]:
        """Identifier, name and how much each holds, the newest first."""
        out: list[dict[str, Any]] = []
        for path in sorted(self.folder.glob("*/project.json"), reverse=True):
            if not PROJECT_ID.fullmatch(path.parent.name):
                continue
            project = Project(path.parent)
            counts = {kind: len(project.items(kind)) for kind in ("logs", "models", "settings")}
            out.append({"id": project.id, "name": project.name, **counts})
        return out


def now() -> str:
    """This second, in UTC."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")
