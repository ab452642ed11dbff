"""Logs in which a unit, a sign or a signal is wrong, or that move too little for an identification."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from support.doctor_logs import (
    BARE,
    DEG,
    HEADER,
    Table,
    clip,
    moving_up,
    n,
    rng,
    steps,
    with_,
)
from support.spoiled_tables import SPOILED_TABLES

__all__ = ["SPOILED"]

SPOILED: list[tuple[str, Callable[[Table], Table], dict[str, str], str, str]] = [
    *SPOILED_TABLES,
    # Units
    (
        "degrees called rad",
        lambda t: with_(t, position=t["position"] * DEG),
        HEADER,
        "position-unit",
        "error",
    ),
    ("degrees, no unit", lambda t: with_(t, position=t["position"] * DEG), BARE, "position-unit", "error"),
    (
        "degrees by the encoder",
        lambda t: {
            "time": t["time"],
            "position": steps(t["position"] * DEG, 360 / 2**14),
            "torque": t["torque"],
        },
        BARE,
        "position-unit",
        "error",
    ),
    (
        "turns for rad",
        lambda t: with_(t, position=t["position"] / (2 * np.pi)),
        BARE,
        "position-unit",
        "error",
    ),
    (
        "counts for rad",
        lambda t: with_(t, position=np.round(t["position"] * 65536 / (2 * np.pi))),
        BARE,
        "position-unit",
        "error",
    ),
    (
        "counts, no velocity",
        lambda t: {"time": t["time"], "position": np.round(t["position"] * 1304), "torque": t["torque"]},
        BARE,
        "position-unit",
        "error",
    ),
    (
        "counts called rad",
        lambda t: {"time": t["time"], "position": np.round(t["position"] * 1304), "torque": t["torque"]},
        HEADER,
        "position-unit",
        "warning",
    ),
    (
        "rpm called rad/s",
        lambda t: with_(t, velocity=t["velocity"] * 30 / np.pi),
        HEADER,
        "velocity-unit",
        "error",
    ),
    ("rpm, no unit", lambda t: with_(t, velocity=t["velocity"] * 30 / np.pi), BARE, "velocity-unit", "error"),
    ("deg/s, no unit", lambda t: with_(t, velocity=t["velocity"] * DEG), BARE, "velocity-unit", "error"),
    (
        "rev/s, no unit",
        lambda t: with_(t, velocity=t["velocity"] / (2 * np.pi)),
        BARE,
        "velocity-unit",
        "error",
    ),
    (
        "degrees and rpm",
        lambda t: with_(t, velocity=t["velocity"] * 30 / np.pi, position=t["position"] * DEG),
        BARE,
        "position-unit",
        "error",
    ),
    (
        "velocity behind a gear",
        lambda t: with_(t, velocity=t["velocity"] * 3.7),
        HEADER,
        "velocity-mismatch",
        "error",
    ),
    (
        "velocity of another axis",
        lambda t: with_(t, velocity=np.sin(7.3 * t["time"])),
        HEADER,
        "velocity-mismatch",
        "error",
    ),
    ("no units at all", lambda t: t, BARE, "assumed-unit", "warning"),
    (
        "per mille for torque",
        lambda t: with_(t, torque=np.round(t["torque"] * 700)),
        BARE,
        "torque-unit",
        "error",
    ),
    (
        "percent for torque",
        lambda t: with_(t, torque=steps(t["torque"] * 90, 0.1)),
        BARE,
        "torque-unit",
        "error",
    ),
    (
        "absurd speed",
        lambda t: with_(t, position=t["position"] * 5e3, velocity=t["velocity"] * 5e3),
        BARE,
        "position-unit",
        "error",
    ),
    # Signs, delays, loads
    ("torque turned", lambda t: with_(t, torque=-t["torque"]), HEADER, "torque-sign", "error"),
    (
        "torque turned, no velocity",
        lambda t: {"time": t["time"], "position": t["position"], "torque": -t["torque"]},
        HEADER,
        "torque-sign",
        "error",
    ),
    (
        "position and velocity turned",
        lambda t: with_(t, position=-t["position"], velocity=-t["velocity"]),
        HEADER,
        "torque-sign",
        "error",
    ),
    ("velocity turned", lambda t: with_(t, velocity=-t["velocity"]), HEADER, "velocity-sign", "error"),
    (
        "gravity",
        lambda t: with_(t, torque=t["torque"] + 0.4 * np.sin(t["position"])),
        HEADER,
        "gravity",
        "warning",
    ),
    (
        "gravity from another zero",
        lambda t: with_(t, torque=t["torque"] + 0.3 * np.cos(t["position"] + 0.4)),
        HEADER,
        "gravity",
        "warning",
    ),
    ("a weight", lambda t: with_(t, torque=t["torque"] + 0.2), HEADER, "offset", "note"),
    # Signals
    ("torque limit", lambda t: with_(t, torque=clip(t["torque"], 0.7)), HEADER, "saturation", "warning"),
    (
        "torque limit, one side",
        lambda t: with_(t, torque=np.minimum(t["torque"], 0.75 * t["torque"].max())),
        HEADER,
        "saturation",
        "warning",
    ),
    (
        "velocity limit",
        lambda t: with_(t, velocity=clip(t["velocity"], 0.8)),
        HEADER,
        "saturation",
        "warning",
    ),
    (
        "coarse encoder",
        lambda t: {
            "time": t["time"],
            "position": steps(t["position"], 2 * np.pi / 64),
            "torque": t["torque"],
        },
        HEADER,
        "quantisation",
        "warning",
    ),
    (
        "encoder of 2^14",
        lambda t: with_(t, position=steps(t["position"], 2 * np.pi / 2**14)),
        HEADER,
        "quantisation",
        "note",
    ),
    (
        "angle within a turn",
        lambda t: with_(t, position=np.mod(t["position"], 2 * np.pi)),
        HEADER,
        "position-wrap",
        "error",
    ),
    (
        "degrees within a turn",
        lambda t: with_(t, position=np.mod(t["position"] * DEG, 360.0)),
        HEADER | {"position": "position [deg]"},
        "position-wrap",
        "error",
    ),
    (
        "a jump of the encoder",
        lambda t: with_(t, position=t["position"] + 0.7 * (t["time"] > 1.234)),
        HEADER,
        "position-jump",
        "warning",
    ),
    # Excitation
    (
        "never moved",
        lambda t: with_(t, position=np.full(n(t), 0.3), velocity=np.zeros(n(t))),
        HEADER,
        "never-moved",
        "error",
    ),
    (
        "a flickering count",
        lambda t: with_(t, position=1e-4 * (rng().random(n(t)) > 0.5), velocity=np.zeros(n(t))),
        HEADER,
        "never-moved",
        "error",
    ),
    (
        "only noise",
        lambda t: with_(
            t, position=1e-5 * rng().standard_normal(n(t)), velocity=1e-3 * rng().standard_normal(n(t))
        ),
        HEADER,
        "never-moved",
        "error",
    ),
    ("torque not logged", lambda t: with_(t, torque=np.zeros(n(t))), HEADER, "no-torque", "error"),
    ("no reversal", moving_up, HEADER, "no-reversal", "warning"),
    (
        "less than a turn",
        lambda t: with_(t, position=t["position"] / 20, velocity=t["velocity"] / 20),
        HEADER,
        "less-than-a-revolution",
        "note",
    ),
]
