"""Closed loops on a GPU beside the processor: do they end alike, and how much sooner.

The loops of `batch.py` (Table 6, PD on the low reference, 2.5 s, Fs and Fc each up to a tenth off) by
`stickslip.simulation.many.simd_batch` at 2e-4 s, with no metrics: on one thread of the processor, on all of them, and
on the GPU, transfers counted, compiling not. With `--jax`, the same step in JAX (`jax_step.py`) on the device that JAX
chooses, which is the GPU where JAX has one. Times are by the clock, the least of three.

    python benchmarks/gpu.py [--cases 1000 10000 100000] [--jax]
"""

from __future__ import annotations

import argparse
import math
import os
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import batch
import jax_step

COMPARED = 4096
"""Loops whose ends are compared."""


def least(run: Callable[[], Any], rounds: int = 3) -> float:
    """Time by the clock, s."""
    times: list[float] = []
    for _ in range(rounds):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


def drawn(n: int) -> tuple[batch.Column, batch.Column]:
    """Fs and Fc of `n` loops, N·m."""
    rng = np.random.default_rng(1)
    spread = rng.uniform(0.9, 1.1, (2, n))
    return batch.CURVE["fs"] * spread[0], batch.CURVE["fc"] * spread[1]


def agreement(name: str) -> None:
    """Where the loops end on both devices, and what is measured on the way."""
    loops = batch.side_by_side(name, *drawn(COMPARED))
    here, there = loops.run(), loops.run(device="gpu")
    apart = np.abs(there.position - here.position)
    print(
        f"    ends apart: median {np.median(apart):.1e}, 99 % {np.percentile(apart, 99):.1e}, "
        f"worst {apart.max():.1e} rad; within 1e-9 rad {np.mean(apart <= 1e-9):.2%} of {COMPARED}"
    )
    worst = 0.0
    for metric, values in here.metrics.items():
        q = np.percentile(values, (50.0, 95.0))
        worst = max(
            worst, float(np.max(np.abs(np.percentile(there.metrics[metric], (50.0, 95.0)) / q - 1.0)))
        )
    print(f"    median and 95th percentile of {len(here.metrics)} metrics: at most {worst:.1e} apart")


def timed(name: str, n: int, jax: bool) -> None:
    """One line of the table."""
    loops, threads = batch.side_by_side(name, *drawn(n)), os.cpu_count() or 1
    ran: dict[str, Callable[[], Any]] = {
        "one thread": lambda: loops.run(()),
        f"{threads} threads": lambda: loops.run((), threads),
        "GPU": lambda: loops.run((), device="gpu"),
    }
    if jax:
        ran["JAX"] = jax_step.runner(name, *drawn(n), batch.DURATION, batch.STEP)
    # One thread does as many a second however many there are.
    few = min(n, 10_000)
    some = loops[:few]
    ran["one thread"] = lambda: some.run(())
    for run in ran.values():
        run()
    found = {label: least(run) for label, run in ran.items()}
    found["one thread"] *= n / few
    rows = "   ".join(f"{label} {seconds:.4f} s" for label, seconds in found.items())
    ratios = "   ".join(
        f"{seconds / found['GPU']:.1f} x {label}" for label, seconds in found.items() if label != "GPU"
    )
    print(f"    {n:>9,} loops: {rows};   the GPU is as fast as {ratios}", flush=True)


def main() -> None:
    """Run the comparison."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, nargs="+", default=[1000, 10_000, 100_000])
    parser.add_argument("--jax", action="store_true", help="compare with JAX (pip install jax)")
    options = parser.parse_args()
    for name in ("none", "GMS feedback"):
        print(f"{name}, {math.ceil(batch.DURATION / batch.STEP):,} steps a loop")
        agreement(name)
        for n in options.cases:
            timed(name, n, options.jax)


if __name__ == "__main__":
    main()
