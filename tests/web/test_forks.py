"""Processes of jobs, forked from one that has loaded what they need: they end as any other, and are told so."""

from __future__ import annotations

import asyncio
import json
import os
import signal
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from stickslip.web.forks import POSSIBLE, Forked, Forks
from stickslip.web.jobs import LONGEST_LINE, ended, worker_command

pytestmark = pytest.mark.skipif(not POSSIBLE, reason="processes are forked on Linux alone")


def apart(work: Callable[[Forks], Coroutine[Any, Any, Any]]) -> Any:
    """Run with a process to fork from, in a thread of its own: a browser of other tests keeps a loop in this one."""

    async def run() -> Any:
        command, environment = worker_command()
        forks = Forks([*command, "--fork"], environment, LONGEST_LINE)
        try:
            return await work(forks)
        finally:
            await forks.close()

    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, run()).result()


async def told(process: Forked, **request: Any) -> dict[str, Any]:
    """The last line of a process that was asked to do something."""
    process.stdin.write(json.dumps(request).encode() + b"\n")
    lines = [json.loads(line) async for line in process.stdout]
    return lines[-1]


def test_each_is_a_process_of_its_own_that_ends_by_itself_or_is_ended() -> None:
    """Its exit code is told, a signal's too; it leads its own group; one whose input closes ends."""

    async def work(forks: Forks) -> None:
        done, killed, cut, asked = [await forks.forked() for _ in range(4)]
        assert len({p.pid for p in (done, killed, cut, asked)}) == 4
        assert all(os.getpgid(p.pid) == p.pid for p in (done, killed, cut, asked))
        assert "KeyError" in (await told(done, task="nothing"))["error"]
        assert await done.wait() == 0
        killed.kill()
        assert await killed.wait() == -signal.SIGKILL
        cut.stdin.close()
        assert await cut.wait() == 1
        assert b"JSONDecodeError" in await cut.stderr.read()
        await ended(asked)
        assert asked.returncode == -signal.SIGTERM
        asked.terminate()  # it has ended: nothing is sent to whoever has its number now

    apart(work)


def test_where_the_first_process_is_killed_its_own_end_and_the_next_job_has_another() -> None:
    """Nobody would tell the exit codes of those that it forked."""

    async def work(forks: Forks) -> None:
        before = await forks.forked()
        first = forks._first
        assert first is not None
        first.kill()
        assert await before.wait() == -signal.SIGTERM
        after = await forks.forked()
        assert "KeyError" in (await told(after, task="nothing"))["error"]
        assert await after.wait() == 0

    apart(work)
