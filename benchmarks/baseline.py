"""The exact integrator's method in C, `baseline.c`: compiled by gcc for a kind of loop and called through ctypes."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.jit import kernel
from stickslip.models.model import Model
from stickslip.simulation._forcing import CELL_SIZE
from stickslip.simulation.case_arrays import FROM_MEASUREMENT, FROM_REFERENCE, KI, SOURCE, Case
from stickslip.simulation.exact import engine as exact
from stickslip.simulation.exact.kernel import LONGEST_STEP, SAFETY, solve
from stickslip.simulation.exact.state import PLAN, Laid, Output

Positions = np.ndarray[Any, np.dtype[np.float64]]
Run = Callable[..., Positions]
"""Runs so many times (once if not told) and returns the positions, always in the same array."""
REAL, WHOLE, ARRAY = ctypes.c_double, ctypes.c_int, ctypes.POINTER(ctypes.c_double)
TOLERANCES = [1e-2 * 10.0 ** (-0.25 * i) for i in range(33)]
"""rad; for the C program with error control as for ours."""
BY_HAND = [1e-5 * 10.0 ** (-0.25 * i) for i in range(21)]
LONGEST = (64e-3, 16e-3, 4e-3, 1e-3)
"""Without error control: how little the corrector still changes (rad), and longest steps (s)."""
MOST = 4
FS, FC = 7, 8
"""Places of the plant's levels in a loop's `values`."""


class Baseline:
    """The C program, compiled in `folder` for each kind of loop when that is first wanted."""

    def __init__(self, folder: str) -> None:
        self.folder = Path(folder)
        self.functions: dict[str, Any] = {}

    def loop(self, ready: exact.Prepared, *, control: bool) -> Loop:
        """The loop of a prepared case, whose table of the feedforward torque the C program reads too.

        With `control`, steps are chosen by the estimate of their error that the exact integrator makes; else by how
        quickly the corrector converges, below a longest step that is given.
        """
        case = ready.case
        source = case.numbers[SOURCE]
        fed_back = case.compensator.model if source == FROM_MEASUREMENT else None
        kind = {
            "MODEL": fed_back.law.name.upper() if fed_back else "NONE",
            "INTEGRAL": int(case.numbers[KI] != 0.0),
            "TABLE": int(source == FROM_REFERENCE),
            "CONTROL": int(control),
        }
        return Loop(self._compiled(kind), numbers(case, fed_back), ready, control)

    def _compiled(self, kind: dict[str, Any]) -> Any:
        name = "_".join(str(value) for value in kind.values())
        if name not in self.functions:
            library = self.folder / f"{name}.so"
            flags = ["-O3", "-march=native", "-D_GNU_SOURCE", "-shared", "-fPIC"]
            flags += [f"-D{key}={value}" for key, value in kind.items()]
            source = Path(__file__).with_name("baseline.c")
            subprocess.run(["gcc", *flags, str(source), "-o", str(library), "-lm"], check=True)
            function = ctypes.CDLL(str(library)).baseline
            function.argtypes = [WHOLE, ARRAY, ARRAY, WHOLE, ARRAY, REAL, REAL, REAL, WHOLE, ARRAY]
            self.functions[name] = function
        return self.functions[name]


class Loop:
    """A loop of the C program; `values` is its struct Loop."""

    def __init__(self, function: Any, values: Positions, ready: exact.Prepared, control: bool) -> None:
        self.function, self.values, self.control = function, values, control
        self.cells, self.grid = ready.cells, ready.case.grid
        self.count = int(ready.plan.view(PLAN)["cells"][0])
        self.breaks = ready.breaks if self.count else ready.breaks[-1:].copy()
        assert self.cells.size == max(1, CELL_SIZE * self.count)

    def run(self, tolerance: float, longest: float = LONGEST_STEP) -> Run:
        """A run at a tolerance (rad) and with a longest step (s)."""
        out, spacing = np.zeros((self.grid.size, 2)), float(self.grid[1] - self.grid[0])
        a, b, c, d = (x.ctypes.data_as(ARRAY) for x in (self.values, self.cells, self.breaks, out))
        tol = SAFETY * tolerance if self.control else tolerance

        def run(times: int = 1) -> Positions:
            if self.function(times, a, b, self.count, c, tol, longest, spacing, self.grid.size, d) < 0:
                out[:] = np.nan
            return out[:, 0]

        return run


@kernel()
def again(times: int, laid: Laid, fresh: Any, output: Output) -> int:
    """Run the kernel of the exact integrator so many times; returns why it ended."""
    code = 0
    for _ in range(times):
        laid.work[:] = fresh
        code = solve(laid, output, True, False, False)
    return code


def ours(ready: exact.Prepared) -> Run:
    """The exact integrator's kernel on a prepared case."""
    out, work = np.empty((ready.case.grid.size, 2)), ready.work.copy()
    laid = Laid(ready.parameters, ready.plan, ready.cells, ready.breaks, ready.case.grid, work)
    output = Output(out, exact.NOTHING, exact.NOTHING_1, exact.NOTHING, exact.NODES.copy())

    def run(times: int = 1) -> Positions:
        again(times, laid, ready.work, output)
        return out[:, 0]

    return run


def compiled_baseline(folder: str) -> Baseline | None:
    """The C program, to be compiled in `folder`; None where there is no gcc."""
    if shutil.which("gcc") is None:
        print("gcc is missing: the C baseline is left out")
        return None
    return Baseline(folder)


def time_of(run: Run, least: float = 3e-4) -> float:
    """CPU time of a run, s: the mean of as many as fill `least` seconds, called from compiled code."""
    start = time.thread_time()
    run()
    times = max(1, round(least / max(time.thread_time() - start, 1e-6)))
    start = time.thread_time()
    run(times)
    return (time.thread_time() - start) / times


def loosest(
    runs: Iterable[tuple[float, Run]], truth: Positions, wanted: float
) -> tuple[float, Run, float] | None:
    """Tolerance, run and error of the loosest that is accurate enough, as the next tighter one is.

    One alone may be so by luck. The tolerances descend.
    """
    before: tuple[float, Run, float] | None = None
    for tolerance, run in runs:
        error = float(np.max(np.abs(run() - truth)))
        if not error <= wanted:
            before = None
        elif before is not None:
            return before
        else:
            before = tolerance, run, error
    return before


@dataclass(frozen=True)
class Found:
    """A setting of the C program that is accurate enough: its run, CPU time (s), error (rad), and which it is."""

    run: Run
    spent: float
    error: float
    setting: str


def measured(found: tuple[float, Run, float] | None, longest: float | None = None) -> list[Found]:
    """The time of what `loosest` has found."""
    if found is None:
        return []
    setting = f"{found[0]:.0e}" if longest is None else f"{1e3 * longest:g} ms"
    return [Found(found[1], min(time_of(found[1]) for _ in range(5)), found[2], setting)]


def fastest_by_hand(
    baseline: Baseline, ready: exact.Prepared, truth: Positions, wanted: float
) -> Found | None:
    """The C program without error control, at its fastest setting that is accurate enough."""
    loop, found = baseline.loop(ready, control=False), []
    for longest in LONGEST:
        found += measured(loosest(((t, loop.run(t, longest)) for t in BY_HAND), truth, wanted), longest)
    return min(found, key=lambda f: f.spent, default=None)


def fastest(baseline: Baseline, ready: exact.Prepared, truth: Positions, wanted: float) -> Found:
    """The C program at its fastest setting that is accurate enough, with error control or without.

    Raises
    ------
    SystemExit
        If none is accurate enough.
    """
    loop = baseline.loop(ready, control=True)
    found = measured(loosest(((t, loop.run(t)) for t in TOLERANCES), truth, wanted))
    by_hand = fastest_by_hand(baseline, ready, truth, wanted)
    if by_hand:
        found.append(by_hand)
    if not found:
        raise SystemExit("no setting of baseline.c is accurate enough")
    return min(found, key=lambda f: f.spent)


def numbers(case: Case, fed_back: Model | None) -> Positions:
    """The struct Loop of baseline.c."""
    gains, motion = case.controller.gains, case.reference.parameters
    filtered = case.reference.kind.name == "step"
    rate = 1.0 / motion.tau if filtered else 2.0 * np.pi * motion.frequency
    head = [case.axis.inertia, gains.kp, gains.ki, gains.kd, float(filtered), motion.amplitude, rate]
    return np.array([*head, *law(case.axis.friction), *law(fed_back)])


def law(model: Model | None) -> list[float]:
    """The struct Law of baseline.c."""
    p: Any = model.parameters if model else None
    elements = len(p.k) if model and model.law.name == "gms" else 0
    stiffness, share = (list(p.k), list(p.alpha)) if elements else ([], [])
    pad = [0.0] * (MOST - elements)
    fc = getattr(p, "fc", 1.0)
    out = [getattr(p, "fs", fc), fc, getattr(p, "vs", 1.0), getattr(p, "sigma2", 0.0), float(elements)]
    out += [*stiffness, *pad, *share, *pad, getattr(p, "c", 0.0)]
    out += [getattr(p, "sigma0", 0.0), p.sigma1 / p.sigma0 if hasattr(p, "sigma0") else 0.0]
    if model and model.law.name == "stribeck":
        edge = exact.layer_of(exact.Side.of(model), exact.elements_of(exact.Side.of(model)))
        return [*out, p.k, edge]
    return [*out, 0.0, 0.0]
