"""How far lanes may be trusted: against the exact integrator, for every kind of compensation.

The loop of Table 6 (2.5 s), Fs and Fc up to 10 % off. Printed for each step: the share of cases that a sweep would flag
(a metric changes by 0.3 % with twice the step), the share with a metric off by more than 1 %, the share that is off and
not flagged, and by how much the median and the 95th percentile of the first metric over all cases are off.

    python benchmarks/lanes_accuracy.py [--cases 200]
"""

from __future__ import annotations

import argparse

import numpy as np

import closed_loop
from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.model import Model
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.many import batch, simd_batch
from stickslip.sweep.block import SURE_OF_STEPS
from stickslip.sweep.metric_check import differ

METRICS = ("position_rms_rad", "position_peak_rad", "velocity_rms_rad_s", "torque_rms_Nm")
STRIBECK = Model("stribeck", k=3.5e4, **closed_loop.CURVE)
COULOMB = Model("coulomb", fc=closed_loop.CURVE["fc"], sigma2=closed_loop.CURVE["sigma2"])
COMPENSATORS = {
    "none": None,
    "FF-coulomb": Feedforward(COULOMB),
    "FF-lugre": Feedforward(closed_loop.LUGRE),
    "FF-gms": Feedforward(closed_loop.GMS),
    "FB-coulomb": Feedback(COULOMB),
    "FB-stribeck": Feedback(STRIBECK),
    "FB-lugre": Feedback(closed_loop.LUGRE),
    "FB-gms": Feedback(closed_loop.GMS),
}
STEPS = (2e-4, 1e-4, 5e-5)


def main() -> None:
    """Run the comparison."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=200)
    options = parser.parse_args()
    rng = np.random.default_rng(2)
    columns = {
        f"friction.{name}": closed_loop.CURVE[name] * rng.uniform(0.9, 1.1, options.cases)
        for name in ("fs", "fc")
    }
    print("| compensation | step, s | flagged | off by 1 % | off, not flagged | median | 95th percentile |")
    print("|---|---|---|---|---|---|---|")
    for name, compensator in COMPENSATORS.items():
        controller = Controller(closed_loop.GAINS, compensator)
        case = prepare(closed_loop.AXIS, controller, closed_loop.REFERENCE, 2.5, tolerance=1e-8, output=2.5)
        exact = batch.prepare(case, columns).run(METRICS)
        found = {h: simd_batch.prepare(case, columns, h).run(METRICS) for h in (2.0 * STEPS[0], *STEPS)}
        truth = np.column_stack([exact.metrics[m] for m in METRICS])
        rows = {h: np.column_stack([r.metrics[m] for m in METRICS]) for h, r in found.items()}
        for h in STEPS:
            flagged = differ(rows[h], rows[2.0 * h], METRICS, part=SURE_OF_STEPS)
            off = differ(truth, rows[h], METRICS)
            middle, high = (
                np.percentile(rows[h][:, 0], q) / np.percentile(truth[:, 0], q) - 1.0 for q in (50.0, 95.0)
            )
            print(
                f"| {name} | {h:g} | {flagged.mean():.1%} | {off.mean():.1%} | {(off & ~flagged).mean():.1%} "
                f"| {middle:+.2%} | {high:+.2%} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
