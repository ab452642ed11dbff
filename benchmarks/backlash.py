"""How often play is found where it is, and where it is not, on drawn logs; and whether its interval holds the gap.

    python benchmarks/backlash.py [--count 20] [--first 7000] [--rate 1000]

Logs of `benchmarks/ordinary_logs.py`: for each motion, those with a gap between motor and load (found, how many
intervals hold the gap, and the dead travel over the gap) and those without (found wrongly). The doctor and
`identify --method axis` say the same number. Thresholds were chosen on seeds 7000 to 7019,
8000 to 8019 and 9000 to 9019.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from ordinary_logs import IMPERFECTIONS, MOTIONS, RATES, draw
from stickslip.core.record import Record
from stickslip.identification.doctor.play import DeadTravel, dead_travel
from stickslip.identification.doctor.view import View

UNITS = {"position": "rad", "motor_torque": "N·m"}


def travel(seed: int, moves: str, imperfection: str, rate: int) -> tuple[DeadTravel, float] | None:
    """The dead travel that is found, and the gap, rad; None where none is."""
    log = draw(seed, "commanded", rate, "p-pi", moves, imperfection)
    record = Record(log.time, {"position": log.position, "motor_torque": log.torque}, UNITS)
    found = dead_travel(View(record))
    return None if found is None else (found, float(log.machine.axis[4]))


def main() -> None:
    """Print a line for each motion and imperfection."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--first", type=int, default=7000)
    parser.add_argument("--rate", type=int, default=1000, choices=RATES)
    args = parser.parse_args()
    for moves in MOTIONS:
        for imperfection in IMPERFECTIONS:
            seeds = range(args.first, args.first + args.count)
            found = [x for s in seeds if (x := travel(s, moves, imperfection, args.rate)) is not None]
            line = f"{moves}, {imperfection}: found in {len(found)} of {args.count}"
            if imperfection == "backlash" and found:
                held = sum(one.lower <= gap <= one.upper for one, gap in found)
                low, middle, high = np.percentile([one.value / gap for one, gap in found], [5, 50, 95])
                line += f"; {held} intervals hold the gap; travel over the gap {middle:.2f} ({low:.2f} to {high:.2f})"
            print(line, flush=True)


if __name__ == "__main__":
    main()
