"""Draw the map of stability: gain against sample time, and gain against the filter's corner."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stickslip.analyse.controller_margins import ControllerStability
from stickslip.analyse.stability import SLOW
from stickslip.analyse.stability_result import FILTERS, GAINS, TIMES, Map, Stability
from stickslip.report.plots import Curve, Panel
from stickslip.report.styles import Style
from stickslip.studies.stability_map import FINE, FINE_GAINS, OPEN, Confirmed

Array = np.ndarray[Any, np.dtype[np.float64]]

ONE = Style("#000000", (0, (1, 1.5)), 1.2)
NOW = Style("#000000", (0, (4, 1.5)), 1.0)
SAFE = LINE = Style("#000000", "-", 1.0)
AREAS = {
    "stable": Style("#56B4E9"), "unstable: oscillates": Style("#E69F00"), "unstable: creeps away": Style("#CC79A7"),
}  # fmt: skip


def picture_of_stability(found: Stability) -> tuple[str, str, Sequence[Panel], float]:
    """Return the picture of the regions in which the stiffest compensator's loop is stable, rings or creeps away."""
    name, drive = found.time_map.name, found.drive
    now = Curve(np.array([1e3 * drive.sample_time]), np.zeros(1), "this drive", NOW, "vertical")
    advice = found.recommended[name]
    safe: list[Curve] = []
    if advice and advice.filter_hz:
        safe = [Curve(np.array([advice.filter_hz]), np.array([advice.gain]), "recommended", SAFE, "points")]
    panels = (
        Panel(
            [*_areas(1e3 * TIMES, found.time_map), _one(1e3 * TIMES), now], "gain", "sample time (ms)",
            (1e3 * float(TIMES[0]), 1e3 * float(TIMES[-1])), (0.0, float(GAINS[-1])), f"{name}, no filter", "log",
        ),
        Panel(
            [*_areas(FILTERS, found.filter_map), _one(FILTERS), *safe], "gain", "corner of the filter (Hz)",
            (float(FILTERS[0]), float(FILTERS[-1])), (0.0, float(GAINS[-1])),
            f"{name}, {1e3 * drive.sample_time:g} ms", "log",
        ),
    )  # fmt: skip
    title = f"Stable gain of feedback with the {name} law"
    return title, _message(found, name), panels, 2.0


def picture_of_controller(found: ControllerStability) -> tuple[str, str, Sequence[Panel], float]:
    """Return the picture of the transfer function of a controller made of control laws."""
    f = found.frequency
    ends = (float(f[0]), float(f[-1]))
    size, turn = np.abs(found.response), np.degrees(np.unwrap(np.angle(found.response)))
    panels = (
        Panel([Curve(f, size, "", LINE)], "gain (N·m/rad)", x_limits=ends, x_scale="log", y_scale="log"),
        Panel([Curve(f, turn, "", LINE)], "phase (°)", "frequency (Hz)", ends, x_scale="log"),
    )
    said = "; ".join(
        f"{loop.name}: {'stable' if loop.poles.stable else 'unstable'}, {loop.poles.growth:+.0f}/s at "
        f"{loop.poles.frequency:.0f} Hz"
        for loop in found.loops
    )
    return "From error to torque, while the contact sticks", said, panels, 2.0


def picture_of_confirmed(found: Confirmed) -> tuple[str, str, Sequence[Panel], float]:
    """Return the picture with predictions by poles as areas and the virtual rig's results as points."""
    panels: list[Panel] = []
    for region in found.maps:
        points = found.of(region.name)
        marks = [
            Curve(
                np.array([p.filter_hz or OPEN for p in points if p.calm == calm]),
                np.array([p.gain for p in points if p.calm == calm]), words, Style("#000000", "-", 0.8), kind,
            )
            for calm, words, kind in ((True, "simulated: calm", "open points"), (False, "simulated: moves", "points"))
        ]  # fmt: skip
        panels.append(Panel(
            [*_areas(FINE, region, FINE_GAINS), *marks], "gain", "corner of the filter (Hz); the last column has none",
            (float(FINE[0]), 1.05 * float(FINE[-1])), (float(FINE_GAINS[0]), float(FINE_GAINS[-1])), region.name, "log",
        ))  # fmt: skip
    agreed = sum(p.agrees for p in found.points)
    message = f"{agreed} of {len(found.points)} settings behave on the virtual rig as the poles predict"
    return f"Feedback at rest on {found.machine}", message, panels, 1.5


def _areas(x: Array, region: Map, gains: Array = GAINS) -> list[Curve]:
    """Return one area for each kind of result, without overlap."""
    stable = -region.growth / np.maximum(np.abs(region.growth), 1.0)
    creeps = np.where((region.growth > 0.0) & (region.frequency < SLOW), 1.0, -1.0)
    rings = np.where((region.growth > 0.0) & (region.frequency >= SLOW), 1.0, -1.0)
    values = dict(zip(AREAS, (stable, rings, creeps)))
    return [Curve(x, gains, name, style, "area", values[name]) for name, style in AREAS.items()]


def _one(x: Array) -> Curve:
    return Curve(np.array([x[0], x[-1]]), np.ones(2), "gain 1", ONE)


def _message(found: Stability, name: str) -> str:
    alone, advice = found.linear.at_one, found.recommended[name]
    static = next(m.static for m in found.margins if m.name == name)
    first = f"the stiffness is negative above gain {static:.2f}; "
    if advice:
        sieve = f"a filter of {advice.filter_hz:g} Hz" if advice.filter_hz else "no filter"
        return f"{first}safe: gain {advice.gain:g} with {sieve}"
    if not alone.stable:
        return f"{first}the linear controller alone oscillates ({alone.growth:+.0f}/s at {alone.frequency:.0f} Hz)"
    return f"{first}no tested setting keeps its margins"
