"""The figures of a study: its references, its open-loop responses, its comparisons and the result of every case."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.plugins import reference_kind
from stickslip.record import Record
from stickslip.report import plots
from stickslip.report._view import StudyView
from stickslip.report.captions import case_caption, case_message
from stickslip.report.plots import REFERENCE, Array, Curve, Panel, draw, envelope, scaled, style_of
from stickslip.study.result import Run

COMMON = "both"  # folder of the figures that no slip rule changes
LINES = 7  # as many controllers as one figure still shows
DENSE = 50  # turning points of a drawn line


@dataclass(frozen=True)
class Figure:
    """A figure as it was saved.

    Attributes
    ----------
    id : str
        Anchor in the report, `signed-3.21`.
    number : str
        The thesis's number, or the empty string.
    title, caption : str
    rule : str
        Its slip rule; "both" where none changes it.
    stem : Path
        Without .svg and .png.
    """

    id: str
    number: str
    title: str
    caption: str
    rule: str
    stem: Path


def named(number: str, fallback: str) -> str:
    """The file's name: by the thesis's number where there is one."""
    return f"figure-{number or fallback}"


def reference_figures(view: StudyView, folder: Path) -> Iterator[Figure]:
    """Position and velocity of every reference (thesis figures 3.15 to 3.17)."""
    for reference in view.references:
        run = next((r for r in view.result.runs if r.reference == reference and not r.failure), None)
        if run is None:
            continue
        record = run.record()
        number = view.edition.motions.get(reference, "")
        stem = folder / COMMON / named(number, f"reference-{reference}")
        message = f"Reference: {what(view, reference)}"
        window = steady_window(record) or (0.0, float(record.time[-1]))
        panels: list[Panel] = []
        for channel, word in (("position_reference", "position"), ("velocity_reference", "velocity")):
            factor, unit = scaled(float(np.max(np.abs(record[channel]))), record.units[channel])
            shown = record.time <= window[1]
            x, y = envelope(record.time[shown], record[channel][shown] * factor)
            panels.append(Panel([Curve(x, y, "", plots.LAWS["gms"])], f"{word} ({unit})", "time (s)", window))
        title = heading(
            number, f"Reference {reference!r}" if not number else f"The {view.edition.references[reference]}"
        )
        draw(stem, title, message, panels, 1.35)
        caption = f"Reference position and velocity: {what(view, reference)}."
        yield Figure(stem.name.removeprefix("figure-"), number, title, caption, COMMON, stem)


def heading(number: str, text: str) -> str:
    """`Figure 3.21 · text`, or the text alone."""
    return f"Figure {number} · {text}" if number else text


def what(view: StudyView, reference: str) -> str:
    """A reference's kind and parameters in a line."""
    run = next(r for r in view.result.runs if r.reference == reference)
    return describe(run.record().meta["reference"])


def describe(reference: Mapping[str, Any]) -> str:
    """A reference's kind and its single numbers with their units, `sine, amplitude 0.01 rad`."""
    units = {f.name: f.par.unit for f in reference_kind(reference["kind"]).fields}
    numbers = {k: v for k, v in reference.items() if isinstance(v, (int, float))}
    return ", ".join(
        [reference["kind"], *(f"{k} {v:g} {units.get(k, '')}".rstrip() for k, v in numbers.items())]
    )


def steady_window(record: Record) -> tuple[float, float] | None:
    """The beginning of a motion that is over early, s; None shows all of it."""
    moving = np.flatnonzero(
        np.abs(record["velocity_reference"]) > 1e-3 * np.max(np.abs(record["velocity_reference"]))
    )
    end = float(record.time[moving[-1]]) if moving.size else 0.0
    return (0.0, 1.5 * end) if 0.0 < end < 0.4 * float(record.time[-1]) else None


# ---- the results: one figure a reference, friction and way to compensate ------------------------------------------


@dataclass(frozen=True)
class Case:
    """What one result figure compares."""

    rule: str
    reference: str
    friction: str
    kind: str
    runs: Sequence[Run]
    part: int = 0

    @property
    def name(self) -> str:
        """For the file, where the thesis gives no number."""
        words = [
            self.reference,
            self.friction,
            self.kind or "linear",
            *([str(self.part + 1)] if self.part else []),
        ]
        return "-".join(words)


def result_cases(view: StudyView, rule: str) -> Iterator[Case]:
    """The figures' cases: controllers without compensator beside those of each kind, few enough to tell apart."""
    for friction in view.frictions:
        for reference in view.references:
            runs = view.group(rule, reference, friction)
            linear = [r for r in runs if not view.compensation(r.controller)]
            for kind in view.kinds() or [""]:
                helped = [r for r in runs if kind and view.compensation(r.controller) == kind]
                base = linear[: LINES - 2] if helped else []
                room = LINES - len(base)
                rest = helped or linear
                for part in range(0, len(rest), room):
                    yield Case(
                        rule, reference, friction, kind, [*base, *rest[part : part + room]], part // room
                    )


def result_figures(view: StudyView, folder: Path) -> Iterator[Figure]:
    """Position and position error of every case, under every slip rule (thesis figures 3.21 to 3.38)."""
    for rule in view.rules:
        for case in result_cases(view, rule):
            number = view.edition.results.get((case.reference, case.friction, case.kind), "")
            stem = folder / rule / named(number, case.name)
            at_rest = view.reference_kind(case.reference) == "step"
            linear = [r.controller for r in case.runs if not view.compensation(r.controller)]
            message = case_message(case.runs, at_rest, linear)
            reference = view.edition.references.get(case.reference, case.reference)
            friction = view.edition.frictions.get(case.friction, case.friction)
            words = f"{reference}, {friction}" + (f", {case.kind}" if case.kind else "")
            panels = result_panels(case, view.controllers, at_rest)
            if not panels:
                continue
            draw(stem, heading(number, words), message, panels)
            yield Figure(
                f"{rule}-{stem.name.removeprefix('figure-')}", number, heading(number, words),
                case_caption(case.runs, at_rest), rule, stem,
            )  # fmt: skip


def result_panels(case: Case, controllers: Sequence[str], at_rest: bool) -> list[Panel]:
    """Position above, error below; errors far beyond the others' are left off the scale and named."""
    records = {r.controller: r.record() for r in case.runs if r.path.exists()}
    records = {name: record for name, record in records.items() if len(record) > 1}
    if not records:
        return []
    first = max(records.values(), key=lambda r: float(r.time[-1]))
    errors = {name: r["position_reference"] - r["position"] for name, r in records.items()}
    # At rest the second half counts, which leaves the transient aside.
    sizes = {name: float(np.max(np.abs(e[e.size // 2 if at_rest else 0 :]))) for name, e in errors.items()}
    limit = readable_limit(sorted(sizes.values()), case.kind == "feedback")
    p_factor, p_unit = scaled(float(np.ptp(first["position_reference"])), "rad")
    e_factor, e_unit = scaled(limit, "rad")
    # Far outside the axes a line need not go on.
    shown = {n: np.clip(e, -2 * limit, 2 * limit) for n, e in errors.items()}
    styles = {
        n: drawn_style(style_of(n, controllers), (r.time, r["position"]), (r.time, shown[n]))
        for n, r in records.items()
    }
    # The legend's handles, in the study's order.
    positions = [Curve(first.time[:0], first.time[:0], n, styles[n]) for n in records]
    positions.insert(0, Curve(first.time[:0], first.time[:0], "reference", REFERENCE))
    deviations: list[Curve] = []
    # Large errors first, so that small ones are drawn over them.
    for name in sorted(records, key=lambda n: -sizes[n]):
        record, style = records[name], styles[name]
        positions.append(Curve(*envelope(record.time, p_factor * record["position"]), "", style))
        # A line that is outside the axes most of the time only hides the others.
        if np.mean(np.abs(errors[name]) > limit) < 0.35:
            deviations.append(Curve(*envelope(record.time, e_factor * shown[name]), "", style))
    x, y = envelope(first.time, p_factor * first["position_reference"])
    positions.append(Curve(x, y, "", REFERENCE))
    low, high = float(y.min()), float(y.max())
    margin = 0.35 * (high - low or 1.0)
    return [
        Panel(positions, f"position ({p_unit})", "time (s)", (0.0, float(first.time[-1])),
              (low - margin, high + margin), f"{case.rule} slip rule"),
        Panel(deviations, f"position error ({e_unit})", "time (s)", None, (-e_factor * limit, e_factor * limit),
              off_scale(sizes, limit, at_rest)),
    ]  # fmt: skip


def off_scale(sizes: dict[str, float], limit: float, at_rest: bool) -> str:
    """Which errors go beyond the limit, and how far: over the whole run, at rest in its second half."""
    factor, unit = scaled(limit, "rad")
    words = [f"{name} {factor * size:.3g}" for name, size in sizes.items() if size > limit]
    what = "off scale in the second half" if at_rest else "off scale"
    return f"{what}: {', '.join(words)} {unit}" if words else ""


def drawn_style(style: plots.Style, *lines: tuple[Array, Array]) -> plots.Style:
    """The style in which lines are drawn, and named in the legend: thin and without dashes if one is dense."""
    return replace(style, dashes="-", width=0.6) if any(dense(x, y) for x, y in lines) else style


def dense(x: Array, y: Array) -> bool:
    """Whether a line oscillates so often that its dashes could not be told apart."""
    _, y = envelope(x, y)
    steps = np.diff(y)
    steps = steps[np.abs(steps) > 0.02 * np.ptp(y)]  # A ripple within the line's width is none.
    return int(np.sum(steps[1:] * steps[:-1] < 0.0)) > DENSE


def readable_limit(sizes: Sequence[float], feedback: bool) -> float:
    """Half height of the error's axis (rad) at which the small errors are still seen, from all, ascending.

    In feedback the good runs are better by orders of magnitude, so that the axis is made for them.
    """
    usual = sizes[(len(sizes) - 1) // (3 if feedback else 2)]
    return 1.35 * max(size for size in sizes if size <= 2.5 * usual) or 1e-6
