"""Simulations of the workbench: one warm process, and its routes."""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from stickslip.web.asking import Refused, Table, body
from stickslip.web.jobs import ended, last_of, started

PATIENCE = 400.0
"""Time limit of a simulation, s, including the first one, which compiles"""


class Bench:
    """A process that simulates one case after another."""

    def __init__(self) -> None:
        self._process: asyncio.subprocess.Process | None = None
        self._turn = asyncio.Lock()
        self._complaints: asyncio.Task[str] | None = None

    async def simulate(self, case: dict[str, Any]) -> dict[str, Any]:
        """Return channels and metrics of a case.

        Raises
        ------
        Refused
            With the error in the case.
        """
        async with self._turn:
            process = await self._running()
            assert process.stdin is not None
            assert process.stdout is not None
            wrong = "its process ended"
            try:
                process.stdin.write(json.dumps({"case": case}).encode() + b"\n")
                async with asyncio.timeout(PATIENCE):
                    await process.stdin.drain()
                    line = await process.stdout.readline()
            except (TimeoutError, ConnectionError) as error:
                line = b""
                if isinstance(error, TimeoutError):
                    wrong = f"it timed out after {PATIENCE:.0f} s"
            except asyncio.CancelledError:
                await self.close()  # its answer would be mistaken for that of the next case
                raise
            if not line:
                await self.close()
                raise Refused(422, f"no result of this simulation: {wrong}; change a number")
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise Refused(422, answer["error"])
        return answer

    async def close(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            await ended(process)

    async def _running(self) -> asyncio.subprocess.Process:
        if self._process is None or self._process.returncode is not None:
            self._process = await started("stickslip.web.bench_worker")
            if self._process.stderr is not None:
                self._complaints = asyncio.create_task(last_of(self._process.stderr))
        return self._process


def table(bench: Bench) -> Table:
    """Return handlers by method and path."""
    from stickslip.web import cases

    async def forms(_request: Request) -> Response:
        return JSONResponse(await asyncio.to_thread(cases.descriptions))

    async def simulate(request: Request) -> Response:
        return JSONResponse(await bench.simulate(await body(request)))

    async def text(request: Request) -> Response:
        kind = request.path_params["kind"]
        write = {"toml": cases.toml_of, "python": cases.python_of}.get(kind)
        if write is None:
            raise Refused(404, "there is nothing at this address")
        case: Any = None
        with suppress(ValueError, RecursionError):
            case = json.loads(request.query_params.get("case", ""))
        if not isinstance(case, dict):
            raise Refused(400, "case must be a JSON object")
        name = {"toml": "case.toml", "python": "case.py"}[kind]
        headers = {"Content-Disposition": f'attachment; filename="{name}"'}
        content = await asyncio.to_thread(write, case)  # type: ignore[reportUnknownArgumentType]
        return Response(content, media_type="text/plain; charset=utf-8", headers=headers)

    return {
        ("GET", "/forms"): forms,
        ("POST", "/simulations"): simulate,
        ("GET", "/simulations/{kind}"): text,
    }
