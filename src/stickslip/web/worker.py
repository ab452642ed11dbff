"""A process that does one job for the page: it reads the request from stdin and writes lines of JSON to stdout.

It ends when stdin closes, so no job outlives the server. ``{"tell": ...}`` reports progress, ``{"done": ...}`` the
result, ``{"error": ...}`` the error: one of the last two is the last line.
"""

from __future__ import annotations

import importlib
import json
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from stickslip.core.config import confined_to
from stickslip.core.errors import StickslipError
from stickslip.core.messages import Surface, shown_on
from stickslip.core.resources import limit_memory

Said = Callable[[dict[str, Any]], None]
"""Sends a line to the server."""


def plain(value: Any) -> Any:
    """Return data for JSON: no arrays, and null for numbers that are not finite."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}  # type: ignore[reportUnknownVariableType, reportUnknownArgumentType]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]  # type: ignore[reportUnknownVariableType]
    if isinstance(value, float) and not (-1e308 <= value <= 1e308):
        return None
    return value if isinstance(value, (str, int, float, bool)) or value is None else str(value)


def main() -> int:
    """Do the job named in the first line of stdin."""
    channel = os.fdopen(os.dup(1), "w", encoding="utf-8", errors="replace")
    os.dup2(2, 1)  # what a library prints is no part of the answer
    get_ready()
    request: dict[str, Any] = json.loads(sys.stdin.readline())
    if "memory" in request:
        limit_memory(int(request["memory"]))
    threading.Thread(target=end_with, args=(sys.stdin,), daemon=True).start()
    warnings.simplefilter("ignore")
    lock = threading.Lock()

    def say(line: dict[str, Any]) -> None:
        with lock:
            channel.write(json.dumps(plain(line), ensure_ascii=False, allow_nan=False) + "\n")
            channel.flush()

    say(outcome(request, say))
    return 0


def get_ready() -> None:
    """Import the modules of most jobs in advance, because the server keeps a prepared process waiting."""
    for name in ("identify", "doctor", "reading", "recommend", "export", "compare"):
        importlib.import_module(f"stickslip.verbs.{name}")
    importlib.import_module("stickslip.web.tasks")


@shown_on(Surface.PAGE)
def outcome(request: dict[str, Any], say: Said) -> dict[str, Any]:
    """Return the last line."""
    try:
        tasks = importlib.import_module("stickslip.web.tasks")
        with confined_to(Path(request["project"])):
            return {"done": tasks.TASKS[request["task"]](request, say)}
    except StickslipError as error:
        return {"error": " ".join(str(error).split()), "kind": type(error).__name__}
    except MemoryError:
        return {
            "error": "this needs more memory than allowed for a file of its size; give a part of it, or another format"
        }
    except Exception as error:  # a reader's library may raise anything on a damaged file
        return {
            "error": f"this failed ({type(error).__name__}: {' '.join(str(error).split())[:300]}); it is a "
            "fault of stickslip or of a library of its"
        }


def end_with(stream: TextIO) -> None:
    """End this process when the server is gone, by an interrupt that a rig's loop handles."""
    for line in stream:
        if line.strip() == "stop":
            break
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    if sys.argv[1:] == ["--fork"]:
        get_ready()
        importlib.import_module("stickslip.web.forks").serve()
    sys.exit(main())
