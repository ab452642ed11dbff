"""Routes of exports: the targets with their content, and archives to download."""

from __future__ import annotations

import asyncio
from typing import Any

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response

from stickslip.web.asking import Refused, Table, body, number, text
from stickslip.web.projects import Item, NotThere, Project
from stickslip.web.sent import ask_again
from stickslip.web.site import Site


def table(site: Site) -> Table:
    """Return handlers by method and path."""

    async def targets(_request: Request) -> Response:
        return JSONResponse({"targets": await asyncio.to_thread(described)})

    async def export(request: Request) -> Response:
        project, data = site.project(request), await body(request)
        item, source, options = asked(project, data)
        model = item if item.folder.parent.name == "models" else model_behind(project, item)
        archive = item.folder / "export.zip"
        archive.unlink(missing_ok=True)
        job = site.jobs.start(
            project, "export", f"Exporting {item.about['name']}",
            {"task": "export", "source": source, "to": text(data, "to"), "options": options, "out": str(archive)},
            item=item.id, short=True, limit=300.0, finish=lambda job: ask_again(site, project, [model], job),
        )  # fmt: skip
        return JSONResponse({"job": job.id}, 201)

    async def archive(request: Request) -> Response:
        job = site.jobs.find(site.project(request).id, request.path_params["job"])
        if job.kind != "export" or job.state != "done":
            raise Refused(409, "this export is not done")
        kind = "settings" if job.item.startswith("setting-") else "models"
        path = site.project(request).item(kind, job.item).folder / "export.zip"
        if not path.is_file():
            raise Refused(404, "this archive is gone; export it again")
        return FileResponse(path, media_type="application/zip", filename=str(job.result["file"]))

    return {
        ("GET", "/targets"): targets,
        ("POST", "/projects/{project}/exports"): export,
        ("GET", "/projects/{project}/exports/{job}"): archive,
    }  # fmt: skip


def model_behind(project: Project, setting: Item) -> Item | None:
    """Return the model of a setting; None if it has been deleted."""
    try:
        return project.item("models", setting.about.get("model"))
    except NotThere:
        return None


def described() -> list[dict[str, Any]]:
    """Return all targets with description, content and settings."""
    from stickslip.exports import CONTROLLER_TARGETS, TARGETS, target_named

    out: list[dict[str, Any]] = []
    for target in (target_named(name) for name in TARGETS):
        asks = [{"name": s.name, "meaning": s.meaning, "default": s.default} for s in target.settings]
        out.append({
            "name": target.name, "title": target.title, "carries": target.carries, "settings": asks,
            "compensator": target.name in CONTROLLER_TARGETS, "any_law": not target.forms, "tried": target.tried,
        })  # fmt: skip
    return out


def asked(project: Project, data: dict[str, Any]) -> tuple[Item, str, dict[str, Any]]:
    """Return the item to export and its settings.

    Raises
    ------
    Refused, NotThere
    """
    options: dict[str, Any] = {}
    if data.get("setting"):
        item = project.item("settings", data["setting"])
        path = item.folder / "recommended.toml"
        if data.get("compensator", True):
            options["compensator"] = "recommended"
    else:
        item = project.item("models", data.get("model"))
        path = item.folder / "model.toml"
    if not path.is_file():
        raise Refused(409, f"{item.about.get('name')} contains nothing to export")
    if data.get("nearest") is True:
        options["nearest"] = True
    if data.get("top_speed") not in (None, ""):
        options["top_speed"] = number(data["top_speed"], "top_speed")
    given: Any = data.get("settings", {})
    if not isinstance(given, dict) or not all(isinstance(v, (str, int, float)) for v in given.values()):  # type: ignore[reportUnknownVariableType, reportUnknownMemberType]
        raise Refused(400, "settings must be names with texts or numbers")
    if given:
        options["settings"] = given
    return item, str(path), options
