"""The sliding curve of a commissioned machine: the points at which it really slid, and the curve that holds them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.identification.estimate import Estimate, Identification, Picture, Trace
from stickslip.identification.steady_friction.choice import choose_sliding
from stickslip.identification.steady_friction.curve import identify_sliding
from stickslip.identification.steady_friction.points import SlidingPoints
from stickslip.identification.steady_friction.segments import Segment, constant_velocity_segments
from stickslip.models.model import Model
from stickslip.rigs.procedures.resting import RESTING, resting
from stickslip.simulation.prescribed.steady import Steady

Array = np.ndarray[Any, np.dtype[np.float64]]

STANDING = 0.7
"""Share of the time at rest from which the mean torque is no friction any more. On thesis-grease that mean lies within
2 % of the sliding curve up to a share of 0.67 (0.014 rad/s), 4 % too low at 0.74, and 10 % too low at 0.005 rad/s."""
ALIKE = 0.1
"""Of the torque at the slowest speed without sticking, by which break-away may differ from it: where an axis sticks and
slips, friction is between the two, and their mean over time is the sliding torque only where they are alike."""
CLOSE = 0.015
"""Largest error of a curve by parameters; beyond it the curve is the table of the points."""
FEW = 6
"""Points up to which a curve with five parameters takes its noise from the runs themselves."""
ELEMENTS = {"k": [300.0], "alpha": [1.0], "c": 50.0}


@dataclass(frozen=True, eq=False)
class Slid:
    """Runs of constant velocity in which the axis slid.

    Attributes
    ----------
    points : SlidingPoints
        Mean of both directions at every speed.
    std : array, shape (n,)
        Of these means, N·m: from the parts of each run, so that what varies over a revolution counts in full.
    segments : list of Segment
    notes : list of str
    """

    points: SlidingPoints
    std: Array
    segments: list[Segment]
    notes: list[str]


def moving(record: Record, fs: float, resolution: float = 0.0) -> Slid:
    """Mean torque per speed, both directions folded, and the runs; without the speeds whose mean is no sliding torque.

    These are the speeds at which the axis mostly stood in a direction, ran in one direction only, or stuck and slipped
    in a direction where the break-away torque `fs` (N·m) is another than that of sliding. `resolution` is that of the
    encoder, rad.
    """
    by_speed: dict[float, list[Segment]] = {}
    for s in constant_velocity_segments(record):
        by_speed.setdefault(_speed(record, s), []).append(s)
    single = sorted(v for v, runs in by_speed.items() if len({s.velocity > 0.0 for s in runs}) < 2)
    rest = {
        v: max(_resting(record, s, resolution) for s in runs)
        for v, runs in sorted(by_speed.items())
        if v not in single
    }
    steady = [v for v, share in rest.items() if share <= RESTING]
    level = np.mean([abs(s.torque) for s in by_speed[steady[0]]]) if steady else math.inf
    alike = abs(fs / float(level) - 1.0) <= ALIKE
    speeds = [v for v, share in rest.items() if share <= (STANDING if alike else RESTING)]
    if len(speeds) < 4:
        raise InputError("sliding: the axis slid steadily at fewer than 4 speeds; run it faster")
    torque = np.array([float(np.mean([abs(s.torque) for s in by_speed[v]])) for v in speeds])
    std = np.array([math.hypot(*(s.std for s in by_speed[v])) / len(by_speed[v]) for v in speeds])
    slid = [s for v in speeds for s in by_speed[v]]
    notes = [f"{len(slid)} runs at {len(speeds)} speeds, mean of both directions."]
    if stuck := [v for v in speeds if rest[v] > RESTING]:
        notes.append(f"Stuck and slipped at {_listed(stuck)}: the torque there is the mean of both.")
    if single:
        notes.append(f"Ran in one direction only, left out: {_listed(single)}.")
    if left := [v for v in rest if v not in speeds]:
        why = "Mostly stood" if alike else "Stuck and slipped, where the mean torque is none of sliding"
        notes.append(
            f"{why}, left out with both directions: {_listed(left)}; there the curve is not measured."
        )
    return Slid(SlidingPoints(np.array(speeds), torque), std, slid, notes)


def _speed(record: Record, s: Segment) -> float:
    """That was asked for, where the record says so: what was measured differs between the directions."""
    if "velocity_reference" not in record.channels:
        return float(f"{abs(s.velocity):.2g}")
    inside = (record.time >= s.start) & (record.time <= s.end)
    return float(f"{abs(float(np.median(record['velocity_reference'][inside]))):.6g}")


def _resting(record: Record, s: Segment, resolution: float) -> float:
    """Share of the time in which the axis all but stands, by the record's own rows."""
    inside = (record.time >= s.start) & (record.time <= s.end)
    return resting(record.time[inside], record["position"][inside], s.velocity, resolution)


def _listed(speeds: list[float]) -> str:
    return f"{', '.join(f'{v:g}' for v in speeds)} rad/s"


def fitted_curve(runs: Slid, fs: float, fs_std: float) -> tuple[Mapping[str, float], Identification]:
    """A Stribeck curve, as some methods need one, and the curve that is nearest: by parameters, else the table.

    The mean break-away torque `fs` (N·m, with its standard deviation) counts as the torque at zero velocity (thesis
    4.3.1.1.2).
    """
    slid = runs.points
    points = SlidingPoints(np.array([0.0]), np.array([fs])) + slid
    level, fast = float(np.median(points.torque)), float(np.max(points.velocity))
    stribeck = Model(
        "gms", {}, **ELEMENTS, fs=float(points.torque[0]), fc=level, vs=0.1, delta_s=1.0, sigma2=0.01
    )
    # As many points as parameters leave no residual that tells the noise.
    noise = float(np.mean(runs.std)) if len(points) <= FEW else None
    plain = identify_sliding(points, stribeck, noise=noise, starts=20)
    best = plain
    if error(plain, slid) > CLOSE:
        templates = {"stribeck": stribeck, **_flexible(level, fast)}
        _, best, _ = choose_sliding(points, templates, noise=noise, starts=20)
    if best.model is None or error(best, slid) > CLOSE:
        best = _table(runs, fs, fs_std, best)
    return simple(slid, fs), dataclasses.replace(best, notes=(*runs.notes, *best.notes))


def simple(slid: SlidingPoints, fs: float) -> dict[str, float]:
    """Break-away, Coulomb and viscous torque, joined at the slowest speed: a curve that every method takes."""
    slope, level = np.polyfit(slid.velocity, slid.torque, 1, w=1.0 / np.sqrt(slid.velocity)).tolist()
    return {
        "fs": fs,
        "fc": float(level),
        "vs": float(slid.velocity[0]),
        "delta_s": 2.0,
        "sigma2": max(float(slope), 0.0),
    }


def _flexible(level: float, fast: float) -> dict[str, Model]:
    """Thesis eqs. 4.4 and 4.5, on the scales of the points."""
    viscous: dict[str, Any] = {"sigma2": 0.01 * level / fast, "fv2": 0.1 * level, "delta_v": 0.5}
    choices = {"viscous": "power"}
    return {
        "eq. 4.4": Model(
            "gms", {"curve": "double_exponential", **choices}, **ELEMENTS, alpha0=0.5 * level, alpha1=0.3 * level,
            alpha2=0.3 * level, v1=0.1, v2=0.3, **viscous,
        ),
    }  # fmt: skip


def error(found: Identification, points: SlidingPoints) -> float:
    """Largest relative error of a curve at the points."""
    if found.model is None:
        return math.inf
    model = found.model
    steady = Steady(model.law, points.velocity, points.side)
    torque = steady.torque(np.array(model.law.pack(model.parameters)))
    return float(np.max(np.abs(torque / points.torque - 1.0)))


def _table(runs: Slid, fs: float, fs_std: float, tried: Identification) -> Identification:
    """The points themselves, joined by a monotone cubic; break-away at rest, constant beyond the fastest."""
    points = runs.points
    torque, std = [fs, *points.torque.tolist()], [fs_std, *runs.std.tolist()]
    model = Model(
        "gms", {"curve": "table"}, **ELEMENTS, sigma2=0.0, curve_velocity=[0.0, *points.velocity.tolist()],
        curve_torque=torque,
    )  # fmt: skip
    note = (
        f"No curve by parameters came within {100 * CLOSE:g} % of every point (nearest "
        f"{100 * error(tried, points):.2g} %): the curve is the table of the points."
    )
    estimates = tuple(point_of(i, t, s) for i, (t, s) in enumerate(zip(torque, std, strict=True)))
    return dataclasses.replace(
        tried, model=model, notes=(note,), estimates=estimates, correlation=np.eye(len(estimates)), measure_next=(),
        pictures=(_picture(points, fs, model),),
        misfit={"rms_Nm": 0.0, "points": float(len(points))},
    )  # fmt: skip


def point_of(i: int, torque: float, std: float) -> Estimate:
    """A point of the table with its interval."""
    low, high = torque - 1.96 * std, torque + 1.96 * std
    why = "" if low > 0.0 and high <= 2.0 * low else "its interval is too wide"
    return Estimate(f"curve_torque[{i}]", "N·m", "s", torque, std, low, high, not why, why)


def _picture(points: SlidingPoints, fs: float, model: Model) -> Picture:
    """The table with its points over the velocity (thesis figures 4.9, 4.33)."""
    low, high = float(points.velocity[0]), float(points.velocity[-1])
    v = np.geomspace(0.3 * low, high, 300)
    torque = Steady(model.law, v, np.ones(v.size)).torque(np.array(model.law.pack(model.parameters)))
    traces = (
        Trace("measured", points.velocity, points.torque, "points"), Trace("table", v, torque),
        Trace("break-away at rest", np.array([0.3 * low]), np.array([fs]), "open points"),
    )  # fmt: skip
    return Picture(
        "sliding", "Sliding curve: table of the points",
        f"Mean of both directions, {float(points.torque.min()):.3g} to {float(points.torque.max()):.3g} N·m",
        "velocity (rad/s)", "friction torque (N·m)", traces, "log",
    )  # fmt: skip
