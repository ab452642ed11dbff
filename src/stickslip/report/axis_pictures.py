"""Pictures of an axis: records and their simulation, residuals, and the friction curve with its band."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.record import Record
from stickslip.identification.estimate import Identification, Picture, Trace
from stickslip.identification.monte_carlo import curve_band, resisting_torque
from stickslip.identification.output_error.problem import PLACE, measured
from stickslip.identification.output_error.search import FittedAxis
from stickslip.identification.regression.inverse import InverseDynamics
from stickslip.report.axis_evidence import measured_friction, slow_rows
from stickslip.report.plots import envelope, quantity
from stickslip.report.sliding_torque import Sliding, over_all_rows, sliding_of
from stickslip.report.torque_pictures import friction_points, over_velocity, stretch, whole_record
from stickslip.simulation.recorded_input.simulation import Mechanics

Array = np.ndarray[Any, np.dtype[np.float64]]

BINS, FEWEST = 60, 5
FAR = 20.0
"""Multiple of the motion by which its first position may differ from 0."""
SHOWN = 4
"""Number of records that are drawn separately; the residuals contain all."""


def data_pictures(records: Sequence[Record], names: Sequence[str]) -> tuple[Picture, ...]:
    """Draw position and drive signal of the first records over time."""
    out: list[Picture] = []
    for place, record in enumerate(records[:SHOWN]):
        seconds = float(record.time[-1] - record.time[0])
        # The value of a clock that has run for long is meaningless.
        late = abs(record.time[0]) > seconds
        time = record.time - (record.time[0] if late else 0.0)
        for channel in ("position", "torque", "motor_torque", "current", "voltage"):
            if channel not in record.channels or not np.any(np.isfinite(record[channel])):
                continue
            values, words = record[channel], channel.replace("_", " ")
            # A small motion far from 0 is shown relative to its start.
            far = channel == "position" and abs(values[0]) > FAR * np.ptp(values)
            if far:
                values, words = values - values[0], "position from the first"
            traces = [over_time("measured", time, values)]
            # A constant reference belongs to an open loop.
            if (
                channel == "position"
                and not far
                and np.ptp(record.channels.get("position_reference", np.zeros(1))) > 0.0
            ):
                traces = [
                    over_time("measured", time, record[channel]),
                    over_time("reference", time, record["position_reference"]),
                ]
            out.append(Picture(
                f"data-{place + 1}-{channel}", f"{names[place]}: {channel.replace('_', ' ')}",
                f"{len(record)} samples over {seconds:.4g} s", "time from the first sample (s)" if late else "time (s)",
                f"{words} ({record.units[channel]})", tuple(traces),
            ))  # fmt: skip
    return tuple(out)


def over_time(label: str, time: Array, signal: Array) -> Trace:
    """Return a signal thinned to the resolution of a picture."""
    good = np.isfinite(signal)
    x, y = envelope(time[good], signal[good])
    return Trace(label, x, y)


def pictures_of(
    found: Identification, speeds: Mapping[str, Sequence[float]] | None = None
) -> tuple[Picture, ...]:
    """Return the method's own pictures, and those for a whole axis and for a law with intervals.

    `speeds` are deciles of the recorded ones in each direction, marked at the curve.
    """
    output, inverse = found.details.get("output"), found.details.get("inverse")
    out = list(found.pictures)
    sliding = sliding_of(found) or over_all_rows(found)
    whole = isinstance(output, FittedAxis) or isinstance(inverse, InverseDynamics)
    if found.model is not None and found.model.law.steady and whole:
        band = curve_picture(found, fastest(output, inverse), sliding, speeds or {})
        out += [band] if band else []
    if sliding is not None:
        out += torque_pictures(found, sliding)
    if isinstance(output, FittedAxis) and tells(found, output, sliding):
        out += [*fits(output), *output_residuals(output)]
    return tuple(out)


def tells(found: Identification, output: FittedAxis, sliding: Sliding | None) -> bool:
    """Whether the simulated position shows the quality of the model: driven by the recorded torque alone it drifts."""
    minimised = "prediction" not in found.details and not (sliding is not None and sliding.certain)
    return minimised or all(t.closed_loop for t in output.problem.experiments)


def torque_pictures(found: Identification, sliding: Sliding) -> list[Picture]:
    """Draw measured and model torque over time and velocity, and the residual."""
    motion = motion_of(found)
    unit, angle, speed = ("N", "m", "m/s") if motion == "linear" else ("N·m", "rad", "rad/s")
    curve = over_velocity(sliding, found, motion)
    several = len(sliding.whole) > 1
    out = [stretch(sliding, motion), *([curve] if curve else [])]
    for number in range(min(len(sliding.whole), SHOWN)):
        out.append(whole_record(sliding, motion, number, f"record {number + 1}" if several else ""))
    wanted = f"model minus measured {'force' if motion == 'linear' else 'torque'} ({unit})"
    return [*out, *residuals(
        "torque", wanted, sliding.residual, sliding.position, sliding.velocity, sliding.time, angle, speed
    )]  # fmt: skip


def motion_of(found: Identification) -> str:
    """Return "rotary" or "linear"."""
    return str(getattr(found.details.get("axis"), "motion", "rotary"))


def fastest(output: Any, inverse: Any) -> float:
    """Return the largest speed of the records, rad/s."""
    if isinstance(inverse, InverseDynamics):
        return float(np.max(np.abs(inverse.velocity)))
    runs = output.problem.simulated(output.u)
    return max(float(np.nanmax(np.abs(run[:, 1]))) for run in runs)


# ---- what was measured and what the fitted axis does ------------------------------------------------------------


def fits(output: FittedAxis) -> list[Picture]:
    """Draw measured and simulated signals of the first records over time."""
    out: list[Picture] = []
    problem = output.problem
    runs = problem.simulated(output.u) or []
    for place, (run, experiment) in enumerate(zip(runs[:SHOWN], problem.experiments[:SHOWN], strict=True)):
        for signal in problem.signals:
            seen, simulated = measured(experiment, signal), run[:, PLACE[signal]]
            off = float(np.sqrt(np.mean((simulated - seen)[experiment.rows] ** 2)))
            unit = problem.units[signal]
            out.append(Picture(
                f"fit-{place + 1}-{signal}", f"{Path(experiment.name).name}: {signal}, measured and simulated",
                f"Root mean square of the difference: {quantity(off, unit)}", "time (s)", f"{signal} ({unit})",
                (over_time("measured", experiment.time, seen), over_time("simulated", experiment.time, simulated)),
            ))  # fmt: skip
    return [*out, *close_up(output, runs)]


def close_up(output: FittedAxis, runs: Sequence[Array]) -> list[Picture]:
    """Draw the slow motion of the first record, because in a picture of the whole record friction is only a line's
    width."""
    out: list[Picture] = []
    problem = output.problem
    experiment = problem.experiments[0]
    rows = slow_rows(experiment)
    if rows is None or not runs:
        return out
    time = experiment.time[rows]
    for signal in problem.signals:
        seen, simulated = measured(experiment, signal)[rows], runs[0][rows, PLACE[signal]]
        off = float(np.sqrt(np.mean((simulated - seen) ** 2)))
        unit = problem.units[signal]
        out.append(Picture(
            f"slow-{signal}", f"{Path(experiment.name).name}: {signal} in slow motion, measured and simulated",
            f"Root mean square of the difference here: {quantity(off, unit)}", "time (s)", f"{signal} ({unit})",
            (over_time("measured", time, seen), over_time("simulated", time, simulated)),
        ))  # fmt: skip
    return out


def output_residuals(output: FittedAxis) -> list[Picture]:
    """Draw residuals of every signal over position, velocity and time."""
    problem = output.problem
    runs = problem.simulated(output.u) or []
    position = np.concatenate([t.position[t.rows] for t in problem.experiments])
    velocity = np.concatenate([run[:, 1][t.rows] for run, t in zip(runs, problem.experiments, strict=True)])
    time = np.concatenate([(t.time - t.time[0])[t.rows] for t in problem.experiments])
    out: list[Picture] = []
    axis = problem.axis
    for signal in problem.signals:
        rest = np.concatenate([
            (run[:, PLACE[signal]] - measured(t, signal))[t.rows]
            for run, t in zip(runs, problem.experiments, strict=True)
        ])  # fmt: skip
        label = f"simulated minus measured {signal} ({problem.units[signal]})"
        out += residuals(
            signal, label, rest, position, velocity, time, axis.unit("rad"), axis.unit("rad/s"),
        )  # fmt: skip
    return out


# ---- residuals ----------------------------------------------------------------------------------------------------


def residuals(
    signal: str, label: str, rest: Array, position: Array, velocity: Array, time: Array, angle: str, speed: str
) -> list[Picture]:  # fmt: skip
    """Draw the mean and the central 90 % of a residual in bins of position, velocity and time."""
    rms, unit = float(np.sqrt(np.mean(rest**2))), label.rpartition(" (")[2].rstrip(")")
    out: list[Picture] = []
    for name, x, x_label in (
        ("position", position, f"position ({angle})"), ("velocity", velocity, f"velocity ({speed})"),
        ("time", time, "time (s)"),
    ):  # fmt: skip
        centre, low, mean, high = binned(x, rest)
        if centre.size < 2:
            continue
        # Share of the residual's variance that a trend over x explains: if it is large, the model lacks a dependence on
        # x.
        share = float(np.var(np.interp(x, centre, mean)) / max(np.var(rest), 1e-300))
        word = f"a mean over {name} explains {100.0 * min(share, 1.0):.0f} % of its variance"
        traces = (
            Trace("middle 90 %", centre, low, "band", high), Trace("mean", centre, mean),
            Trace("", centre[[0, -1]], np.zeros(2)),
        )  # fmt: skip
        out.append(Picture(
            f"residual-{signal}-over-{name}", f"Residual of the {signal} over {name}",
            f"Root mean square {quantity(rms, unit)}; {word}", x_label, label, traces,
        ))  # fmt: skip
    return out


def binned(x: Array, y: Array) -> tuple[Array, Array, Array, Array]:
    """Return centres of equal bins of x with enough samples, and their 5 %, mean and 95 % of y."""
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if x.size == 0 or np.ptp(x) == 0.0:
        none = np.zeros(0)
        return none, none, none, none
    group = np.minimum((BINS * (x - x.min()) / np.ptp(x)).astype(np.int64), BINS - 1)
    order = np.argsort(group, kind="stable")
    parts = np.split(order, np.searchsorted(group[order], np.arange(1, BINS)))
    rows = [p for p in parts if p.size >= FEWEST]
    columns = [
        (float(np.mean(x[p])), *np.percentile(y[p], [5.0, 95.0]).tolist(), float(np.mean(y[p]))) for p in rows
    ]
    table = np.array(columns).reshape(-1, 4)
    return table[:, 0], table[:, 1], table[:, 3], table[:, 2]


# ---- the law ------------------------------------------------------------------------------------------------------


def curve_picture(
    found: Identification, top: float, sliding: Sliding | None = None,
    speeds: Mapping[str, Sequence[float]] | None = None,
) -> Picture | None:  # fmt: skip
    """Draw the law at constant velocity with its 95 % band, measured friction, and marks of the recorded speeds."""
    assert found.model is not None
    if not (math.isfinite(top) and top > 0.0):
        return None
    own = [e for e in found.estimates if e.name.partition("[")[0] in {f.name for f in found.model.law.fields}]
    if not own:
        return None
    places = [i for i, e in enumerate(found.estimates) if e in own]
    grid = np.geomspace(1e-3 * top, top, 150)
    known = found.correlation[np.ix_(places, places)]
    best = [side * resisting_torque(found.model, side * grid) for side in (1.0, -1.0)]
    same = bool(np.allclose(*best, rtol=1e-6))
    traces: list[Trace] = []
    banded = False
    for side, curve in zip((1.0, -1.0), best[:1] if same else best, strict=False):
        word = "" if same else f", v {'>' if side > 0.0 else '<'} 0"
        drawn = side * curve_band(found.model, own, known, side * grid)
        # With poorly determined parameters, no valid law may remain at some speed.
        if np.all(np.any(np.isfinite(drawn), axis=0)):
            banded = True
            low, high = np.nanpercentile(drawn, [2.5, 97.5], axis=0)
            traces.append(Trace(f"95 % band{word}", grid, low, "band", high))
        traces.append(Trace(f"best fit{word}", grid, curve))
    points = points_of(found, sliding)
    traces += [*points, *marks(speeds or {}, float(grid[0]), float(grid[-1]))]
    unit = getattr(found.details["axis"], "unit", str)
    unsure = ", ".join(e.name for e in own if not e.identified)
    message = f"Not identified: {unsure}." if unsure else "Every parameter of the law is identified."
    return Picture(
        "sliding-curve", f"Friction at constant velocity: {found.model.law.title or found.model.law.name}",
        f"{message}{' The band contains 95 % of the laws that are consistent with the data.' if banded else ''}"
        f"{' Points: as measured.' if points else ''}", f"velocity ({unit('rad/s')})",
        f"friction torque ({unit('N·m')})",
        tuple(traces), "log",
    )  # fmt: skip


def marks(speeds: Mapping[str, Sequence[float]], low: float, high: float) -> list[Trace]:
    """Return 50 quantiles of the recorded speeds for the curve, interpolated from the deciles."""
    if not speeds:
        return []
    x = np.concatenate(
        [np.interp(np.linspace(0.0, 10.0, 51), np.arange(11), each) for each in speeds.values()]
    )
    x = np.sort(x[(x >= low) & (x <= high)])
    return [Trace("recorded speeds", x, np.zeros(x.size), "rug")]


def points_of(found: Identification, sliding: Sliding | None = None) -> list[Trace]:
    """Return measured friction points for the curve; none if it depends on more than the speed."""
    inverse, mechanics = found.details.get("inverse"), found.details.get("mechanics")
    if not isinstance(inverse, InverseDynamics) or (
        isinstance(mechanics, Mechanics) and mechanics.load_motor > 0.0
    ):
        return []
    known = mechanics if isinstance(mechanics, Mechanics) else None
    if sliding is not None and sliding.certain and known is not None:
        sides = friction_points(sliding, float(known.offset))
    else:
        sides = measured_friction(inverse, known)
    kinds = (("measured, v > 0", "points"), ("measured, v < 0", "open points"))
    return [Trace(label, x, y, kind) for (label, kind), (x, y) in zip(kinds, sides, strict=True) if x.size]
