"""A hobby servo that lifts a pendulum: DC motor, position controller and load-dependent friction from 12 records.

    python examples/identify_servo.py [--all] [folder of the records]

The records are those of the public xl330 set (Rhoban, "Better actuator models"): four motions at three gains of the
firmware. Each is simulated as a whole: the firmware's loop volts = clip(gain kp (goal - position)), the motor
T = kt/R volts - kt ke/R v, the pendulum m g l sin(q - q0), and friction that grows with the torque in the gearing.
What is compared is the position alone. Then every gain is left out in turn and predicted from the others. With --all
every law that says its torque at constant velocity is fitted, and the error on the last 30 % of every record chooses.
"""

from __future__ import annotations

import json
import math
import os
import sys
import time
from pathlib import Path
from typing import Any

# Small matrices: threads of the algebra library would mostly wait for each other, at full load.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from stickslip.identification.axis import identify_axis
from stickslip.identification.experiment import Experiment
from stickslip.identification.output_error.output import Extras, OutputError, output_error
from stickslip.machines.servo import Motor, ServoAxis
from stickslip.models import plugins
from stickslip.simulation.recorded_input.simulation import Loop

SUPPLY = 7.4  # V
COUNTS, DIVISOR, PWM_LIMIT = 4096.0, 256.0, 885.0
"""Per turn; of the firmware's position gain (seen on the scope, "Better actuator models"); counts of a full duty."""
VOLTS_PER_GAIN = SUPPLY * COUNTS / (2.0 * math.pi) / DIVISOR / PWM_LIMIT  # V/rad at kp = 1
MOTOR = Motor(torque_constant=0.4, resistance=5.0)  # to start from
MASS, LENGTH = 0.49, 0.1  # kg, m
GRAVITY = MASS * 9.80665 * LENGTH
LAWS = ("coulomb",)
"""Friction grows with the load in each; a Stribeck effect can be tried by adding its name."""


def experiment(path: Path) -> Experiment:
    """One record: the loop is simulated, the drive is off where torque is disabled."""
    data = json.loads(path.read_text(encoding="utf-8"))
    column: dict[str, Any] = {
        k: np.array([float(e[k]) for e in data["entries"]])
        for k in ("timestamp", "position", "goal_position", "torque_enable")
    }
    loop = Loop(kp=VOLTS_PER_GAIN * data["kp"], limit=SUPPLY, period=1e-3)
    return Experiment(
        path.stem, column["timestamp"], column["position"], None, "voltage", column["goal_position"], loop,
        column["torque_enable"],
    )  # fmt: skip


AXIS = ServoAxis(gravity="pendulum", motor=MOTOR, drive_side="load")
MECHANICS = {"inertia": MASS * LENGTH**2 + 0.002, "gravity": GRAVITY, "gravity_angle": 0.0, "load_motor": 10.0,
             "load_external": 10.0}  # fmt: skip
OPTIONS: dict[str, Any] = {
    "robust": True, "extras": Extras(load=True), "free": ("drive_gain", "back_emf", "controller_gain"),
    "frozen": ("gravity", "offset"),
}  # fmt: skip


def identify(experiments: list[Experiment], name: str) -> OutputError:
    """Motor, controller gain, gravity's angle and friction, from positions alone."""
    start: dict[str, dict[str, float]] = {
        "coulomb": {"fc": 0.01, "sigma2": 0.005},
        "stribeck": {"fc": 0.01, "fs": 0.015, "vs": 0.5, "k": 10.0, "sigma2": 0.005},
    }
    return output_error(
        experiments, AXIS, plugins.law(name), None, values={**MECHANICS, **start[name]}, **OPTIONS
    )


def choose(experiments: list[Experiment]) -> None:
    """Fit every law, let held-out data choose, and fit that to all."""
    begin = time.process_time()
    laws = [name for name in plugins.law_names() if plugins.law(name).steady]
    found = identify_axis(
        experiments, AXIS, laws, values={**MECHANICS, "fc": 0.01, "sigma2": 0.005}, **OPTIONS
    )
    print("law              free  mean absolute position error on the last 30 %, rad")
    for c in found.details["candidates"]:
        print(
            f"{c.law:16s} {c.parameters:4d}  {c.held_out.get('position_mean_absolute', math.nan):.4f} {c.failure}"
        )
    assert found.model
    error = mean_absolute(found.details["output"], experiments)
    spent = time.process_time() - begin
    print(f"chosen: {found.model.law.name}, {error:.4f} rad on {len(experiments)} records; CPU {spent:.1f} s")


def mean_absolute(found: OutputError, experiments: list[Experiment]) -> float:
    """Mean over the records of the mean absolute position error, rad."""
    return float(np.mean([found.held_out([t])["position_mean_absolute"] for t in experiments]))


def main() -> None:
    """Fit all records, then leave one gain out at a time."""
    words = [w for w in sys.argv[1:] if w != "--all"]
    data = os.environ.get("STICKSLIP_DATA", "../shared/data")
    folder = Path(words[0] if words else f"{data}/xl330_pendulum")
    experiments = [experiment(p) for p in sorted(folder.glob("kp*.json"))]
    if "--all" in sys.argv:
        choose(experiments)
        return
    gains = sorted({t.name.partition("_")[0] for t in experiments})
    for name in LAWS:
        begin = time.process_time()
        found = identify(experiments, name)
        print(
            f"{name}: mean absolute position error {mean_absolute(found, experiments):.4f} rad on "
            f"{len(experiments)} records"
        )
        for e in found.estimates:
            print(f"  {e.symbol:10s} {e.value:10.5g} [{e.lower:.4g}, {e.upper:.4g}] {e.unit} {e.verdict}")
        errors: list[float] = []
        for gain in gains:
            others = [t for t in experiments if not t.name.startswith(gain + "_")]
            left_out = [t for t in experiments if t.name.startswith(gain + "_")]
            errors.append(mean_absolute(identify(others, name), left_out))
        listing = ", ".join(f"{g} {e:.4f}" for g, e in zip(gains, errors, strict=True))
        print(
            f"  leaving one gain out: {np.mean(errors):.4f} rad ({listing}); CPU {time.process_time() - begin:.1f} s"
        )


if __name__ == "__main__":
    main()
