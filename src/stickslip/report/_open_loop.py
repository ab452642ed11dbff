"""Further figures of a study: friction over velocity in open loop, and comparisons of controllers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from stickslip.control.controller import Controller
from stickslip.control.linear import Gains
from stickslip.core.record import Record
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.report._view import StudyView
from stickslip.report.figures import COMMON, Figure, describe, heading, named
from stickslip.report.plots import Array, Curve, Panel, draw, envelope, one_prefix
from stickslip.report.styles import Style, style_of, styles_of
from stickslip.simulation.closed_loop import simulate
from stickslip.simulation.prescribed.open_loop import respond
from stickslip.studies.open_loop import Drive, Response
from stickslip.studies.plan import Study, load
from stickslip.studies.result import StudyResult

NEAR_ZERO = 0.04  # rad/s, the range shown in the thesis for comparing laws
GRID = 20_000  # instants of a response
PLANT = {
    "nominal": Style("#000000", "-", 2.2),
    "plus10": Style("#D55E00", (0, (5, 1.5)), 1.2),
    "minus10": Style("#0072B2", (0, (2, 1)), 1.2),
}
UNITS = {"position": "rad", "velocity": "rad/s"}
WINDOWS = {"3.18": 1.0, "3.19": 0.5}  # periods of the reference shown in the thesis


def planned(result: StudyResult) -> Study | None:
    """Return the study of a folder, read from the copies of its inputs."""
    inputs = result.manifest.get("inputs", [])
    if not inputs:
        return None
    copies = {entry["written"]: result.folder / entry["copy"] for entry in inputs}
    return load(result.folder / inputs[0]["copy"], copies)


def response_figures(view: StudyView, folder: Path) -> Iterator[Figure]:
    """Draw friction over velocity of laws for the same motion (thesis figures 3.5, 3.10 to 3.14, 3.20).

    The slip rules agree here: a prescribed motion does not reverse within the few milliseconds in which they
    differ.
    """
    known: dict[str, tuple[Array, Array]] = {}
    study = planned(view.result) if view.result.config.get("responses") else None
    plants = {name: view.edition.frictions.get(name, name) for name in view.frictions}
    for response in study.responses if study else ():
        stem = folder / COMMON / named(response.figure, f"response-{response.name}")
        loops = {name: _loop(model, response, known) for name, model in response.models.items()}
        near = view.edition.near_zero and any(name not in view.frictions for name in loops)
        curves = [_loop_curve(n, x, y, near, plants.get(n, ""), len(loops)) for n, (x, y) in loops.items()]
        limits = (-NEAR_ZERO, NEAR_ZERO) if near else None
        title = heading(response.figure, response.title)
        plant = near and next(iter(loops)) in view.frictions
        called = {n: plants.get(n, n) for n in loops} if not near else {}
        message = _gap(loops, near, "the plant" if plant else next(iter(loops)), called)
        draw(stem, title, message, [Panel(curves, "friction torque (N·m)", "velocity (rad/s)", limits)], 2.7)
        caption = f"Along {describe(response.motion.as_dict())}. {message}."
        yield Figure(stem.name.removeprefix("figure-"), response.figure, title, caption, COMMON, stem)


def _loop(model: Model, response: Response, known: dict[str, tuple[Array, Array]]) -> tuple[Array, Array]:
    """Return velocity (rad/s) and torque (N·m) in the second half of the response, after the first loading."""
    key = f"{model!r} {response.motion!r} {response.duration}"
    if key not in known:
        record = respond(
            model, response.motion, np.linspace(0.0, response.duration, GRID + 1), tolerance=1e-8
        )
        late = record.time >= 0.5 * response.duration
        known[key] = record["velocity"][late], record["friction_torque"][late]
    return known[key]


def _loop_curve(name: str, x: Array, y: Array, near: bool, plant: str, count: int) -> Curve:
    if near:
        # Only the visible part, which keeps the detail in the file; gaps separate the passes.
        outside = np.abs(x) > 1.3 * NEAR_ZERO
        keep = ~(outside & np.roll(outside, 1))
        x, y = np.where(outside, np.nan, x)[keep], y[keep]
    else:
        # Away from zero velocity a loop is smooth: keep points that move by the width of a dot.
        dots = np.cumsum(np.hypot(np.diff(x, prepend=x[0]) / np.ptp(x), np.diff(y, prepend=y[0]) / np.ptp(y)))
        keep = np.append(np.diff(np.floor(dots * 800.0)) > 0, True)
        x, y = x[keep], y[keep]
    style = PLANT.get(name, PLANT["nominal"]) if plant else law_style(name)
    label = f"{name} law" if not plant else "plant" if near else plant
    if count == 1 or (near and not plant):
        style = replace(style, width=1.1)
    return Curve(x, y, label if count > 1 else "", style)


def law_style(name: str) -> Style:
    """Return the style of a law drawn over the plant: its colour, dashed, because the plant's line is below."""
    return replace(style_of(name), dashes=(0, (4, 1.2)), width=1.4, mark="")


def _gap(loops: dict[str, tuple[Array, Array]], near: bool, first: str, called: Mapping[str, str]) -> str:
    """Return the largest difference from the first loop, in the visible part; `called`: names of the legend."""
    (_, (x, torque)), *others = loops.items()
    shown = np.abs(x) <= NEAR_ZERO if near else np.ones(x.size, np.bool_)
    gaps = {name: float(np.max(np.abs(y - torque)[shown])) for name, (_, y) in others}
    words = ", ".join(
        f"{called.get(name, name)} {gap:.3g} N·m" if len(gaps) > 1 else f"{gap:.3g} N·m"
        for name, gap in gaps.items()
    )
    return (
        f"Largest difference from {called.get(first, first)}: {words}"
        if words
        else f"Peak torque {np.max(np.abs(torque)):.4g} N·m"
    )


def drive_figures(view: StudyView, folder: Path) -> Iterator[Figure]:
    """Draw positions of axes with the same motor torque (thesis figure 3.12)."""
    study = planned(view.result) if view.result.config.get("drives") else None
    for drive in study.drives if study else ():
        records = {name: _driven(axis, drive) for name, axis in drive.axes.items()}
        factor, prefix = one_prefix(max(float(np.ptp(r["position"])) for r in records.values()))
        labels = {n: "plant" if n in view.frictions else f"{n} law" for n in records}
        curves = [
            Curve(*envelope(r.time, factor * r["position"]), labels[n], style)
            for n, r in records.items()
            for style in [PLANT["nominal"] if n in view.frictions else law_style(n)]
        ]
        title = heading(drive.figure, drive.title)
        peaks = ", ".join(
            f"{labels[n]} {factor * float(np.max(r['position'])):.4g} {prefix}rad" for n, r in records.items()
        )
        stem = folder / COMMON / named(drive.figure, f"drive-{drive.name}")
        panel = Panel(curves, f"position ({prefix}rad)", "time (s)", (0.0, drive.duration))
        draw(stem, title, f"Largest position: {peaks}", [panel], 2.7)
        caption = (
            f"Open loop under {drive.amplitude:g} N·m at {drive.frequency:g} Hz. Largest position: {peaks}. Gross "
            "sliding dominates the record; the presliding stiffness is visible only near the turning points."
        )
        yield Figure(stem.name.removeprefix("figure-"), drive.figure, title, caption, COMMON, stem)


def _driven(axis: RigidAxis, drive: Drive) -> Record:
    """Simulate the axis with T_m = amplitude sin(2 pi f t), by a controller that outputs the reference velocity as
    torque."""
    w = 2.0 * np.pi * drive.frequency
    torque = Reference(
        "harmonic", amplitude=drive.amplitude / w, frequency=drive.frequency, phase=-0.5 * np.pi
    )
    passing = Controller(Gains(kp=0.0, kr=1.0))
    return simulate(
        axis, passing, torque, drive.duration, integrator="adaptive", tolerance=1e-8, metered=False
    )


def comparison_figures(view: StudyView, folder: Path) -> Iterator[Figure]:
    """Draw position and velocity errors of the controllers of every comparison (thesis figures 3.18, 3.19)."""
    for name, table in view.result.config.get("comparisons", {}).items():
        numbers = iter(table.get("figures", []))
        for reference in table.get("references", []):
            for friction in table.get("frictions", []):
                number = str(next(numbers, ""))
                cases = {c: f"{reference}/{friction}/{c}" for c in table.get("controllers", [])}
                figure = _comparison(view, folder, name, number, cases, str(table.get("title", name)))
                if figure:
                    yield figure


def _comparison(
    view: StudyView, folder: Path, name: str, number: str, cases: dict[str, str], title: str
) -> Figure | None:
    rule = view.rules[0]
    try:
        records = {c: view.record(rule, case) for c, case in cases.items()}
        rms = {c: view.metric(rule, case, "position_rms_rad") for c, case in cases.items()}
    except KeyError:
        return None  # Only a part of the study was run, or a run failed; the report lists these.
    reference, friction, _ = next(iter(cases.values())).split("/")
    period = 1.0 / view.result.config["references"][reference].get("frequency", np.inf)
    end = period * WINDOWS[number] if number in WINDOWS and period else None
    last = max(float(r.time[-1]) for r in records.values())
    lines = {
        word: {c: _error(r, word, end or np.inf) for c, r in records.items()}
        for word in ("position", "velocity")
    }
    largest = [max(float(np.max(np.abs(y))) for _, y in own.values()) for own in lines.values()]
    factor, prefix = one_prefix(*largest)
    styles = styles_of(list(dict.fromkeys([*view.controllers, *records])))
    panels: list[Panel] = []
    for word, own in lines.items():
        curves = [Curve(*envelope(x, factor * y), c, styles[c]) for c, (x, y) in own.items()]
        label = f"{word} error ({prefix}{UNITS[word]})"
        panels.append(Panel(curves, label, "time (s)", (0.0, end or last)))
    words = f"{' and '.join(cases)}, {'without friction' if friction == 'none' else friction + ' friction'}"
    stem = folder / COMMON / named(number, f"{name}-{reference}-{friction}")
    message = "RMS position error: " + ", ".join(f"{c} {factor * v:.3g} {prefix}rad" for c, v in rms.items())
    draw(stem, heading(number, words), message, panels, 1.6)
    caption = f"{title}: tracking errors along {reference!r}, {words.partition(', ')[2]}. {message}."
    return Figure(stem.name.removeprefix("figure-"), number, heading(number, words), caption, COMMON, stem)


def _error(record: Record, word: str, end: float) -> tuple[Array, Array]:
    """Return times and errors of position or velocity up to a time."""
    shown = record.time <= end
    return record.time[shown], (record[f"{word}_reference"] - record[word])[shown]
