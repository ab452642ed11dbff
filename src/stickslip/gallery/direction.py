"""Dependence on the direction of motion.

Levels of friction differ between the two directions (thesis 2.1.7). Any law that slides may have parameters of its
own for v < 0, by the choice `symmetry = "asymmetric"`. What does not belong to sliding, the stiffness at rest, stays
the same, so that the torque is continuous at a reversal.
"""

from __future__ import annotations

import numpy as np

from stickslip import Model, Record, Reference, law, respond
from stickslip.report.analysis_pictures import Drawn
from stickslip.report.plots import Curve, Panel
from stickslip.report.styles import Style

SHARE = 0.7  # of the static and of the Coulomb torque is left for v < 0
EXAMPLE = law("gms").example
SAME = Model("gms", **EXAMPLE)
OTHER = Model(
    "gms", {"symmetry": "asymmetric"}, **EXAMPLE,
    **{f"{name}_negative": EXAMPLE[name] for name in ("vs", "sigma2")},
    **{f"{name}_negative": SHARE * EXAMPLE[name] for name in ("fs", "fc")},
)  # fmt: skip
GREY, BLUE = Style("#777777", (0, (4, 1.2)), 1.2), Style("#0072B2", "-", 1.5)


def loop(model: Model) -> Record:
    """The second period of a slow sinusoid of 50 mrad/s."""
    motion = Reference("harmonic", amplitude=0.05 / np.pi, frequency=0.5)
    whole = respond(model, motion, np.linspace(0.0, 4.0, 8001), tolerance=1e-9)
    late = slice(4000, None)
    return Record(whole.time[late], {n: x[late] for n, x in whole.channels.items()}, whole.units)


def picture() -> Drawn:
    """Draw torque over velocity."""
    curves = [
        Curve(1e3 * r["velocity"], r["friction_torque"], name, style)
        for name, style, r in (("symmetric", GREY, loop(SAME)), ("asymmetric", BLUE, loop(OTHER)))
    ]
    panel = Panel(curves, "torque (N·m)", "velocity (mrad/s)", legend="upper left")
    message = f"GMS with {100 * SHARE:.0f} % of its static and Coulomb torque for v < 0"
    return "Friction that depends on the direction", message, [panel], 2.4
