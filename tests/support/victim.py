"""A process that runs loops in children that others may kill: it compiles once and forks for each.

Reads a JSON object a line from stdin: ``path`` of the record, ``count`` (a file in which the rig counts the torques it
was given), ``realtime``, ``blocks``, ``file_limit`` (bytes; 0 none). Answers with the child's pid, then, when it has
ended, with how: the exit code and what the loop said, or the signal.
"""

from __future__ import annotations

import json
import mmap
import os
import resource
import sys
import time
from typing import Any

import numpy as np
from axis_rig import AxisRig

from stickslip.control.controller import Controller
from stickslip.control.linear import pd
from stickslip.core.errors import StickslipError
from stickslip.rigs.loop import Loop
from stickslip.rigs.rig import Measurement, setpoints

PD = Controller(pd(19.7612, 0.1747), torque_limit=0.5)


class Counted(AxisRig):
    """Counts the torques it was given, and keeps the last, where another process can read them."""

    def __init__(self, path: str, **options: Any) -> None:
        super().__init__(**options)
        with open(path, "r+b") as file:
            self._shared = np.frombuffer(mmap.mmap(file.fileno(), 16), dtype="<f8")

    def exchange(self, torque: float) -> Measurement:
        measured = super().exchange(torque)
        self._shared[1] = torque
        self._shared[0] += 1
        return measured

    def exchange_block(self, control: Any, wanted: Any, rows: Any) -> int:
        count = super().exchange_block(control, wanted, rows)
        time.sleep(1e-3)
        self._shared[1] = self.torques[-1]
        self._shared[0] += count
        return count


def motion(count: int) -> Any:
    t = 1e-3 * np.arange(count)
    return setpoints(count, position=0.5 * np.sin(6.0 * t), velocity=3.0 * np.cos(6.0 * t), closed=1.0)


def work(order: dict[str, Any]) -> None:
    if order["file_limit"]:
        resource.setrlimit(resource.RLIMIT_FSIZE, (order["file_limit"], order["file_limit"]))
    rig = Counted(order["count"], blocks=order["blocks"])
    with Loop(rig, path=order["path"], realtime=order["realtime"]) as loop:
        # Through only where whoever should kill it keeps it waiting for minutes.
        for _ in range(100):
            loop.run(motion(300_000), PD)


def child(order: dict[str, Any], pipe: int) -> None:
    said = ""
    try:
        work(order)
    except StickslipError as error:
        said = f"{type(error).__name__}: {error}"
    os.write(pipe, said.encode())
    os._exit(0)


def main() -> None:
    with Loop(AxisRig(blocks=True)) as loop:  # compiles
        loop.run(motion(100), PD)
    with Loop(AxisRig(blocks=False)) as loop:
        loop.run(motion(100), PD)
    for line in sys.stdin:
        out, into = os.pipe()
        pid = os.fork()
        if pid == 0:
            child(json.loads(line), into)
        os.close(into)
        print(pid, flush=True)
        with os.fdopen(out) as pipe:
            said = pipe.read()
        status = os.waitpid(pid, 0)[1]
        print(
            json.dumps({"signal": os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0, "said": said}),
            flush=True,
        )


if __name__ == "__main__":
    main()
