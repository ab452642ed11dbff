"""The page of reference motions, made from their descriptions, with a picture of each."""

from __future__ import annotations

import numpy as np
from law_pages import parameters
from pages import GENERATED, write

from stickslip.models import plugins
from stickslip.models.model import Reference
from stickslip.report.plots import Curve, Panel, draw
from stickslip.report.styles import Style

FOLDER = GENERATED / "references"
LINE = Style("#0072B2", "-", 1.4)
SHOWN = {
    "sine": ({"amplitude": 0.5, "frequency": 1.0}, 2.0),
    "plain_sine": ({"amplitude": 0.5, "frequency": 1.0}, 2.0),
    "harmonic": ({"amplitude": 0.1, "frequency": 1.0, "velocity": 0.5}, 2.0),
    "step": ({"amplitude": 0.01, "tau": 0.02}, 0.3),
    "ramp": ({"velocity": 0.5, "end": 0.6}, 1.0),
    "staircase": ({"height": 0.01, "dwell": 0.5, "steps": 4.0, "tau": 0.02}, 2.5),
    "scurve": ({"distance": 1.0, "velocity": 2.0, "acceleration": 20.0, "jerk": 400.0}, 0.8),
}
"""Parameters and duration (s) of the pictures; a kind that is not named here has none."""


def make() -> None:
    """Write the page and its pictures."""
    kinds = [plugins.reference_kind(name) for name in plugins.reference_names()]
    parts = [
        "# Reference motions\n\nWhat an axis is to follow: `kind` in a file, `ss.Reference(kind, ...)` in Python. "
        "Position in rad, velocity in rad/s, time in s."
    ]
    for kind in kinds:
        said = f"## {kind.title}\n\n`{kind.name}`\n\n$$\n{kind.equation}\n$$\n\n{parameters(kind.fields)}"
        parts.append(said + picture(kind.name, kind.title))
    write(FOLDER / "index.md", "\n\n".join(parts) + "\n")


def picture(name: str, title: str) -> str:
    """Draw a kind of which an example is given; the Markdown that shows it."""
    if name == "table":
        motion, duration = Reference.table([0.0, 0.3, 0.6, 1.0], [0.0, 0.4, 0.4, -0.2]), 1.2
        words = "time = 0, 0.3, 0.6, 1; position = 0, 0.4, 0.4, -0.2"
    elif name in SHOWN:
        values, duration = SHOWN[name]
        motion = Reference(name, **values)
        words = ", ".join(f"{k} = {v:g}" for k, v in values.items())
    else:
        return ""
    time = np.linspace(0.0, duration, 2001)
    rows = motion.sample(time)
    panels = [
        Panel([Curve(time, rows[:, i], "", LINE)], label, "time (s)", (0.0, duration))
        for i, label in enumerate(("position (rad)", "velocity (rad/s)"))
    ]
    draw(FOLDER / name, title, words, panels, 1.2)
    return f"\n\n```{{image}} {name}.svg\n:alt: {title}: position and velocity\n```"
