"""What a sample costs: the located flows of axes and trains and the general step, in one run, with the error of each.

    python benchmarks/sampled_engine.py [--prototypes DIR]

The thesis's axis under a PD of 20 Hz at 1 kHz with LuGre feedforward and a torque limit, at low and at high velocity;
behind the axes three inertias as a machine. The error is the largest distance in position from the located flow at a
tolerance of 1e-12 rad, which `tests/simulation/test_sampled.py` and `test_train.py` hold against independent results,
and for laws that have none from general steps at 1e-11 rad. Times are CPU times, the least of several runs, without
metrics, a row at every sample.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np

import stickslip as ss
from stickslip.machines.contact import Contact
from stickslip.machines.flexible import FlexibleAxis
from stickslip.machines.machine import Machine
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.machine import loop as machine_loop
from stickslip.simulation.machine.layout import lay_out_machine
from stickslip.simulation.sampled import engine as sampled

INERTIA, TIME = 3.8623e-4, 1e-3
CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018}
LUGRE = ss.Model("lugre", sigma0=3.5e4, sigma1=0.1, **CURVE)
LAWS = (
    ss.Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **CURVE),
    LUGRE,
    ss.Model("maxwell_slip", k=[1e4, 7e3, 5e3, 3e3], w=[0.08375] * 4, sigma2=0.018),
    ss.Model("coulomb", fc=0.285, sigma2=0.018),
    ss.Model("stribeck", k=3.5e4, **CURVE),
    *(ss.Model(name, **ss.law(name).example) for name in ("dahl", "elasto_plastic")),
)
MOTIONS = {
    "low": (ss.Reference("sine", amplitude=0.01, frequency=0.4), 5.0),
    "high": (ss.Reference("sine", amplitude=0.5, frequency=0.1), 20.0),
}
OTHERS = tuple(
    ss.Model(name, **ss.law(name).example)
    for name in ("static", "stribeck_plain", "karnopp", "armstrong", "leuven")
)
"""Laws without a located flow."""
ROTOR, SHAFT, DISK = 1.2e-4, 1.2e-4, 1.8757e-4
TRAIN = Machine(
    "three inertias", ROTOR + SHAFT + DISK, Contact(LAWS[0]), sample_time=TIME,
    flexible=FlexibleAxis(ROTOR, SHAFT, DISK, 17800.0, 396.0, 0.03),
)  # fmt: skip
FLOWS, STEPS = (1e-8, 1e-9), (1e-6, 1e-8)
"""Tolerances of located flows and of general steps, rad."""


def positions(outcome):
    """Positions at the samples, rad."""
    return outcome.rows[outcome.rows[:, 8] == 0.0, 3]


def timed(run, repeats):
    """What a run returns, and the least time that it takes, s."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        outcome = run()
        times.append(time.process_time() - start)
    return outcome, min(times)


def ways(law, reference, duration, controller):
    """The true positions, and runs by what they are."""

    def case(tolerance):
        axis = ss.RigidAxis(INERTIA, law)
        return prepare(axis, controller, reference, duration, tolerance=tolerance, metered=False)

    def by_steps(case):
        with patch.object(sampled, "cannot_locate", lambda case: "asked for"):
            return sampled.run(case)

    runs = {f"steps {t:g}": (partial(by_steps, case(t)), 3) for t in STEPS}
    if law in OTHERS:
        return positions(by_steps(case(1e-11))), runs
    flows = {f"flow {t:g}": (partial(sampled.run, case(t)), 5) for t in FLOWS}
    return positions(sampled.run(case(1e-12))), flows | runs


def train_ways(reference, duration):
    """The same of the three inertias."""
    controller = ss.Controller(ss.place("PD", TRAIN.inertia, 20.0, 1.0), ss.Feedforward(LUGRE), 1.0, TIME)

    def flow(tolerance):
        return machine_loop.simulate_machine(
            TRAIN, controller, reference, duration, metered=False, tolerance=tolerance
        )

    def by_steps(tolerance):
        with patch.object(machine_loop, "lay_out_machine", partial(lay_out_machine, located=False)):
            return flow(tolerance)

    runs = {f"flow {t:g}": (partial(flow, t), 12) for t in FLOWS}
    return flow(1e-12)["position"], runs | {f"sub-steps {t:g}": (partial(by_steps, t), 5) for t in STEPS}


def prototypes(folder):
    """Print what a sample costs in C: the prototypes in a folder, compiled here, at tolerances of their own."""
    with tempfile.TemporaryDirectory() as own:
        for file in folder.iterdir():
            if file.is_file():
                shutil.copy(file, own)
        sys.path.insert(0, own)
        from common import REFS, build, params
        from tabs import runA, tables

        gms = build("a13.c", "gms.so", "-DPLANT=1", "-DNT=8")
        lugre = build("a2.c", "lugre.so", "-DNT=10")
        train = build("a13.c", "train.so", "-DPLANT=3", "-DNT=12")
        for motion, (_, _, samples) in REFS.items():
            p = params(1, motion, 0)
            loops = {
                "gms": partial(runA, gms, p, samples, 1e-9, tables(1, p)),
                "lugre": partial(runA, lugre, params(2, motion, 0), samples, 1e-12, np.zeros(1)),
            }
            p = params(3, motion, 0)
            loops["three inertias"] = partial(runA, train, p, samples, 1e-10, tables(3, p))
            for law, loop in loops.items():
                _, least = timed(loop, 20)
                print(f"{law:<16}{motion:<8}{'C text':<14}{1e6 * least / samples:>10.2f}", flush=True)


def main() -> None:
    """Print a line a law, motion and way."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--prototypes", type=Path, metavar="DIR", help="with a13.c and a2.c")
    options = parser.parse_args()
    controller = ss.Controller(ss.place("PD", INERTIA, 20.0, 1.0), ss.Feedforward(LUGRE), 1.0, TIME)
    print(f"{'law':<16}{'motion':<8}{'way':<14}{'us/sample':>10}{'error, rad':>12}{'events':>8}")
    if options.prototypes:
        prototypes(options.prototypes)
    for law in (*LAWS, *OTHERS):
        for motion, (reference, duration) in MOTIONS.items():
            truth, runs = ways(law, reference, duration, controller)
            for name, (run, repeats) in runs.items():
                run()
                outcome, least = timed(run, repeats)
                error = float(np.abs(positions(outcome) - truth).max())
                each = 1e6 * least * TIME / duration
                print(
                    f"{law.law.name:<16}{motion:<8}{name:<14}{each:>10.2f}{error:>12.1e}{outcome.counts['events']:>8}",
                    flush=True,
                )
    for motion, (reference, duration) in MOTIONS.items():
        truth, runs = train_ways(reference, duration)
        for name, (run, repeats) in runs.items():
            run()
            record, least = timed(run, repeats)
            error = float(np.abs(record["position"] - truth).max())
            print(
                f"{TRAIN.name:<16}{motion:<8}{name:<14}{1e6 * least * TIME / duration:>10.2f}{error:>12.1e}",
                flush=True,
            )


if __name__ == "__main__":
    main()
