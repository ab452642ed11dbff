"""How often the doctor finds play where it is, and where it is not, on drawn logs.

    python benchmarks/backlash.py [--count 20] [--first 7000]

Logs of `benchmarks/ordinary_logs.py`, of seeds on which no threshold was chosen: for each motion, those with a gap
between motor and load (found, and the dead travel over the gap) and those without (found wrongly).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from ordinary_logs import IMPERFECTIONS, MOTIONS, draw
from stickslip.identify.doctor._view import View
from stickslip.identify.doctor.play import backlash
from stickslip.record import Record

UNITS = {"position": "rad", "motor_torque": "N·m"}


def travel(seed: int, moves: str, imperfection: str) -> tuple[float, float] | None:
    """The dead travel that the doctor names, and the gap, rad; None where it names none."""
    log = draw(seed, "commanded", 1000, "p-pi", moves, imperfection)
    record = Record(log.time, {"position": log.position, "motor_torque": log.torque}, UNITS)
    for finding in backlash(View(record)):
        return float(finding.message.split("about ")[1].split()[0]), float(log.machine.axis[4])
    return None


def main() -> None:
    """Print a line for each motion and imperfection."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--first", type=int, default=7000)
    args = parser.parse_args()
    for moves in MOTIONS:
        for imperfection in IMPERFECTIONS:
            seeds = range(args.first, args.first + args.count)
            found = [x for seed in seeds if (x := travel(seed, moves, imperfection)) is not None]
            line = f"{moves}, {imperfection}: found in {len(found)} of {args.count}"
            if imperfection == "backlash" and found:
                low, middle, high = np.percentile([width / gap for width, gap in found], [5, 50, 95])
                line += f"; dead travel over the gap {middle:.2f} ({low:.2f} to {high:.2f})"
            print(line, flush=True)


if __name__ == "__main__":
    main()
