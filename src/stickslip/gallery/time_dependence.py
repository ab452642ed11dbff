"""Dependence on time.

Dirt, warmth and wear change friction while a machine runs (thesis 2.1.5). Any law may have a change that settles, by
the choice `time_dependence = "settling"`: its torque is multiplied by 1 + d (1 - exp(-t / tau)). An axis that warms up
loses a part of its friction so; parameters found in the first minute are wrong after the tenth.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip import Model, Record, Reference, law, respond
from stickslip.report.analysis_pictures import Drawn
from stickslip.report.plots import Curve, Panel
from stickslip.report.styles import Style

Array = np.ndarray[Any, np.dtype[np.float64]]
DRIFT, TIME = -0.3, 60.0  # of the torque in the long run; s
PERIOD, PERIODS, SAMPLES = 10.0, 24, 2000  # s; and samples in each
GREY, BLUE = Style("#777777", (0, (4, 1.2)), 1.2), Style("#0072B2", "-", 1.3)
THIN = Style("#0072B2", "-", 0.8)


def warming(name: str) -> Model:
    """A law with its example's parameters and the change."""
    return Model(name, {"time_dependence": "settling"}, **law(name).example, drift=DRIFT, drift_time=TIME)


def factor(time: Array) -> Array:
    """What is left of the friction, -."""
    return 1.0 + DRIFT * (1.0 - np.exp(-time / TIME))


def swung(model: Model) -> Record:
    """A slow sinusoid with up to 50 mrad/s."""
    motion = Reference("harmonic", amplitude=0.05 * PERIOD / (2.0 * np.pi), frequency=1.0 / PERIOD)
    return respond(model, motion, np.linspace(0.0, PERIOD * PERIODS, PERIODS * SAMPLES + 1), tolerance=1e-9)


def picture() -> Drawn:
    """Draw torque over time, and over velocity in the second and the last period."""
    record = swung(warming("gms"))
    torque, speed = record["friction_torque"], 1e3 * record["velocity"]
    bound = torque[: 2 * SAMPLES].max() * factor(record.time)
    over_time = Panel(
        [
            Curve(record.time, torque, "", THIN),
            Curve(record.time, bound, "", GREY),
        ],
        "torque (N·m)", "time (s)", note="dashed: in proportion to 1 + d (1 - exp(-t/τ))",
    )  # fmt: skip
    second, last = slice(SAMPLES, 2 * SAMPLES + 1), slice(-SAMPLES - 1, None)
    loops = [
        Curve(
            speed[part], torque[part], f"{record.time[part][0]:.0f} to {record.time[part][-1]:.0f} s", style
        )
        for part, style in ((second, GREY), (last, BLUE))
    ]
    over_speed = Panel(loops, "torque (N·m)", "velocity (mrad/s)", legend="upper left")
    message = f"GMS that loses {-100 * DRIFT:.0f} % of its friction with a time constant of {TIME:.0f} s"
    return "Friction that depends on time", message, [over_time, over_speed], 2.0
