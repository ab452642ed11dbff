"""What a sample of the virtual rig's block costs: with every imperfection, with none, with each alone.

    python benchmarks/rig_sample.py [--rig thesis-dry] [--law gms] [--seconds 20]

The loop of `benchmarks/rig_loop.py`, PD of 25 Hz with feedforward along a slow sine, without a record's file. Times are
CPU times in us a sample, the least of several runs: of the whole block, and of the machine alone under the torques that
the block commanded.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np

from stickslip.control.compensator import Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.machines.files import machine
from stickslip.machines.machine import IMPERFECTIONS, Machine
from stickslip.rigs.loop_sample import COLUMNS, control_of
from stickslip.rigs.rig import Measurement, setpoints
from stickslip.rigs.virtual import VirtualRig, run_block
from stickslip.simulation.machine.layout import lay_out_machine, look, run

REPEATS = 5


def costs(plant: Machine, controller: Controller, wanted: Any) -> tuple[float, float, float]:
    """us a sample of the block and of the machine alone, and sub-steps a sample."""
    rows, measured = np.zeros((len(wanted), len(COLUMNS))), np.zeros((len(wanted), len(Measurement._fields)))
    blocks: list[float] = []
    machines: list[float] = []
    substeps = 0.0
    for _ in range(REPEATS):
        rig = VirtualRig(plant)
        control = control_of(controller, rig.limits, rig.sample_time)
        look(rig.laid, control.measured)
        begin = time.process_time()
        done = run_block(rig.laid, control, wanted, rows)
        blocks.append(time.process_time() - begin)
        if done < len(wanted):
            raise SystemExit(f"{rig.name}: stopped after {done} samples")
        substeps = float(rig.laid.now["taken"]) / done
        torques, laid = np.ascontiguousarray(rows[:, COLUMNS.index("torque_command")]), lay_out_machine(plant)
        begin = time.process_time()
        run(laid, torques, measured)
        machines.append(time.process_time() - begin)
    return 1e6 * min(blocks) / len(wanted), 1e6 * min(machines) / len(wanted), substeps


def main() -> None:
    """Print a line a set of imperfections."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rig", default="thesis-dry")
    parser.add_argument("--law", default="gms", help="of the feedforward; one that the machine has")
    parser.add_argument("--seconds", type=float, default=20.0)
    args = parser.parse_args()
    whole = machine(args.rig)
    t = whole.sample_time * np.arange(round(args.seconds / whole.sample_time))
    w = 2.0 * np.pi * 0.5
    wanted = setpoints(
        t.size, position=0.3 * (1 - np.cos(w * t)), velocity=0.3 * w * np.sin(w * t), closed=1.0
    )
    controller = Controller(
        place("PD", whole.inertia, 25.0, 1.0), Feedforward(whole.models[args.law]), torque_limit=1.0
    )
    sets = {"all": whole, "none": whole.without(*IMPERFECTIONS)}
    sets |= {f"{one} alone": whole.without(*(n for n in IMPERFECTIONS if n != one)) for one in IMPERFECTIONS}
    sets |= {f"all but {one}": whole.without(one) for one in IMPERFECTIONS}
    print(f"{args.rig:<24}{'block, us':>10}{'machine':>10}{'sub-steps':>10}{'samples/s':>12}")
    for name, plant in sets.items():
        block, alone, substeps = costs(plant, controller, wanted)
        print(f"{name:<24}{block:>10.2f}{alone:>10.2f}{substeps:>10.2f}{1e6 / block:>12,.0f}", flush=True)


if __name__ == "__main__":
    main()
