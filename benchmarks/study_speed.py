"""What every kind of run of the thesis's study takes, per simulated second, and what others take for it.

Every reference and controller of the study (nominal friction, signed rule), where the largest error in position on a
1 ms grid stays below `--error` (1e-6 rad) against an exact run at 3.3e-11. The exact integrator's kernel and the same
method in C (`baseline.c`, compiled by gcc -O3 -march=native for each kind of loop) run at one tolerance: the loosest at
which both are accurate enough, as they are at the next tighter one (one alone may be luck). Where C is faster without
error control, at a longest step found by hand, that counts. Ours and C are run in turns, called from compiled code, and
the least CPU times count; both write position and velocity, and read the same table of a feedforward torque. Beside
them the adaptive integrator (Dormand-Prince with located events, no metrics), and SciPy's BDF, Radau and LSODA on the
same compiled rates and event functions with their Jacobian, restarted at every located event: CPU times in the same
process, SciPy's of one run at the loosest tolerance from 1e-6 to 1e-12 that is accurate enough. * marks what misses the
error at every tolerance, with the time of the most accurate; what is more than 1e-4 rad off has lost the motion.

    python benchmarks/study_speed.py [--duration 2] [--only low/PD,step] [--no-scipy] [--own]

Prints PASS or FAIL for the bars: BDF takes at least 200 times as long, and C no less than two thirds.
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
    fastest,
    fastest_by_hand,
    loosest,
    ours,
    time_of,
)
from hybrid_loop import HybridLoop
from stickslip.simulation.adaptive import engine as adaptive
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.exact import engine as exact
from stickslip.studies import study as studies
from stickslip.studies.planned_run import PlannedRun

TIMES_BDF, TIMES_C = 200, 1.5
LONGEST = 1e-3  # s, lest SciPy step over an event
BEYOND = 1e-11  # s
DIFFERENCE = 1e-7
LOST = 1e-4  # rad; a solution that is this far off is one of another motion
SCIPY_TOLERANCES = [1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12]
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
        self.loop = HybridLoop(case)

    def event(self) -> Any:
        """The event function, as SciPy wants it."""

        def due(t: float, y: Any) -> float:
            return self.due(t, y)

        due.terminal, due.direction = True, 1.0  # type: ignore[attr-defined]
        return due

    def rate(self, t: float, y: Any) -> Any:
        """The right-hand side."""
        return self.loop.rates(t, y)

    def due(self, t: float, y: Any) -> float:
        """The largest event function."""
        return self.loop.events(t, y)

    def cross(self, t: float, y: Any, stop: float) -> float:
        """Go to the far side of a located event and change the modes there; returns the time."""
        beyond = BEYOND
        while self.due(t, y) < 0.0 and beyond < 1e3 * BEYOND:
            y += beyond * self.rate(t, y)
            t += beyond
            beyond *= 2.0
        self.settle(t, y)
        self.loop.begin(t, 0.5 * (t + stop), y)
        return t

    def settle(self, t: float, y: Any) -> None:
        """Switch until no event is due."""
        for _ in range(9):
            if self.due(t, y) < 0.0:
                break
            self.loop.switch(t, y)

    def jacobian(self, t: float, y: Any) -> Any:
        """Jacobian by differences of fixed size: SciPy's own steps grow without bound where a state changes nothing."""
        before, slopes = self.rate(t, y), np.empty((y.size, y.size))
        for i in range(y.size):
            moved = y.copy()
            moved[i] += DIFFERENCE * self.scale[i]
            slopes[:, i] = (self.rate(t, moved) - before) / (moved[i] - y[i])
        return slopes

    def positions(self, tolerance: float) -> Any:
        """Position on the grid, from event to event."""
        grid, out, t, y = self.case.grid, np.zeros(self.case.grid.size), 0.0, self.loop.y.copy()
        # The absolute tolerances keep the proportions that our adaptive integrator gives the states.
        atol = adaptive.tolerances(self.case)
        self.scale = atol / atol[0]
        atol = atol * (tolerance / atol[0])
        for stop in self.case.breaks:
            self.loop.begin(t, 0.5 * (t + stop), y)
            self.settle(t, y)
            while t < stop:
                # The last time is where the next solve goes on.
                times = np.append(grid[(grid > t) & (grid < stop)], stop)
                found: Any = solve_ivp(
                    self.rate, (t, stop), y, self.method, t_eval=times, events=self.event(), rtol=tolerance, atol=atol,
                    max_step=LONGEST, first_step=min(1e-6, 0.5 * (stop - t)), jac=self.jacobian,
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
    """What one of SciPy's solvers does with a run: CPU time (s), error (rad)."""

    method: str
    spent: float = math.nan
    error: float = math.inf


def in_scipy(method: str, run: PlannedRun, truth: Any, wanted: float) -> Found:
    """A solver at the loosest tolerance that is accurate enough, else at the most accurate."""
    best = Found(method)
    for tolerance in SCIPY_TOLERANCES:
        start = time.thread_time()
        try:
            positions = Scipy(laid_out(run, 1e-9), method).positions(tolerance)
        except (ArithmeticError, ValueError):
            continue  # Where a mode lasts shorter than SciPy resolves, its search for the event fails.
        spent, error = time.thread_time() - start, float(np.max(np.abs(positions - truth)))
        if error < best.error:
            best = Found(method, spent, error)
        if error <= wanted:
            break
    return best


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


def solver_cells(
    solvers: list[Found], duration: float, our_time: float, wanted: float
) -> tuple[list[str], float]:
    """Cells of BDF, and of the fastest that is accurate enough; the ratio of BDF's time to ours (inf without)."""
    if not solvers:
        return [""] * 5, math.inf
    bdf = solvers[0]
    followed = bdf.error <= LOST
    cells = ["loses the motion", f"{bdf.error:.0e}", ""]
    if followed:
        mark = "*" if bdf.error > wanted else ""
        cells = [f"{1e3 * bdf.spent / duration:.0f}", f"{bdf.error:.0e}{mark}", f"{bdf.spent / our_time:.0f}"]
    best = min((s for s in solvers if s.error <= wanted), key=lambda s: s.spent, default=None)
    if best is None:
        return [*cells, "none reaches it", ""], bdf.spent / our_time if followed else math.inf
    cells += [f"{best.method}, {1e3 * best.spent / duration:.0f}", f"{best.spent / our_time:.0f}"]
    return cells, bdf.spent / our_time if followed else math.inf


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


def at_own(run: PlannedRun, truth: Any, wanted: float) -> tuple[float, Run, float]:
    """Ours at its own loosest tolerance: the tolerance, the run, its error."""
    best = loosest(((t, ours(exact.prepare(laid_out(run, t)))) for t in TOLERANCES), truth, wanted)
    assert best is not None
    return best


def compare(
    run: PlannedRun, wanted: float, baseline: Baseline | None, *, with_scipy: bool, own: bool
) -> tuple[float, float]:
    """Measure a run, print its row; returns the time of BDF over ours (inf where it has none), and ours over C's."""
    ready = exact.prepare(laid_out(run, 3.3e-11))
    truth = ready.run()[0][:, 0].copy()
    loop = baseline.loop(ready, control=True) if baseline else None
    tolerance, mine, c, error, c_error = at_one_tolerance(run, loop, truth, wanted)
    by_hand = fastest_by_hand(baseline, ready, truth, wanted) if baseline else None
    setting, our_time, c_time = "", math.inf, math.inf
    if own and baseline:
        (tolerance, mine, error), by_hand = (
            at_own(run, truth, wanted),
            fastest(baseline, ready, truth, wanted),
        )
    if by_hand and c and by_hand.spent < min(time_of(c) for _ in range(5)):
        c, c_error, setting = by_hand.run, by_hand.error, f", {by_hand.setting}"
    for _ in range(ROUNDS):
        our_time = min(our_time, time_of(mine, 1e-3))
        c_time = min(c_time, time_of(c, 1e-3)) if c else c_time
    theirs, accurate = adaptive_time(run, truth, wanted)
    solvers = [in_scipy(method, run, truth, wanted) for method in METHODS] if with_scipy else []
    scipy, ratio = solver_cells(solvers, run.duration, our_time, wanted)
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
    parser.add_argument("--own", action="store_true", help="ours and C each at its own fastest setting")
    options = parser.parse_args()
    print(
        "| run | tolerance (rad) | exact, us/s | error (rad) | C, us/s | error (rad) | exact/C | BDF, ms/s"
        " | error (rad) | BDF/exact | fastest of SciPy, ms/s | its time/exact | adaptive/exact |"
    )
    print("|" + 13 * "---|")
    least, most = math.inf, 0.0
    with tempfile.TemporaryDirectory() as folder:
        baseline = compiled_baseline(folder)
        for planned in studies.load("thesis").runs:
            name = f"{planned.reference}/{planned.controller}"
            if (planned.slip_rule, planned.friction) == ("signed", "nominal") and name.startswith(
                tuple(options.only.split(","))
            ):
                run = replace(planned, duration=min(planned.duration, options.duration))
                bdf, c = compare(
                    run, options.error, baseline, with_scipy=not options.no_scipy, own=options.own
                )
                least, most = min(least, bdf), max(most, c)
    if not options.no_scipy:
        said = "PASS" if least >= TIMES_BDF else "FAIL"
        print(f"{said}  BDF takes at least {TIMES_BDF} times as long: {least:.0f}")
    print(f"{'PASS' if most <= TIMES_C else 'FAIL'}  at most {TIMES_C} times the time of C: {most:.2f}")


if __name__ == "__main__":
    main()
