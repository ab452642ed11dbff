"""The exact integrator against the same method in C and SciPy's BDF.

The closed loop of Table 6 (PD on the low reference, 5 s) without compensation, with GMS feedback and with LuGre
feedforward; position on a 1 ms grid. Each program runs at its fastest setting whose largest error in position
stays below `--error` (1e-6 rad), measured against a tight run of our own: ours and SciPy's BDF (compiled
right-hand side, restarted at every located event) by tolerance, `baseline.c` (compiled here by gcc -O3
-march=native) by tolerance, or by its longest step. Times are medians of runs taken in turns in one process: ours on
the prepared kernel (a feedforward torque is tabulated when it is prepared, for C too; that time is printed). What
`simulate()` adds to its kernel is measured apart. PID and LuGre feedback are compared with C alone;
`study_speed.py` has every kind of loop.

    python benchmarks/closed_loop.py [--short [--record]]

Every bar is printed with PASS or FAIL. The short form, which CI runs, exits with 1 where the ratio of our time to C's
has risen by half over the one that `c_ratios.json` keeps (`--record` renews it). That ratio is between the least times
of runs taken in turns, and what has risen is measured twice more, so that a busy machine does not fail it.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from baseline import TOLERANCES, Baseline, Run, compiled_baseline, fastest, ours
from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.jit import kernel
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation import _forcing
from stickslip.simulation.case_arrays import lay_out
from stickslip.simulation.closed_loop import simulate
from stickslip.simulation.exact import engine as exact

INERTIA = 3.8623e-4
CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "delta_s": 2.0, "sigma2": 0.018}
PLANT = Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **CURVE)
GMS = Model("gms", k=[12896.0, 8141.0, 4273.0], alpha=[1 / 3] * 3, c=23.8782, **CURVE)
LUGRE = Model("lugre", sigma0=3.5e4, sigma1=0.1, **CURVE)
AMPLITUDE, FREQUENCY = 0.01, 0.4
GAINS = place("PD", INERTIA, 36.0, 1.0)
COMPENSATORS: dict[str, Feedback | Feedforward | None] = {
    "none": None,
    "GMS feedback": Feedback(GMS),
    "LuGre feedforward": Feedforward(LUGRE),
}
CODES = {"none": 0.0, "LuGre feedforward": 1.0, "GMS feedback": 2.0}
CONTROLLERS = {name: Controller(GAINS, helper) for name, helper in COMPENSATORS.items()}
AGAINST_C = {
    "PID": Controller(place("PID", INERTIA, 36.0, 1.0)),
    "LuGre feedback": Controller(GAINS, Feedback(LUGRE)),
}
"""Compared with C alone."""
TIMES_BDF = {"none": 2000.0, "GMS feedback": 1500.0, "LuGre feedforward": 500.0}
TIMES_C = 1.5
RISE = 1.5
TRIES = 3
RATIOS = Path(__file__).with_name("c_ratios.json")
OVERHEAD = 300e-6  # s
REPEATED = 10
BDF_TOLERANCES = [1e-6, 1e-7, 1e-8, 1e-9, 1e-10]
Positions = np.ndarray[Any, np.dtype[np.float64]]


# ---- ours ---------------------------------------------------------------------------------------------------


REFERENCE = Reference("sine", amplitude=AMPLITUDE, frequency=FREQUENCY)
AXIS = RigidAxis(INERTIA, PLANT)


def prepared(name: str, tolerance: float, grid: Positions) -> exact.Prepared:
    """The case on our prepared kernel."""
    controller = (CONTROLLERS | AGAINST_C)[name]
    return exact.prepare(
        lay_out(AXIS, controller, REFERENCE, float(grid[-1]), tolerance=tolerance, grid=grid, metered=False)
    )


def positions(name: str, tolerance: float, grid: Positions) -> Positions:
    """Position on the grid."""
    return prepared(name, tolerance, grid).run()[0][:, 0].copy()


def overhead(name: str, tolerance: float, grid: Positions, repeats: int) -> float:
    """What `simulate()` adds to the kernel that writes its rows, s."""
    controller = CONTROLLERS[name]

    def whole() -> Any:
        return simulate(
            AXIS, controller, REFERENCE, float(grid[-1]), integrator="exact", tolerance=tolerance, output=grid,
            metered=False,
        )  # fmt: skip

    kernel_only = prepared(name, tolerance, grid)
    times = interleaved({"simulate": whole, "kernel": kernel_only.record}, {}, repeats)
    return times["simulate"] - times["kernel"]


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
    run: Callable[[float], Positions], truth: Positions, wanted: float, tolerances: list[float]
) -> tuple[float, float]:
    """The loosest tolerance with an error below `wanted`, and the error."""
    error = math.inf
    for tolerance in tolerances:
        error = float(np.max(np.abs(run(tolerance) - truth)))
        if error <= wanted:
            return tolerance, error
    return tolerances[-1], error


def fastest_c(
    baseline: Baseline, name: str, truth: Positions, wanted: float, grid: Positions
) -> tuple[Run, float]:
    """The C baseline at its fastest setting with an error below `wanted`, and the error."""
    found = fastest(baseline, prepared(name, wanted, grid), truth, wanted)
    return found.run, found.error


def interleaved(
    quick: dict[str, Callable[[], Any]], slow: dict[str, Callable[[], Any]], repeats: int, rounds: int = 1
) -> dict[str, float]:
    """Median times of runs taken in turns, s; in every round the slow ones run once."""
    every = in_turns(quick, slow, repeats, rounds)
    return {name: float(np.median(values)) for name, values in every.items()}


def in_turns(
    quick: dict[str, Callable[[], Any]], slow: dict[str, Callable[[], Any]], repeats: int, rounds: int = 1
) -> dict[str, list[float]]:
    """All times of runs taken in turns, s."""
    times: dict[str, list[float]] = {name: [] for name in [*quick, *slow]}
    for _ in range(rounds):
        for some, count in ((quick, max(1, repeats // rounds)), (slow, 1)):
            for _ in range(count):
                for name, run in some.items():
                    start = time.perf_counter()
                    run()
                    times[name].append(time.perf_counter() - start)
    return times


def verdict(fine: bool) -> str:
    """PASS or FAIL."""
    return "PASS" if fine else "FAIL"


def compare(name: str, grid: Positions, wanted: float, repeats: int, rounds: int, baseline: Any) -> float:
    """Measure one compensation, print its row and its bars; returns the ratio of the least times of ours and C."""
    truth = positions(name, 1e-10, grid)
    tolerance, error = loosest(lambda tol: positions(name, tol, grid), truth, wanted, TOLERANCES)
    b_tolerance, b_error = loosest(lambda tol: scipy_run(name, tol, grid), truth, wanted, BDF_TOLERANCES)
    mine = ours(prepared(name, tolerance, grid))
    # Called from compiled code some times, so that what a call costs from Python does not count.
    quick: dict[str, Callable[[], Any]] = {"ours": lambda: mine(REPEATED)}
    c_error = math.nan
    if baseline is not None:
        run, c_error = fastest_c(baseline, name, truth, wanted, grid)
        quick["C"] = lambda: run(REPEATED)
    every = in_turns(quick, {"BDF": lambda: scipy_run(name, b_tolerance, grid)}, repeats, rounds)
    times = {label: float(np.median(values)) for label, values in every.items()}
    our_time, c_time, b_time = times["ours"] / REPEATED, times.get("C", math.nan) / REPEATED, times["BDF"]
    print(
        f"{name:18} {1e6 * our_time:8.0f} us {error:8.1e}   {1e6 * c_time:8.0f} us {c_error:8.1e}"
        f"   {1e3 * b_time:8.0f} ms {b_error:8.1e}   {our_time / c_time:6.2f}   {b_time / our_time:8.0f}"
    )
    print(
        f"    {verdict(b_time >= TIMES_BDF[name] * our_time)}  at least {TIMES_BDF[name]:.0f} times faster than BDF"
    )
    if baseline is not None:
        print(f"    {verdict(our_time <= TIMES_C * c_time)}  at most {TIMES_C} times the time of C")
    added = overhead(name, tolerance, grid, min(repeats, 50))
    print(f"    {verdict(added <= OVERHEAD)}  simulate() adds {1e6 * added:.0f} us (at most 300)", flush=True)
    return min(every["ours"]) / min(every["C"]) if baseline is not None else math.nan


def against_c(name: str, grid: Positions, wanted: float, repeats: int, baseline: Baseline) -> float:
    """Measure one kind of loop against C alone, print its row; returns the ratio of the least times."""
    truth = positions(name, 1e-10, grid)
    tolerance, error = loosest(lambda tol: positions(name, tol, grid), truth, wanted, TOLERANCES)
    mine = ours(prepared(name, tolerance, grid))
    theirs, c_error = fastest_c(baseline, name, truth, wanted, grid)
    every = in_turns({"ours": mine, "C": theirs}, {}, repeats)
    ours_s, c_s = (float(np.median(every[label])) for label in ("ours", "C"))
    print(
        f"{name:18} {1e6 * ours_s:8.0f} us {error:8.1e}   {1e6 * c_s:8.0f} us {c_error:8.1e}   {ours_s / c_s:31.2f}",
        flush=True,
    )
    return min(every["ours"]) / min(every["C"])


def risen(ratios: dict[str, float], kept: dict[str, float]) -> list[str]:
    """Which ratios to C have risen by half over those kept, in words."""
    return [
        f"{name}: {ratio:.2f} times the time of C, {kept[name]:.2f} when it was recorded"
        for name, ratio in ratios.items()
        if ratio > RISE * kept[name]
    ]


def gate(measure: Callable[[str], float], record: bool) -> None:
    """Compare the ratios to C with those kept, or keep them; exits with 1 where one has risen."""
    kept = json.loads(RATIOS.read_text()) if RATIOS.exists() else {}
    ratios: dict[str, float] = {}
    names = [*CONTROLLERS, *AGAINST_C]
    for name in names:
        for _ in range(TRIES):
            ratios[name] = min(measure(name), ratios.get(name, math.inf))
            if not record and not risen({name: ratios[name]}, {name: kept.get(name, math.inf)}):
                break
    if record:
        RATIOS.write_text(
            json.dumps({name: round(ratio, 3) for name, ratio in ratios.items()}, indent=1) + "\n"
        )
        print(f"{RATIOS} keeps {ratios}")
        return
    if missing := [name for name in names if name not in kept]:
        sys.exit(f"{RATIOS.name} has no ratio for {', '.join(missing)}; --short --record writes it")
    if complaints := risen(ratios, kept):
        sys.exit("\n".join(complaints))
    print(
        f"no ratio to C has risen by half over {RATIOS.name}: "
        + ", ".join(f"{r:.2f}" for r in ratios.values())
    )


def main() -> None:
    """Run the comparison."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--short", action="store_true", help="0.5 s instead of 5 s, fewer repeats: for CI")
    parser.add_argument(
        "--record", action="store_true", help="with --short: keep the ratios to C as they are now"
    )
    parser.add_argument("--error", type=float, default=1e-6, help="largest error allowed, rad")
    parser.add_argument("--repeats", type=int, default=201)
    options = parser.parse_args()
    duration, repeats, rounds = (0.5, 60, 3) if options.short else (5.0, options.repeats, 3)
    grid = np.arange(round(duration * 1000) + 1) * 1e-3
    with tempfile.TemporaryDirectory() as folder:
        baseline = compiled_baseline(folder)
        print(f"{duration:g} s of the loop of Table 6, position on a 1 ms grid; errors in rad")
        print(f"{'':18} {'ours':>20}   {'C':>20}   {'BDF':>20}   ours/C   BDF/ours")

        def measure(name: str) -> float:
            if baseline is not None and name in AGAINST_C:
                return against_c(name, grid, options.error, repeats, baseline)
            return compare(name, grid, options.error, repeats, rounds, baseline)

        if options.short and baseline is not None:
            gate(measure, options.record)
        else:
            for name in [*CONTROLLERS, *(AGAINST_C if baseline is not None else ())]:
                measure(name)
    print(f"tabulating the feedforward torque: {1e6 * tabulation('LuGre feedforward', grid):.0f} us")


if __name__ == "__main__":
    main()
