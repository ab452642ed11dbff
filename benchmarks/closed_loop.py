"""The exact integrator against the same method in C and SciPy's BDF.

The closed loop of Table 6 (PD on the low reference, 5 s) without compensation, with GMS feedback and with LuGre
feedforward. Each program gets the loosest tolerance at which its largest error in position over a 1 ms grid stays
below `--error` (1e-6 rad); the error is against a tight run of our own. Times are medians of interleaved runs in
one process: ours on the prepared kernel (a feedforward torque is tabulated when it is prepared; that time is
printed too), `baseline.c` compiled here by gcc -O3 -march=native, SciPy with a compiled right-hand side, restarted
at every located event.

    python benchmarks/closed_loop.py [--short]
"""

from __future__ import annotations

import argparse
import ctypes
import math
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from stickslip.control.compensators.feedback import Feedback
from stickslip.control.compensators.feedforward import Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.jit import kernel
from stickslip.machines.rigid import RigidAxis
from stickslip.model import Model, Reference
from stickslip.simulate import _forcing, exact
from stickslip.simulate._case import lay_out

INERTIA = 3.8623e-4
CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "delta_s": 2.0, "sigma2": 0.018}
PLANT = Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **CURVE)
GMS = Model("gms", k=[12896.0, 8141.0, 4273.0], alpha=[1 / 3] * 3, c=23.8782, **CURVE)
LUGRE = Model("lugre", sigma0=3.5e4, sigma1=0.1, **CURVE)
AMPLITUDE, FREQUENCY = 0.01, 0.4
GAINS = place("PD", INERTIA, 36.0, 1.0)
COMPENSATORS = {"none": None, "GMS feedback": Feedback(GMS), "LuGre feedforward": Feedforward(LUGRE)}
CODES = {"none": 0.0, "LuGre feedforward": 1.0, "GMS feedback": 2.0}
TARGETS = {"none": 2000, "GMS feedback": 1500, "LuGre feedforward": 500}
TOLERANCES = [3e-4 * 10.0 ** (-0.5 * i) for i in range(12)]
Positions = np.ndarray[Any, np.dtype[np.float64]]


# ---- ours ---------------------------------------------------------------------------------------------------


def prepared(name: str, tolerance: float, grid: Positions) -> exact.Prepared:
    """The case on our prepared kernel."""
    controller = Controller(GAINS, COMPENSATORS[name])
    reference = Reference("sine", amplitude=AMPLITUDE, frequency=FREQUENCY)
    axis = RigidAxis(INERTIA, PLANT)
    return exact.prepare(
        lay_out(axis, controller, reference, float(grid[-1]), tolerance=tolerance, grid=grid, metered=False)
    )


def tabulation(name: str, grid: Positions) -> float:
    """Time to tabulate the feedforward torque, s."""
    case = prepared(name, 1e-6, grid).case
    _forcing._tables.clear()
    start = time.perf_counter()
    if name == "LuGre feedforward":
        _forcing.feedforward(case)
    return time.perf_counter() - start


# ---- C ------------------------------------------------------------------------------------------------------


def numbers(name: str) -> Positions:
    """The struct Loop of baseline.c."""

    def contact(model: Model) -> list[float]:
        p = model.parameters
        pad = [0.0] * (8 - len(p.k))
        return [len(p.k), *p.k, *pad, *p.alpha, *pad, p.c, p.fs, p.fc, p.vs, p.sigma2]

    head = [INERTIA, GAINS.kp, GAINS.kd, AMPLITUDE, 2.0 * math.pi * FREQUENCY, CODES[name]]
    lugre = LUGRE.parameters
    return np.array([*head, *contact(PLANT), *contact(GMS), lugre.sigma0, lugre.sigma1])


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


def c_run(function: Any, name: str, tolerance: float, grid: Positions) -> Callable[[], Positions]:
    """A run of the C baseline."""
    p, out = numbers(name), np.zeros(grid.size)
    spacing = float(grid[1] - grid[0])
    real = ctypes.POINTER(ctypes.c_double)
    a, b = p.ctypes.data_as(real), out.ctypes.data_as(real)

    def run() -> Positions:
        function(a, float(grid[-1]), tolerance, 16e-3, spacing, grid.size, b)
        return out

    return run


# ---- SciPy --------------------------------------------------------------------------------------------------


@kernel()
def slope(t: float, y: Any, p: Any, slips: Any, sigma: float, dy: Any) -> None:
    """Right-hand side: position, velocity, the elements' forces, and the bristle of the feedforward."""
    n = int(p[6])
    w = p[4]
    goal = p[3] * (1.0 - math.cos(w * t))
    rate = p[3] * w * math.sin(w * t)
    v = y[1]
    torque = p[1] * (goal - y[0]) + p[2] * (rate - v) - p[27] * v
    for side in range(2):
        base = 6 + 22 * side
        x = v / p[base + 20]
        s = p[base + 19] + (p[base + 18] - p[base + 19]) * math.exp(-x * x)
        first = 2 if side == 0 else 2 + n
        count = n if side == 0 else (int(p[28]) if p[5] == 2.0 else 0)
        for i in range(count):
            force = y[first + i]
            torque += -force if side == 0 else force
            if slips[first - 2 + i]:
                dy[first + i] = p[base + 17] * (p[base + 9 + i] * sigma - force / s)
            else:
                dy[first + i] = p[base + 1 + i] * v
    if p[5] == 2.0:
        torque += p[49] * v
    if p[5] == 1.0:
        x = rate / p[48]
        s = p[47] + (p[46] - p[47]) * math.exp(-x * x)
        last = 2 + n
        dy[last] = rate - p[50] * abs(rate) / s * y[last]
        torque += p[50] * y[last] + p[51] * dy[last] + p[49] * rate
    dy[0] = v
    dy[1] = torque / p[0]


@kernel()
def guard(y: Any, p: Any, slips: Any, sigma: float) -> float:
    """The largest event function: a break-away, or a reversal while something slips."""
    g = -1e9
    v = y[1]
    n = int(p[6])
    direction = 1.0 if v >= 0.0 else -1.0
    total = n + (int(p[28]) if p[5] == 2.0 else 0)
    for i in range(total):
        if slips[i]:
            g = max(g, -10.0 * sigma * v)
        else:
            base = 6 if i < n else 28
            j = i if i < n else i - n
            x = v / p[base + 20]
            s = p[base + 19] + (p[base + 18] - p[base + 19]) * math.exp(-x * x)
            g = max(g, direction * y[2 + i] / p[base + 9 + j] - s)
    return g


def direction(y: Positions) -> float:
    """Sign of the velocity."""
    return 1.0 if y[1] >= 0.0 else -1.0


def scipy_run(name: str, tolerance: float, grid: Positions) -> Positions:
    """SciPy's BDF from event to event."""
    p = numbers(name)
    elements = 4 + (3 if name == "GMS feedback" else 0)
    size = 2 + elements + (1 if name == "LuGre feedforward" else 0)
    shares = np.array([*PLANT.parameters.alpha, *GMS.parameters.alpha][:elements])
    slips, sigma, dy = np.zeros(elements, dtype=np.bool_), 1.0, np.zeros(size)
    atol = np.full(size, tolerance)
    atol[1] = 1e3 * tolerance
    atol[2 : 2 + elements] = 1e3 * tolerance
    if name == "LuGre feedforward":
        atol[-1] = 1e-2 * tolerance

    def rhs(t: float, y: Positions) -> Positions:
        slope(t, y, p, slips, sigma, dy)
        return dy.copy()

    def event(_: float, y: Positions) -> float:
        return guard(y, p, slips, sigma)

    event.terminal, event.direction = True, 1.0  # type: ignore[attr-defined]
    y, t, end, out = np.zeros(size), 0.0, float(grid[-1]), np.zeros(grid.size)
    while t < end:
        inside = grid[(grid > t) & (grid <= end)]
        r = solve_ivp(
            rhs, (t, end), y, "BDF", t_eval=inside, events=event, rtol=tolerance, atol=atol, max_step=1e-3
        )
        if len(r.t):
            out[np.searchsorted(grid, r.t)] = r.y[0]
        if r.status != 1:
            break
        t, y = float(r.t_events[0][0]), r.y_events[0][0].copy()
        # Whichever event function is largest there has ended its mode: a reversal, or an element's limit.
        s = CURVE["fc"] + (CURVE["fs"] - CURVE["fc"]) * math.exp(-((y[1] / CURVE["vs"]) ** 2))
        limits = np.where(slips, -math.inf, direction(y) * y[2 : 2 + elements] / shares - s)
        if slips.any() and -10.0 * sigma * y[1] >= limits.max():
            slips[:], y[1] = False, 0.0
        else:
            sigma = direction(y)
            slips[np.argmax(limits)] = True
    return out


# ---- the comparison -----------------------------------------------------------------------------------------


def loosest(
    run: Callable[[float], Positions], truth: Positions, wanted: float, tolerances: Any
) -> tuple[float, float]:
    """The loosest tolerance with an error below `wanted`, and the error."""
    error = math.inf
    for tolerance in tolerances:
        error = float(np.max(np.abs(run(tolerance) - truth)))
        if error <= wanted:
            return tolerance, error
    return tolerances[-1], error


def interleaved(runs: dict[str, Callable[[], Any]], repeats: int) -> dict[str, float]:
    """Median time of each run, s, taken in turns."""
    times: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            start = time.perf_counter()
            run()
            times[name].append(time.perf_counter() - start)
    return {name: float(np.median(values)) for name, values in times.items()}


def compare(
    name: str, grid: Positions, wanted: float, repeats: int, baseline: Any, scipy_tolerances: Any
) -> None:
    """Measure one compensation and print its row."""
    truth = prepared(name, 1e-10, grid).run()[0][:, 0].copy()
    tolerance, error = loosest(
        lambda tol: prepared(name, tol, grid).run()[0][:, 0], truth, wanted, TOLERANCES
    )
    ours = prepared(name, tolerance, grid)
    runs: dict[str, Callable[[], Any]] = {"ours": ours.run}
    c_error = math.nan
    if baseline is not None:
        c_tolerance, c_error = loosest(
            lambda tol: c_run(baseline, name, tol, grid)(), truth, wanted, [0.02 * x for x in TOLERANCES]
        )
        runs["C"] = c_run(baseline, name, c_tolerance, grid)
    times = interleaved(runs, repeats)
    b_tolerance, b_error = loosest(lambda tol: scipy_run(name, tol, grid), truth, wanted, scipy_tolerances)
    b_time = interleaved({"BDF": lambda: scipy_run(name, b_tolerance, grid)}, 1)["BDF"]
    c_time = times.get("C", math.nan)
    print(
        f"{name:18} {1e6 * times['ours']:8.0f} us {error:8.1e}   {1e6 * c_time:8.0f} us {c_error:8.1e}"
        f"   {1e3 * b_time:8.0f} ms {b_error:8.1e}   {times['ours'] / c_time:6.2f}   {b_time / times['ours']:8.0f}"
        f"  (at least {TARGETS[name]})",
        flush=True,
    )


def main() -> None:
    """Run the comparison."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--short", action="store_true", help="0.5 s instead of 5 s, fewer repeats: for CI")
    parser.add_argument("--error", type=float, default=1e-6, help="largest error allowed, rad")
    parser.add_argument("--repeats", type=int, default=200)
    options = parser.parse_args()
    duration, repeats = (0.5, 20) if options.short else (5.0, options.repeats)
    grid = np.arange(round(duration * 1000) + 1) * 1e-3
    tolerances = [1e-6, 1e-7, 1e-8, 1e-9, 1e-10]
    with tempfile.TemporaryDirectory() as folder:
        baseline = compiled_baseline(folder)
        print(f"{duration:g} s of the loop of Table 6, position on a 1 ms grid; errors in rad")
        print(f"{'':18} {'ours':>20}   {'C':>20}   {'BDF':>20}   ours/C   BDF/ours")
        for name in COMPENSATORS:
            compare(name, grid, options.error, repeats, baseline, tolerances)
        print(f"tabulating the feedforward torque: {1e6 * tabulation('LuGre feedforward', grid):.0f} us")


if __name__ == "__main__":
    main()
