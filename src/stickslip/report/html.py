"""Write the report of a study: one self-contained HTML file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from stickslip.report._tables import metrics_tables
from stickslip.report._view import StudyView
from stickslip.report.captions import case_message, figure_of_merit, ranking
from stickslip.report.conclusions import study_conclusion
from stickslip.report.figures import COMMON, Figure
from stickslip.report.page import filled
from stickslip.report.plots import embedded
from stickslip.studies.result import designed_for
from stickslip.thesis.claims import Claim, Verdict, judge
from stickslip.thesis.edition import SLIP, Note

MARKS = {True: ("yes", "holds"), False: ("no", "does not hold"), None: ("open", "not run")}
READING = Note(
    "Reading the metrics",
    "A standstill is |v| below 1e-3 rad/s for at least 10 ms while |v_d| is above 2e-3 rad/s. Reversals are sign "
    "changes of the velocity through a trigger of ±1e-3 rad/s. A limit cycle has at least 5 periods in the last "
    "40 % whose amplitudes and periods vary by less than 5 %. Settling is the time after which the position "
    "stays within 2 % of the step. The steady-state error is the mean over the last 20 %.",
)


OF_MACHINES = Note(
    "Metrics of machines",
    "Metrics of a machine with imperfections are computed from its samples, with the position as a cubic and the "
    "velocity as a straight line between them. Reversals, standstills and velocities within a sample are not seen: "
    "compare these metrics only between machines of equal sample time, not with those of axes under [axis].",
)


def render(view: StudyView, figures: Sequence[Figure]) -> str:
    """Return the report's HTML."""
    asked = view.edition.claims
    verdicts = {rule: judge(view, rule, asked) for rule in view.rules} if asked else {}
    manifest = view.result.manifest
    counted = _tally(asked, verdicts)
    return filled(
        "study.html",
        title=manifest.get("title")
        or view.result.config.get("title")
        or f"Study {manifest.get('study', '')}".strip(),
        ran=_ran(view),
        conclusion=study_conclusion(view, counted),
        tally=counted,
        summary=_summary(view),
        overview=_overview(view),
        tables=metrics_tables(view),
        rules=view.rules,
        resting=_resting(view),
        claims=[_claim(c, verdicts, figures) for c in asked],
        parts=_parts(view, figures),
        failed=[run for run in view.runs.values() if run.failure],
        notes=notes(view),
        manifest=json.dumps(_brief(manifest), indent=1, default=str, ensure_ascii=False),
    )


def _ran(view: StudyView) -> str:
    """Return a line on the runs."""
    count = len(view.result.runs)
    seconds = sum(run.seconds for run in view.result.runs)
    words = [
        f"{len(view.references)} references ({', '.join(view.references)})",
        f"{len(view.frictions)} frictions ({', '.join(view.frictions)})",
        f"{len(view.controllers)} controllers ({', '.join(view.controllers)})",
        f"slip rules: {', '.join(view.rules)}",
    ]
    version = view.result.manifest.get("versions", {}).get("stickslip", "")
    words += [said for said in [designed_for(view.result.manifest)] if said]
    return f"{count} runs in {seconds:.1f} s of CPU: {'; '.join(words)}. stickslip {version}".strip()


def _tally(claims: Sequence[Claim], verdicts: Mapping[str, Mapping[str, Verdict]]) -> list[dict[str, Any]]:
    """Return the number of statements that hold, by slip rule."""
    if not verdicts:
        return []
    counts: dict[str, int] = {}
    for claim in claims:
        found = {rule: verdict[claim.id].holds for rule, verdict in verdicts.items()}
        held = [rule for rule, holds in found.items() if holds]
        if any(holds is None for holds in found.values()):
            words = "not judged: runs are missing"
        elif len(held) == len(found):
            words = "statements hold" + (" under both rules" if len(found) > 1 else "")
        else:
            words = f"hold only under the {held[0]} rule" if held else "hold under neither rule"
        counts[words] = counts.get(words, 0) + 1
    return [{"count": n, "words": words} for words, n in sorted(counts.items(), key=lambda item: -item[1])]


def _resting(view: StudyView) -> list[str]:
    """Return the references that come to rest."""
    return [r for r in view.references if view.reference_kind(r) == "step"]


def _summary(view: StudyView) -> list[str]:
    """Return lines on the best controllers and on failed runs."""
    lines: list[str] = []
    resting = _resting(view)
    halves = f" ({', '.join(resting)}: in the second half)" if resting else ""
    for rule in view.rules:
        wins: dict[str, int] = {}
        for reference in view.references:
            merit, _ = figure_of_merit(view.reference_kind(reference) == "step")
            for friction in view.frictions:
                for run in ranking(view.group(rule, reference, friction), merit)[:1]:
                    wins[run.controller] = wins.get(run.controller, 0) + 1
        listed = ", ".join(f"{name} {n}" for name, n in sorted(wins.items(), key=lambda item: -item[1]))
        lines.append(
            f"Smallest RMS position error in {sum(wins.values())} cases{halves}, {rule} rule: {listed or 'none'}."
        )
    failed = sum(bool(run.failure) for run in view.runs.values())
    return [*lines, f"{failed} of {len(view.runs)} runs failed." if failed else "No run failed."]


def _overview(view: StudyView) -> list[dict[str, Any]]:
    """Return the smallest error of every reference and friction, for each rule."""
    linear = [c for c in view.controllers if not view.compensation(c)]
    rows: list[dict[str, Any]] = []
    for reference in view.references:
        at_rest = view.reference_kind(reference) == "step"
        for friction in view.frictions:
            groups = [view.group(rule, reference, friction) for rule in view.rules]
            if any(groups):
                cells = [
                    case_message([r for r in group if not r.failure], at_rest, linear) for group in groups
                ]
                rows.append({"case": f"{reference}, {friction}", "cells": cells})
    return rows


def _claim(
    claim: Claim, verdicts: Mapping[str, Mapping[str, Verdict]], figures: Sequence[Figure]
) -> dict[str, Any]:
    rows = [
        dict(
            zip(("mark", "word"), MARKS[v[claim.id].holds], strict=True),
            rule=rule,
            numbers=v[claim.id].numbers,
        )
        for rule, v in verdicts.items()
    ]
    everywhere = all(v[claim.id].holds for v in verdicts.values())
    links = [
        {"number": number, "anchor": next(f.id for f in figures if f.number == number)}
        for number in claim.figures
        if any(f.number == number for f in figures)
    ]
    return {
        "id": claim.id, "text": claim.text, "section": claim.section, "verdicts": rows,
        # Statements on all simulations would list every figure.
        "links": links if len(claim.figures) <= 4 else [], "why": "" if everywhere else claim.why,
    }  # fmt: skip


def _parts(view: StudyView, figures: Sequence[Figure]) -> list[dict[str, Any]]:
    """Return the figures in parts: those that are equal for all rules, then the results for each rule."""
    parts: list[dict[str, Any]] = []
    for rule in (COMMON, *view.rules):
        chosen = [_embedded(f) for f in figures if f.rule == rule]
        title = "References, laws and linear controllers" if rule == COMMON else f"Results, {rule} slip rule"
        if chosen:
            parts.append({"title": title, "figures": chosen})
    return parts


def _embedded(figure: Figure) -> dict[str, Any]:
    """Return a figure for the template, with its files embedded."""
    return {"id": figure.id, "title": figure.title, "caption": figure.caption, **image(figure.stem)}


def image(stem: Path) -> dict[str, Any]:
    """Return one of a figure's files, `embedded`: the SVG, unless dense oscillations make it larger than the PNG."""
    svg = stem.with_name(stem.name + ".svg")
    png = stem.with_name(stem.name + ".png")
    return embedded(svg if svg.stat().st_size <= 1.5 * png.stat().st_size else png)


def _brief(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """Return the manifest without the metrics of the runs, which are in the tables."""
    brief = {k: v for k, v in manifest.items() if k not in ("runs", "configuration")}
    if "runs" in manifest:
        brief["runs"] = f"{len(manifest['runs'])}, listed in manifest.json"
    return brief


def notes(view: StudyView) -> list[Note]:
    """Return the notes that apply to a study."""
    edition = view.edition
    ruled = () if edition.before or view.rules == ["signed"] else (SLIP,)
    machines = (OF_MACHINES,) if view.result.config.get("machines") else ()
    return [*edition.before, *ruled, *starts(view), *edition.after, READING, *machines, *edition.last]


def starts(view: StudyView) -> list[Note]:
    """Return the note on runs that depend on their start, if any."""
    named = [run.key for run in view.runs.values() if run.depends_on_start]
    text = (
        "From an initial position shifted by 1e-9 rad, these runs take another branch of the motion, and their "
        "metrics are those of "
        f"one branch: {', '.join(named)}."
    )
    return [Note("Runs that depend on their start", text)] if named else []
