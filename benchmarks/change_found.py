"""Does `stickslip compare` call a change only where there is one, and find 10 % of Coulomb friction?

Every axis of `coverage_records.py` is recorded twice as it is, with other noise, and once with its Coulomb torque
raised; the records are identified with their true law given, and compared.

    python benchmarks/change_found.py [--records 40] [--first 0] [--jobs 2]
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

from coverage_records import make
from stickslip.core.errors import StickslipError
from stickslip.identification.axis import identify_axis
from stickslip.identification.compare.change import compare_models
from stickslip.identification.experiment import experiment_of
from stickslip.identification.identified_file import read_identified
from stickslip.identification.model_file import write_model
from stickslip.machines.servo import ServoAxis

RAISED = 1.1


def study(seed: int) -> tuple[bool, bool] | None:
    """Whether a change is called between two records of one axis, and after the Coulomb torque rose."""
    axis = ServoAxis(drive_side="load")
    cases = [make(seed), make(seed, repeat=1), make(seed, repeat=2, coulomb=RAISED)]
    with TemporaryDirectory() as folder:
        found: list[Path] = []
        for i, case in enumerate(cases):
            try:
                result = identify_axis([experiment_of(case.record, axis)], axis, [case.model.law])
            except StickslipError as error:
                print(f"seed {seed} ({case.family}): {error}", file=sys.stderr)
                return None
            found.append(write_model(Path(folder) / f"{i}.toml", result, data=[], law=case.family))
        first, again, raised = (read_identified(path) for path in found)
        return compare_models(first, again).changed, compare_models(first, raised).changed


def main() -> int:
    """Count."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--records", type=int, default=40, help="axes, each recorded three times")
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    alarms, hits, count = 0, 0, 0
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    # Processes that begin anew read how many threads algebra may use.
    with ProcessPoolExecutor(options.jobs, multiprocessing.get_context("spawn")) as pool:
        for found in pool.map(study, range(options.first, options.first + options.records)):
            if found is None:
                continue
            count, alarms, hits = count + 1, alarms + found[0], hits + found[1]
            print(f"{count} axes: {alarms} false alarms, {hits} rises of {RAISED - 1:.0%} found", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
