"""Identify the EMPS axis: the published inverse dynamics, then the simulated closed loop.

    STICKSLIP_DATA=../shared/data python examples/identify_emps.py

The record belongs to the report of Janot, Gautier and Brunot (2019, hal-02178709) and is not part of this package;
without it this prints where to get it. The command line does the second half from the file:

    stickslip identify DATA_EMPS.mat --map position=qm:m --drive-gain 35.15065 \\
        --loop kp=38995.8,kd=243.45,limit=10,span=2 --law coulomb --intervals covariance
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from stickslip.identification.axis import identify_axis
from stickslip.identification.experiment import Experiment
from stickslip.identification.regression.inverse import inverse_dynamics
from stickslip.machines.servo import ServoAxis
from stickslip.simulation.recorded_input.simulation import Loop

FILE = Path(os.environ.get("STICKSLIP_DATA", "../shared/data")) / "emps" / "DATA_EMPS.mat"


def emps() -> tuple[Experiment, ServoAxis]:
    """The record with its position and velocity loop: u = kv (kp e - dq), |u| <= 10 V."""
    data: Any = loadmat(FILE)
    t, q, r, u = (np.ascontiguousarray(data[k].ravel(), dtype=float) for k in ("t", "qm", "qg", "vir"))
    kp, kv, gain = (float(data[k].item()) for k in ("kp", "kv", "gtau"))
    loop = Loop(kp=kv * kp, kd=kv, limit=10.0, velocity_span=2)
    return Experiment("emps", t, q, u, "voltage", r, loop), ServoAxis(
        motion="linear", drive_gain=gain, drive_side="load"
    )


def main() -> int:
    """Print parameters, intervals and errors."""
    if not FILE.exists():
        print(f"no record at {FILE}: fetch DATA_EMPS.mat from nonlinearbenchmark.org and set STICKSLIP_DATA")
        return 0
    experiment, axis = emps()
    for per_direction in (False, True):
        found = inverse_dynamics([experiment], axis, per_direction=per_direction)
        print(f"inverse dynamics, relative force error {100 * found.relative_error:.4f} %")
        for name, value, std, unit in zip(found.names, found.values, found.std, found.units):
            print(f"  {name:<10}{value:>10.4f} +- {std:.4f} {unit}")
    # The output error is what was published; the prediction error looks at what Coulomb friction leaves out, too.
    result = identify_axis([experiment], axis, ["coulomb"], intervals="covariance")
    print(
        f"closed loop, relative errors: position {100 * result.misfit['position_relative']:.5f} %, "
        f"force {100 * result.misfit['drive_relative']:.3f} %"
    )
    for e in result.estimates:
        print(f"  {e.name:<10}{e.value:>10.4f}  [{e.lower:.4f}, {e.upper:.4f}] {e.unit}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
