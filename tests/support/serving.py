"""A server on a free port in a process of its own, and what a person does in a browser."""

from __future__ import annotations

import base64
import os
import re
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

DEMO = Path(__file__).parents[2] / "src" / "stickslip" / "demo.csv"
QUIET = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage",
)  # fmt: skip


@dataclass
class Served:
    """A running server: its address, its token, its folder, its process."""

    url: str
    token: str
    folder: Path
    process: subprocess.Popen[str]

    def client(self, entered: bool = True) -> Any:
        """A client with the cookie, as the page has it."""
        client = httpx.Client(base_url=self.url, timeout=120.0)
        if entered:
            assert client.post("/api/session", json={"token": self.token}).status_code == 200
        return client

    @property
    def page(self) -> str:
        """What the terminal prints."""
        return f"{self.url}/#token={self.token}"


def start_server(folder: Path, *options: str) -> Served:
    """`stickslip web`."""
    command = [sys.executable, "-m", "stickslip", "web", "--no-browser", "--projects", str(folder), *options]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ.copy()
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    found = re.fullmatch(r"(http://127\.0\.0\.1:\d+)/#token=([\w-]{30,})\n", line)
    assert found, f"{line!r} {process.stderr.read() if process.stderr else ''}"
    return Served(found[1], found[2], folder, process)


def stop_server(served: Served) -> str:
    """End it as Ctrl-C does. Returns what it said on stderr."""
    served.process.terminate()
    try:
        return served.process.communicate(timeout=120)[1]
    except subprocess.TimeoutExpired:
        served.process.kill()
        raise


def drop(page: Any, *files: Path, on: str = ".drop") -> None:
    """Drop files as from a file manager."""
    handle = page.evaluate_handle(
        """(files) => { const all = new DataTransfer();
        for (const [name, content] of files) {
          all.items.add(new File([Uint8Array.from(atob(content), (c) => c.charCodeAt(0))], name)); }
        return all; }""",
        [[f.name, base64.b64encode(f.read_bytes()).decode()] for f in files],
    )
    page.dispatch_event(on, "drop", {"dataTransfer": handle})


def ended(client: Any, project: str, job: str, patience: float = 120.0) -> dict[str, Any]:
    """The job, when it has ended."""
    until = time.monotonic() + patience
    while time.monotonic() < until:
        about: dict[str, Any] = client.get(f"/api/projects/{project}/jobs/{job}/about").json()
        if about["state"] in ("done", "failed", "cancelled"):
            return about
        time.sleep(0.1)
    raise AssertionError(f"{job} did not end in {patience} s")


def settled(client: Any, address: str, patience: float = 120.0) -> dict[str, Any]:
    """What is known of an item, when no job works on it."""
    until = time.monotonic() + patience
    while time.monotonic() < until:
        about: dict[str, Any] = client.get(address).json()
        if about["state"] not in ("coming", "reading", "looking", "running"):
            return about
        time.sleep(0.1)
    raise AssertionError(f"{address} did not settle in {patience} s")
