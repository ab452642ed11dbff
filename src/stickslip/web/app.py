"""The page's server as an ASGI application with its routes."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles

from stickslip.web import security
from stickslip.web.asking import Handler, Refused, answered, body, text
from stickslip.web.bench import Bench
from stickslip.web.jobs import Jobs
from stickslip.web.projects import Projects
from stickslip.web.security import Gate
from stickslip.web.site import Site

STATIC = Path(__file__).with_name("static")


@dataclass(frozen=True)
class Options:
    """Options of a server.

    Attributes
    ----------
    projects : Path
        Folder of the projects.
    token : str
    hosts : sequence of str
        As for `stickslip.web.security.Gate`.
    cookie : str
    max_upload : int
        Bytes.
    jobs : int
        Number of parallel long jobs.
    """

    projects: Path
    token: str
    hosts: Sequence[str]
    cookie: str = "stickslip"
    max_upload: int = 2 * 2**30
    jobs: int = 2


def make_app(options: Options) -> Gate:
    """Return the application.

    Raises
    ------
    InputError
        If the folder of projects cannot be written.
    """
    site = Site(Projects(options.projects), Jobs(options.jobs), options.max_upload, Bench())

    @asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncGenerator[None]:
        # After the page has been sent, because the first job starts later than the first picture.
        asyncio.get_running_loop().call_later(1.0, site.jobs.prepare)
        yield
        await site.close()

    app = Starlette(routes=routes(site, options), lifespan=lifespan)
    return Gate(app, options.token, options.hosts, options.cookie)


def routes(site: Site, options: Options) -> list[BaseRoute]:
    """Return all routes."""
    from stickslip.web import bench, exporting, identifying, logs, projects_api, rigs, sent

    tables = [part.table(site) for part in (logs, identifying, sent, exporting, rigs, projects_api)]
    tables.append(bench.table(site.bench))
    out: list[BaseRoute] = [Route(security.SESSION, answered(session(options)), methods=["POST"])]
    for table in tables:
        for (method, path), handler in table.items():
            out.append(Route(f"/api{path}", answered(handler), methods=[method]))
    out.append(Route("/api/{rest:path}", answered(nothing_there)))
    out.append(Route("/", answered(index)))
    out.append(Mount("/static", StaticFiles(directory=STATIC)))
    return out


def session(options: Options) -> Handler:
    """Exchange the token for a cookie."""

    async def handler(request: Request) -> Response:
        given = text(await body(request), "token")
        if not security.same(given, options.token):
            raise Refused(
                401, "this token belongs to another server; open the address that `stickslip web` printed"
            )
        answer = JSONResponse({"ok": True})
        answer.set_cookie(options.cookie, options.token, httponly=True, samesite="strict", path="/")
        return answer

    return handler


async def index(_request: Request) -> Response:
    """Return the page."""
    return Response((STATIC / "index.html").read_bytes(), media_type="text/html")


async def nothing_there(_request: Request) -> Response:
    """Answer an unknown address."""
    raise Refused(404, "there is nothing at this address")
