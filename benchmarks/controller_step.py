"""Nanoseconds a sample of controllers exported to C: a PD, with a disturbance observer, with a scale that adapts.

``python benchmarks/controller_step.py [COMPILER]``: compiled with -O2, over a motion with reversals at 1 kHz,
measured in 65,536 counts, and over the same slower, where the sliding curve falls; the median of 41 blocks, of the
whole sample and of what a compensator adds to the PD's.
"""

from __future__ import annotations

import math
import statistics
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from stickslip.control.catalogue import Belief, compensated
from stickslip.control.controller import Controller
from stickslip.exports.c99_controller import write
from stickslip.models.model import Model

STEPS, BLOCKS = 20_000, 41
MOTIONS = {"fast": 1.0, "slow": 0.03}
NAMES = ("none", "dob", "dob-reset", "ff-dob", "scale", "scale-dob")
LAW = Model("lugre", sigma0=3.5e4, sigma1=0.0, fs=0.335, fc=0.285, vs=0.01, sigma2=0.018)
MAIN = """
#define _POSIX_C_SOURCE 199309L
#include "x.h"
#include <stdio.h>
#include <time.h>
static double q[{n}], qd[{n}], vd[{n}], torque[{n}];
static double now(void)
{{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}}
int main(void)
{{
    x_settings n;
    x_memory m;
    x_state z;
    x_parameters p;
    x_surroundings u = {{ 0.0, 1.0, 20.0, 0.0, 0.0 }};
    x_init(&n, &p);
    for (int i = 0; i < {n}; i++) {{
        if (scanf("%lf %lf %lf", &q[i], &qd[i], &vd[i]) != 3) {{ return 1; }}
    }}
    for (int block = 0; block < {blocks}; block++) {{
        x_reset(&m, &z);
        double a = now();
        for (int i = 0; i < {n}; i++) {{
            torque[i] = x_sample(q[i], qd[i], vd[i], 0.0, &n, &m, &z, &p, &u);
        }}
        double b = now();
        printf("%.17g %.17g\\n", (b - a) / {n}, torque[{n} - 1]);
    }}
    return 0;
}}
"""


def controller(name: str) -> Controller:
    """A compensator of the catalogue on the thesis's axis, beside a PD (the scale alone: a PID) of 20 Hz."""
    loop = "PID" if name == "scale" else "PD"
    return compensated(name, loop, Belief(3.8623e-4, LAW, torque_limit=1.0, bandwidth=20.0, counts=65536.0))


def measured(name: str, compiler: str, share: float) -> float:
    """Nanoseconds a sample, along that share of the motion."""
    with TemporaryDirectory() as folder:
        for file, text in write(controller(name), "x").files.items():
            Path(folder, file).write_text(str(text))
        Path(folder, "main.c").write_text(MAIN.format(n=STEPS, blocks=BLOCKS))
        build = [compiler, "-std=c99", "-O2", "-ffp-contract=off", "x.c", "main.c", "-lm", "-o", "run"]
        subprocess.run(build, cwd=folder, check=True)
        done = subprocess.run(
            ["./run"], cwd=folder, input=motion(share), capture_output=True, text=True, check=True
        )
    return statistics.median(float(line.split()[0]) for line in done.stdout.splitlines())


def motion(share: float) -> str:
    """Measured position, reference and its velocity, as text: that share of a sum of sines, counted, 3 mrad beside."""
    t = 1e-3 * np.arange(STEPS)
    q, v = np.zeros(STEPS), np.zeros(STEPS)
    for a, w in ((0.5, 1.0), (0.01, 11.0), (1e-4, 97.0)):
        q += share * a * (1.0 - np.cos(w * t))
        v += share * a * w * np.sin(w * t)
    count = 2.0 * math.pi / 65536.0
    seen = count * np.floor((q - 3e-3 * np.sin(5.0 * t)) / count + 0.5)
    return "\n".join(f"{a!r} {b!r} {c!r}" for a, b, c in zip(seen.tolist(), q.tolist(), v.tolist()))


def main() -> None:
    """Print one line a controller."""
    compiler = sys.argv[1] if len(sys.argv) > 1 else "gcc"
    print(f"{compiler} -std=c99 -O2 -ffp-contract=off, {STEPS} samples, median of {BLOCKS} blocks")
    for motion_name, share in MOTIONS.items():
        alone = measured("none", compiler, share)
        print(f"{motion_name}: {'PD':<15} {alone:6.1f} ns a sample")
        for name in NAMES[1:]:
            whole = measured(name, compiler, share)
            added = f"{whole - alone:5.1f} ns of them the compensator"
            print(f"{motion_name}: {'PD + ' + name:<15} {whole:6.1f} ns a sample, {added}")


if __name__ == "__main__":
    main()
