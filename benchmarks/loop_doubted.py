"""How often the gains of a loop are doubted: those that made the record, and wrong ones.

    python benchmarks/loop_doubted.py --first 20 --count 30

Each seed is an axis with a law, a loop (PR, PD or PID), a programme of velocities and coloured noise
(`coverage_records`). Its record is as fine as what the controller saw, or rounded when the controller saw the exact
position, or its torque or its reference two rows late, or every fifth row alone.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import coverage_records as records
from stickslip.control.linear import place
from stickslip.identification.experiment import Experiment
from stickslip.identification.output_error.loop_check import shown_gains
from stickslip.simulation.recorded_input.simulation import Drive, Loop, Mechanics, drive_axis

KINDS = ("as seen", "rounded", "late", "reference late", "every fifth row")
COUNTS = (2000, 16384, 1_000_000)
KINDS_OF_LOOP = ("PR", "PD", "PID")


def experiment(seed: int, counts: int, kind: str) -> Experiment:
    """A record with the loop that made it."""
    rng = np.random.default_rng([77, seed])
    inertia, fc = records.log_uniform(rng, 3e-4, 5e-3), records.log_uniform(rng, 0.1, 0.6)
    top, vs = records.log_uniform(rng, 4.0, 12.0), records.log_uniform(rng, 0.03, 0.3)
    sliding = {
        "fs": fc * rng.uniform(1.15, 1.6),
        "fc": fc,
        "vs": vs,
        "sigma2": fc * rng.uniform(0.2, 1.0) / top,
    }
    friction = records.law_of(rng, records.FAMILIES[seed % len(records.FAMILIES)], inertia, sliding)
    levels = np.geomspace(vs * records.log_uniform(rng, 0.15, 2.0), top, int(rng.integers(6, 10)))
    velocity = records.programme(
        rng.permutation(levels), rng.uniform(0.4, 0.9, levels.size), fc * rng.uniform(0.5, 2.0) / inertia,
        int(rng.integers(3, 6)), top,
    )  # fmt: skip
    period = records.PERIOD
    reference = np.concatenate([[0.0], np.cumsum(0.5 * period * (velocity[1:] + velocity[:-1]))])
    time = period * np.arange(reference.size)
    gains = place(KINDS_OF_LOOP[int(rng.integers(3))], inertia, rng.uniform(10.0, 25.0), 1.0)
    count = 2.0 * math.pi / counts
    push = records.coloured(
        rng, time.size, fc * rng.uniform(0.005, 0.02), records.log_uniform(rng, 2e-3, 3e-2)
    )
    noise = records.coloured(
        rng, time.size, fc * rng.uniform(0.003, 0.01), records.log_uniform(rng, 1e-3, 5e-3)
    )
    loop = Loop(gains.kp, gains.ki, gains.kd, gains.kr)
    seen = loop if kind == "rounded" else replace(loop, count=count)
    drive = Drive(time, reference, "feedback", seen, disturbance=push, max_step=records.FINE)
    out = drive_axis(Mechanics(inertia, offset=fc * rng.uniform(-0.1, 0.1)), friction, drive)
    position, signal = count * np.floor(out[:, 0] / count + 0.5), out[:, 2] + noise
    if kind == "late":
        signal = np.concatenate([signal[[0, 0]], signal[:-2]])
    if kind == "reference late":
        reference = np.concatenate([reference[[0, 0]], reference[:-2]])
    every = 5 if kind == "every fifth row" else 1
    return Experiment(
        f"seed {seed}", time[::every], position[::every], signal[::every], "torque", reference[::every], loop
    )  # fmt: skip


def claims(loop: Loop) -> Iterator[tuple[str, Loop]]:
    """What somebody may say of a loop: first what it is."""
    yield "right", loop
    yield "right, its period", replace(loop, period=records.PERIOD)
    yield "kd x 2", replace(loop, kd=2.0 * loop.kd)
    yield "kp x 1.41", replace(loop, kp=1.41 * loop.kp)
    yield "kr out or in", replace(loop, kr=0.0 if loop.kr else loop.kd)
    yield "kd x 1.2", replace(loop, kd=1.2 * loop.kd)
    yield "kp x 1.2", replace(loop, kp=1.2 * loop.kp)


def main() -> None:
    """Print a line for each kind of record and encoder."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--first", type=int, default=20)
    parser.add_argument("--count", type=int, default=30)
    args = parser.parse_args()
    for kind in KINDS:
        for counts in COUNTS:
            doubted: Counter[str] = Counter()
            for seed in range(args.first, args.first + args.count):
                made = experiment(seed, counts, kind)
                assert made.loop is not None
                for name, loop in claims(made.loop):
                    shown = shown_gains(replace(made, loop=loop))
                    doubted[name] += bool(shown is not None and shown.differing())
            said = ", ".join(f"{name} {doubted[name]}" for name, _ in claims(Loop()))
            print(f"{kind:<16}{counts:>8} counts, doubted of {args.count}: {said}", flush=True)


if __name__ == "__main__":
    main()
