"""What every kind of run of the thesis's study takes, per simulated second, and what others take for it.

Every reference and controller of the study (nominal friction, signed rule), where the largest error in position on a
1 ms grid stays below `--error` (1e-6 rad) against an exact run at 3.3e-11. The exact integrator's kernel and the same
method in C (`baseline.c`, compiled by gcc -O3 -march=native for each kind of loop) run at one tolerance: the loosest at
which both are accurate enough, as they are at the next tighter one (one alone may be luck). Where C is faster without
error control, at a longest step found by hand, that counts. Ours and C are run in turns, called from compiled code, and
the least CPU times count; both write position and velocity, and read the same table of a feedforward torque. Beside
them the adaptive integrator (Dormand-Prince with located events, no metrics), and the fastest of SciPy's BDF, Radau and
LSODA on the same compiled rates and event functions, restarted at every located event: CPU times in the same process,
SciPy's of one run. * marks what misses the error at every tolerance and method, with the time of the most accurate;
what is more than 1e-4 rad off has lost the motion, and no ratio is given.

    python benchmarks/study_speed.py [--duration 2] [--only low/PD,step] [--no-scipy]

Prints PASS or FAIL for the bars: SciPy takes at least 200 times as long, and C no less than two thirds.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from baseline import (
    TOLERANCES,
    Baseline,
    Loop,
    Run,
    compiled_baseline,
    fastest_by_hand,
    ours,
    time_of,
)
from stickslip.simulation import adaptive, exact
from stickslip.simulation._loop import EXTRA, LAWS, arrays_of, begin_side, events, rates, switch
from stickslip.simulation.closed_loop import prepare
from stickslip.study import study as studies
from stickslip.study.plan import PlannedRun

TIMES_SCIPY, TIMES_C = 200, 1.5
LONGEST = 1e-3  # s, lest SciPy step over an event
BEYOND = 1e-11  # s
LOST = 1e-4  # rad; a solution that is this far off is one of another motion
SCIPY_TOLERANCES = [1e-6, 1e-7, 1e-8, 1e-9, 1e-10]
METHODS = ("BDF", "Radau", "LSODA")
ROUNDS = 25
ADAPTIVE_TOLERANCES = [1e-4 * 10.0 ** (-0.5 * i) for i in range(13)]


def laid_out(run: PlannedRun, tolerance: float) -> Any:
    """The run's case."""
    return prepare(
        run.axis, run.control, run.motion, run.duration, tolerance=tolerance, output=1e-3, metered=False
    )


def on_grid(outcome: Any) -> Any:
    """Position on the grid."""
    rows = outcome.rows
    return rows[rows[:, 8] == 0.0][:, 3]


# ---- SciPy ---------------------------------------------------------------------------------------------------


class Scipy:
    """A run as right-hand side and event function, with its modes."""

    def __init__(self, case: Any, method: str) -> None:
        self.case, self.method = case, method
        self.a, self.w = arrays_of(case)
        numbers = case.numbers[[adaptive.POSITION_0, adaptive.VELOCITY_0]]
        self.y = np.concatenate([numbers, np.zeros(LAWS - 2), case.plant.state, case.compensator.state])
        self.k, self.g = np.zeros((8, self.y.size)), np.zeros(self.y.size - LAWS + EXTRA)

    def event(self) -> Any:
        """The event function, as SciPy wants it."""

        def due(t: float, y: Any) -> float:
            return self.due(t, y)

        due.terminal, due.direction = True, 1.0  # type: ignore[attr-defined]
        return due

    def rate(self, t: float, y: Any) -> Any:
        """The right-hand side."""
        rates(self.a, self.w, t, np.ascontiguousarray(y), self.k, 0)
        return self.k[0].copy()

    def due(self, t: float, y: Any) -> float:
        """The largest event function."""
        return float(events(self.a, self.w, t, np.ascontiguousarray(y), self.k, 7, self.g))

    def cross(self, t: float, y: Any, stop: float) -> float:
        """Go to the far side of a located event and change the modes there; returns the time."""
        beyond = BEYOND
        while self.due(t, y) < 0.0 and beyond < 1e3 * BEYOND:
            y += beyond * self.rate(t, y)
            t += beyond
            beyond *= 2.0
        self.settle(t, y)
        begin_side(self.a, self.w, t, 0.5 * (t + stop), y, self.k, 7)
        return t

    def settle(self, t: float, y: Any) -> None:
        """Switch until no event is due."""
        for _ in range(9):
            if self.due(t, y) < 0.0:
                break
            switch(self.a, self.w, t, y, self.k, 7, self.g)

    def positions(self, tolerance: float) -> Any:
        """Position on the grid, from event to event."""
        grid, out, t, y = self.case.grid, np.zeros(self.case.grid.size), 0.0, self.y.copy()
        # The absolute tolerances keep the proportions that our adaptive integrator gives the states.
        atol = adaptive.tolerances(self.case)
        atol = atol * (tolerance / atol[0])
        for stop in self.case.breaks:
            begin_side(self.a, self.w, t, 0.5 * (t + stop), y, self.k, 7)
            self.settle(t, y)
            while t < stop:
                # The last time is where the next solve goes on.
                times = np.append(grid[(grid > t) & (grid < stop)], stop)
                found: Any = solve_ivp(
                    self.rate, (t, stop), y, self.method, t_eval=times, events=self.event(), rtol=tolerance, atol=atol,
                    max_step=LONGEST, first_step=min(1e-6, 0.5 * (stop - t)),
                )  # fmt: skip
                if found.status < 0:
                    raise ArithmeticError(found.message)
                at = np.searchsorted(grid, found.t)
                hit = (at < grid.size) & (grid[np.minimum(at, grid.size - 1)] == found.t)
                out[at[hit]] = found.y[0][hit] if len(found.t) else 0.0
                if found.status == 0:
                    t, y = stop, found.y[:, -1].copy()
                else:
                    t, y = float(found.t_events[0][0]), found.y_events[0][0].copy()
                    t = self.cross(t, y, stop)
        return out


@dataclass(frozen=True)
class Found:
    """The best of SciPy's solvers on a run: which, CPU time (s), error (rad)."""

    method: str
    spent: float
    error: float


def best_of_scipy(run: PlannedRun, truth: Any, wanted: float) -> Found | None:
    """The fastest of SciPy's solvers that is accurate enough, else the most accurate; None where all give up."""
    found: list[Found] = []
    for method in METHODS:
        for tolerance in SCIPY_TOLERANCES:
            start = time.thread_time()
            try:
                positions = Scipy(laid_out(run, 1e-9), method).positions(tolerance)
            except (ArithmeticError, ValueError):
                continue  # Where a mode lasts shorter than SciPy resolves, its search for the event fails.
            spent = time.thread_time() - start
            found.append(Found(method, spent, float(np.max(np.abs(positions - truth)))))
            if found[-1].error <= wanted:
                break
    accurate = [f for f in found if f.error <= wanted]
    if accurate:
        return min(accurate, key=lambda f: f.spent)
    return min(found, key=lambda f: f.error, default=None)


# ---- the table -----------------------------------------------------------------------------------------------


def adaptive_time(run: PlannedRun, truth: Any, wanted: float) -> tuple[float, bool]:
    """CPU time of the adaptive integrator, s, and whether it is accurate enough."""
    tolerance, error = ADAPTIVE_TOLERANCES[-1], math.inf
    for tolerance in ADAPTIVE_TOLERANCES:
        error = float(np.max(np.abs(on_grid(adaptive.run(laid_out(run, tolerance))) - truth)))
        if error <= wanted:
            break
    case, times = laid_out(run, tolerance), []
    for _ in range(3):
        start = time.thread_time()
        adaptive.run(case)
        times.append(time.thread_time() - start)
    return min(times), error <= wanted


def at_one_tolerance(
    run: PlannedRun, loop: Loop | None, truth: Any, wanted: float
) -> tuple[float, Run, Run | None, float, float]:
    """The loosest tolerance at which ours and C are accurate enough: the tolerance, both runs, their errors."""
    before: tuple[float, Run, Run | None, float, float] | None = None
    for tolerance in TOLERANCES:
        mine, c = ours(exact.prepare(laid_out(run, tolerance))), loop.run(tolerance) if loop else None
        error, c_error = (float(np.max(np.abs(r() - truth))) if r else 0.0 for r in (mine, c))
        if not max(error, c_error) <= wanted:
            before = None
        elif before:
            return before
        else:
            before = tolerance, mine, c, error, c_error
    raise SystemExit(f"{run.reference}/{run.controller}: no tolerance is accurate enough")


def compare(
    run: PlannedRun, wanted: float, baseline: Baseline | None, with_scipy: bool
) -> tuple[float, float]:
    """Measure a run, print its row; returns the time of SciPy over ours (inf where it has none), and ours over C's."""
    ready = exact.prepare(laid_out(run, 3.3e-11))
    truth = ready.run()[0][:, 0].copy()
    loop = baseline.loop(ready, control=True) if baseline else None
    tolerance, mine, c, error, c_error = at_one_tolerance(run, loop, truth, wanted)
    by_hand = fastest_by_hand(baseline, ready, truth, wanted) if baseline else None
    setting, our_time, c_time = "", math.inf, math.inf
    if by_hand and c and by_hand.spent < min(time_of(c) for _ in range(5)):
        c, c_error, setting = by_hand.run, by_hand.error, f", {1e3 * by_hand.longest:g} ms"
    for _ in range(ROUNDS):
        our_time = min(our_time, time_of(mine, 1e-3))
        c_time = min(c_time, time_of(c, 1e-3)) if c else c_time
    theirs, accurate = adaptive_time(run, truth, wanted)
    found = best_of_scipy(run, truth, wanted) if with_scipy else None
    ratio, scipy = math.inf, ("", "", "")
    if with_scipy and (found is None or found.error > LOST):
        scipy = ("all lose the motion", f"{found.error:.0e}" if found else "", "")
    elif found:
        mark = "*" if found.error > wanted else ""
        ratio = found.spent / our_time
        scipy = (
            f"{found.method}, {1e3 * found.spent / run.duration:.0f}",
            f"{found.error:.0e}{mark}",
            f"{ratio:.0f}",
        )
    cells = (
        f"{run.reference}/{run.controller}", f"{tolerance:.0e}", f"{1e6 * our_time / run.duration:.1f}", f"{error:.0e}",
        f"{1e6 * c_time / run.duration:.1f}", f"{c_error:.0e}{setting}", f"{our_time / c_time:.2f}", *scipy,
        f"{theirs / our_time:.0f}{'' if accurate else '*'}",
    )  # fmt: skip
    print("| " + " | ".join(cells) + " |", flush=True)
    return ratio, our_time / c_time if c else 0.0


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--duration", type=float, default=2.0, help="longest run, s")
    parser.add_argument("--error", type=float, default=1e-6, help="largest error allowed, rad")
    parser.add_argument("--only", default="", help="runs, as low/PD,step")
    parser.add_argument(
        "--no-scipy", action="store_true", help="leave SciPy out, which takes most of the time"
    )
    options = parser.parse_args()
    print(
        "| run | tolerance (rad) | exact, us/s | error (rad) | C, us/s | error (rad) | exact/C | SciPy, ms/s"
        " | error (rad) | SciPy/exact | adaptive/exact |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    least, most = math.inf, 0.0
    with tempfile.TemporaryDirectory() as folder:
        baseline = compiled_baseline(folder)
        for planned in studies.load("thesis").runs:
            name = f"{planned.reference}/{planned.controller}"
            if (planned.slip_rule, planned.friction) == ("signed", "nominal") and name.startswith(
                tuple(options.only.split(","))
            ):
                run = replace(planned, duration=min(planned.duration, options.duration))
                scipy, c = compare(run, options.error, baseline, not options.no_scipy)
                least, most = min(least, scipy), max(most, c)
    if not options.no_scipy:
        said = "PASS" if least >= TIMES_SCIPY else "FAIL"
        print(f"{said}  SciPy takes at least {TIMES_SCIPY} times as long: {least:.0f}")
    print(f"{'PASS' if most <= TIMES_C else 'FAIL'}  at most {TIMES_C} times the time of C: {most:.2f}")


if __name__ == "__main__":
    main()
