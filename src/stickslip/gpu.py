"""Programs of lanes on a graphics processor, one thread a case. Imported only where a GPU is asked for.

The text is that of the processor (`stickslip.simulation.many.simd_source`) with one lane, and an entry of its own;
what its functions are decorated with here makes device code of them. With ``NUMBA_ENABLE_CUDASIM=1`` numba's simulator
runs them in Python, which is how they are tested without a GPU.
"""

# numba carries no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportMissingTypeStubs=false
# pyright: reportAttributeAccessIssue=false, reportUnknownArgumentType=false

from __future__ import annotations

import functools
import hashlib
import math
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import config, cuda, float64

from stickslip.errors import InputError
from stickslip.jit import loaded

__all__ = ["cuda", "float64", "solver"]

THREADS = 64
"""In a block."""
HEADER = "from stickslip.jit import"
ENTRY = """
ROOM = NUMBERS + VARIED
@compile_entry
def solve_gpu(c, columns, start, h, reference, cuts, sums, ends):
    case = cuda.grid(1)
    if case < columns.shape[0]:
        z = cuda.local.array(ROOM, float64)
        count = begin_block(z, c, columns, start, case)
        run_parts(z, c, h, reference, cuts, sums, case, count)
        end_block(z, ends, case, count)
"""
compile_entry: Any = cuda.jit


def compile_lanes(function: Any) -> Any:
    """Decorator of programs: a function of the device."""
    return cuda.jit(function, device=True)


compile_inlined = compile_lanes


@compile_lanes
def exponential(x: float) -> float:
    """exp(x)."""
    return math.exp(x)


@compile_lanes
def select(condition: bool, one: float, other: float) -> float:
    """One value or the other."""
    return one if condition else other


def pointer(array: Any, offset: int) -> Any:
    """Only the processor's entry calls it."""
    raise NotImplementedError


def text_for_gpu(text: str, lanes: int) -> str:
    """A program of lanes as one of a single lane for the GPU."""
    one = text.replace(f"LANES = {lanes}\n", "LANES = 1\n", 1)
    return one.replace(HEADER, "from stickslip.gpu import compile_entry, cuda, float64,", 1) + ENTRY


@functools.lru_cache(maxsize=16)
def compiled(text: str) -> Any:
    """The entry of a program."""
    return loaded(f"gpu_{hashlib.sha256(text.encode()).hexdigest()[:16]}", text).solve_gpu


def check() -> None:
    """Refuse where there is no GPU.

    Raises
    ------
    InputError
    """
    if config.ENABLE_CUDASIM or cuda.is_available():
        return
    why = str(cuda.cuda_error() or "the driver is there, but no device").strip().splitlines()
    raise InputError(
        "device = 'gpu': no GPU was found; looked for NVIDIA's driver (libcuda) and a device through numba.cuda: "
        f"{why[0].rstrip('.') if why else 'none'}; on a machine with both, pip install 'stickslip[gpu]'; "
        "else choose device = 'cpu'"
    )


def solver(text: str, lanes: int) -> Callable[..., None]:
    """What does on the GPU what the processor's ``solve_lanes`` does; `text` and `lanes` are the processor's.

    Raises
    ------
    InputError
        If there is no GPU.
    """
    check()
    entry = compiled(text_for_gpu(text, lanes))

    def solve(
        c: Any, columns: Any, start: Any, h: float, reference: Any, cuts: Any, sums: Any, ends: Any
    ) -> None:  # fmt: skip
        n = len(columns)
        room = [
            cuda.to_device(np.ascontiguousarray(a)) for a in (columns, start, reference, cuts, sums, ends)
        ]
        columns_, start_, reference_, cuts_, sums_, ends_ = room
        with warnings.catch_warnings():
            # Few loops leave most of a GPU idle: numba's word for it is no news, and the user cannot act on it.
            warnings.filterwarnings("ignore", message=".*Grid size")
            entry[-(-n // THREADS), THREADS](c, columns_, start_, h, reference_, cuts_, sums_, ends_)
        sums_.copy_to_host(sums)
        ends_.copy_to_host(ends)

    return solve
