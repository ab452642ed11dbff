"""What every kind of run of the thesis's study takes, per simulated second, and what others take for it.

Every reference and controller of the study (nominal friction, signed rule), at the loosest tolerance whose largest
error in position on a 1 ms grid stays below `--error` (1e-6 rad) against an exact run at 3.3e-11: the exact
integrator's prepared kernel; the adaptive one (Dormand-Prince with located events, no metrics); SciPy's BDF on the same
compiled rates and event functions, restarted at every located event; and, of PD, LuGre feedforward and GMS feedback
along a sine, the same method in C (`baseline.c`, compiled by gcc). CPU times in one process, medians; * marks what
misses the error at every tolerance, and takes the time of the tightest. Where BDF is more than 1e-4 rad off at every
tolerance, it loses the motion, and no ratio is given.

    python benchmarks/study_speed.py [--duration 2]

Prints PASS or FAIL for the bars: BDF takes at least 200 times as long, and C no less than two thirds.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import closed_loop
from baseline import c_run, compiled_baseline
from stickslip.simulation import adaptive, exact
from stickslip.simulation._loop import EXTRA, LAWS, arrays_of, begin_side, events, rates, switch
from stickslip.simulation.closed_loop import prepare
from stickslip.study import study as studies
from stickslip.study.plan import PlannedRun

TIMES_BDF, TIMES_C = 200, 1.5
LONGEST = 1e-3  # s, lest BDF step over an event
BEYOND = 1e-11  # s
LOST = 1e-4  # rad; a solution that is this far off is one of another motion
BDF_TOLERANCES = [1e-6, 1e-7, 1e-8, 1e-9, 1e-10]
TOLERANCES = [1e-4 * 10.0 ** (-0.5 * i) for i in range(13)]


def median_time(run: Callable[[], Any], repeats: int) -> float:
    """Median CPU time of a call, s."""
    times: list[float] = []
    for _ in range(repeats):
        start = time.thread_time()
        run()
        times.append(time.thread_time() - start)
    return float(np.median(times))


def laid_out(run: PlannedRun, tolerance: float) -> Any:
    """The run's case."""
    return prepare(
        run.axis, run.control, run.motion, run.duration, tolerance=tolerance, output=1e-3, metered=False
    )


def on_grid(outcome: Any) -> Any:
    """Position on the grid."""
    rows = outcome.rows
    return rows[rows[:, 8] == 0.0][:, 3]


def loosest(run: Callable[[float], Any], truth: Any, wanted: float) -> tuple[float, float]:
    """Tolerance and error of the loosest run that is accurate enough."""
    error = np.inf
    for tolerance in TOLERANCES:
        error = float(np.max(np.abs(run(tolerance) - truth)))
        if error <= wanted:
            return tolerance, error
    return TOLERANCES[-1], error


# ---- SciPy ---------------------------------------------------------------------------------------------------


class Bdf:
    """A run as right-hand side and event function, with its modes."""

    def __init__(self, case: Any) -> None:
        self.case = case
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
                    self.rate, (t, stop), y, "BDF", t_eval=times, events=self.event(), rtol=tolerance, atol=atol,
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


# ---- C -------------------------------------------------------------------------------------------------------


def in_c(function: Any, run: PlannedRun, truth: Any, wanted: float) -> tuple[float, float]:
    """CPU time (s) and error of `baseline.c` at its fastest setting that is accurate enough; NaN where it cannot."""
    code = {"PD": 0.0, "FF-lugre": 1.0, "FB-gms": 2.0}.get(run.controller)
    if function is None or code is None or run.motion.kind.name != "sine":
        return math.nan, math.nan
    motion, gains = run.motion.parameters._asdict(), run.control.gains
    # The laws are those of the study.
    p = closed_loop.numbers("none")
    p[:6] = [
        run.axis.inertia,
        gains.kp,
        gains.kd,
        motion["amplitude"],
        2.0 * math.pi * motion["frequency"],
        code,
    ]
    grid = np.arange(truth.size) * 1e-3
    best = (math.inf, math.nan)
    for tolerance, longest in closed_loop.C_SETTINGS:
        again = c_run(function, p, tolerance, longest, grid)
        error = float(np.max(np.abs(again() - truth)))
        if error <= wanted:
            best = min(best, (median_time(again, 5), error))
    return best


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--duration", type=float, default=2.0, help="longest run, s")
    parser.add_argument("--error", type=float, default=1e-6, help="largest error allowed, rad")
    parser.add_argument("--only", default="", help="runs, as low/PD,step")
    options = parser.parse_args()
    print(
        "| run | exact, us/s | tolerance, error (rad) | adaptive/exact | BDF, ms/s | error (rad) | BDF/exact"
        " | exact/C |"
    )
    print("|---|---|---|---|---|---|---|---|")
    least, most = math.inf, 0.0
    with tempfile.TemporaryDirectory() as folder:
        baseline = compiled_baseline(folder)
        for planned in studies.load("thesis").runs:
            name = f"{planned.reference}/{planned.controller}"
            if (planned.slip_rule, planned.friction) == ("signed", "nominal") and name.startswith(
                tuple(options.only.split(","))
            ):
                bdf, c = compare(
                    replace(planned, duration=min(planned.duration, options.duration)),
                    options.error,
                    baseline,
                )
                least, most = min(least, bdf), max(most, c)
    print(
        f"{'PASS' if least >= TIMES_BDF else 'FAIL'}  BDF takes at least {TIMES_BDF} times as long: {least:.0f}"
    )
    print(f"{'PASS' if most <= TIMES_C else 'FAIL'}  at most {TIMES_C} times the time of C: {most:.2f}")


def compare(run: PlannedRun, wanted: float, baseline: Any) -> tuple[float, float]:
    """Measure a run, print its row; returns the time of BDF over ours, and ours over C's (0 where C has none)."""
    truth = exact.prepare(laid_out(run, 3.3e-11)).run()[0][:, 0].copy()
    tolerance, error = loosest(lambda tol: exact.prepare(laid_out(run, tol)).run()[0][:, 0], truth, wanted)
    level, other = loosest(lambda tol: on_grid(adaptive.run(laid_out(run, tol))), truth, wanted)
    spent, b_error = math.nan, math.inf
    for b_level in BDF_TOLERANCES:
        start = time.thread_time()
        try:
            found = Bdf(laid_out(run, 1e-9)).positions(b_level)
        except (ArithmeticError, ValueError):
            continue  # Where a mode lasts shorter than SciPy resolves, its search for the event fails.
        spent, b_error = time.thread_time() - start, float(np.max(np.abs(found - truth)))
        if b_error <= wanted:
            break
    ready, case = exact.prepare(laid_out(run, tolerance)), laid_out(run, level)
    ours = median_time(ready.run, 21)
    theirs = median_time(lambda: adaptive.run(case), 3)
    c, _ = in_c(baseline, run, truth, wanted)
    marks = ["*" if e > wanted else "" for e in (error, other, b_error)]
    ratio_c = f"{ours / c:.2f}" if math.isfinite(c) else ""
    bdf = ("loses the motion", "", "")
    if b_error <= LOST:
        bdf = f"{1e3 * spent / run.duration:.0f}", f"{b_error:.1e}{marks[2]}", f"{spent / ours:.0f}"
    cells = (
        f"{run.reference}/{run.controller}", f"{1e6 * ours / run.duration:.1f}",
        f"{tolerance:.0e}, {error:.1e}{marks[0]}", f"{theirs / ours:.0f}{marks[1]}", *bdf, ratio_c,
    )  # fmt: skip
    print("| " + " | ".join(cells) + " |", flush=True)
    return (spent / ours if b_error <= LOST else math.inf), (ours / c if math.isfinite(c) else 0.0)


if __name__ == "__main__":
    main()
