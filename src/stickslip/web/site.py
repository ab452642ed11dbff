"""What the handlers share: the projects, the jobs, the limits."""

from __future__ import annotations

from dataclasses import dataclass

from starlette.requests import Request

from stickslip.web.bench import Bench
from stickslip.web.jobs import Jobs
from stickslip.web.projects import Item, Project, Projects


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
    """

    projects: Projects
    jobs: Jobs
    max_upload: int
    bench: Bench

    def project(self, request: Request) -> Project:
        """The project that the path names.

        Raises
        ------
        NotThere
        """
        return self.projects.find(request.path_params["project"])

    def item(self, request: Request, kind: str) -> Item:
        """The log, model or setting that the path names.

        Raises
        ------
        NotThere
        """
        return self.project(request).item(kind, request.path_params["item"])

    async def close(self) -> None:
        """End what runs."""
        await self.bench.close()
        await self.jobs.close()
