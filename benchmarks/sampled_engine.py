"""What a sample costs: the sampled engine beside the fixed integrator, in one run, with the error of each.

    python benchmarks/sampled_engine.py

The thesis's axis under a PD of 20 Hz at 1 kHz with LuGre feedforward and a torque limit, at low and at high velocity.
The error is the largest distance in position from the sampled engine at a tolerance of 1e-12 rad, which
`tests/simulation/test_sampled.py` holds against independent results. Times are the least of several runs, without
metrics, a row at every sample.
"""

from __future__ import annotations

import time

import numpy as np

import stickslip as ss
from stickslip.simulation import fixed, sampled
from stickslip.simulation.closed_loop import prepare

INERTIA, TIME = 3.8623e-4, 1e-3
CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018}
LUGRE = ss.Model("lugre", sigma0=3.5e4, sigma1=0.1, **CURVE)
LAWS = (
    ss.Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **CURVE),
    LUGRE,
    ss.Model("maxwell_slip", k=[1e4, 7e3, 5e3, 3e3], w=[0.08375] * 4, sigma2=0.018),
    ss.Model("coulomb", fc=0.285, sigma2=0.018),
    ss.Model("stribeck", k=3.5e4, **CURVE),
)
MOTIONS = {
    "low": (ss.Reference("sine", amplitude=0.01, frequency=0.4), 5.0),
    "high": (ss.Reference("sine", amplitude=0.5, frequency=0.1), 20.0),
}
TOLERANCES, STEPS = (1e-8, 1e-9), (2e-5,)


def positions(outcome):
    """Positions at the samples, rad."""
    return outcome.rows[outcome.rows[:, 8] == 0.0, 3]


def timed(run, repeats):
    """What a run returns, and the least time that it takes, s."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        outcome = run()
        times.append(time.perf_counter() - start)
    return outcome, min(times)


def main() -> None:
    """Print a line a law, motion and engine."""
    controller = ss.Controller(ss.place("PD", INERTIA, 20.0, 1.0), ss.Feedforward(LUGRE), 1.0, TIME)
    print(f"{'law':<14}{'motion':<8}{'engine':<18}{'us/sample':>10}{'error, rad':>12}{'events':>8}")
    for law in LAWS:
        for motion, (reference, duration) in MOTIONS.items():

            def case(tolerance, law=law, reference=reference, duration=duration):
                axis = ss.RigidAxis(INERTIA, law)
                return prepare(axis, controller, reference, duration, tolerance=tolerance, metered=False)

            truth = positions(sampled.run(case(1e-12)))
            rough = case(1e-9)
            cases = {tolerance: case(tolerance) for tolerance in TOLERANCES}
            runs = {f"sampled {t:g}": (lambda c=c: sampled.run(c), 5) for t, c in cases.items()}
            runs |= {f"fixed {dt:g} s": (lambda dt=dt, c=rough: fixed.run(c, dt), 1) for dt in STEPS}
            for name, (run, repeats) in runs.items():
                run()
                outcome, least = timed(run, repeats)
                error = float(np.abs(positions(outcome) - truth).max())
                each = 1e6 * least * TIME / duration
                print(
                    f"{law.law.name:<14}{motion:<8}{name:<18}{each:>10.2f}{error:>12.1e}{outcome.counts['events']:>8}"
                )


if __name__ == "__main__":
    main()
