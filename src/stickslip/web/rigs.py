"""Routes of the rig view: a plan before anything moves, and a run that continues only while its page is open.

The page sends a sign of life every half second. Without it, or if the connection of its live signals ends, the run is
stopped: the loop ramps the torque to zero in the rig's own time, as for any signal.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator
from typing import Any, cast

from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse

from stickslip.web.asking import Refused, Table, body, text
from stickslip.web.jobs import Job
from stickslip.web.logs import read_again
from stickslip.web.projects import Item, Project
from stickslip.web.sent import LOOK, MAIN, ask_again, started
from stickslip.web.site import Site

PATIENCE = 4.0
"""Time without a sign of life from the page after which the rig is stopped, s"""
FRAME = 0.04
"""Pause between two frames of live signals, s: more than 20 frames per second"""
SHOWN = ("position", "position_reference", "velocity", "torque_command", "motor_torque")
KILLED = 9
"""The signal that kills a process that did not end on request"""
GRACE = 10.0
"""Time in addition to the rig's ramp after which a stopped run is killed, s"""
VIRTUAL: dict[str, Any] = {"sentence": "", "real": False, "limits": dict[str, float]()}
"""Facts about a machine of the library."""
MOST = 25
"""Most rows of a frame, one per interval"""


class Watch:
    """Stops every run whose page is closed.

    Parameters
    ----------
    site : Site
    """

    def __init__(self, site: Site) -> None:
        self.site = site
        self._seen: dict[str, float] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    def begin(self, job: Job) -> None:
        """Start to watch a run."""
        self._seen[job.id] = time.monotonic()
        task = asyncio.create_task(self._watch(job))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def alive(self, job: Job) -> None:
        """Note a sign of life of its page."""
        if job.id in self._seen:
            self._seen[job.id] = time.monotonic()

    def gone(self, job: Job) -> None:
        """Note that its page is closed."""
        if not job.ended:
            self._seen[job.id] = float("-inf")

    async def _watch(self, job: Job) -> None:
        while not job.ended:
            if time.monotonic() - self._seen[job.id] > PATIENCE:
                await self.site.jobs.cancel(job)
            await asyncio.sleep(0.1)
        self._seen.pop(job.id, None)


def table(site: Site) -> Table:
    """Return handlers by method and path."""
    watch = Watch(site)
    return {**beginning(site, watch), **running(site, watch)}


def beginning(site: Site, watch: Watch) -> Table:
    """Return the routes of rigs and procedures, a plan, and the start of a run."""

    async def rigs(_request: Request) -> Response:
        return JSONResponse(await asyncio.to_thread(described))

    async def plan(request: Request) -> Response:
        project = site.project(request)
        asked, rig = asked_of(project, await body(request))
        job = site.jobs.start(
            project, "plan", "Planning", {"task": "rig_plan", **asked}, short=True, limit=120.0,
            finish=lambda job: ask_again(site, project, [rig], job),
        )  # fmt: skip
        return JSONResponse({"job": job.id}, 201)

    async def start(request: Request) -> Response:
        project, data = site.project(request), await body(request)
        if data.get("armed") is not True:
            raise Refused(409, "the rig is not armed: read its plan, then arm it")
        asked, rig = asked_of(project, data)
        said = await facts_now(site, project, rig) if rig else VIRTUAL
        if said["sentence"] and data.get("understood") != said["sentence"]:
            raise Refused(409, f"{said['sentence']}: confirm this before the rig is armed")
        refuse_second(site, project, real=said["real"])
        on = rig.about["name"] if rig else asked["machine"]
        name = project.free_name("logs", f"{asked['procedure']} on {on}")
        item = project.add("logs", name=name, file="live.stream", state="coming", reading={}, size=0)
        confirmed = {"real": said["real"], "understood": said["sentence"]}
        work = {"task": "rig_run", "folder": str(item.folder), **confirmed, **asked}
        job = site.jobs.start(
            project, "rig", name, work, item=item.id, short=True,
            grace=GRACE + said["limits"].get("stop_time", 0.0),
            finish=lambda job: kept(site, project, item, job),
        )  # fmt: skip
        watch.begin(job)
        return JSONResponse({"job": job.id, "log": item.id}, 201)

    return {
        ("GET", "/rigs"): rigs,
        ("POST", "/projects/{project}/rig/plan"): plan,
        ("POST", "/projects/{project}/rig/run"): start,
    }


def running(site: Site, watch: Watch) -> Table:
    """Return the routes of signs of life and of the live signals."""

    def found(request: Request) -> Job:
        job = site.jobs.find(site.project(request).id, request.path_params["job"])
        if job.kind != "rig":
            raise Refused(404, "this job is not a run of a rig")
        return job

    async def alive(request: Request) -> Response:
        job = found(request)
        watch.alive(job)
        return JSONResponse({"state": job.state})

    async def live(request: Request) -> Response:
        job = found(request)
        item = site.project(request).item("logs", job.item)

        async def stream() -> AsyncIterator[bytes]:
            try:
                async for frame in frames(job, item):
                    yield f"data: {json.dumps(frame)}\n\n".encode()
            finally:
                watch.gone(job)

        return StreamingResponse(stream(), media_type="text/event-stream")

    return {
        ("POST", "/projects/{project}/rig/{job}/alive"): alive,
        ("GET", "/projects/{project}/rig/{job}/live"): live,
    }


def described() -> dict[str, Any]:
    """Return the machines of the library, and the procedures with their options."""
    from dataclasses import fields

    from stickslip.machines.files import library, machine
    from stickslip.rigs.procedures import PROCEDURES, procedure

    machines = [{"name": name, "title": machine(name).title} for name in library()]
    procedures: list[dict[str, Any]] = []
    for kind in (procedure(name) for name in PROCEDURES):
        options = [{"name": f.name, "default": written(f.default)} for f in fields(kind)]
        procedures.append({"name": kind.name, "title": kind.title, "options": options})
    return {"machines": machines, "procedures": procedures}


async def facts_now(site: Site, project: Project, rig: Item) -> dict[str, Any]:
    """Return the current facts in the file of a rig, read by a worker, independent of the project's JSON.

    Raises
    ------
    Refused
        If it cannot be run.
    """
    job = started(site, project, rig, LOOK, f"Reading {rig.about['name']}", short=True)
    async for _ in job.lines():
        pass
    if job.state != "done" or job.result.get("state") != "ready":
        raise Refused(409, job.error or "this rig cannot be run; open it in the project to see why")
    return job.result


def refuse_second(site: Site, project: Project, real: bool) -> None:
    """Refuse a second rig in a project, and a second real one in all projects, because both might be the same machine.

    Raises
    ------
    Refused
    """
    moving = [job for job in site.jobs.all() if job.kind == "rig" and not job.over]
    if any(job.project == project.id for job in moving):
        raise Refused(409, "the rig is already running; stop it first")
    if real and any(job.request["real"] for job in moving):
        raise Refused(409, "a real rig is already running in another project; stop it first")


def written(value: Any) -> str:
    """Return an option's value as text."""
    return (
        ",".join(f"{x:g}" for x in cast("tuple[float, ...]", value))
        if isinstance(value, tuple)
        else str(value)
    )


def asked_of(project: Project, data: dict[str, Any]) -> tuple[dict[str, Any], Item | None]:
    """Return rig, procedure and options for the worker, and the project's item if the rig is one.

    Machine and procedure must be registered, a rig must be an item of the project, and no option may be a path.

    Raises
    ------
    Refused, NotThere
    """
    from stickslip.machines.files import library
    from stickslip.rigs.procedures import PROCEDURES

    procedure, rig = text(data, "procedure"), rig_of(project, data)
    machine = "" if rig else text(data, "machine")
    if (machine not in library() and rig is None) or procedure not in PROCEDURES:
        raise Refused(400, "choose one of the rigs and one of the procedures")
    options: Any = data.get("options", {})
    if not isinstance(options, dict):
        raise Refused(400, "options must be names and texts")
    given = cast("dict[str, Any]", options)
    out = {name: text(given, name)[:200] for name in given if given[name] not in ("", None)}
    if odd := [name for name in ("controller", "model") if out.get(name)]:
        raise Refused(400, f"{odd[0]} names a file, which the page does not support; use the command line")
    file = str(rig.folder / MAIN["rigs"]) if rig else ""
    return {"machine": machine, "rig": file, "procedure": procedure, "options": out}, rig


def rig_of(project: Project, data: dict[str, Any]) -> Item | None:
    """Return the requested rig of the project; None for a machine of the library.

    Raises
    ------
    Refused, NotThere
    """
    if not text(data, "rig", ""):
        return None
    rig = project.item("rigs", data["rig"])
    if rig.about.get("state") != "ready":
        raise Refused(409, "this rig cannot be run; open it in the project to see why")
    return rig


async def frames(job: Job, item: Item) -> AsyncIterator[dict[str, Any]]:
    """Stream the new measurements of the rig until the run ends."""
    from stickslip.core.stream import rows_since

    path, after = item.folder / "live.stream", 0
    while True:
        over = job.over
        if path.is_file():
            units, rows = rows_since(path, after)
            after += len(rows)
            if len(rows):
                names = list(units)
                kept_rows = rows[:: max(1, len(rows) // MOST)]
                channels = {n: kept_rows[:, names.index(n)].tolist() for n in SHOWN if n in names}
                finite = {n: [v if v == v else None for v in values] for n, values in channels.items()}
                yield {"time": kept_rows[:, 0].tolist(), "channels": finite, "units": units, "rows": after}
        if over:
            killed = job.process is not None and job.process.returncode == -KILLED
            yield {"end": job.state, "error": job.error, "result": job.result, "killed": killed}
            return
        last = next((line["tell"] for line in reversed(job.said) if "tell" in line), "")
        yield {"tell": last, "state": job.state}
        await asyncio.sleep(FRAME)


def kept(site: Site, project: Project, item: Item, job: Job) -> None:
    """Turn the run's record into a log: the procedure's record, or the part before a stop."""
    name = next((f for f in ("upload.npz", "live.stream") if (item.folder / f).is_file()), "")
    if not name:
        item.update(
            state="unread", readable=False, problem=job.error or "it was stopped before it moved", columns=[]
        )
        return
    said = "" if job.state == "done" else " (stopped)"
    size = (item.folder / name).stat().st_size
    item.update(file=name, size=size, state="reading", name=str(item.about["name"]) + said)
    read_again(site, project, item)
