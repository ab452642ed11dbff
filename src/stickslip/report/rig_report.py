"""The report of `stickslip study thesis-rig`: statements, figures, ablation and seeds in one HTML file."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.report.conclusions import rig_conclusion
from stickslip.report.html import image
from stickslip.report.page import filled, replaced, unwritable
from stickslip.report.plots import REFERENCE, Curve, Panel, draw, envelope, style_of
from stickslip.study.rig_cases import GROUPS, Group
from stickslip.study.rig_study import NOMINAL, RigResult, RigView
from stickslip.thesis.rig_verdicts import Judged, judged_over, main_share

__all__ = ["draw_groups", "verdict_table", "write_rig_report"]

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


def draw_groups(result: RigResult, folder: Path) -> list[dict[str, Any]]:
    """Draw every group's responses; returns what the report needs of each."""
    out: list[dict[str, Any]] = []
    for group in GROUPS:
        keys = [
            run.key for run in result.runs if run.variant == NOMINAL and run.key.startswith(group.name + "/")
        ]
        if keys:
            out.append(_drawn(result, group, keys, folder / group.name))
    return out


def _drawn(result: RigResult, group: Group, keys: Sequence[str], stem: Path) -> dict[str, Any]:
    names = [key.rpartition("/")[2] for key in keys]
    linear = [n for n in names if "-" not in n]
    panels = [
        _panel(result, group, [*linear, *(n for n in names if n.startswith(kind))], note)
        for kind, note in (("FF", "feedforward"), ("FB", "feedback"))
        if any(n.startswith(kind) for n in names)
    ]
    runs = {run.key: run for run in result.runs if run.variant == NOMINAL}
    best = min(keys, key=lambda key: runs[key].metrics["position_rms_rad"])
    rms = 1e3 * runs[best].metrics["position_rms_rad"]
    title = f"{group.friction}, {group.reference}, {group.linear} {group.bandwidth:g} Hz"
    title += f" (thesis figures {' and '.join(group.figures)})"
    message = f"least RMS error: {best.rpartition('/')[2]}, {rms:.3g} mrad"
    draw(stem, title, message, panels, 2.1)
    return {"id": group.name, "title": title, "caption": message, **image(stem)}


def _panel(result: RigResult, group: Group, names: Sequence[str], note: str) -> Panel:
    start, end = WINDOWS[group.reference]
    curves: list[Curve] = []
    reference: Curve | None = None
    for name in names:
        record = result.record(f"{group.name}/{name}")
        time = record.time - record.time[0]
        inside = (time >= start) & (time <= end)
        if not np.any(inside):
            continue
        if name == names[-1]:  # over the others
            wanted = 1e3 * record["position_reference"][inside]
            reference = Curve(*envelope(time[inside], wanted), "reference", REFERENCE)
        path = 1e3 * record["position"][inside]
        style = style_of("gms10" if name.endswith("gms10") else name, ("gms10",))
        curves.append(
            Curve(*envelope(time[inside], path, 260), name.removeprefix("FF-").removeprefix("FB-"), style)
        )
    travel = 1e3 * {"low": 0.02, "high": 1.0, "step": 0.01}[group.reference]
    curves += [reference] if reference else []
    return Panel(curves, "position (mrad)", "time (s)", (start, end), (-0.45 * travel, 1.45 * travel), note)


def verdict_table(judged: Sequence[Judged]) -> list[dict[str, Any]]:
    """One row a statement."""
    return [
        {
            "id": j.claim.id, "section": j.claim.section, "figures": ", ".join(j.claim.figures), "text": j.claim.text,
            "mark": MARKS[j.holds][0], "word": MARKS[j.holds][1], "numbers": j.numbers, "main": j.main,
            "share": f"{j.held} of {j.seeds}" if j.seeds else "", "reason": j.reason,
        }
        for j in judged
    ]  # fmt: skip


def _ablation(result: RigResult) -> list[dict[str, Any]]:
    """The chosen metrics as the machines are, and without each imperfection."""
    found = {(run.variant, run.key): run.metrics for run in result.runs}
    rows: list[dict[str, Any]] = []
    for name in [v for v in result.variants if not v.startswith("seed ")]:
        cells = [found.get((name, key), {}).get(metric) for key, metric, _ in ABLATED]
        rows.append({"name": name, "cells": ["" if c is None else f"{1e3 * c:.3g}" for c in cells]})
    return rows if len(rows) > 1 else []


def _tally(judged: Sequence[Judged]) -> Iterator[dict[str, Any]]:
    for holds, words in (
        (True, "statements hold"),
        (False, "do not hold"),
        (None, "are not judged: runs are missing"),
    ):
        count = sum(j.holds is holds for j in judged)
        if count:
            yield {"count": count, "words": words}


def best_pairs(result: RigResult) -> list[tuple[float, float]]:
    """RMS error of the best linear controller and of the best compensator of every group that has both."""
    pairs: list[tuple[float, float]] = []
    for group in GROUPS:
        errors: dict[bool, list[float]] = {False: [], True: []}
        for run in result.runs:
            if run.variant == NOMINAL and run.key.startswith(group.name + "/") and not run.stopped:
                errors["-" in run.key.rpartition("/")[2]].append(run.metrics["position_rms_rad"])
        if errors[False] and errors[True]:
            pairs.append((min(errors[False]), min(errors[True])))
    return pairs


def write_rig_report(result: RigResult) -> Path:
    """Draw the figures and write ``report.html``; returns it.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    judged = judged_over(RigView(result), result.variants)
    target = result.folder / "report.html"
    try:
        figures = draw_groups(result, result.folder / "figures")
    except OSError as error:
        raise unwritable(target, error) from None
    counted, mains = list(_tally(judged)), main_share(judged)
    html = filled(
        "rig.html",
        title="Chapter 4 of the thesis on a virtual machine",
        ran=f"{len(result.runs)} runs, {len(result.variants)} variants, {result.manifest['wall_s']:.0f} s",
        conclusion=rig_conclusion(counted, mains, best_pairs(result)),
        tally=counted,
        mains=[{"text": t, "held": a, "of": b} for t, (a, b) in mains.items()],
        rows=verdict_table(judged),
        seeds=result.manifest["seeds"],
        ablation=_ablation(result),
        columns=[text for *_, text in ABLATED],
        figures=figures,
        stopped=[run for run in result.runs if run.stopped and run.variant == NOMINAL],
        manifest=json.dumps(result.manifest, indent=1),
    )
    return replaced(target, html)
