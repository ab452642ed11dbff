"""What every kind of run of the thesis's study takes, per simulated second.

Every reference and controller of the study (nominal friction, signed rule) on the exact integrator's prepared
kernel, at its loosest tolerance whose largest error in position on a 1 ms grid stays below `--error` (1e-6 rad)
against a run at 1e-11; beside it the adaptive integrator (Dormand-Prince with located events) at the same
error, without metrics. CPU times, medians. A run that misses the error at every tolerance is ill-conditioned
and marked with *.

    python benchmarks/study_speed.py [--duration 2]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.simulation import adaptive, exact
from stickslip.simulation.closed_loop import prepare
from stickslip.study import study as studies
from stickslip.study.plan import PlannedRun

TOLERANCES = [1e-5 * 10.0 ** (-0.5 * i) for i in range(11)]


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


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--duration", type=float, default=2.0, help="longest run, s")
    parser.add_argument("--error", type=float, default=1e-6, help="largest error allowed, rad")
    options = parser.parse_args()
    print("| run | exact, us/s | tolerance, error (rad) | adaptive, us/s | error (rad) | adaptive/exact |")
    print("|---|---|---|---|---|---|")
    for planned in studies.load("thesis").runs:
        if (planned.slip_rule, planned.friction) != ("signed", "nominal"):
            continue
        run = replace(planned, duration=min(planned.duration, options.duration))
        truth = exact.prepare(laid_out(run, 1e-11)).run()[0][:, 0].copy()

        def quick(tolerance: float, run: PlannedRun = run) -> Any:
            return exact.prepare(laid_out(run, tolerance)).run()[0][:, 0].copy()

        def slow(tolerance: float, run: PlannedRun = run) -> Any:
            return on_grid(adaptive.run(laid_out(run, tolerance)))

        tolerance, error = loosest(quick, truth, options.error)
        level, other = loosest(slow, truth, options.error)
        ready, case = exact.prepare(laid_out(run, tolerance)), laid_out(run, level)
        ours = median_time(ready.run, 21) / run.duration
        theirs = median_time(lambda case=case: adaptive.run(case), 5) / run.duration
        marks = ["*" if e > options.error else "" for e in (error, other)]
        print(
            f"| {run.reference}/{run.controller} | {1e6 * ours:.1f} | {tolerance:.0e}, {error:.1e}{marks[0]} "
            f"| {1e6 * theirs:.0f} | {other:.1e}{marks[1]} | {theirs / ours:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
