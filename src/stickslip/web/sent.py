"""Routes of uploaded models, studies and rigs: store, inspect, and run once their code has been shown and approved.

A TOML file may name Python code, which runs with all rights of the user. So it runs only if this user has approved the
same bytes (`stickslip.core.code_approval`), in the page after its text was shown. Statements of a project about itself
are ignored: the approval is for the text that was shown, identified by its SHA-256.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import PurePosixPath, PureWindowsPath
from typing import Any, cast

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from stickslip.core import code_approval
from stickslip.core.config import toml_in
from stickslip.core.errors import CodeRefused
from stickslip.core.whole_files import write_whole
from stickslip.verbs.kinds import WORDS, kind_of_toml
from stickslip.web.asking import Refused, Table, body, text
from stickslip.web.jobs import Job
from stickslip.web.projects import Item, Project, words
from stickslip.web.site import Site

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_. -]{0,79}\.(toml|py|csv)", re.IGNORECASE)
"""Names that are kept because the TOML file refers to them; none leads out of the folder."""
MAIN = {"models": "model.toml", "studies": "study.toml", "rigs": "rig.toml"}
KEPT_AS = {"model": "models", "study": "studies", "simulation": "studies", "rig": "rigs"}
"""Name of each kind of file in a project."""
DEVICE = re.compile(r"/dev/[A-Za-z0-9_-]+(/[A-Za-z0-9_.-]+)*")
"""A serial port or similar device of a rig."""
RIG_FILES = ("kind", "machine", "file")
"""Keys of a rig's table that may name a file, which is read during inspection."""
LOOK, RUN = "look", "run_sent"


def table(site: Site) -> Table:
    """Return handlers by method and path."""

    def begin(project: Project, item: Item, task: str, title: str) -> Response:
        job = started(site, project, item, task, title)
        return JSONResponse({"id": item.id, "kind": item.folder.parent.name, "job": job.id}, 201)

    async def add(request: Request) -> Response:
        project = site.project(request)
        files = files_of(await body(request))
        main, kind = main_of(files)
        machine, kind = kind == "machine", "rigs" if kind == "machine" else kind
        stored = {
            MAIN[kind] if name == main and not machine else name: content for name, content in files.items()
        }
        if len(stored) < len(files):
            raise Refused(400, f"two of these files would be called {MAIN[kind]}; rename one")
        if machine:
            stored = with_rig(main, stored)
        name = words(main.removesuffix(".toml"), "study")
        item = project.add(kind, name=name, sent=sorted(files), state="looking")
        for name, content in stored.items():
            write_whole(item.folder / name, content, "projects")
        return begin(project, item, LOOK, f"Reading {main}")

    async def approve(request: Request) -> Response:
        project, item = site.project(request), site.item(request, request.path_params["kind"])
        about = item.about
        shown: dict[str, Any] = about.get("asks", {})
        digest = text(await body(request), "sha256")
        if about.get("state") != "asks" or digest != shown["sha256"]:
            raise Refused(409, "the code has changed since it was shown; open the page again and review it")
        code_approval.approve(str(item.folder / shown["name"]), digest)
        item.update(asks=None)
        return begin(project, item, LOOK, f"Running {shown['name']}")

    async def run(request: Request) -> Response:
        project, item = site.project(request), site.item(request, "studies")
        if item.about.get("state") == "asks":
            raise Refused(409, "it names code that is not approved; review it first")
        if any(job.item == item.id and not job.ended for job in site.jobs.of(project.id)):
            raise Refused(409, "it is already running")
        return begin(project, item, RUN, f"Running {item.about['name']}")

    return {
        ("POST", "/projects/{project}/sent"): add,
        ("POST", "/projects/{project}/{kind}/{item}/approval"): approve,
        ("POST", "/projects/{project}/studies/{item}/run"): run,
    }


def started(site: Site, project: Project, item: Item, task: str, title: str, short: bool = False) -> Job:
    """Start a job on an uploaded item; its result is stored in the item."""
    item.update(state="looking" if task == LOOK else "running", problem="")
    request = {"task": task, "folder": str(item.folder), "file": MAIN[item.folder.parent.name]}

    def finish(job: Job) -> None:
        told(item, job)
        if task != LOOK:
            ask_again(site, project, [item], job)

    return site.jobs.start(project, task, title, request, item=item.id, short=short, finish=finish)


def ask_again(site: Site, project: Project, items: Sequence[Item | None], job: Job) -> None:
    """Inspect the items whose code was refused, so the page shows the code and asks for approval."""
    if job.result.get("kind") == CodeRefused.__name__:
        for item in items:
            if item is not None and (item.folder / MAIN[item.folder.parent.name]).is_file():
                started(site, project, item, LOOK, f"Reading {item.about['name']}")


def told(item: Item, job: Job) -> None:
    """Store what a job found out about an item."""
    if not item.folder.is_dir():
        return
    if job.state == "done":
        item.update(**job.result)
    else:
        item.update(state=job.state, problem=job.error)


def files_of(data: dict[str, Any]) -> dict[str, str]:
    """Return the uploaded texts, by name.

    Raises
    ------
    Refused
    """
    given: Any = data.get("files")
    if not isinstance(given, list) or not 1 <= len(cast("list[Any]", given)) <= 20:
        raise Refused(400, "files must be a list of at most 20 names with texts")
    out: dict[str, str] = {}
    for one in cast("list[Any]", given):
        if not isinstance(one, dict):
            raise Refused(400, "each file must have a name and a text")
        file = cast("dict[str, Any]", one)
        name = text(file, "name")
        if not NAME.fullmatch(name):
            only = ".toml, .py and .csv files with plain names only"
            raise Refused(400, f"{name[:80]!r}: a model, study or rig comes with {only}")
        out[name] = text(file, "text")
    return out


def main_of(files: Mapping[str, str]) -> tuple[str, str]:
    """Return the main file, and the kind of item.

    Raises
    ------
    Refused
    """
    tables: dict[str, dict[str, Any]] = {}
    for name in (n for n in files if n.lower().endswith(".toml")):
        try:
            tables[name] = toml_in(files[name])
        except (ValueError, RecursionError) as error:
            raise Refused(400, f"{name} is not TOML ({' '.join(str(error).split())[:200]})") from None
    named = {PurePosixPath(value).name for one in tables.values() for value in texts_in(one)}
    first = [name for name in tables if name not in named]
    if len(first) != 1:
        raise Refused(400, "give one model or study at a time, or one rig, with the files that it names")
    main, kind = first[0], kind_of_toml(tables[first[0]])
    devices = set(devices_in(tables[main])) if kind == "rig" else set[str]()
    for name, one in tables.items():
        for value in texts_in(one):
            if leaves(value) and value not in devices:
                raise Refused(
                    400, f"{name} names {value[:80]!r}, which was not uploaded; put that file next to it"
                )
    # A machine becomes a virtual rig.
    machine = kind == "machine"
    if kind not in KEPT_AS and not machine:
        what = WORDS[kind][0] if kind else "of an unknown kind"
        raise Refused(
            400, f"{main} is {what}; the page accepts models, studies, simulations, rigs and machines"
        )
    if kind == "rig" or machine:
        complete(tables, files)
    return main, kind if machine else KEPT_AS[kind]


def with_rig(machine: str, files: dict[str, str]) -> dict[str, str]:
    """Return the files of a machine uploaded alone, with a virtual rig for it.

    Raises
    ------
    Refused
    """
    if MAIN["rigs"] in files:
        raise Refused(400, f"a machine cannot be called {MAIN['rigs']}; give it another name")
    return {MAIN["rigs"]: f'[rig]\nkind = "virtual"\nmachine = "{machine}"\n', **files}


def devices_in(table: Mapping[str, Any]) -> Iterator[str]:
    """Return the device names of a rig, which are never read as files."""
    rig = table.get("rig")
    if isinstance(rig, dict):
        said = cast("dict[str, Any]", rig)
        for value in texts_in({k: v for k, v in said.items() if k not in RIG_FILES}):
            if DEVICE.fullmatch(value) and ".." not in PurePosixPath(value).parts:
                yield value


def complete(tables: Mapping[str, Mapping[str, Any]], files: Mapping[str, str]) -> None:
    """Refuse a rig that names files that were not uploaded.

    Raises
    ------
    Refused
    """
    for name, one in tables.items():
        for key, value in files_in(one):
            if value not in files and (key == "file" or value.lower().endswith((".toml", ".py"))):
                raise Refused(
                    400, f"{name} names {value[:80]!r}, which was not uploaded; drop both together, and name "
                    "it without a folder"
                )  # fmt: skip


def files_in(table: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Return the keys of a rig or machine that may name a file, with their values."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from files_in(cast("dict[str, Any]", value))
        elif isinstance(value, str) and key in (*RIG_FILES, "law"):
            yield key, value


def texts_in(value: Any) -> Iterator[str]:
    """Yield every text in a table."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        yield from texts_in(list(cast("dict[str, Any]", value).values()))
    elif isinstance(value, list):
        for one in cast("list[Any]", value):
            yield from texts_in(one)


def leaves(value: str) -> bool:
    """Whether a text, as a path, leads out of its folder."""
    ways = PurePosixPath(value), PureWindowsPath(value)
    return value.startswith("~") or any(way.anchor or ".." in way.parts for way in ways)
