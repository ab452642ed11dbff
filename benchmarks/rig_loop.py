"""How well the loop keeps its time: a minute at 1 kHz on the virtual rig, and as fast as it can.

    python benchmarks/rig_loop.py [--seconds 60] [--rig thesis-dry] [--law gms]

Run it on a machine that is otherwise quiet, with the right to a real-time priority; what was granted is printed.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from stickslip.control.compensator import Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core.record import Record
from stickslip.machines.files import machine
from stickslip.rigs.loop import Loop
from stickslip.rigs.rig import Capabilities, setpoints
from stickslip.rigs.virtual import VirtualRig


class OneByOne(VirtualRig):
    """The same machine through `exchange`."""

    @property
    def capabilities(self) -> Capabilities:
        return replace(super().capabilities, blocks=False)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rig", default="thesis-dry")
    parser.add_argument(
        "--law", default="gms", help="of the feedforward compensator; one that the machine has"
    )
    args = parser.parse_args()
    plant = machine(args.rig)
    gains = place("PD", plant.inertia, 25.0, 1.0)
    controller = Controller(gains, Feedforward(plant.models[args.law]), torque_limit=1.0)
    t = plant.sample_time * np.arange(round(args.seconds / plant.sample_time))
    w = 2.0 * np.pi * 0.5
    wanted = setpoints(
        t.size, position=0.3 * (1 - np.cos(w * t)), velocity=0.3 * w * np.sin(w * t), closed=1.0
    )
    with tempfile.TemporaryDirectory() as folder:
        with Loop(VirtualRig(plant), realtime=True, path=Path(folder) / "real.stream") as loop:
            loop.prepare(controller)
            loop.run(wanted, controller)
            account = loop.account()
        print(
            f"{args.rig}, {args.law} feedforward, {args.seconds:g} s in real time, load {os.getloadavg()[0]:.1f}"
        )
        print(*account.lines(), f"granted: {', '.join(account.granted)}", sep="\n")
        for kind in (VirtualRig, OneByOne):
            path = Path(folder) / f"{kind.__name__}.stream"
            with Loop(kind(plant)) as loop:
                loop.run(wanted[:100], controller)  # compiles
            with Loop(kind(plant), path=path) as loop:
                loop.prepare(controller)
                begin = time.perf_counter()
                loop.run(wanted, controller)
                took = time.perf_counter() - begin
            way = "blocks" if kind is VirtualRig else "exchange"
            print(f"{way}: {t.size / took:,.0f} samples/s, {args.seconds / took:.0f} times real time")
        a, b = (Record.load(Path(folder) / f"{kind.__name__}.stream") for kind in (VirtualRig, OneByOne))
        same = np.array_equal(a.time, b.time) and all(np.array_equal(a[n], b[n]) for n in a.channels)
        print(f"records of both: {'identical, bit for bit' if same else 'DIFFERENT'}")


if __name__ == "__main__":
    main()
