"""Write the report of experiments on rigs (`stickslip study thesis-rig`): statements, figures, ablation and seeds."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.errors import unwritable
from stickslip.core.record import Record
from stickslip.core.whole_files import write_whole
from stickslip.report.conclusions import rig_conclusion
from stickslip.report.html import image
from stickslip.report.page import filled
from stickslip.report.plots import Curve, Panel, draw, envelope
from stickslip.report.styles import REFERENCE, style_of
from stickslip.studies.experiments import Experiment, ExperimentView, experiments_of
from stickslip.studies.result import Run, StudyResult
from stickslip.thesis.rig_verdicts import Judged, judged_over, main_share

MARKS = {True: ("yes", "holds"), False: ("no", "does not hold"), None: ("open", "not run")}
WINDOWS = {"low": (2.5, 5.0), "high": (0.0, 20.0), "step": (0.0, 1.5)}
"""s, of each reference that is drawn."""
REVERSALS = {"high": (14.8, 15.8)}
"""s, about the second reversal of a reference whose whole travel hides what happens there."""
MARGIN = 2.0
"""Of the reference's travel, up to which an error is drawn to scale."""
ABLATED = (
    ("dry-low-PD36/PD", "position_above_5Hz_rms_rad", "PD 36 Hz, dry, slow: oscillation"),
    ("dry-low-PD36/FF-lugre", "position_rms_rad", "FF LuGre, dry, slow: error"),
    ("grease-low-PD25/FF-lugre", "position_rms_rad", "FF LuGre, grease, slow: error"),
    ("grease-low-PD25/FB-gms", "position_above_5Hz_rms_rad", "FB GMS, grease, slow: oscillation"),
    ("dry-high-PID10/PID", "position_rms_rad", "PID 10 Hz, dry, fast: error"),
    ("dry-high-PD10/FF-gms", "position_rms_rad", "FF GMS, dry, fast: error"),
)  # fmt: skip
"""Runs and metrics of the table of imperfections."""


def draw_experiments(result: StudyResult, folder: Path) -> list[dict[str, Any]]:
    """Draw every experiment's responses; returns what the report needs of each."""
    view = ExperimentView(result)
    return [
        drawn
        for one in experiments_of(result.config)
        if (runs := view.nominal(one))
        for drawn in (
            _drawn(one, runs, folder / one.name),
            *_enlarged(one, runs, folder / f"{one.name}-enlarged"),
        )
    ]


def _drawn(one: Experiment, runs: Mapping[str, Run], stem: Path) -> dict[str, Any]:
    linear = [n for n in runs if "-" not in n]
    groups: dict[str, list[str]] = {kind: [] for kind in KINDS}
    for name in runs:
        if name not in linear:
            groups[name[:2] if name[:2] in KINDS else ""].append(name)
    window = WINDOWS.get(one.reference, (0.0, math.inf))
    panels = [
        _panel({n: runs[n] for n in (*linear, *names)}, window, KINDS[kind])
        for kind, names in groups.items()
        if names
    ]
    best = min(runs, key=lambda name: runs[name].metrics["position_rms_rad"])
    rms = 1e3 * runs[best].metrics["position_rms_rad"]
    return _saved(stem, titled(one, one.figures), f"Least RMS error: {worded(best)}, {rms:.3g} mrad", panels)


def _enlarged(one: Experiment, runs: Mapping[str, Run], stem: Path) -> Iterator[dict[str, Any]]:
    """Draw a reversal of a fast reference: feedforward, LuGre feedback and its velocity (figures 4.20, 4.22, 4.46).

    Feedback by the other laws oscillates beyond the scale.
    """
    window = REVERSALS.get(one.reference)
    runs = {name: run for name, run in runs.items() if not run.failure}
    linear = [n for n in runs if n == one.linear]
    feedforward, feedback = ([n for n in runs if n.startswith(start)] for start in ("FF-", "FB-lugre"))
    if window is None or not linear or not (feedforward or feedback):
        return
    panels: list[Panel] = []
    for names, kind in ((feedforward, "feedforward"), (feedback, "feedback of LuGre")):
        if names:
            panels.append(_panel({n: runs[n] for n in (*linear, *names)}, window, kind))
    if feedback:
        shown = {n: runs[n] for n in (*linear, *feedback)}
        panels.append(_panel(shown, window, "feedback of LuGre", "velocity"))
    errors = {n: _error_within(runs[n], window) for n in (*linear, *feedforward, *feedback)}
    best = min(errors, key=errors.__getitem__)
    message = f"Least RMS error from {window[0]:g} to {window[1]:g} s: {worded(best)}, {1e3 * errors[best]:.3g} mrad"
    title = titled(one, one.enlarged)
    yield _saved(stem, f"Reversal enlarged: {title[0].lower()}{title[1:]}", message, panels)


def _saved(stem: Path, title: str, message: str, panels: Sequence[Panel]) -> dict[str, Any]:
    draw(stem, title, message, panels, 2.1)
    return {"id": stem.name, "title": title, "caption": message, **image(stem)}


def titled(one: Experiment, figures: Sequence[str]) -> str:
    """Name an experiment: machine, reference and controller, and the thesis's figures."""
    title = f"Machine {one.machine}, reference {one.reference}, {one.linear} of {one.bandwidth:g} Hz"
    word = "figures" if len(figures) > 1 else "figure"
    return title + (f" (thesis {word} {' and '.join(figures)})" if figures else "")


def _error_within(run: Run, window: tuple[float, float]) -> float:
    """RMS position error of a run in a window of time, rad."""
    record = run.record()
    inside = _inside(record, window)
    return float(np.sqrt(np.mean((record["position_reference"] - record["position"])[inside] ** 2)))


def _inside(record: Record, window: tuple[float, float]) -> Any:
    time = record.time - record.time[0]
    return (time >= window[0]) & (time <= window[1])


KINDS = {"FF": "feedforward", "FB": "feedback", "": "others"}


def labelled(name: str) -> str:
    """Return the label of a controller: its law, and the low-pass on its velocity."""
    law = name.removeprefix("FF-").removeprefix("FB-")
    return "gms, 10 Hz filter" if law == "gms10" else law


def worded(name: str) -> str:
    """Return the description of a controller: its law and structure."""
    kind = KINDS.get(name[:2], "") if "-" in name else ""
    return f"{labelled(name)} {kind}".strip()


def _panel(
    runs: Mapping[str, Run], window: tuple[float, float], note: str, channel: str = "position"
) -> Panel:
    """Position or velocity of runs and their reference in a window of time; what leaves the scale is named."""
    lines = {name: _line(run.record(), window, channel) for name, run in runs.items()}
    time, goal, _ = max(lines.values(), key=lambda line: line[0].size)
    unit = "mrad" if channel == "position" else "mrad/s"
    if not time.size:
        return Panel((), f"{channel} ({unit})", "time (s)", None, None, f"{note}; every run ended before")
    curves = [Curve(time[:0], time[:0], "reference", REFERENCE)]
    # One legend serves all panels: a law looks the same in feedforward and feedback.
    curves += [
        Curve(*envelope(x, y, 260), labelled(n), style_of(n.removeprefix("FF-").removeprefix("FB-")))
        for n, (x, _, y) in lines.items()
        if x.size
    ]
    curves.append(Curve(*envelope(time, goal), "", REFERENCE))  # over the others, but named first
    largest = {n: float(np.max(np.abs(y - g), initial=0.0)) for n, (_, g, y) in lines.items()}
    room = MARGIN * float(np.ptp(goal))
    seen = [goal, *(y for n, (_, _, y) in lines.items() if y.size and largest[n] <= room)]
    low, high = min(float(y.min()) for y in seen), max(float(y.max()) for y in seen)
    least = 0.08 * (high - low)
    away = [f"{labelled(n)} by {x:.0f}" for n, x in largest.items() if x > room]
    if away:
        note += f"; off scale: {', '.join(away)} {unit}"
    return Panel(
        curves, f"{channel} ({unit})", "time (s)", (window[0], min(window[1], float(time[-1]))),
        (low - least, high + least), note,
    )  # fmt: skip


def _line(record: Record, window: tuple[float, float], channel: str) -> tuple[Any, Any, Any]:
    """Time, reference and channel in a window, s and thousandths."""
    inside = _inside(record, window)
    time = (record.time - record.time[0])[inside]
    return time, 1e3 * record[f"{channel}_reference"][inside], 1e3 * record[channel][inside]


def verdict_table(judged: Sequence[Judged]) -> list[dict[str, Any]]:
    """Return one row per statement."""
    return [
        {
            "id": j.claim.id, "section": j.claim.section, "figures": ", ".join(j.claim.figures), "text": j.claim.text,
            "mark": MARKS[j.holds][0], "word": MARKS[j.holds][1], "numbers": j.numbers, "main": j.main,
            "share": f"{j.held} of {j.seeds}" if j.seeds else "", "reason": j.reason,
        }
        for j in judged
    ]  # fmt: skip


def _ablation(view: ExperimentView) -> list[dict[str, Any]]:
    """Return the selected metrics with all imperfections, and without each one."""
    rows: list[dict[str, Any]] = []
    for name in [v for v in view.varied() if not v.startswith("seed ")]:
        cells: list[str] = []
        for case, metric, _ in ABLATED:
            try:
                cells.append(f"{1e3 * view.metric(name, case, metric):.3g}")
            except KeyError:
                cells.append("")
        rows.append({"name": name, "cells": cells})
    return rows if len(rows) > 1 and any("".join(row["cells"]) for row in rows) else []


def _tally(judged: Sequence[Judged]) -> Iterator[dict[str, Any]]:
    for holds, words in (
        (True, "statements hold"),
        (False, "do not hold"),
        (None, "are not judged: runs are missing"),
    ):
        count = sum(j.holds is holds for j in judged)
        if count:
            yield {"count": count, "words": words}


def best_pairs(view: ExperimentView) -> list[tuple[float, float]]:
    """Return the RMS errors of the best linear controller and the best compensator of every experiment with both."""
    pairs: list[tuple[float, float]] = []
    for one in view.experiments.values():
        errors: dict[bool, list[float]] = {False: [], True: []}
        for name, run in view.nominal(one).items():
            if not run.failure:
                errors["-" in name].append(run.metrics["position_rms_rad"])
        if errors[False] and errors[True]:
            pairs.append((min(errors[False]), min(errors[True])))
    return pairs


def write_rig_report(result: StudyResult) -> Path:
    """Draw the figures and write ``report.html``; return its path.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    view = ExperimentView(result)
    judged = judged_over(view, view.varied())
    target = result.folder / "report.html"
    try:
        figures = draw_experiments(result, result.folder / "figures")
    except OSError as error:
        raise unwritable(target, error) from None
    counted, mains = list(_tally(judged)), main_share(judged)
    nominal = {run.key for one in view.experiments.values() for run in view.nominal(one).values()}
    html = filled(
        "rig.html",
        title=result.manifest["title"],
        ran=f"{len(result.runs)} runs, {len(view.varied())} variants, {result.manifest['timings']['wall_s']:.0f} s",
        conclusion=rig_conclusion(counted, mains, best_pairs(view)),
        tally=counted,
        mains=[{"text": t, "held": a, "of": b} for t, (a, b) in mains.items()],
        rows=verdict_table(judged),
        seeds=result.config.get("seeds", 0),
        ablation=_ablation(view),
        columns=[text for *_, text in ABLATED],
        figures=figures,
        stopped=[run for run in result.runs if run.failure and run.key in nominal],
        manifest=json.dumps({k: v for k, v in result.manifest.items() if k != "runs"}, indent=1),
    )
    return write_whole(target, html)
