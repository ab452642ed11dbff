"""Write the report of a bench of compensators: decision table, a picture and a table per machine."""

from __future__ import annotations

import base64
import math
from collections import Counter
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from stickslip.control.catalogue import CATALOGUE
from stickslip.control.learned import told
from stickslip.core.whole_files import write_whole
from stickslip.report.page import filled
from stickslip.studies.bench import BenchResult, BenchRun
from stickslip.studies.bench_decision import CONDITIONS, LATE, USUAL, Choice, Standing, choices, standings

WIDTH, LEFT, ROW, TOP = 760.0, 190.0, 15.0, 46.0
"""Layout of a picture, px: width, space for names, height of a row, space for the title."""
CALM, OTHER, BAR = "#1f5f99", "#999999", "#c9d8e6"


def write_bench_report(result: BenchResult) -> Path:
    """Write report.html into the folder of a bench.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    every, steady, late = (
        standings(result.runs, c) for c in (USUAL, CONDITIONS["friction as believed"], LATE)
    )
    means = {(s.machine, s.label): s.mean for s in steady}
    delayed = {(s.machine, s.label): s for s in late}
    machines: list[dict[str, Any]] = []
    for name in dict.fromkeys(s.machine for s in every):
        own = sorted((s for s in every if s.machine == name), key=lambda s: (bool(s.why_not), s.mean))
        message = message_of(own)
        picture = base64.b64encode(dots(name, message, own).encode()).decode("ascii")
        machines.append(
            {
                "name": name, "message": message, "picture": f"data:image/svg+xml;base64,{picture}",
                "rows": [
                    row(s, means.get((name, s.label), math.nan), delayed.get((name, s.label))) for s in own
                ],
                "learned": learned_on(name, result.runs),
            }
        )  # fmt: skip
    html = filled(
        "bench.html", title=result.bench.title, count=len(result.runs),
        failed=sum(bool(r.failure) for r in result.runs),
        conditions=list(CONDITIONS), choices=table_of(choices(result.runs)), machines=machines,
    )  # fmt: skip
    return write_whole(result.folder / "report.html", html)


def learned_on(machine: str, runs: Sequence[BenchRun]) -> list[dict[str, str]]:
    """Return the parameters learned on a machine at the end of the reference with the most learning: a row for every
    run."""
    own = [r for r in runs if r.machine == machine and r.learned]
    along = Counter(r.reference for r in own).most_common(1)
    return [
        {"run": r.key.partition("/")[2], "lines": "; ".join(told({"learned": r.learned}))}
        for r in own
        if r.reference == along[0][0]
    ]


def table_of(found: Sequence[Choice]) -> list[dict[str, Any]]:
    """Return the decision table: a row for the knowledge of each machine, a cell for every condition."""
    choice = {(c.machine, c.knowledge, c.condition): c for c in found}
    return [
        {
            "machine": machine, "known": known,
            "cells": [cell(choice.get((machine, known, condition))) for condition in CONDITIONS],
        }
        for machine, known in dict.fromkeys((c.machine, c.knowledge) for c in found)
    ]  # fmt: skip


def cell(choice: Choice | None) -> dict[str, str]:
    """Return the choice, its mean and its worst error relative to the PD's; a condition without runs has no choice."""
    if choice is None:
        return {"label": "not run", "numbers": ""}
    chosen = choice.chosen
    if chosen is None:
        return {"label": "none: the PD itself is not calm", "numbers": ""}
    return {"label": chosen.label, "numbers": f"{shown(chosen.mean)}, at worst {shown(chosen.worst)}"}


def message_of(own: Sequence[Standing]) -> str:
    """Return the message of a machine's picture as a sentence."""
    fit = [s for s in own if not s.why_not]
    if not fit:
        return "None is suitable: each fails, chatters, hunts, or is somewhere worse than the PD alone."
    share = f"{100.0 * fit[0].mean:.2g} %"
    return (
        f"{fit[0].label} has {share} of the error of the PD alone, the smallest without hunting or chatter."
    )


def row(s: Standing, steady: float, delayed: Standing | None) -> dict[str, str]:
    """Return a row of a machine's table."""
    late = "–" if delayed is None else (delayed.why_not.partition(":")[0] or shown(delayed.mean))
    return {
        "label": s.label, "needs": CATALOGUE[s.compensator].needs, "steady": shown(steady), "mean": shown(s.mean),
        "worst": shown(s.worst), "chatter": f"{100.0 * s.chatter:.1f}", "hunting": f"{1e6 * s.hunting:.0f}",
        "recovery": f"{1e3 * s.recovery:.0f}" if math.isfinite(s.recovery) else "–", "effort": shown(s.effort),
        "why": s.why_not, "late": late,
    }  # fmt: skip


def shown(value: float | None) -> str:
    """Return a ratio as text."""
    if value is None or not math.isfinite(value):
        return "–"
    if value >= 1.0:
        return f"{value:.2f}"
    return f"{value:.3f}" if value >= 0.01 else f"{value:.2g}"


def dots(title: str, message: str, own: Sequence[Standing]) -> str:
    """Return the SVG of a machine: errors relative to the PD's, mean as a dot and worst case as a bar, logarithmic."""
    drawn = [s for s in own if math.isfinite(s.mean)]
    low = min([0.05, *(s.mean for s in drawn)])
    high = max([2.0, *(min(s.worst, 50.0) for s in drawn)])
    height = TOP + ROW * len(drawn) + 34.0

    def across(x: float) -> float:
        part = math.log(min(max(x, low), high) / low) / math.log(high / low)
        return LEFT + (WIDTH - LEFT - 20.0) * part

    bottom = TOP + ROW * len(drawn)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {WIDTH:.0f} {height:.0f}" font-family="DejaVu Sans, Verdana, Helvetica, Arial, sans-serif" '
        'font-size="11">',
        f'<rect width="{WIDTH:.0f}" height="{height:.0f}" fill="#ffffff"/>',
        f'<text x="8" y="16" font-weight="bold">Machine {escape(title)}</text>',
        f'<text x="8" y="32" fill="#444444">{escape(message)}</text>',
    ]
    for tick in (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0):
        if low <= tick <= high:
            x, weight = across(tick), "1.4" if tick == 1.0 else "0.5"
            parts += [
                f'<path d="M{x:.1f} {TOP:.0f}V{bottom:.1f}" stroke="#bbbbbb" stroke-width="{weight}"/>',
                f'<text x="{x:.1f}" y="{bottom + 13.0:.1f}" text-anchor="middle">{tick:g}</text>',
            ]
    for i, s in enumerate(drawn):
        y = TOP + ROW * (i + 0.5)
        colour = OTHER if s.why_not else CALM
        parts += [
            f'<text x="{LEFT - 8.0:.0f}" y="{y + 4.0:.1f}" text-anchor="end" fill="{colour}">{escape(s.label)}</text>',
            f'<path d="M{across(s.mean):.1f} {y:.1f}H{across(s.worst):.1f}" stroke="{BAR}" stroke-width="7"/>',
            f'<circle cx="{across(s.mean):.1f}" cy="{y:.1f}" r="3.6" fill="{colour}"/>',
        ]
    parts.append(
        f'<text x="{0.5 * (LEFT + WIDTH):.0f}" y="{height - 5.0:.0f}" text-anchor="middle">error RMS over '
        "that of the PD alone: mean of all cases, bar to the worst; grey: not recommended</text></svg>"
    )
    return "\n".join(parts)
