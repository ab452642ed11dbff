"""Routes of computations from logs and models: identification, recommendation, comparison."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response

from stickslip.control.own_loop import REFERENCE_VELOCITIES
from stickslip.web.asking import Refused, Table, body, chosen_names, number, text
from stickslip.web.jobs import Job
from stickslip.web.projects import Item, Project, words
from stickslip.web.sent import ask_again
from stickslip.web.site import Site

REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox"
"""A report is a separate page with its own styles and without scripts."""


def table(site: Site) -> Table:
    """Return handlers by method and path."""
    return {**computing(site), **files(site)}


def begin(
    site: Site, project: Project, item: Item, kind: str, title: str, request: dict[str, Any], model: Item | None = None,
) -> Response:  # fmt: skip
    """Start the job that creates an item from `model`, and store its result in the item."""

    def finish(job: Job) -> None:
        if item.folder.is_dir():
            item.update(state=job.state, problem=job.error, **(job.result if job.state == "done" else {}))
        ask_again(site, project, [model], job)

    job = site.jobs.start(project, kind, title, {"task": kind, "folder": str(item.folder), **request},
                          item=item.id, finish=finish)  # fmt: skip
    return JSONResponse({"id": item.id, "job": job.id}, 201)


def computing(site: Site) -> Table:
    """Return the routes that start a job."""

    async def identify(request: Request) -> Response:
        project, data = site.project(request), await body(request)
        logs = logs_named(project, data)
        options = identify_options(data)
        named = ", ".join(str(log.about["name"]) for log in logs)
        name = project.free_name("models", words(data.get("name", ""), f"Friction of {named}"))
        item = project.add(
            "models", name=name, logs=[log.id for log in logs], options=options, state="running"
        )
        about = [{"folder": str(log.folder), "name": log.about["name"]} for log in logs]
        return begin(
            site, project, item, "identify", f"Identifying {named}", {"logs": about, "options": options}
        )

    async def recommend(request: Request) -> Response:
        project, data = site.project(request), await body(request)
        model = whole_model(project, data.get("model"))
        options = recommend_options(data)
        name = words(data.get("name", ""), f"Setting for {model.about['name']}")
        name = project.free_name("settings", name)
        item = project.add("settings", name=name, model=model.id, options=options, state="running")
        asked = {"model": str(model.folder / "model.toml"), "options": options}
        title = f"Simulating settings for {model.about['name']}"
        return begin(site, project, item, "recommend", title, asked, model)

    async def compare(request: Request) -> Response:
        project, data = site.project(request), await body(request)
        models = [whole_model(project, data.get(key)) for key in ("first", "second")]
        if models[0].id == models[1].id:
            raise Refused(400, "choose two models")
        names = [str(m.about["name"]) for m in models]
        paths = {k: str(m.folder / "model.toml") for k, m in zip(("first", "second"), models, strict=True)}
        asked = {"task": "compare", **paths, "names": names}
        job = site.jobs.start(project, "compare", f"Comparing {names[0]} and {names[1]}", asked, short=True,
                              limit=300.0, finish=lambda job: ask_again(site, project, models, job))  # fmt: skip
        return JSONResponse({"job": job.id}, 201)

    return {
        ("POST", "/projects/{project}/models"): identify,
        ("POST", "/projects/{project}/settings"): recommend,
        ("POST", "/projects/{project}/comparisons"): compare,
    }


def files(site: Site) -> Table:
    """Return the routes of result files, and of the candidate laws."""

    async def report(request: Request) -> Response:
        kind = request.path_params["kind"]
        path = site.item(request, kind).folder / "report.html"
        if not path.is_file():
            raise Refused(404, "there is no report yet")
        inline = request.query_params.get("show") == "1"
        disposition = "inline" if inline else 'attachment; filename="report.html"'
        headers = {"Content-Security-Policy": REPORT_POLICY, "Content-Disposition": disposition}
        return FileResponse(path, media_type="text/html", headers=headers)

    async def file_of(request: Request) -> Response:
        kind, name = {"models": ("models", "model.toml"), "settings": ("settings", "recommended.toml")}.get(
            request.path_params["kind"], ("", "")
        )
        path: Path = site.item(request, kind).folder / name
        if not path.is_file():
            raise Refused(404, "there is no such file yet")
        return FileResponse(path, media_type="application/toml", filename=name)

    async def laws(_request: Request) -> Response:
        return JSONResponse({"laws": await asyncio.to_thread(laws_to_identify)})

    return {
        ("GET", "/laws"): laws,
        ("GET", "/projects/{project}/{kind}/{item}/report"): report,
        ("GET", "/projects/{project}/{kind}/{item}/toml"): file_of,
    }


def logs_named(project: Project, data: dict[str, Any]) -> list[Item]:
    """Return the logs to identify from, all of which have been read.

    Raises
    ------
    Refused, NotThere
    """
    logs = [project.item("logs", i) for i in chosen_names(data.get("logs"), "logs")]
    if not logs:
        raise Refused(400, "choose a log to identify from")
    for log in logs:
        if not log.about.get("readable"):
            raise Refused(409, f"{log.about.get('name')} has not been read; see its problem first")
    return logs


def laws_to_identify() -> list[dict[str, str]]:
    """Return the candidate laws of identification: those with a torque at constant velocity."""
    from stickslip.models import plugins

    laws = [plugins.law(name) for name in plugins.law_names()]
    return [{"name": law.name, "title": law.title or law.name} for law in laws if law.steady]


def whole_model(project: Project, identifier: object) -> Item:
    """Return the model with an identifier, which must have a complete law.

    Raises
    ------
    Refused, NotThere
    """
    model = project.item("models", identifier)
    if model.about.get("state") == "asks":
        raise Refused(409, f"{model.about.get('name')} names code that is not approved; review it first")
    if not (model.folder / "model.toml").is_file():
        raise Refused(409, f"{model.about.get('name')} has no complete law; identify one first")
    return model


def identify_options(data: dict[str, Any]) -> dict[str, Any]:
    """Return options of `stickslip.identify` from the form.

    Raises
    ------
    Refused
    """
    from stickslip.identification.methods import METHODS
    from stickslip.models.plugins import law_names

    out: dict[str, Any] = {"method": chosen_names([data.get("method", "axis")], "method", tuple(METHODS))[0]}
    if laws := chosen_names(data.get("laws", []), "laws", (*law_names(), "all")):
        out["law"] = laws
    for name in ("inertia", "drive_gain"):
        if data.get(name) not in (None, ""):
            out[name] = number(data[name], name)
    if data.get("loop") not in (None, ""):
        out["loop"] = text(data, "loop")[:500]
    for flag in ("per_direction", "pendulum", "robust", "inverse"):
        if data.get(flag) is True:
            out[flag] = True
    if data.get("accept"):
        out["accept"] = chosen_names(data["accept"], "accept")
    return out


def recommend_options(data: dict[str, Any]) -> dict[str, Any]:
    """Return options of `stickslip.recommend` from the form.

    Raises
    ------
    Refused
    """
    out: dict[str, Any] = {}
    for name in ("bandwidth", "damping", "sample_time", "counts_per_rev", "torque_limit", "amplitude", "frequency",
                 "inertia"):  # fmt: skip
        if data.get(name) not in (None, ""):
            out[name] = number(data[name], name)
    for name, most in (("axes", 50), ("confirm", 1000)):
        if data.get(name) not in (None, ""):
            count = number(data[name], name)
            if count != int(count) or not 0 <= count <= most:
                raise Refused(400, f"{name} must be a whole number up to {most}")
            out[name] = int(count)
    if data.get("linear"):
        out["linear"] = chosen_names([data["linear"]], "linear", ("PD", "PID", "PR"))[0]
    if data.get("reference_velocity"):
        kind = chosen_names([data["reference_velocity"]], "reference_velocity", REFERENCE_VELOCITIES)
        out["reference_velocity"] = kind[0]
    if data.get("loop") not in (None, ""):
        out["loop"] = text(data, "loop")[:500]
    return out
