"""Make the record of `stickslip demo`: python tools/make_demo.py writes src/stickslip/demo.csv.

Simulated: a rigid axis with Stribeck friction and a constant torque in a sampled position loop (PD, 1 kHz), a coloured
torque noise (standard deviation 2 mN·m, time constant 5 ms), a 16-bit encoder.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from stickslip import Model
from stickslip.simulation.recorded_input.simulation import Drive, Loop, Mechanics, drive_axis

FRICTION = Model("stribeck", k=50.0, sigma2=0.018, fs=0.335, fc=0.285, vs=0.1)
MECHANICS = Mechanics(4e-4, offset=0.03)
COUNT = 2.0 * math.pi / 65536.0
LOOP = Loop(kp=8.0, kd=0.08, kr=0.08, limit=3.0, count=COUNT)
SECONDS, PERIOD, NOISE, COLOUR = 6.0, 1e-3, 2e-3, 5e-3
PARTS = ((3.0, 0.2, 0.3), (0.5, 0.7, 1.1), (0.2, 1.9, 4.0), (0.05, 4.3, 2.0))
"""Amplitude (rad), frequency (Hz) and phase (rad) of the reference's sinusoids: slow and fast, many reversals."""


def main() -> None:
    """Simulate and write."""
    time = PERIOD * np.arange(round(SECONDS / PERIOD))
    wanted = sum(
        (a * (np.sin(2.0 * math.pi * f * time + p) - math.sin(p)) for a, f, p in PARTS), np.zeros(time.size)
    )
    rng = np.random.default_rng(2026)
    keep, push = math.exp(-PERIOD / COLOUR), np.zeros(time.size)
    for i in range(1, time.size):
        push[i] = keep * push[i - 1] + math.sqrt(1.0 - keep * keep) * NOISE * rng.normal()
    drive = Drive(time, wanted, "feedback", LOOP, disturbance=push, max_step=1e-4)
    out = drive_axis(MECHANICS, FRICTION, drive)
    position = COUNT * np.round(out[:, 0] / COUNT)
    table = np.column_stack([time, position, out[:, 2], wanted])
    target = Path(__file__).parents[1] / "src" / "stickslip" / "demo.csv"
    np.savetxt(
        target, table, delimiter=",", fmt=("%.3f", "%.6f", "%.5f", "%.6f"), comments="", encoding="utf-8",
        header="time [s],position [rad],motor_torque [N·m],position_reference [rad]",
    )  # fmt: skip
    print(target, target.stat().st_size)


if __name__ == "__main__":
    main()
