"""Ten thousand closed loops with perturbed Fs and Fc on one core, against C.

The loop of Table 6 (PD on the low reference, 2.5 s), Fs and Fc each up to `--spread` off. Ours is
`stickslip.simulation.many.batch` at the loosest tolerance at which 99 % of 200 of the loops end within `--error` of a
tight run; with no metrics, with four that count nothing, and with all.
C is `baseline.c` (the same method, compiled here by gcc -O3 -march=native), and, where `--prototypes DIR` names a
folder with it, the first prototype etd.c (event-driven, position on a 1 ms grid). With `--jax`, a trapezoid at 2e-4 s
in JAX (`jax_step.py`), compiled beforehand. Times are CPU times of the process, the least of three rounds taken in
turns; laying out counts, compiling does not. The ratio to C is judged without compensation.

    python benchmarks/batch.py [--cases 10000] [--spread 0.1] [--prototypes DIR] [--jax]
"""

from __future__ import annotations

import argparse
import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import closed_loop
import jax_step
from baseline import FC, FS, Baseline, compiled_baseline
from stickslip.control.controller import Controller
from stickslip.simulation.case_arrays import Case
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.exact import engine as exact
from stickslip.simulation.many import batch

DURATION = 2.5
CURVE = closed_loop.CURVE
TOLERANCES = [1e-4 * 10.0 ** (-0.5 * i) for i in range(10)]
SAMPLE = 200
COARSE = ("position_rms_rad", "position_peak_rad", "velocity_rms_rad_s", "torque_rms_Nm")
REAL, ARRAY = ctypes.c_double, ctypes.POINTER(ctypes.c_double)
TIMES_C = 1.3
STEP = 2e-4
Column = np.ndarray[Any, np.dtype[np.float64]]


def pointer(values: Column) -> Any:
    """Address of an array."""
    return values.ctypes.data_as(ARRAY)


def the_case(name: str, tolerance: float) -> Case:
    """The loop that the others vary."""
    controller = Controller(closed_loop.GAINS, closed_loop.COMPENSATORS[name])
    return prepare(
        closed_loop.AXIS, controller, closed_loop.REFERENCE, DURATION, tolerance=tolerance, output=DURATION
    )


def ours(name: str, fs: Column, fc: Column, tolerance: float) -> batch.Batch:
    """The loops, laid out."""
    return batch.prepare(the_case(name, tolerance), {"friction.fs": fs, "friction.fc": fc})


def built(compiler: str, source: Path, folder: str) -> Any | None:
    """A C file as a library; None where the compiler is missing."""
    if shutil.which(compiler) is None:
        print(f"{compiler} is missing: {source.name} is left out")
        return None
    library = Path(folder) / f"{source.stem}.so"
    flags = ["-O3", "-march=native", "-D_GNU_SOURCE", "-shared", "-fPIC"]
    subprocess.run(
        [compiler, *flags, str(source), "-o", str(library), "-lm"], check=True, stderr=subprocess.DEVNULL
    )
    return ctypes.CDLL(str(library))


def same_method(c: Baseline, name: str, fs: Column, fc: Column, tolerance: float) -> Callable[[], Column]:
    """baseline.c over the loops."""
    loop, ends = c.loop(exact.prepare(the_case(name, 1e-6)), control=False), np.zeros(fs.size)
    one = loop.run(tolerance)

    def run() -> Column:
        for i in range(fs.size):
            loop.values[FS], loop.values[FC] = fs[i], fc[i]
            ends[i] = one()[1]
        return ends.copy()

    return run


def prototype_numbers(name: str) -> Column:
    """The parameters of the prototypes."""
    g, gms, lugre, plant = closed_loop.GAINS, closed_loop.GMS, closed_loop.LUGRE, closed_loop.PLANT
    curve = [CURVE["fs"], CURVE["fc"], CURVE["vs"], CURVE["sigma2"]]
    omega = 2.0 * np.pi * closed_loop.FREQUENCY
    p = plant.parameters
    head = [closed_loop.INERTIA, g.kp, g.kd, closed_loop.AMPLITUDE, omega, 4, *p.k, *p.alpha, p.c, *curve]
    q = gms.parameters
    tail = [closed_loop.CODES[name], 3, *q.k, 0.0, *q.alpha, 0.0, q.c, *curve]
    return np.array([*head, *tail, lugre.parameters.sigma0, lugre.parameters.sigma1])


def event_driven(library: Any, name: str, fs: Column, fc: Column, tolerance: float) -> Callable[[], Column]:
    """etd.c over the loops, position on a 1 ms grid."""
    function = library.sim_etd
    function.argtypes = [
        ARRAY,
        REAL,
        REAL,
        REAL,
        REAL,
        ARRAY,
        ARRAY,
        ctypes.POINTER(ctypes.c_int),
        ctypes.c_int,
    ]
    p, grid, events, count = prototype_numbers(name), np.zeros(2502), np.zeros(100_000), ctypes.c_int()
    ends = np.zeros(fs.size)

    def run() -> Column:
        for i in range(fs.size):
            p[15], p[16] = fs[i], fc[i]
            function(
                pointer(p), DURATION, tolerance, 64e-3, 1e-3, pointer(grid), pointer(events), ctypes.byref(count),
                100_000,
            )  # fmt: skip
            ends[i] = grid[2500]
        return ends.copy()

    return run


def loosest(make: Callable[[float], Callable[[], Column]], truth: Column, wanted: float) -> float:
    """The loosest tolerance at which 99 % of the loops end within `wanted` of the truth, rad."""
    for tolerance in TOLERANCES:
        if np.percentile(np.abs(make(tolerance)() - truth), 99.0) <= wanted:
            return tolerance
    return TOLERANCES[-1]


def compare(name: str, options: argparse.Namespace, c: dict[str, Any]) -> None:
    """Measure one compensation."""
    rng = np.random.default_rng(1)
    fs = CURVE["fs"] * rng.uniform(1.0 - options.spread, 1.0 + options.spread, options.cases)
    fc = CURVE["fc"] * rng.uniform(1.0 - options.spread, 1.0 + options.spread, options.cases)
    some = fs[:SAMPLE].copy(), fc[:SAMPLE].copy()
    truth = ours(name, *some, 1e-10).run(()).position
    tolerance = loosest(lambda tol: lambda: ours(name, *some, tol).run(()).position, truth, options.error)
    many = ours(name, fs, fc, tolerance)
    laid_out = least(lambda: ours(name, fs, fc, tolerance))
    runs: dict[str, Callable[[], Column]] = {
        "ours, no metrics": lambda: many.run(()).position,
        "ours, 4 metrics": lambda: many.run(COARSE).position,
        "ours, all metrics": lambda: many.run().position,
    }
    if "baseline" in c:
        level = loosest(lambda tol: same_method(c["baseline"], name, *some, tol), truth, options.error)
        runs[f"C, same method ({level:.0e})"] = same_method(c["baseline"], name, fs, fc, level)
    if "etd" in c:
        level = loosest(lambda tol: event_driven(c["etd"], name, *some, tol), truth, options.error)
        runs[f"C, etd.c ({level:.0e})"] = event_driven(c["etd"], name, fs, fc, level)
    if options.jax:
        runs[f"JAX, trapezoid ({STEP:g} s)"] = jax_step.runner(name, fs, fc, DURATION, STEP)
    times = dict.fromkeys(runs, np.inf)
    errors: dict[str, Column] = {}
    for _ in range(3):
        for label, run in runs.items():
            start = time.process_time()
            ends = run()
            times[label] = min(times[label], time.process_time() - start)
            errors[label] = np.abs(ends[:SAMPLE] - truth)
    print(f"{name}, {options.cases} loops, ours at {tolerance:.0e} rad, laid out in {laid_out:.3f} s")
    for label in runs:
        e = errors[label]
        worse = f"median {np.median(e):.1e}, 99 % {np.percentile(e, 99):.1e} rad"
        print(f"    {label:28} {times[label]:8.3f} s   error: {worse}")
    bare, metered = times["ours, no metrics"], times["ours, all metrics"]
    print(f"          {metered / bare:.2f} times as long with all metrics as with none")
    for label in runs:
        if not label.startswith("ours"):
            ratio = (bare + laid_out) / times[label]
            judged = label.startswith("C") and name == "none"
            verdict = closed_loop.verdict(ratio <= TIMES_C) if judged else "    "
            print(f"    {verdict}  {ratio:.2f} times {label}" + f" (at most {TIMES_C})" * judged)
    print(f"    both cores: {two_cores(many):.2f} times as fast as one", flush=True)


def least(run: Callable[[], Any]) -> float:
    """CPU time, the least of three, s."""
    times: list[float] = []
    for _ in range(3):
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
    return min(times)


def two_cores(many: batch.Batch) -> float:
    """How much faster two threads are by the clock, the best of five."""
    times: dict[int, float] = {1: np.inf, 2: np.inf}
    for _ in range(5):
        for jobs in times:
            start = time.perf_counter()
            many.run((), jobs)
            times[jobs] = min(times[jobs], time.perf_counter() - start)
    return times[1] / times[2]


def main() -> None:
    """Run the comparison."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--spread", type=float, default=0.1, help="of Fs and Fc, as a part of their values")
    parser.add_argument("--error", type=float, default=1e-6, help="in the last position, rad")
    parser.add_argument("--jax", action="store_true", help="compare with JAX (pip install jax)")
    parser.add_argument("--prototypes", type=Path, metavar="DIR", help="with etd.c")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        c: dict[str, Any] = {}
        baseline = compiled_baseline(folder)
        if baseline is not None:
            c["baseline"] = baseline
        if options.prototypes:
            library = built("gcc", options.prototypes / "etd.c", folder)
            if library is not None:
                c["etd"] = library
        for name in ("none", "GMS feedback"):
            compare(name, options, c)


if __name__ == "__main__":
    main()
