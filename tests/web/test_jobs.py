"""Jobs in processes of their own: the limit on time is for reading a file, not for what follows."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Coroutine
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from stickslip.web.jobs import Job, Jobs
from stickslip.web.projects import Project

SCRIPT = """
import json, sys, time
for line in {first}, {{"tell": "working"}}:
    print(json.dumps(line), flush=True)
time.sleep(4.0)
print(json.dumps({{"done": {{"x": 1}}}}), flush=True)
"""


class Scripted(Jobs):
    """Jobs whose process runs a script instead of a worker."""

    def __init__(self, first: dict[str, Any]) -> None:
        super().__init__()
        self.script = SCRIPT.format(first=first)

    async def _process(self) -> asyncio.subprocess.Process:
        pipe = asyncio.subprocess.PIPE
        return await asyncio.create_subprocess_exec(
            sys.executable, "-c", self.script, stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True
        )


def apart(work: Coroutine[Any, Any, Any]) -> Any:
    """Run in a thread of its own: a browser of other tests keeps a loop in this one."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, work).result()


async def ended(first: dict[str, Any]) -> tuple[Job, list[dict[str, Any]]]:
    """A job of 4 s with a limit of 2.5 s, when it has ended, and what it showed."""
    jobs, shown = Scripted(first), list[dict[str, Any]]()
    project = Project(Path("2026-01-01-00000000"))
    job = jobs.start(project, "read", "Reading", {}, limit=2.5, meanwhile=shown.append)
    async for _ in job.lines():
        pass
    await jobs.close()
    return job, shown


@pytest.mark.slow
def test_a_job_that_has_shown_something_may_take_longer() -> None:
    """The doctor of ten million rows, whose record is in sight already."""
    job, shown = apart(ended({"shown": {"rows": 7}}))
    assert (job.state, job.error) == ("done", "")
    assert shown == [{"rows": 7}]
    assert job.result == {"x": 1}


@pytest.mark.slow
def test_a_job_that_shows_nothing_is_ended() -> None:
    """A file on which a reader never comes to an end."""
    job, shown = apart(ended({"tell": "reading"}))
    assert job.state == "failed"
    assert "timed out after 2 s" in job.error
    assert not shown
    assert job.process is not None
    assert job.process.returncode is not None
