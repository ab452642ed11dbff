"""Write the report of experiments on rigs (`stickslip study thesis-rig`): statements, figures, ablation and seeds."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.errors import unwritable
from stickslip.report.conclusions import rig_conclusion
from stickslip.report.html import image
from stickslip.report.page import filled
from stickslip.report.plots import Curve, Panel, draw, envelope
from stickslip.report.styles import REFERENCE, style_of
from stickslip.study.experiments import Experiment, ExperimentView, experiments_of
from stickslip.study.result import Run, StudyResult
from stickslip.thesis.rig_verdicts import Judged, judged_over, main_share
from stickslip.whole_files import write_whole

MARKS = {True: ("yes", "holds"), False: ("no", "does not hold"), None: ("open", "not run")}
WINDOWS = {"low": (2.5, 5.0), "high": (0.0, 20.0), "step": (0.0, 1.5)}
"""s, of each reference that is drawn."""
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
        _drawn(one, runs, folder / one.name)
        for one in experiments_of(result.config)
        if (runs := view.nominal(one))
    ]


def _drawn(one: Experiment, runs: Mapping[str, Run], stem: Path) -> dict[str, Any]:
    linear = [n for n in runs if "-" not in n]
    groups: dict[str, list[str]] = {kind: [] for kind in KINDS}
    for name in runs:
        if name not in linear:
            groups[name[:2] if name[:2] in KINDS else ""].append(name)
    panels = [
        _panel(one, {n: runs[n] for n in (*linear, *names)}, KINDS[kind])
        for kind, names in groups.items()
        if names
    ]
    best = min(runs, key=lambda name: runs[name].metrics["position_rms_rad"])
    rms = 1e3 * runs[best].metrics["position_rms_rad"]
    title = f"Machine {one.machine}, reference {one.reference}, {one.linear} of {one.bandwidth:g} Hz"
    title += f" (thesis figures {' and '.join(one.figures)})" if one.figures else ""
    message = f"Least RMS error: {worded(best)}, {rms:.3g} mrad"
    draw(stem, title, message, panels, 2.1)
    return {"id": one.name, "title": title, "caption": message, **image(stem)}


KINDS = {"FF": "feedforward", "FB": "feedback", "": "others"}


def labelled(name: str) -> str:
    """Return the label of a controller: its law, and the low-pass on its velocity."""
    law = name.removeprefix("FF-").removeprefix("FB-")
    return "gms, 10 Hz filter" if law == "gms10" else law


def worded(name: str) -> str:
    """Return the description of a controller: its law and structure."""
    kind = KINDS.get(name[:2], "") if "-" in name else ""
    return f"{labelled(name)} {kind}".strip()


def _panel(one: Experiment, runs: Mapping[str, Run], note: str) -> Panel:
    start, end = WINDOWS.get(one.reference, (0.0, math.inf))
    curves: list[Curve] = []
    reference: Curve | None = None
    goal = np.zeros(1)
    for name, run in runs.items():
        record = run.record()
        time = record.time - record.time[0]
        goal, end = 1e3 * record["position_reference"], min(end, float(time[-1]))
        inside = (time >= start) & (time <= end)
        if not np.any(inside):
            continue
        if name == list(runs)[-1]:  # over the others, but named first
            curves.insert(0, Curve(time[:0], time[:0], "reference", REFERENCE))
            reference = Curve(*envelope(time[inside], goal[inside]), "", REFERENCE)
        path = 1e3 * record["position"][inside]
        # One legend serves both panels: a law looks the same in feedforward and feedback.
        style = style_of(name.removeprefix("FF-").removeprefix("FB-"))
        curves.append(Curve(*envelope(time[inside], path, 260), labelled(name), style))
    curves += [reference] if reference else []
    ends = (float(np.min(goal)), float(np.max(goal)))
    margin = 0.45 * (ends[1] - ends[0])
    return Panel(
        curves, "position (mrad)", "time (s)", (start, end), (ends[0] - margin, ends[1] + margin), note
    )


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
