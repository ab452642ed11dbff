"""What a sweep's flags are worth: random cases of every run of the study against runs at a tight tolerance.

Friction and inertia are drawn as in the shipped sweep (up to 30 % off), the cases computed as `stickslip sweep` does,
at its tolerance, and once more at 3.3e-11 rad, a third of the finest that a sweep goes to. A metric that is not within
1 % of that (a count of reversals: not within one) must belong to a flagged case, and at most 5 % may be flagged where
the study's nominal run is well-conditioned (class W: two independent integrators agree on it to within their errors).

    python benchmarks/sweep_accuracy.py [--cases 200] [--references low,high,step]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from stickslip.studies.study import load as load_study
from stickslip.sweeps import block, measured, metric_check
from stickslip.sweeps.plan import Sweep, load

EXACT = 3.3e-11
WANTED, MOST_FLAGGED = 0.01, 0.05
NOT_W = {
    "low": ("FF-gms", "FB-coulomb", "FB-stribeck", "FB-lugre", "FB-gms"),
    "high": ("FF-gms", "FB-coulomb", "FB-stribeck", "FB-lugre", "FB-gms"),
    "step": ("FF-coulomb", "FB-coulomb", "FB-stribeck", "FB-lugre", "FB-gms"),
}
"""Nominal runs that are sensitive or ill-conditioned, from the independent integrators' results."""


def sweep_of(reference: str, cases: int, seed: int) -> Sweep:
    """The shipped sweep on another reference."""
    shipped = load("thesis-robustness")
    numerics = shipped.runs[0].numerics
    runs = [
        replace(run, numerics=replace(numerics, output=run.duration))
        for run in load_study("thesis").runs
        if (run.slip_rule, run.reference, run.friction) == ("signed", reference, "nominal")
    ]
    return replace(shipped, runs=runs, drawn=replace(shipped.drawn, cases=cases, seed=seed))


def main() -> None:
    """Count."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--references", default="low,high,step")
    parser.add_argument("--seed", type=int, default=3)
    options = parser.parse_args()
    good = True
    print(
        "| run | class | flagged | off by more than 1 % | of them not flagged | CPU s |\n|---|---|---|---|---|---|"
    )
    for reference in options.references.split(","):
        sweep = sweep_of(reference, options.cases, options.seed)
        for i, run in enumerate(sweep.runs):
            start = time.process_time()
            blocks = [block.compute(sweep, i, at) for at in range(0, options.cases, sweep.size_of(i))]
            spent = time.process_time() - start
            found = np.concatenate([b.metrics for b in blocks])
            flagged = np.concatenate([b.flagged for b in blocks])
            values = sweep.values(run, sweep.drawn.block(0, options.cases))
            exact = replace(run, numerics=replace(run.numerics, tolerance=EXACT))
            sure = measured.measured(exact, values, sweep.metrics, options.cases)
            off = metric_check.differ(found, sure.metrics, sweep.metrics, run.duration, WANTED)
            well = run.controller not in NOT_W[reference]
            share, missed = float(flagged.mean()), int(np.sum(off & ~flagged))
            fine = missed == 0 and (share <= MOST_FLAGGED or not well)
            good = good and fine
            print(f"| {reference}/{run.controller} | {'W' if well else ''} | {100.0 * share:.1f} % | {int(off.sum())} "
                  f"| {missed} | {spent:.1f} |{'' if fine else ' FAIL'}", flush=True)  # fmt: skip
    print(
        "PASS" if good else "FAIL", " every metric within 1 % or flagged, at most 5 % flagged where class W"
    )


if __name__ == "__main__":
    main()
