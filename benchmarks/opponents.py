"""What users would pick instead: general integrators on the loop of Table 6, at equal accuracy.

The three loops of `closed_loop.py` (none, GMS feedback, LuGre feedforward; 5 s of the low reference, or 0.5 s
with `--short`). Every opponent restarts at each located event, with the same compiled event function and right-
hand side, and takes steps of 1 ms at most, lest it step over an event. Each runs at its loosest tolerance whose
largest error in position stays below `--error` (1e-6 rad) against a tight run of ours, or is marked as less
accurate. SciPy's `solve_ivp` with BDF, Radau and LSODA; SciPy's BDF with the right-hand side in plain Python;
CVODE (BDF) through scikit-sundae where it is installed; Octave's ode15s where it is installed, whose events lie on
straight lines between its steps, so that it takes steps of 0.1 ms; and the method of ours in C, compiled by gcc.
MuJoCo's LuGre actuator steps at fixed times without events and is compared in `stiction_drift.py`.

    python benchmarks/opponents.py [--short]
"""

from __future__ import annotations

import argparse
import importlib
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

import closed_loop as loop
from baseline import compiled_baseline

Positions = np.ndarray[Any, np.dtype[np.float64]]
Solver = Callable[
    ["Loop", float, Positions, Positions, float], tuple[Positions, Positions, float, Positions, bool]
]
TOLERANCES = [1e-6, 1e-7, 1e-8, 1e-9, 1e-10]
LONGEST, OCTAVE_LONGEST = 1e-3, 1e-4  # s
OCTAVE = "Octave ode15s"
ROUNDS, QUICK_RUNS = 3, 20


class Loop:
    """A loop as right-hand side and event function, with its modes."""

    def __init__(self, name: str, plain: bool = False) -> None:
        self.slope: Any = loop.slope.py_func if plain else loop.slope
        self.p = loop.numbers(name)
        self.elements = 4 + (3 if name == "GMS feedback" else 0)
        self.size = 2 + self.elements + (1 if name == "LuGre feedforward" else 0)
        self.shares = np.array([*loop.PLANT.parameters.alpha, *loop.GMS.parameters.alpha][: self.elements])
        self.slips, self.sigma, self.dy = np.zeros(self.elements, dtype=np.bool_), 1.0, np.zeros(self.size)
        self.lugre = name == "LuGre feedforward"

    def absolute(self, tolerance: float) -> Positions:
        """Absolute tolerances, on the scale of each state."""
        atol = np.full(self.size, tolerance)
        atol[1 : 2 + self.elements] = 1e3 * tolerance
        if self.lugre:
            atol[-1] = 1e-2 * tolerance
        return atol

    def rate(self, t: float, y: Positions) -> Positions:
        """The right-hand side."""
        self.slope(t, y, self.p, self.slips, self.sigma, self.dy)
        return self.dy.copy()

    def event(self, _: float, y: Positions) -> float:
        """The event function."""
        return float(loop.guard(y, self.p, self.slips, self.sigma))

    def switch(self, y: Positions) -> None:
        """Change the mode whose event function is largest: a reversal, or an element's limit."""
        s = loop.CURVE["fc"] + (loop.CURVE["fs"] - loop.CURVE["fc"]) * math.exp(
            -((y[1] / loop.CURVE["vs"]) ** 2)
        )
        side = loop.direction(y)
        limits = np.where(self.slips, -math.inf, side * y[2 : 2 + self.elements] / self.shares - s)
        if self.slips.any() and -10.0 * self.sigma * y[1] >= limits.max():
            self.slips[:], y[1] = False, 0.0
        else:
            self.sigma = side
            self.slips[np.argmax(limits)] = True


def scipy_solver(method: str) -> Solver:
    """A method of `solve_ivp`, up to the next event."""

    def solve(
        one: Loop, t: float, y: Positions, inside: Positions, tolerance: float
    ) -> tuple[Positions, Positions, float, Positions, bool]:
        def event(time: float, state: Positions) -> float:
            return one.event(time, state)

        event.terminal, event.direction = True, 1.0  # type: ignore[attr-defined]
        r: Any = solve_ivp(
            one.rate, (t, float(inside[-1])), y, method, t_eval=inside, events=event, rtol=tolerance,
            atol=one.absolute(tolerance), max_step=LONGEST,
        )  # fmt: skip
        if r.status != 1:
            return r.t, r.y[0] if len(r.t) else np.zeros(0), float(inside[-1]), y, False
        return (
            r.t,
            r.y[0] if len(r.t) else np.zeros(0),
            float(r.t_events[0][0]),
            r.y_events[0][0].copy(),
            True,
        )

    return solve


def cvode_solver() -> Solver | None:
    """CVODE (BDF), up to the next event; None where scikit-sundae is missing."""
    try:
        cvode: Any = importlib.import_module("sksundae.cvode")
    except ImportError:
        print("scikit-sundae is missing: CVODE is left out")
        return None

    def solve(
        one: Loop, t: float, y: Positions, inside: Positions, tolerance: float
    ) -> tuple[Positions, Positions, float, Positions, bool]:
        def rate(time: float, state: Positions, out: Positions) -> None:
            one.slope(time, state, one.p, one.slips, one.sigma, out)

        def events(time: float, state: Positions, out: Positions) -> None:
            out[0] = one.event(time, state)

        events.terminal, events.direction = [True], [1]  # type: ignore[attr-defined]
        solver = cvode.CVODE(
            rate, method="BDF", rtol=tolerance, atol=one.absolute(tolerance), eventsfn=events, num_events=1,
            max_step=LONGEST, max_num_steps=1_000_000,
        )  # fmt: skip
        times = np.concatenate([[t], inside[inside > t]])
        r: Any = solver.solve(times, y)
        # The last row of a run that an event ended is the event itself.
        hit = r.t_events is not None and len(r.t_events) > 0
        last = -1 if hit else len(r.t)
        return r.t[1:last], r.y[1:last, 0], float(r.t[-1]), np.array(r.y[-1]), hit

    return solve


def positions(name: str, solve: Solver, tolerance: float, grid: Positions, plain: bool = False) -> Positions:
    """Position on the grid, from event to event."""
    one = Loop(name, plain)
    y, t, end, out = np.zeros(one.size), 0.0, float(grid[-1]), np.zeros(grid.size)
    while t < end:
        inside = grid[(grid > t) & (grid <= end)]
        times, found, t, y, hit = solve(one, t, y, inside, tolerance)
        out[np.searchsorted(grid, times)] = found
        if not hit:
            break
        one.switch(y)
    return out


def octave_run(name: str, tolerance: float, grid: Positions) -> tuple[Positions, float] | None:
    """Positions and CPU time (s) of Octave's ode15s; None where it is missing or gives up."""
    program = shutil.which("octave-cli")
    if program is None:
        return None
    one = Loop(name)
    head = [tolerance, OCTAVE_LONGEST, float(grid[1] - grid[0]), grid.size, one.elements, one.size]
    with tempfile.TemporaryDirectory() as folder:
        numbers, result = Path(folder) / "numbers.txt", Path(folder) / "result.txt"
        np.savetxt(numbers, [*head, *one.p], fmt="%.17g")
        script = Path(__file__).with_name("ode15s.m")
        subprocess.run(
            [program, "--norc", "-q", script, numbers, result], capture_output=True, timeout=600, check=False
        )
        if not result.exists():
            return None
        found = np.loadtxt(result)
    return found[1:], float(found[0])


def with_octave(
    name: str, grid: Positions, truth: Positions, wanted: float, errors: dict[str, float]
) -> dict[str, float]:
    """Time of Octave's ode15s, by its label, at the loosest tolerance that is accurate enough, or the best."""
    times: dict[str, float] = {}
    for tolerance in TOLERANCES[::2]:
        if (found := octave_run(name, tolerance, grid)) is None:
            continue
        error = float(np.max(np.abs(found[0] - truth)))
        if error < errors.get(OCTAVE, math.inf):
            errors[OCTAVE], times[OCTAVE] = error, found[1]
        if error <= wanted:
            break
    if not times:
        print(f"{name}: Octave's ode15s is missing or gives up")
    return times


def in_turns(quick: dict[str, Callable[[], Any]], slow: dict[str, Callable[[], Any]]) -> dict[str, float]:
    """Median CPU times of runs taken in turns, s: a busy machine must not count against the slow ones."""
    times: dict[str, list[float]] = {label: [] for label in [*quick, *slow]}
    for _ in range(ROUNDS):
        for some, count in ((quick, QUICK_RUNS), (slow, 1)):
            for _ in range(count):
                for label, run in some.items():
                    start = time.thread_time()
                    run()
                    times[label].append(time.thread_time() - start)
    return {label: float(np.median(values)) for label, values in times.items()}


def compare(name: str, grid: Positions, wanted: float, baseline: Any) -> None:
    """Measure one compensation, print a row for everyone."""
    truth = loop.positions(name, 1e-10, grid)
    level, error = loop.loosest(lambda tol: loop.positions(name, tol, grid), truth, wanted, loop.TOLERANCES)
    quick: dict[str, Callable[[], Any]] = {"stickslip": loop.prepared(name, level, grid).run}
    errors = {"stickslip": error}
    if baseline is not None:
        quick["C, same method"], errors["C, same method"] = loop.fastest_c(
            baseline, name, truth, wanted, grid
        )
    slow: dict[str, Callable[[], Any]] = {}
    solvers: dict[str, tuple[Solver | None, bool]] = {
        f"SciPy {m}": (scipy_solver(m), False) for m in ("BDF", "Radau", "LSODA")
    }
    solvers["SciPy BDF, plain Python"] = scipy_solver("BDF"), True
    solvers["CVODE (scikit-sundae)"] = cvode_solver(), False
    for label, (solve, plain) in solvers.items():
        if solve is None:
            continue

        def run(tolerance: float, solve: Solver = solve, plain: bool = plain) -> Positions:
            return positions(name, solve, tolerance, grid, plain)

        tolerance, errors[label] = loop.loosest(run, truth, wanted, TOLERANCES)
        slow[label] = lambda run=run, tolerance=tolerance: run(tolerance)
    times = in_turns(quick, slow) | with_octave(name, grid, truth, wanted, errors)
    print(f"\n| {name} | time | error | times ours |\n|---|---|---|---|")
    for label, spent in times.items():
        mark = "" if errors[label] <= wanted else " (less accurate)"
        print(
            f"| {label} | {1e3 * spent:.3g} ms | {errors[label]:.1e} rad{mark} | {spent / times['stickslip']:.3g} |"
        )


def main() -> None:
    """Run the comparison."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--short", action="store_true", help="0.5 s instead of 5 s")
    parser.add_argument("--error", type=float, default=1e-6, help="largest error allowed, rad")
    options = parser.parse_args()
    grid = np.arange(round((0.5 if options.short else 5.0) * 1000) + 1) * 1e-3
    with tempfile.TemporaryDirectory() as folder:
        baseline = compiled_baseline(folder)
        for name in loop.COMPENSATORS:
            compare(name, grid, options.error, baseline)


if __name__ == "__main__":
    main()
