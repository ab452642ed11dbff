"""Run long jobs in separate processes: start, watch, cancel. Their output is kept for a reload of the page."""

from __future__ import annotations

import asyncio
import json
import os
import secrets
import signal
import sys
import time
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from stickslip.core.errors import InputError
from stickslip.web.forks import POSSIBLE, Forked, Forks
from stickslip.web.projects import NotThere, Project

Process = asyncio.subprocess.Process | Forked

LONGEST_LINE = 64 * 2**20
KEPT = 200
"""Most finished jobs that are kept."""
WAITING = 40
"""Most waiting jobs."""
GRACE = 3.0
"""Time from a request to end until a job is killed, s; longer for a moving rig (`Job.grace`)."""


@dataclass
class Job:
    """One job.

    Attributes
    ----------
    id, project, kind, title : str
    state : str
        "waiting", "running", "done", "failed" or "cancelled".
    said : list of dict
        All lines so far, each with its number and time.
    result : dict
        The result.
    settled : bool
        Whether `finish` has been called, so the result is stored.
    """

    id: str
    project: str
    kind: str
    title: str
    request: Mapping[str, Any]
    limit: float = float("inf")
    finish: Callable[[Job], None] | None = None
    item: str = ""
    grace: float = GRACE
    meanwhile: Callable[[dict[str, Any]], None] | None = None
    clock: asyncio.Timeout | None = None
    state: str = "waiting"
    said: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    result: dict[str, Any] = field(default_factory=dict[str, Any])
    error: str = ""
    process: Process | None = None
    settled: bool = False
    changed: asyncio.Event = field(default_factory=asyncio.Event)
    began: float = field(default_factory=time.time)

    @property
    def ended(self) -> bool:
        """Whether it has ended."""
        return self.state in ("done", "failed", "cancelled")

    @property
    def over(self) -> bool:
        """Whether it has ended and its process, which may take longer, is gone."""
        return self.ended and (self.process is None or self.process.returncode is not None)

    def say(self, **line: Any) -> None:
        """Add a line and wake the listeners."""
        self.said.append({"n": len(self.said) + 1, "s": round(time.time() - self.began, 2), **line})
        self.changed.set()
        self.changed = asyncio.Event()

    def about(self) -> dict[str, Any]:
        """Return its description for the page."""
        last = next((line["tell"] for line in reversed(self.said) if "tell" in line), "")
        return {
            "id": self.id, "kind": self.kind, "title": self.title, "state": self.state, "item": self.item,
            "last": last, "error": self.error, "result": self.result, "s": round(time.time() - self.began, 1),
        }  # fmt: skip

    async def lines(self, after: int = 0) -> AsyncIterator[dict[str, Any] | None]:
        """Yield its lines from `after` to the end; None every 15 s, so a dead listener is detected."""
        while True:
            changed = self.changed
            while after < len(self.said):
                after += 1
                yield self.said[after - 1]
            if self.ended:
                return
            try:
                await asyncio.wait_for(changed.wait(), 15.0)
            except TimeoutError:
                yield None


def worker_command(module: str = "stickslip.web.worker") -> tuple[list[str], dict[str, str]]:
    """Return command and environment of a process with the import path of this one."""
    paths = os.pathsep.join(p or os.getcwd() for p in sys.path)
    threads = {name: os.environ.get(name, "1") for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    return [sys.executable, "-P", "-m", module], {**os.environ, **threads, "PYTHONPATH": paths}


class Jobs:
    """All jobs of a server.

    Parameters
    ----------
    most : int
        Number of parallel long jobs; others wait. Short jobs do not wait for them.
    """

    def __init__(self, most: int = 2) -> None:
        self._jobs: dict[str, Job] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        command, environment = worker_command()
        self._forks = Forks([*command, "--fork"], environment, LONGEST_LINE) if POSSIBLE else None
        self._spare: asyncio.Task[asyncio.subprocess.Process] | None = None
        self._closed = False
        self._places = {"long": asyncio.Semaphore(most), "short": asyncio.Semaphore(2)}

    def start(
        self, project: Project, kind: str, title: str, request: Mapping[str, Any], *, item: str = "",
        short: bool = False, limit: float = float("inf"), finish: Callable[[Job], None] | None = None,
        grace: float = GRACE, meanwhile: Callable[[dict[str, Any]], None] | None = None,
    ) -> Job:  # fmt: skip
        """Start a job, or queue it.

        Parameters
        ----------
        project : Project
        kind, title : str
        request : mapping
            Request to the worker; ``task`` names the task. It opens only files of the project.
        item : str
            Identifier of the item that it creates.
        short : bool
            Whether it is short and overtakes long ones.
        limit : float
            Time limit without any output, s.
        finish : callable, optional
            Called at its end.
        grace : float
            Time for an orderly end after a request, s.
        meanwhile : callable, optional
            Called with intermediate results.

        Raises
        ------
        InputError
            If too many jobs wait.
        """
        waiting = sum(not job.ended for job in self._jobs.values())
        if waiting >= WAITING:
            raise InputError(f"{waiting} jobs are running or waiting; wait for some of them, or cancel them")
        name = f"job-{secrets.token_hex(6)}"
        request = {**request, "project": str(project.folder)}
        job = Job(name, project.id, kind, title, request, limit, finish, item, grace, meanwhile)
        self._jobs[job.id] = job
        self._forget()
        task = asyncio.create_task(self._run(job, self._places["short" if short else "long"]))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return job

    def find(self, project: str, identifier: str) -> Job:
        """Return the job with an identifier in a project.

        Raises
        ------
        NotThere
        """
        job = self._jobs.get(identifier)
        if job is None or job.project != project:
            raise NotThere("no such job; the server may have been restarted")
        return job

    def works_on(self, item: str) -> bool:
        """Whether a job on an item is running or waiting, or its result is not stored yet."""
        return any(job.item == item and not job.settled for job in self._jobs.values())

    def of(self, project: str) -> list[Job]:
        """Return the jobs of a project, oldest first."""
        return [job for job in self._jobs.values() if job.project == project]

    def all(self) -> list[Job]:
        """Return the jobs of all projects, oldest first."""
        return list(self._jobs.values())

    async def cancel(self, job: Job) -> None:
        """End a job; its files so far are kept."""
        if job.ended:
            return
        job.state = "cancelled"
        if job.process is not None:
            await ended(job.process, job.grace)
        job.say(end="cancelled")

    async def close(self) -> None:
        """End all jobs."""
        self._closed = True
        if self._spare is not None:
            await ended(await self._spare)
        for job in list(self._jobs.values()):
            await self.cancel(job)
        if self._forks is not None:
            await self._forks.close()
        for task in list(self._tasks):
            task.cancel()

    def _forget(self) -> None:
        old = [job.id for job in self._jobs.values() if job.ended]
        for identifier in old[: max(0, len(self._jobs) - KEPT)]:
            del self._jobs[identifier]

    async def _run(self, job: Job, place: asyncio.Semaphore) -> None:
        async with place:
            if not job.ended:
                await self._work(job)
        was_cancelled = job.ended
        if not was_cancelled:
            job.state = "failed" if job.error else "done"
        try:
            if job.finish is not None:
                job.finish(job)
        except (InputError, OSError) as error:  # a full disk, or a folder that is gone
            job.state, job.error = "failed", f"the result cannot be stored ({error})"
        job.settled = True
        if not was_cancelled:
            job.say(end=job.state, error=job.error, result=job.result)

    async def _work(self, job: Job) -> None:
        """Run the process of a job until it ends."""
        job.state, job.began = "running", time.time()
        try:
            async with asyncio.timeout(None if job.limit == float("inf") else job.limit) as job.clock:
                await self._listen(job)
        except TimeoutError:
            job.error = f"timed out after {job.limit:.0f} s"
        except Exception as error:
            job.error = f"its process could not be started ({error})"
        finally:
            if job.process is not None:
                await ended(job.process, job.grace)

    def prepare(self) -> None:
        """Start a process in advance that has done the imports for the next job."""
        if self._closed:
            return
        if self._forks is not None:
            task: asyncio.Task[Any] = asyncio.create_task(self._forks.prepare())
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
        elif self._spare is None:
            self._spare = asyncio.create_task(started())

    async def _process(self) -> Process:
        if self._forks is not None:
            with suppress(OSError):
                return await self._forks.forked()
        spare, self._spare = self._spare, None
        process = await (spare or started())
        self.prepare()
        return process if process.returncode is None else await started()

    async def _listen(self, job: Job) -> None:
        """Send the job to a process and read its output until it ends."""
        process = job.process = await self._process()
        if job.ended:
            return
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        complaints = asyncio.create_task(last_of(process.stderr))
        process.stdin.write(json.dumps(dict(job.request)).encode() + b"\n")
        with suppress(ConnectionError):
            await process.stdin.drain()
        heard = False
        async for text in process.stdout:
            line: dict[str, Any] = json.loads(text)
            heard = "done" in line or "error" in line
            if "done" in line:
                job.result = line["done"]
            elif "error" in line:
                job.error = str(line["error"])
                job.result = {"kind": line.get("kind", "")}
            elif "shown" in line:
                if job.meanwhile is not None:
                    job.meanwhile(line["shown"])
                if job.clock is not None:  # the file has been read: the rest is our own work
                    job.clock.reschedule(None)
                job.say(shown=True)
            else:
                job.say(**line)
        await process.wait()
        if not heard and job.state == "running":
            said = await complaints
            job.error = f"its process ended with exit code {process.returncode}" + (
                f": {said}" if said else ""
            )


async def started(*module: str) -> asyncio.subprocess.Process:
    """Start a process that waits for a job, or one of another module."""
    command, environment = worker_command(*module)
    return await asyncio.create_subprocess_exec(
        *command, env=environment, stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE, limit=LONGEST_LINE, start_new_session=True,
    )  # fmt: skip


async def last_of(stream: asyncio.StreamReader) -> str:
    """Return the last line of a stream, which is read to its end, so the writer is not blocked."""
    tail = b""
    while chunk := await stream.read(65536):
        tail = (tail + chunk)[-2000:]
    lines = tail.decode("utf-8", "replace").strip().splitlines()
    return lines[-1][:300] if lines else ""


async def ended(process: Process, grace: float = GRACE) -> None:
    """End a process and its children: terminate, then kill."""
    if process.returncode is not None:
        return
    with suppress(ProcessLookupError):
        process.terminate()
    try:
        await asyncio.wait_for(process.wait(), grace)
    except TimeoutError:
        with suppress(ProcessLookupError, PermissionError):
            if hasattr(os, "killpg"):
                os.killpg(process.pid, signal.SIGKILL)
            else:
                process.kill()
        await process.wait()
