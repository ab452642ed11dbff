"""The figures of a study: its references, its open-loop responses, its comparisons and the result of every case."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.record import Record
from stickslip.models.plugins import reference_kind
from stickslip.report._view import StudyView
from stickslip.report.captions import case_caption, case_message, error_of
from stickslip.report.plots import Curve, Panel, draw, envelope, one_prefix
from stickslip.report.styles import LAWS, REFERENCE, Style, styles_of
from stickslip.studies.result import Run

COMMON = "both"  # folder of the figures that are equal for all slip rules
LINES = 7  # most controllers in one figure


@dataclass(frozen=True)
class Figure:
    """A saved figure.

    Attributes
    ----------
    id : str
        Anchor in the report, `signed-3.21`.
    number : str
        The thesis's number, or the empty string.
    title, caption : str
    rule : str
        Its slip rule; "both" if it is equal for all.
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
    """Return the file's name: by the thesis's number if there is one."""
    return f"figure-{number or fallback}"


def reference_figures(view: StudyView, folder: Path) -> Iterator[Figure]:
    """Draw position and velocity of every reference (thesis figures 3.15 to 3.17)."""
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
        channels = {"position": "position_reference", "velocity": "velocity_reference"}
        factor, prefix = one_prefix(*(float(np.max(np.abs(record[c]))) for c in channels.values()))
        for word, channel in channels.items():
            shown = record.time <= window[1]
            x, y = envelope(record.time[shown], record[channel][shown] * factor)
            label = f"{word} ({prefix}{record.units[channel]})"
            panels.append(Panel([Curve(x, y, "", Style(LAWS["gms"].colour))], label, "time (s)", window))
        title = heading(
            number, f"Reference {reference!r}" if not number else f"The {view.edition.references[reference]}"
        )
        draw(stem, title, message, panels, 1.35)
        caption = f"Reference position and velocity: {what(view, reference)}."
        yield Figure(stem.name.removeprefix("figure-"), number, title, caption, COMMON, stem)


def heading(number: str, text: str) -> str:
    """Return `Figure 3.21 · text`, or the text alone."""
    return f"Figure {number} · {text}" if number else text


def what(view: StudyView, reference: str) -> str:
    """Return a reference's kind and parameters in one line."""
    run = next(r for r in view.result.runs if r.reference == reference)
    return describe(run.record().meta["reference"])


def describe(reference: Mapping[str, Any]) -> str:
    """Return a reference's kind and its single numbers with their units, `sine, amplitude 0.01 rad`."""
    units = {f.name: f.par.unit for f in reference_kind(reference["kind"]).fields}
    numbers = {k: v for k, v in reference.items() if isinstance(v, (int, float))}
    return ", ".join(
        [reference["kind"], *(f"{k} {v:g} {units.get(k, '')}".rstrip() for k, v in numbers.items())]
    )


def steady_window(record: Record) -> tuple[float, float] | None:
    """Return the interval to show of a motion that ends early, s; None: all of it."""
    moving = np.flatnonzero(
        np.abs(record["velocity_reference"]) > 1e-3 * np.max(np.abs(record["velocity_reference"]))
    )
    end = float(record.time[moving[-1]]) if moving.size else 0.0
    return (0.0, 1.5 * end) if 0.0 < end < 0.4 * float(record.time[-1]) else None


# ---- the results: one figure a reference, friction and way to compensate ------------------------------------------


@dataclass(frozen=True)
class Case:
    """The runs that one result figure compares."""

    rule: str
    reference: str
    friction: str
    kind: str
    runs: Sequence[Run]
    every: Sequence[Run]
    """Including those of the case's other figures."""
    part: int = 0
    parts: int = 1

    @property
    def name(self) -> str:
        """Name of the file without a number of the thesis."""
        words = [
            self.reference,
            self.friction,
            self.kind or "linear",
            *([str(self.part + 1)] if self.part else []),
        ]
        return "-".join(words)


def result_cases(view: StudyView, rule: str) -> Iterator[Case]:
    """Return the cases of figures: controllers without compensator and those of each kind, few enough to
    distinguish."""
    for friction in view.frictions:
        for reference in view.references:
            runs = view.group(rule, reference, friction)
            linear = [r for r in runs if not view.compensation(r.controller)]
            for kind in view.kinds() or [""]:
                helped = [r for r in runs if kind and view.compensation(r.controller) == kind]
                base = linear[: LINES - 2] if helped else []
                rest = helped or linear
                count = math.ceil(len(rest) / (LINES - len(base)))
                for part in range(count):
                    own = rest[part * len(rest) // count : (part + 1) * len(rest) // count]
                    yield Case(
                        rule, reference, friction, kind, [*base, *own], [*linear, *helped], part, count
                    )


def result_figures(view: StudyView, folder: Path) -> Iterator[Figure]:
    """Draw position and position error of every case, for every slip rule (thesis figures 3.21 to 3.38)."""
    for rule in view.rules:
        for case in result_cases(view, rule):
            number = view.edition.results.get((case.reference, case.friction, case.kind), "")
            stem = folder / rule / named(number, case.name)
            at_rest = view.reference_kind(case.reference) == "step"
            linear = [r.controller for r in case.every if not view.compensation(r.controller)]
            records = records_of(case)
            if not records:
                continue
            limit = error_limit(case, records, at_rest)
            span = max(float(np.ptp(record["position_reference"])) for record in records.values())
            factor, prefix = one_prefix(span, limit)
            unit = (factor, f"{prefix}rad")
            title = heading(number, titled(view, case))
            message = case_message(case.every, at_rest, linear, unit, [r.controller for r in case.runs])
            draw(stem, title, message, result_panels(case, records, limit, view.controllers, unit, at_rest))
            yield Figure(
                f"{rule}-{stem.name.removeprefix('figure-')}", number, title,
                case_caption(case.runs, at_rest), rule, stem,
            )  # fmt: skip


def titled(view: StudyView, case: Case) -> str:
    """Return the title of a case, with the part that a figure shows."""
    reference = view.edition.references.get(case.reference, f"reference {case.reference}")
    plant = "friction" if case.friction in view.result.config.get("friction", {}) else "machine"
    friction = view.edition.frictions.get(case.friction, f"{plant} {case.friction}")
    words = f"{reference}, {friction}" + (f", {case.kind}" if case.kind else "")
    words += f" (part {case.part + 1} of {case.parts})" if case.parts > 1 else ""
    return words[0].upper() + words[1:]


def records_of(case: Case) -> dict[str, Record]:
    """Return the records of a case's runs by controller, without missing or empty ones."""
    records = {r.controller: r.record() for r in case.runs if r.path.exists()}
    return {name: record for name, record in records.items() if len(record) > 1}


def error_sizes(records: Mapping[str, Record], at_rest: bool) -> dict[str, float]:
    """Return the largest error of each record (rad); for a resting reference that of its second half, without the
    transient."""
    errors = {name: r["position_reference"] - r["position"] for name, r in records.items()}
    return {name: float(np.max(np.abs(e[e.size // 2 if at_rest else 0 :]))) for name, e in errors.items()}


def error_limit(case: Case, records: Mapping[str, Record], at_rest: bool) -> float:
    """Return half the height of the error axis, rad."""
    return readable_limit(sorted(error_sizes(records, at_rest).values()), case.kind == "feedback")


def result_panels(
    case: Case, records: Mapping[str, Record], limit: float, controllers: Sequence[str], unit: tuple[float, str],
    at_rest: bool,
) -> list[Panel]:  # fmt: skip
    """Return the panels: position above, error below; much larger errors are off the scale and named.

    Parameters
    ----------
    case : Case
    records : mapping of str to Record
        By controller.
    limit : float
        Half height of the error's axis, rad.
    controllers : sequence of str
        Of the whole study, which determine the styles.
    unit : tuple of (float, str)
        Factor from rad, and unit, of both axes.
    at_rest : bool
        Whether the reference comes to rest.
    """
    first = max(records.values(), key=lambda r: float(r.time[-1]))
    errors = {name: r["position_reference"] - r["position"] for name, r in records.items()}
    sizes = error_sizes(records, at_rest)
    factor, named_unit = unit
    # Far outside the axes a line may end.
    shown = {n: np.clip(e, -2 * limit, 2 * limit) for n, e in errors.items()}
    styles = styles_of(controllers)
    # The legend's handles, in the study's order.
    positions = [Curve(first.time[:0], first.time[:0], n, styles[n]) for n in records]
    positions.insert(0, Curve(first.time[:0], first.time[:0], "reference", REFERENCE))
    deviations: list[Curve] = []
    # Large errors first, so small ones are drawn over them.
    for name in sorted(records, key=lambda n: -sizes[n]):
        record, style = records[name], styles[name]
        positions.append(Curve(*envelope(record.time, factor * record["position"]), "", style))
        # A line that is outside the axes most of the time only hides the others.
        if np.mean(np.abs(errors[name]) > limit) < 0.35:
            deviations.append(Curve(*envelope(record.time, factor * shown[name]), "", style))
    x, y = envelope(first.time, factor * first["position_reference"])
    positions.append(Curve(x, y, "", REFERENCE))
    low, high = float(y.min()), float(y.max())
    margin = 0.35 * (high - low or 1.0)
    return [
        Panel(positions, f"position ({named_unit})", "time (s)", (0.0, float(first.time[-1])),
              (low - margin, high + margin), f"{case.rule} slip rule"),
        Panel(deviations, f"position error ({named_unit})", "time (s)", None, (-factor * limit, factor * limit),
              off_scale(sizes, limit, unit, at_rest)),
    ]  # fmt: skip


def off_scale(sizes: Mapping[str, float], limit: float, unit: tuple[float, str], at_rest: bool) -> str:
    """Return a note on errors (rad) beyond the limit, with their size in a unit (its factor from rad first)."""
    words = [f"{name} {error_of(size, unit[0])}" for name, size in sizes.items() if size > limit]
    what = "off scale in the second half" if at_rest else "off scale"
    return f"{what}: {', '.join(words)} {unit[1]}" if words else ""


def readable_limit(sizes: Sequence[float], feedback: bool) -> float:
    """Return half the height of the error axis (rad) at which small errors are visible, from all errors in ascending
    order.

    With feedback the good runs are better by orders of magnitude, so the axis is scaled for them.
    """
    usual = sizes[(len(sizes) - 1) // (3 if feedback else 2)]
    return 1.35 * max(size for size in sizes if size <= 2.5 * usual) or 1e-6
