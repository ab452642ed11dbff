"""Shared objects of the handlers: projects, jobs, limits."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from starlette.requests import Request

from stickslip.core.errors import InputError
from stickslip.web.bench import Bench
from stickslip.web.jobs import Jobs
from stickslip.web.projects import KINDS, Item, Project, Projects, refuse_links

BUSY = ("coming", "reading", "looking", "running")
"""States of an item that end with a job or an upload of this server."""
STOPPED = "the server ended before this was finished; "
REMEDY = {
    "logs": "read it again under “Columns and units”, or delete it", "studies": "run it again",
    "models": "delete it and start again", "settings": "delete it and start again",
    "rigs": "delete it and drop its files again",
}  # fmt: skip
"""Remedy for an item whose job is gone, by kind."""


@dataclass(frozen=True)
class Site:
    """One server's projects and jobs.

    Attributes
    ----------
    projects : Projects
    jobs : Jobs
    max_upload : int
        Bytes.
    bench : Bench
    coming : set of str
        Identifiers of the logs in upload.
    """

    projects: Projects
    jobs: Jobs
    max_upload: int
    bench: Bench
    coming: set[str] = field(default_factory=set[str])

    def project(self, request: Request) -> Project:
        """Return the project in the path.

        Raises
        ------
        NotThere
        """
        return self.projects.find(request.path_params["project"])

    def item(self, request: Request, kind: str) -> Item:
        """Return the log, model or setting in the path.

        Raises
        ------
        NotThere
        """
        return self.project(request).item(kind, request.path_params["item"])

    def about(self, project: Project, item: Item) -> dict[str, Any]:
        """Return the facts about an item for the page, with its true state.

        A project may have been moved, or its server killed, during a job: without the job the item has failed.
        """
        about, kind = item.about, item.folder.parent.name
        problem = ""
        try:
            refuse_links(item.folder, project.folder)
        except InputError as error:
            problem = str(error)
        if about.get("state") in BUSY and item.id not in self.coming and not self.jobs.works_on(item.id):
            problem = problem or STOPPED + REMEDY[kind]
        if not problem:
            return about
        failed: dict[str, Any] = {"state": "failed"}
        if kind == "logs":
            failed = {"state": "unread", "readable": False, "columns": []}
        return {**about, **failed, "problem": problem}

    def summary(self, project: Project) -> dict[str, Any]:
        """Return the name of a project and its items for the page."""
        held = {kind: [self.about(project, item) for item in project.items(kind)] for kind in KINDS}
        return {"id": project.id, "name": project.name, "folder": str(project.folder), **held}

    async def close(self) -> None:
        """End all jobs."""
        await self.bench.close()
        await self.jobs.close()
