"""Routes of projects and jobs."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator

from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse

from stickslip.web.asking import Refused, Table, body
from stickslip.web.jobs import Job
from stickslip.web.projects import KINDS
from stickslip.web.site import Site


def table(site: Site) -> Table:
    """Return handlers by method and path."""
    return {**projects(site), **items(site), **jobs(site)}


def projects(site: Site) -> Table:
    """Return the routes of all projects, and of one."""

    async def all_projects(_request: Request) -> Response:
        return JSONResponse({"projects": site.projects.all(), "folder": str(site.projects.folder)})

    async def add(request: Request) -> Response:
        project = site.projects.add((await body(request)).get("name", ""))
        return JSONResponse({"id": project.id, "name": project.name}, 201)

    async def one(request: Request) -> Response:
        project = site.project(request)
        running = [job.about() for job in site.jobs.of(project.id)]
        return JSONResponse({**site.summary(project), "jobs": running})

    return {
        ("GET", "/projects"): all_projects, ("POST", "/projects"): add, ("GET", "/projects/{project}"): one,
    }  # fmt: skip


def items(site: Site) -> Table:
    """Return the routes of logs, models, settings and studies of a project."""

    async def about(request: Request) -> Response:
        item = site.item(request, known_kind(request))
        return JSONResponse({**site.about(site.project(request), item), "result": item.result})

    async def removed(request: Request) -> Response:
        kind = known_kind(request)
        item = site.item(request, kind)
        for job in site.jobs.of(request.path_params["project"]):
            if job.item == item.id:
                await site.jobs.cancel(job)
        site.project(request).remove(kind, item.id)
        return JSONResponse({"removed": item.id})

    return {
        ("GET", "/projects/{project}/{kind}/{item}"): about,
        ("DELETE", "/projects/{project}/{kind}/{item}"): removed,
    }


def jobs(site: Site) -> Table:
    """Return the routes of a project's jobs: their output and cancelling."""

    def found(request: Request) -> Job:
        return site.jobs.find(site.project(request).id, request.path_params["job"])

    async def about(request: Request) -> Response:
        return JSONResponse(found(request).about())

    async def cancelled(request: Request) -> Response:
        job = found(request)
        await site.jobs.cancel(job)
        return JSONResponse(job.about())

    async def said(request: Request) -> Response:
        job = found(request)
        seen = request.headers.get("last-event-id", "0")
        return events(job, int(seen) if seen.isdecimal() and len(seen) < 10 else 0)

    return {
        ("GET", "/projects/{project}/jobs/{job}/about"): about,
        ("DELETE", "/projects/{project}/jobs/{job}/run"): cancelled,
        ("GET", "/projects/{project}/jobs/{job}/events"): said,
    }


def known_kind(request: Request) -> str:
    """Return the kind of item in the path.

    Raises
    ------
    Refused
    """
    kind: str = request.path_params["kind"]
    if kind not in KINDS:
        raise Refused(404, "there is nothing at this address")
    return kind


def events(job: Job, after: int) -> Response:
    """Stream the output of a job as server-sent events; a reloaded page requests the missing ones."""

    async def stream() -> AsyncIterator[bytes]:
        async for line in job.lines(after):
            if line is None:
                yield b": still there\n\n"
            else:
                data = json.dumps(line, ensure_ascii=False)
                yield f"id: {line['n']}\ndata: {data}\n\n".encode("utf-8", "replace")

    return StreamingResponse(stream(), media_type="text/event-stream")
