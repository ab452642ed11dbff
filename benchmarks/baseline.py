"""The exact integrator's method in C, `baseline.c`: compiled by gcc and called through ctypes."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Positions = np.ndarray[Any, np.dtype[np.float64]]


def compiled_baseline(folder: str) -> Any | None:
    """Compile baseline.c into `folder`; None where there is no gcc."""
    if shutil.which("gcc") is None:
        print("gcc is missing: the C baseline is left out")
        return None
    library = Path(folder) / "baseline.so"
    source = Path(__file__).with_name("baseline.c")
    flags = ["-O3", "-march=native", "-D_GNU_SOURCE", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, str(source), "-o", str(library), "-lm"], check=True)
    function = ctypes.CDLL(str(library)).baseline
    real, array = ctypes.c_double, ctypes.POINTER(ctypes.c_double)
    function.argtypes = [array, real, real, real, real, ctypes.c_int, array]
    return function


def c_run(
    function: Any, p: Positions, tolerance: float, longest: float, grid: Positions
) -> Callable[[], Positions]:
    """A run of the C baseline; `p` is its struct Loop."""
    out = np.zeros(grid.size)
    spacing = float(grid[1] - grid[0])
    real = ctypes.POINTER(ctypes.c_double)
    a, b = p.ctypes.data_as(real), out.ctypes.data_as(real)

    def run() -> Positions:
        function(a, float(grid[-1]), tolerance, longest, spacing, grid.size, b)
        return out

    return run
