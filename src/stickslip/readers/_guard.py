"""Call a function in a separate process, which a C library may crash or block without harm to the user's process.

Starting Python takes 0.2 to 0.3 s, so this is only for formats whose library cannot be protected in another way.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from stickslip.core.errors import InputError
from stickslip.core.resources import limit_memory
from stickslip.readers.limits import memory_for, size_of, too_large

T = TypeVar("T")
PATIENCE = 20.0
"""Time limit for reading a file, s; the same again for every 200 MB."""


class Died(Exception):
    """The process ended without an answer."""


def read_apart(function: Callable[..., T], path: Path, *more: Any, library: str) -> T:
    """Return ``function(path, *more)``, which reads a file or folder with a C library, in limited time and memory.

    Raises
    ------
    InputError
        If the function does, the library exceeds a limit, or it crashes.
    """
    size = size_of(path)
    try:
        return call(
            function, path, *more, limit=PATIENCE * (1.0 + size / 200e6), memory=memory_for(size)
        )  # fmt: skip
    except MemoryError:
        raise too_large(path) from None
    except Died as error:
        raise InputError(
            f"{path} is damaged: {library} {error}; check that it is complete, or export it again"
        ) from None


def call(function: Callable[..., T], *arguments: Any, limit: float, memory: int = 0) -> T:
    """Return ``function(*arguments)``, or raise its exception.

    Parameters
    ----------
    function : callable
        Must be importable by name, like the types of its arguments and result.
    limit : float
        s, after which the process is ended.
    memory : int
        Bytes that the process may allocate (if the system can limit them) before it raises `MemoryError`; 0 for no
        limit.

    Raises
    ------
    Died
        If the process gave no answer.
    """
    if not sys.executable:  # Python inside another program
        return function(*arguments)
    # The child gets the import path of this process.
    paths = os.pathsep.join(p or os.getcwd() for p in sys.path)
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-m", __name__],
            input=pickle.dumps((function, arguments, memory)),
            capture_output=True,
            timeout=limit,
            env={**os.environ, "PYTHONPATH": paths},
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise Died(f"timed out after {limit:.0f} s") from None
    if done.returncode != 0:
        said = done.stderr.decode("utf-8", "replace").strip().rsplit("\n", 1)[-1]
        raise Died(f"crashed, exit code {done.returncode}{': ' + said if said else ''}")
    answer, error = pickle.loads(done.stdout)
    if error is not None:
        raise error
    return answer


def _serve() -> None:
    """Read the call from stdin, write its answer or its exception to stdout."""
    channel = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of a library must not mix with the answer
    function, arguments, memory = pickle.load(sys.stdin.buffer)
    try:
        if memory:
            limit_memory(memory)
        answer = (function(*arguments), None)
    except Exception as error:
        answer = (None, error)
    with channel:
        pickle.dump(answer, channel, protocol=5)


if __name__ == "__main__":
    _serve()
