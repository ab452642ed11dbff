"""Nanoseconds a step of the exported C against hand-written C of the same equations, interleaved in one run.

``python benchmarks/export_step.py [COMPILER]``: LuGre, GMS with 4 elements and Stribeck friction (`hand_written.c`),
both compiled with -O2, over the same steps; the median of 41 alternating blocks, and the largest difference of the
torques.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from stickslip.exports import c99
from stickslip.exports.job import Job
from stickslip.models import plugins
from stickslip.models.model import Model

HERE = Path(__file__).parent
STEPS, BLOCKS = 20_000, 41
HAND = {
    "lugre": (
        "static double hand_z; static lugre_parameters hand_p = {{ {sigma0}, {sigma1}, {fs}, {fc}, {vs}, {sigma2} }};",
        "lugre_hand(v0[i], v1[i], dt[i], &hand_z, &hand_p)",
        "hand_z = 0.0",
    ),
    "gms": (
        "static gms_state hand_z; static gms_parameters hand_p = "
        "{{ {{ {k} }}, {{ {alpha} }}, {c}, {fs}, {fc}, {vs}, {sigma2} }};",
        "gms_hand(v0[i], v1[i], dt[i], &hand_z, &hand_p)",
        "memset(&hand_z, 0, sizeof hand_z)",
    ),
    "stribeck_plain": (
        "static stribeck_parameters hand_p = {{ {fs}, {fc}, {vs}, {sigma2} }};",
        "stribeck_hand(v1[i], 0.0, &hand_p)",
        "",
    ),
}
MAIN = """
#define _POSIX_C_SOURCE 199309L
#include "hand_written.h"
#include "x.h"
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
{declared}
static double v0[{n}], v1[{n}], dt[{n}], ours[{n}], hand[{n}];
static double now(void)
{{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}}
int main(void)
{{
    x_parameters p;
    x_state z;
    x_surroundings u = {{ 0.0, 1.0, 20.0, 0.0, 0.0 }};
    x_init(&p);
    for (int i = 0; i < {n}; i++) {{
        if (scanf("%lf %lf %lf", &v0[i], &v1[i], &dt[i]) != 3) {{ return 1; }}
    }}
    for (int block = 0; block < {blocks}; block++) {{
        x_reset(&z);
        {cleared};
        double a = now();
        for (int i = 0; i < {n}; i++) {{ ours[i] = x_step(v0[i], v1[i], dt[i], &z, &p, &u); }}
        double b = now();
        for (int i = 0; i < {n}; i++) {{ hand[i] = {call}; }}
        double c = now();
        double off = 0.0;
        for (int i = 0; i < {n}; i++) {{ off = fmax(off, fabs(ours[i] - hand[i])); }}
        printf("%.17g %.17g %.17g\\n", (b - a) / {n}, (c - b) / {n}, off);
    }}
    return 0;
}}
"""


def measured(name: str, compiler: str) -> tuple[float, float, float]:
    """Nanoseconds a step, exported and by hand, and the largest difference in N·m."""
    law = plugins.law(name)
    values = {
        k: ", ".join(map(repr, v)) if isinstance(v, (list, tuple)) else repr(v)
        for k, v in law.example.items()
    }
    declared, call, cleared = HAND[name]
    with TemporaryDirectory() as folder:
        for file, text in c99.write(Job(Model(law, **dict(law.example)), "x")).files.items():
            Path(folder, file).write_text(str(text))
        for file in ("hand_written.c", "hand_written.h"):
            Path(folder, file).write_text((HERE / file).read_text())
        text = MAIN.format(
            declared=declared.format(**values), call=call, cleared=cleared, n=STEPS, blocks=BLOCKS
        )
        Path(folder, "main.c").write_text(text)
        sources = ["x.c", "hand_written.c", "main.c"]
        subprocess.run([compiler, "-std=c99", "-O2", *sources, "-lm", "-o", "run"], cwd=folder, check=True)
        done = subprocess.run(
            ["./run"], cwd=folder, input=motion(), capture_output=True, text=True, check=True
        )
    rows = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    return statistics.median(rows[:, 0]), statistics.median(rows[:, 1]), float(rows[:, 2].max())


def motion() -> str:
    """A motion with reversals at 1 kHz, as text: a sum of sines from 1 mrad/s to 1 rad/s."""
    t = 1e-3 * np.arange(STEPS + 1)
    v = 0.7 * np.sin(3.0 * t) + 0.2 * np.sin(41.0 * t) + 0.001 * np.sin(301.0 * t)
    return "\n".join(f"{a!r} {b!r} 0.001" for a, b in zip(v[:-1].tolist(), v[1:].tolist()))


def main() -> None:
    """Print one line a law."""
    compiler = sys.argv[1] if len(sys.argv) > 1 else "gcc"
    print(f"{compiler} -std=c99 -O2, {STEPS} steps, median of {BLOCKS} blocks")
    for name in HAND:
        ours, hand, off = measured(name, compiler)
        print(
            f"{name:<15} exported {ours:6.1f} ns, by hand {hand:6.1f} ns: {ours / hand:.2f} times, {off:.1e} N·m apart"
        )


if __name__ == "__main__":
    main()
