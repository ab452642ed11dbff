"""Fork processes for jobs from one that has done its imports, which take a second.

This is for Linux only; elsewhere a job's process is started normally. The server sends a request to fork over a socket,
with the stdin, stdout and stderr of the new process. The first process answers with a line of JSON, and with another
one with the exit code when a forked process has ended. It ends with the server.
"""

from __future__ import annotations

import asyncio
import gc
import json
import os
import select
import signal
import socket
import sys
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field

POSSIBLE = sys.platform == "linux"


@dataclass(eq=False)
class Forked:
    """A process of a job, with the part of `asyncio.subprocess.Process` that jobs use."""

    pid: int
    stdin: asyncio.StreamWriter
    stdout: asyncio.StreamReader
    stderr: asyncio.StreamReader
    returncode: int | None = None
    gone: asyncio.Event = field(default_factory=asyncio.Event)

    async def wait(self) -> int:
        """Wait for the end and return the exit code."""
        await self.gone.wait()
        assert self.returncode is not None
        return self.returncode

    def terminate(self) -> None:
        """Request its end."""
        if self.returncode is None:
            os.kill(self.pid, signal.SIGTERM)

    def kill(self) -> None:
        """End it."""
        if self.returncode is None:
            os.kill(self.pid, signal.SIGKILL)

    def ended(self, code: int) -> None:
        """Set its exit code."""
        self.returncode = code
        self.stdin.close()
        self.gone.set()


@dataclass(frozen=True)
class Ends:
    """The server's ends of a process's stdin, stdout and stderr."""

    stdin: asyncio.StreamWriter
    stdout: asyncio.StreamReader
    stderr: asyncio.StreamReader
    answer: asyncio.Future[Forked]


class Forks:
    """A process to fork from, and the forked ones.

    Parameters
    ----------
    command : list of str
        Command of a process that calls `serve`.
    environment : dict of str to str
    longest : int
        Longest line that a process may write, bytes.
    """

    def __init__(self, command: list[str], environment: dict[str, str], longest: int) -> None:
        self._command, self._environment, self._longest = command, environment, longest
        self._first: asyncio.subprocess.Process | None = None
        self._hearing: asyncio.Task[None] | None = None
        self._link: socket.socket | None = None
        self._turn = asyncio.Lock()
        self._asked = 0
        self._waiting: dict[int, Ends] = {}
        self._running: dict[int, Forked] = {}

    async def prepare(self) -> socket.socket:
        """Start the process to fork from, unless it is running; return its socket."""
        async with self._turn:
            if self._link is None:
                ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                with theirs:
                    self._first = await asyncio.create_subprocess_exec(
                        *self._command, env=self._environment, stdin=theirs.fileno(), stdout=asyncio.subprocess.PIPE,
                        stderr=asyncio.subprocess.DEVNULL, start_new_session=True,
                    )  # fmt: skip
                self._link = ours
                self._hearing = asyncio.create_task(self._hear(self._first))
            return self._link

    async def forked(self) -> Forked:
        """Return a new process.

        Raises
        ------
        OSError
            If the one to fork from has ended.
        """
        link = await self.prepare()
        self._asked += 1
        number = self._asked
        ours, their_input = socket.socketpair()
        out, their_out = os.pipe()
        errors, their_errors = os.pipe()
        stdin = (await asyncio.open_connection(sock=ours))[1]
        answer: asyncio.Future[Forked] = asyncio.get_running_loop().create_future()
        self._waiting[number] = Ends(stdin, await self._read(out), await self._read(errors), answer)
        try:
            socket.send_fds(link, [str(number).encode()], [their_input.fileno(), their_out, their_errors])
        except OSError:
            del self._waiting[number]
            stdin.close()
            raise
        finally:
            their_input.close()
            os.close(their_out)
            os.close(their_errors)
        return await answer

    async def close(self) -> None:
        """End the process to fork from; the forked ones continue."""
        if self._link is not None:
            self._link.close()
        if self._hearing is not None:
            await self._hearing

    async def _read(self, pipe: int) -> asyncio.StreamReader:
        """Return a stream of the output of a pipe."""
        reader = asyncio.StreamReader(limit=self._longest)
        file = os.fdopen(pipe, "rb", buffering=0)
        await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), file)
        return reader

    async def _hear(self, first: asyncio.subprocess.Process) -> None:
        """Process the messages of the process to fork from, until it ends."""
        assert first.stdout is not None
        async for text in first.stdout:
            line: dict[str, int] = json.loads(text)
            if "asked" in line:
                ends = self._waiting.pop(line["asked"])
                process = Forked(line["pid"], ends.stdin, ends.stdout, ends.stderr)
                self._running[process.pid] = process
                if ends.answer.cancelled():
                    process.stdin.close()  # it will not get a job: end it
                else:
                    ends.answer.set_result(process)
            else:
                self._running.pop(line["pid"]).ended(line["code"])
        await first.wait()
        if self._link is not None:
            self._link.close()
            self._link = None
        for ends in self._waiting.values():
            ends.stdin.close()
            if not ends.answer.cancelled():
                ends.answer.set_exception(OSError("the process to fork from has ended"))
        self._waiting.clear()
        running, self._running = list(self._running.values()), {}
        for process in running:
            await orphan_ended(process)


async def orphan_ended(process: Forked) -> None:
    """End a process whose exit code will not be reported, and wait for its end."""
    loop, gone = asyncio.get_running_loop(), asyncio.Event()
    with suppress(ProcessLookupError):
        watched = os.pidfd_open(process.pid)
        loop.add_reader(watched, gone.set)
        process.terminate()
        await gone.wait()
        loop.remove_reader(watched)
        os.close(watched)
    process.ended(-signal.SIGTERM)


# ---- the process to fork from --------------------------------------------------------------------------------


def serve() -> None:
    """Fork on request of the server. Return in every forked process; end this one with the server."""
    gc.freeze()  # loaded modules stay in memory shared by all processes
    link, answers = socket.socket(fileno=os.dup(0)), os.fdopen(os.dup(1), "w", encoding="ascii")
    poll, running = select.poll(), dict[int, int]()
    poll.register(link, select.POLLIN)
    while True:
        for found, _ in poll.poll():
            if found != link.fileno():
                code = os.waitstatus_to_exitcode(os.waitpid(running[found], 0)[1])
                print(json.dumps({"pid": running.pop(found), "code": code}), file=answers, flush=True)
                poll.unregister(found)
                os.close(found)
                continue
            asked, ends, _, _ = socket.recv_fds(link, 64, 3)
            if not asked:
                sys.exit(0)
            pid = os.fork()
            if pid == 0:
                link.close()
                answers.close()
                begun(ends, running)
                return
            os.setpgid(pid, pid)
            for end in ends:
                os.close(end)
            watched = os.pidfd_open(pid)
            running[watched] = pid
            poll.register(watched, select.POLLIN)
            print(json.dumps({"asked": int(asked), "pid": pid}), file=answers, flush=True)


def begun(ends: Iterable[int], others: Iterable[int]) -> None:
    """Set up a forked process: its own group, stdin, stdout and stderr; close everything else."""
    os.setpgid(0, 0)  # as in the parent, so it is set before either continues
    for place, end in enumerate(ends):
        os.dup2(end, place)
    for descriptor in (*ends, *others):
        os.close(descriptor)
