"""Logs whose columns, values or times are wrong."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from support.doctor_logs import (
    BARE,
    HEADER,
    Table,
    n,
    put,
    rng,
    rows,
    with_,
)

# (what is wrong, how a good table is spoiled, names of the columns, the code that must be found, its level)
SPOILED_TABLES: list[tuple[str, Callable[[Table], Table], dict[str, str], str, str]] = [
    # Columns
    ("no time", lambda t: {k: v for k, v in t.items() if k != "time"}, HEADER, "refused", "column of times"),
    (
        "no position and velocity",
        lambda t: {k: t[k] for k in ("time", "torque")},
        HEADER,
        "missing-column",
        "error",
    ),
    (
        "no torque",
        lambda t: {k: v for k, v in t.items() if k != "torque"},
        HEADER,
        "missing-column",
        "warning",
    ),
    ("current for torque", lambda t: t, HEADER | {"torque": "I_q [A]"}, "missing-column", "error"),
    (
        "torque in mA",
        lambda t: with_(t, torque=t["torque"] * 2e4),
        HEADER | {"torque": "torque [mA]"},
        "missing-column",
        "error",
    ),
    (
        "two positions",
        lambda t: {**t, "other": t["position"] * 1.1},
        HEADER | {"position": "pos a [rad]", "other": "pos b [rad]"},
        "ambiguous-column",
        "error",
    ),
    (
        "two torques",
        lambda t: {**t, "other": t["torque"]},
        HEADER | {"torque": "torque a", "other": "torque b"},
        "ambiguous-column",
        "error",
    ),
    (
        "several axes",
        lambda t: {**t, "p2": t["position"]},
        HEADER | {"position": "pos1", "p2": "pos2"},
        "ambiguous-column",
        "warning",
    ),
    (
        "nothing is named",
        lambda t: t,
        {"time": "a1x", "position": "b1x", "velocity": "c1x", "torque": "d1x"},
        "refused",
        "no column",
    ),
    (
        "percent without rating",
        lambda t: with_(t, torque=t["torque"] * 50),
        HEADER | {"torque": "torque [%]"},
        "refused",
        "--rated-torque",
    ),
    (
        "counts without resolution",
        lambda t: with_(t, position=np.round(t["position"] * 1000)),
        HEADER | {"position": "position [counts]"},
        "refused",
        "--counts-per-rev",
    ),
    # Missing values
    (
        "NaN in position",
        lambda t: with_(t, position=put(t["position"], slice(100, 110), np.nan)),
        HEADER,
        "nan",
        "warning",
    ),
    ("NaN in torque", lambda t: with_(t, torque=put(t["torque"], 500, np.nan)), HEADER, "nan", "warning"),
    ("NaN in time", lambda t: with_(t, time=put(t["time"], [7, 900], np.nan)), HEADER, "nan", "warning"),
    (
        "infinite velocity",
        lambda t: with_(t, velocity=put(t["velocity"], 50, np.inf)),
        HEADER,
        "nan",
        "warning",
    ),
    (
        "half is NaN",
        lambda t: with_(t, torque=put(t["torque"], np.random.default_rng(0).permutation(n(t))[::2], np.nan)),
        HEADER,
        "nan",
        "error",
    ),
    ("everything is NaN", lambda t: with_(t, torque=np.full(n(t), np.nan)), HEADER, "nan", "error"),
    # Time
    (
        "a gap",
        lambda t: rows(t, (np.arange(n(t)) < 1000) | (np.arange(n(t)) > 1100)),
        HEADER,
        "gap",
        "warning",
    ),
    ("many gaps", lambda t: rows(t, np.arange(n(t)) % 500 > 20), HEADER, "gap", "warning"),
    (
        "duplicate times",
        lambda t: with_(t, time=put(t["time"], 200, t["time"][199])),
        HEADER,
        "duplicate-time",
        "warning",
    ),
    (
        "duplicate rows",
        lambda t: {k: np.insert(v, [300, 600], v[[300, 600]]) for k, v in t.items()},
        HEADER,
        "duplicate-time",
        "warning",
    ),
    (
        "coarse clock",
        lambda t: with_(t, time=np.floor(t["time"] * 100) / 100),
        HEADER,
        "duplicate-time",
        "error",
    ),
    (
        "time goes back",
        lambda t: with_(t, time=t["time"] - 0.5 * (t["time"] > 1.5)),
        HEADER,
        "backward-time",
        "error",
    ),
    (
        "two records in one",
        lambda t: {k: np.concatenate([v, v]) for k, v in t.items()},
        HEADER,
        "backward-time",
        "error",
    ),
    ("rows shuffled", lambda t: rows(t, rng().permutation(n(t))), HEADER, "backward-time", "error"),
    (
        "two rows swapped",
        lambda t: rows(t, np.r_[0:700, 701, 700, 702 : n(t)]),
        HEADER,
        "backward-time",
        "error",
    ),
    ("lost samples", lambda t: rows(t, rng().random(n(t)) > 0.2), HEADER, "irregular-sampling", "warning"),
    (
        "jitter of 30 %",
        lambda t: with_(t, time=t["time"] + 3e-4 * rng().random(n(t))),
        HEADER,
        "irregular-sampling",
        "warning",
    ),
    (
        "jitter of 5 %",
        lambda t: with_(t, time=t["time"] + 5e-5 * rng().random(n(t))),
        HEADER,
        "jitter",
        "note",
    ),
    ("ms, no unit", lambda t: with_(t, time=t["time"] * 1e3), BARE, "time-unit", "error"),
    (
        "ms, velocity named",
        lambda t: with_(t, time=t["time"] * 1e3),
        HEADER | {"time": "time"},
        "time-unit",
        "error",
    ),
    ("us, no unit", lambda t: with_(t, time=t["time"] * 1e6), BARE, "time-unit", "error"),
    ("ms called s", lambda t: with_(t, time=t["time"] * 1e3), HEADER, "time-unit", "error"),
    ("s called ms", lambda t: t, HEADER | {"time": "time [ms]"}, "time-unit", "warning"),
    ("too few rows", lambda t: rows(t, np.arange(n(t)) < 12), HEADER, "too-short", "error"),
]
