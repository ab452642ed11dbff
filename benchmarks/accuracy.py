"""How far the exact integrator keeps its promise: random cases against the adaptive one.

Every case is a run of the thesis's study (any of its references and controllers) whose friction, inertia and
gain are drawn at random. The largest error in position of the exact integrator at `--tolerance` against the
adaptive one at 1e-10 rad is compared with `--bar`; a case counts as ill-conditioned where a start that is 1e-9
rad off ends up more than 1e-7 rad off, or where the adaptive one at 1e-9 disagrees with itself by as much: a rest that
feedback makes unstable to one side ends when rounding decides, and there is no truth to compare with. Every miss is
printed with the growth of the start's error: where it is above bar / tolerance, no error of the tolerance's size stays
below the bar. The error can be seen without the other integrator: by how much the position changes at a hundredth of
the tolerance.

    python benchmarks/accuracy.py [--cases 1000] [--tolerance 1e-7]
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from stickslip.simulation import adaptive, exact
from stickslip.simulation.closed_loop import prepare
from stickslip.study import study as studies
from stickslip.study.plan import PlannedRun
from stickslip.sweep.numbers import value_of, varied

VARIED = ("friction.fs", "friction.fc", "friction.sigma2", "friction.vs", "friction.c", "axis.inertia")
LONGEST = {"low": 1.5, "high": 4.0, "step": 1.5}
OFF, SENSITIVE = 1e-9, 1e-7


def drawn(runs: list[PlannedRun], rng: np.random.Generator) -> PlannedRun:
    """A run with numbers up to 30 % off, and a gain from 0.5 to 1."""
    run = runs[rng.integers(len(runs))]
    values = {name: value_of(run, name) * rng.uniform(0.7, 1.3) for name in VARIED}
    if run.control.compensator:
        values["controller.gain"] = rng.uniform(0.5, 1.0)
    return varied(run, values)


def positions(integrator: Any, run: PlannedRun, tolerance: float, start: float = 0.0) -> Any:
    """Position on an even grid of 301 times, or as far as the run came."""
    duration = LONGEST[run.reference]
    case = prepare(
        run.axis, run.control, run.motion, duration,
        tolerance=tolerance, output=duration / 300.0, metered=False, initial=(start, 0.0),
    )  # fmt: skip
    rows = integrator.run(case).rows
    return rows[rows[:, 8] == 0.0][:, 3]


def apart(one: Any, other: Any) -> float:
    """Largest difference."""
    n = min(len(one), len(other))
    return float(np.max(np.abs(one[:n] - other[:n])))


def main() -> None:
    """Count."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--tolerance", type=float, default=1e-7, help="rad")
    parser.add_argument("--bar", type=float, default=1e-6, help="rad")
    parser.add_argument("--seed", type=int, default=5)
    options = parser.parse_args()
    runs = [r for r in studies.load("thesis").runs if (r.slip_rule, r.friction) == ("signed", "nominal")]
    rng = np.random.default_rng(options.seed)
    well, ill, missed, told, steep, worst = 0, 0, 0, 0, 0, 0.0
    for _ in range(options.cases):
        run = drawn(runs, rng)
        if exact.can_run(prepare(run.axis, run.control, run.motion, 1.0)):
            continue
        fine = positions(exact, run, 0.01 * options.tolerance)
        found = positions(exact, run, options.tolerance)
        reference = positions(adaptive, run, 1e-10)
        error = apart(found, reference)
        moved = apart(fine, positions(exact, run, 0.01 * options.tolerance, OFF))
        if max(moved, apart(reference, positions(adaptive, run, 1e-9))) > SENSITIVE:
            ill += 1
            continue
        well += 1
        worst = max(worst, error)
        if error > options.bar:
            missed += 1
            steep += moved / OFF > options.bar / options.tolerance
            seen = apart(found, fine)
            told += seen > 0.3 * options.bar
            print(
                f"    {run.reference}/{run.controller}: error {error:.1e} rad, seen as {seen:.1e};"
                f" a start's error grows {moved / OFF:.0f} times",
                flush=True,
            )
    print(
        f"{well} well-conditioned cases, {ill} others; worst error {worst:.1e} rad at tolerance {options.tolerance:g}"
    )
    print(
        f"{missed} above {options.bar:g} rad, {told} of them seen by the finer run, {steep} where a start's error grows"
        f" more than {options.bar / options.tolerance:g} times"
    )
    print("PASS" if missed == 0 else "FAIL", f" every well-conditioned case within {options.bar:g} rad")


if __name__ == "__main__":
    main()
