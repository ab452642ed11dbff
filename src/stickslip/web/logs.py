"""Routes of logs: upload of files, reading by a worker, and samples as numbers."""

from __future__ import annotations

import asyncio
import re
import shutil
from importlib.resources import files
from typing import Any, cast

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from stickslip.readers.limits import memory_for
from stickslip.web.asking import Refused, Table, body, number, text
from stickslip.web.jobs import Job
from stickslip.web.projects import Item, Project, words
from stickslip.web.site import Site
from stickslip.web.uploads import received, suffix_of, time_for

NUMBERS = (
    "counts_per_rev",
    "rated_torque",
    "rated_current",
    "torque_constant",
    "force_constant",
    "gear_ratio",
    "lead",
    "pole_pairs",
    "sample_time",
)


def table(site: Site) -> Table:
    """Return handlers by method and path."""

    async def add(request: Request) -> Response:
        project = site.project(request)
        name = words(request.query_params.get("name", ""), "log")
        file = "upload" + suffix_of(name)
        item = project.add("logs", name=name, file=file, state="coming")
        site.coming.add(item.id)
        try:
            size, digest = await received(request, item.folder / file, site.max_upload)
        except BaseException:
            shutil.rmtree(item.folder, ignore_errors=True)
            raise
        finally:
            site.coming.discard(item.id)
        item.update(size=size, sha256=digest, reading={}, state="reading")
        job = read_again(site, project, item)
        return JSONResponse({"id": item.id, "job": job.id}, 201)

    async def example(request: Request) -> Response:
        project = site.project(request)
        content = (files("stickslip") / "demo.csv").read_bytes()
        item = project.add(
            "logs", name="demo.csv", file="upload.csv", state="reading", reading={}, size=len(content)
        )
        (item.folder / "upload.csv").write_bytes(content)
        return JSONResponse({"id": item.id, "job": read_again(site, project, item).id}, 201)

    async def again(request: Request) -> Response:
        project, item = site.project(request), site.item(request, "logs")
        item.update(reading=reading_of(await body(request)), state="reading")
        return JSONResponse({"job": read_again(site, project, item).id})

    async def samples(request: Request) -> Response:
        from stickslip.web import views

        item = site.item(request, "logs")
        view: dict[str, Any] = item.about.get("view", {})
        if not view:
            raise Refused(409, "this log has not been read yet")
        asked = request.query_params
        start, end = (number(asked.get(k, d), k) for k, d in (("from", "-1e300"), ("to", "1e300")))
        bins = int(min(max(number(asked.get("bins", "1000"), "bins"), 1.0), views.MOST_BINS))
        try:
            places = channels_of(asked.get("channels", ""), len(view["channels"]))
            content = await asyncio.to_thread(
                views.samples, item.folder / "view", view, places, start, end, bins
            )
        except (OSError, LookupError, TypeError, ValueError):
            raise Refused(409, "the view of this log is damaged; read the log again") from None
        return Response(content, media_type="application/octet-stream")

    return {
        ("POST", "/projects/{project}/logs"): add,
        ("POST", "/projects/{project}/example"): example,
        ("PUT", "/projects/{project}/logs/{item}/reading"): again,
        ("GET", "/projects/{project}/logs/{item}/samples"): samples,
    }  # fmt: skip


def read_again(site: Site, project: Project, item: Item) -> Job:
    """Start a worker that reads a log with its current options.

    Raises
    ------
    Refused
        If its file is missing.
    """
    about = item.about
    file = item.folder / str(about.get("file", ""))
    if not file.is_file():
        raise Refused(409, f"the file of {about['name']} is missing; drop it again")
    size = file.stat().st_size
    request = {
        "task": "read", "folder": str(item.folder), "file": file.name, "name": about["name"],
        "reading": reading_of(about.get("reading", {})), "memory": memory_for(size),
    }  # fmt: skip

    def finish(job: Job) -> None:
        if not item.folder.is_dir():
            return
        if job.state == "done":
            item.update(state="read", **job.result)
        else:
            item.update(
                state="unread", readable=False, problem=job.error or "reading it was cancelled", columns=[]
            )
        job.result = {}

    def meanwhile(shown: dict[str, Any]) -> None:
        if item.folder.is_dir():
            item.update(state="looking", **shown)

    return site.jobs.start(
        project, "read", f"Reading {about['name']}", request, item=item.id, short=True, limit=time_for(size),
        finish=finish, meanwhile=meanwhile,
    )  # fmt: skip


def channels_of(given: str, count: int) -> list[int]:
    """Return indices of channels, such as "0,2"; all by default.

    Raises
    ------
    Refused
    """
    if not given:
        return list(range(count))
    places = [int(p) if re.fullmatch(r"\d{1,4}", p) else count for p in given.split(",")][:64]
    if any(p >= count for p in places):
        raise Refused(400, f"channels must be indices from 0 to {count - 1}")
    return places


def reading_of(data: dict[str, Any]) -> dict[str, Any]:
    """Return the options for reading a log from the form.

    Raises
    ------
    Refused
    """
    out: dict[str, Any] = {}
    mapping: Any = data.get("map", {})
    if not isinstance(mapping, dict) or len(cast("dict[str, Any]", mapping)) > 50:
        raise Refused(400, "map must have a column for each channel")
    columns = cast("dict[str, Any]", mapping)
    out["map"] = {k: text(columns, k) for k in columns if columns[k] not in ("", None)}
    for name in (*NUMBERS, "start", "end"):
        if data.get(name) not in ("", None):
            out[name] = number(data[name], name)
    if data.get("side") not in ("", None):
        out["side"] = text(data, "side")
        if out["side"] not in ("motor", "load"):
            raise Refused(400, "side must be motor or load")
    ranges: Any = data.get("leave_out", [])
    if not isinstance(ranges, list) or len(cast("list[Any]", ranges)) > 500:
        raise Refused(400, "leave_out must be a list of rows A:B")
    kept = [
        r
        for r in cast("list[Any]", ranges)
        if isinstance(r, str) and re.fullmatch(r"\d{1,12}:\d{1,12}|spikes", r)
    ]
    if len(kept) != len(cast("list[Any]", ranges)):
        raise Refused(400, "leave_out must be a list of rows A:B, or spikes")
    if kept:
        out["leave_out"] = kept
    if data.get("unwrap") is True:
        out["unwrap"] = True
    return out
