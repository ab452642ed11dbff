"""The report of a recommendation: the position error before and after as a figure, and one HTML file."""

from __future__ import annotations

import json
import math
import os
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.analyse.controller_margins import LATEST, ControllerStability
from stickslip.analyse.wording import quantity
from stickslip.core.whole_files import write_whole
from stickslip.identification.estimate import Picture
from stickslip.identification.identified_file import Identified
from stickslip.recommendation.candidate_run import Trial
from stickslip.recommendation.notes import not_simulated
from stickslip.recommendation.recommendation import ALLOWANCE, Comparison, Recommendation
from stickslip.report import plots
from stickslip.report.identification import panel_of
from stickslip.report.page import filled
from stickslip.report.plots import Curve, Panel
from stickslip.report.recommendation_text import (
    beside_rows,
    error_from_to,
    loop_words,
    margin,
    motion_words,
    percent,
    safety,
    setting_rows,
    verdict,
    worst_left,
)
from stickslip.report.styles import REFERENCE, Style

BEFORE, AFTER = Style("#D55E00", width=0.9), Style("#0072B2", width=1.1)
HEIGHT, TALLER = 1.35, 1.75
"""Of a panel, inches: three panels and the legend fit a screen. The taller ones each have a time axis of their own."""

Array = np.ndarray[Any, np.dtype[np.float64]]


def recommendation_figure(
    result: Recommendation, unit: Callable[[str], str], curve: Picture | None = None
) -> Any:
    """Return the position error before and after as a Matplotlib figure, below the reference or the friction curve.

    Parameters
    ----------
    result : Recommendation
    unit : callable
        Turns an angular unit into the axis's own.
    curve : Picture, optional
        The identified friction over velocity, drawn in place of the reference.
    """
    title, loop = figure_title(result, unit), loop_words(result, unit)
    reference, *errors = panels_of(result, unit)
    if curve is None:
        return plots.figure_of(title, loop, [reference, *errors], HEIGHT)
    return plots.figure_of(title, loop, [panel_of(curve), *errors], TALLER)


def figure_title(result: Recommendation, unit: Callable[[str], str]) -> str:
    """Return the finding that the figure shows."""
    (first, *_) = result.comparisons
    before, after = first.errors
    if first.after is None:
        return f"Position error without friction compensation: {quantity(before, unit('rad'))} RMS"
    return f"Position error: {error_from_to(before, after, unit('rad'))} RMS with {name_of(result)}"


def name_of(result: Recommendation) -> str:
    """Return what is recommended, in a few words."""
    if result.instead is not None:
        return result.instead.label
    assert result.chosen is not None
    return result.chosen.setting.words


def panels_of(result: Recommendation, unit: Callable[[str], str]) -> Iterator[Panel]:
    """Yield the reference, then the error of every comparison."""
    (first, *_) = result.comparisons
    course, angle = result.drive.course, unit("rad")
    start = round(course.run_up / first.before.sample_time)
    span = (0.0, (first.before.position.size - start) * first.before.sample_time)

    def curve(values: Array, label: str, style: Style, factor: float = 1.0) -> Curve:
        time: Array = first.before.sample_time * np.arange(values.size - start, dtype=np.float64)
        return Curve(*plots.envelope(time, factor * values[start:]), label, style)

    factor, prefixed = plots.scaled(float(np.max(np.abs(first.before.reference))), angle)
    reference = curve(first.before.reference, "", REFERENCE, factor)
    time_label = f"time (s); the motion ends at {course.judged.duration:.3g} s"
    yield Panel([reference], f"reference ({prefixed})", time_label, x_limits=span)
    largest = max(float(np.max(np.abs(error_of(c.before)))) for c in result.comparisons)
    factor, prefixed = plots.scaled(largest, angle)
    for comparison in result.comparisons:
        curves = [curve(error_of(comparison.before), "loop alone", BEFORE, factor)]
        if comparison.after is not None:
            curves.append(curve(error_of(comparison.after), "with what is recommended", AFTER, factor))
        yield Panel(
            curves, f"error ({prefixed})", time_label, x_limits=span, note=comparison_note(comparison, angle)
        )


def error_of(trial: Trial) -> Array:
    """Return reference minus position at every sample, rad (m)."""
    return trial.reference - trial.position


def comparison_note(comparison: Comparison, angle: str) -> str:
    """Return the axis and its RMS errors in words."""
    before, after = comparison.errors
    if comparison.after is None:
        return f"{comparison.axis}: RMS {quantity(before, angle)}"
    return f"{comparison.axis}: RMS {error_from_to(before, after, angle)}"


def write_recommendation(
    path: str | os.PathLike[str], found: Identified, result: Recommendation, stability: ControllerStability | None,
    *, notes: Sequence[str], setting_file: str = "recommended.toml", versions: Mapping[str, str] | None = None,
) -> Path:  # fmt: skip
    """Write the report of a recommendation, one HTML file that needs nothing but itself.

    Parameters
    ----------
    path : path
    found : Identified
        The model that the recommendation was made for.
    result : Recommendation
    stability : ControllerStability or None
        Of the loop with what is recommended, about rest, on the best estimate; None if it is not determined.
    notes : sequence of str
        As they are printed.
    setting_file : str
        Name of the file that `stickslip export` takes, as the page's commands have it.
    versions : mapping
        Of the software.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    with plots.house_style():
        figure = recommendation_figure(result, found.unit)
    title = figure_title(result, found.unit)
    shown = {"id": "error", "title": title, "caption": loop_words(result, found.unit)}
    html = filled(
        "recommendation.html",
        title=f"Friction compensation recommended for {found.path.name}",
        ran=f"stickslip {(versions or {}).get('stickslip', '')}, from {found.path}",
        verdict=verdict(result, found.unit),
        tally=list(tally(result, stability, found.unit)),
        figure=shown | plots.embedded_figure(figure),
        setting=list(setting_rows(result, found.unit)),
        command=export_command(result, setting_file),
        conditions=list(conditions(result, found.unit)),
        margins=list(margin_rows(result, stability)),
        missing=not_simulated(result.drive.machine, found.train),
        worse=ALLOWANCE,
        better=result.better,
        repeats=list(when_to_repeat(result, found.unit)),
        warnings=[n for n in notes if n in result.warnings],
        notes=[n for n in notes if n not in result.warnings],
        candidates=[
            [c.setting.label, c.setting.kind, f"{c.setting.gain:.3g}", f"{c.setting.deadband:.3g}",
             f"{100.0 * c.errors[0]:.1f} %", worst_left(c), safety(c)]
            for c in result.candidates
        ],
        compensators=[(*row[:3], row[3].removeprefix("<- ")) for row in beside_rows(result)],
        deadband=f"dead band, {found.unit('rad/s')}",
        data=json.dumps(result.as_dict(), indent=1, default=str, ensure_ascii=False),
    )  # fmt: skip
    return write_whole(Path(path), html)


def tally(
    result: Recommendation, stability: ControllerStability | None, unit: Callable[[str], str]
) -> Iterator[dict[str, str]]:
    """Yield the numbers that an engineer looks for first."""
    before, after = result.comparisons[0].errors
    yield {"count": quantity(before, unit("rad")), "words": "RMS error without compensation, best estimate"}
    if result.comparisons[0].after is None:
        return
    yield {"count": quantity(after, unit("rad")), "words": "with what is recommended, best estimate"}
    if result.confirmed_on > 1:
        words = f"less error, {100.0 * result.confidence:.0f} % interval"
        yield {"count": percent(*result.reduction), "words": words}
    if result.switched_on is not None and result.switched_on.setting.compensates:
        yield {"count": f"{result.margin:.3g}", "words": "times the gain is safe on all sampled axes"}
    if stability is not None and stability.is_linear and math.isfinite(stability.loops[1].phase):
        yield {"count": f"{stability.loops[1].phase:.0f}°", "words": "phase margin while the axis slides"}


def conditions(result: Recommendation, unit: Callable[[str], str]) -> Iterator[tuple[str, str]]:
    """Yield what the recommendation holds for: loop, sampling, drive and motion."""
    drive = result.drive
    yield "loop", loop_words(result, unit)
    yield "inertia", f"{result.inertia:.5g} {unit('kg·m²')}"
    yield "sample time", f"{drive.sample_time:g} s"
    counts = (
        f"{drive.encoder_counts:.6g} counts per revolution" if drive.encoder_counts else "exact positions"
    )
    yield "encoder", counts
    limited = math.isfinite(drive.torque_limit)
    yield "torque limit", f"{drive.torque_limit:g} {unit('N·m')}" if limited else "none"
    yield "reference velocity", {
        "difference": "difference of two reference positions", "instant": "that of the trajectory at the sample",
    }.get(drive.reference_velocity or "", "not stated: both kinds were simulated")  # fmt: skip
    late = "up to one sample, sampled" if drive.delay is None else f"{drive.delay:g} samples"
    yield "delay of the commands", f"{drive.machine.delay:g} samples" if drive.machine else late
    if drive.machine is not None:
        yield "machine", drive.machine.name
    yield "motion", motion_words(result, unit)


def margin_rows(result: Recommendation, stability: ControllerStability | None) -> Iterator[tuple[str, str]]:
    """Yield the margins of the compensator's gain and of the loop about rest."""
    chosen = result.switched_on
    if chosen is not None and chosen.setting.compensates:
        yield "gain of the compensator, by simulation", margin(chosen, result)
    loops = stability.loops if stability is not None and stability.is_linear else ()
    if not loops:
        yield "poles of the loop about rest", "not determined: the loop is not linear about rest"
    for loop in loops:
        name = f"{loop.name}, best estimate"
        if not loop.poles.stable:
            yield name, f"unstable ({loop.poles.growth:+.1f}/s at {loop.poles.frequency:.1f} Hz)"
            continue
        late = f"{loop.delay:.2g}" if loop.delay < LATEST else f"more than {LATEST:g}"
        yield name, f"{loop.margins().partition(', ')[2]}; tolerates {late} more samples of delay"
    if result.hunting and not result.rings:
        yield "at rest", result.hunting
    if result.rings:
        yield "linear controller alone", f"oscillates {result.rings}"


def when_to_repeat(result: Recommendation, unit: Callable[[str], str]) -> Iterator[str]:
    """Yield the changes after which the recommendation no longer holds."""
    path = result.drive.path
    yield "The loop changes: gains, velocity filter, feedforward, sample time, delay or torque limit."
    yield (
        f"The motion gets faster than {path.top_speed:.3g} {unit('rad/s')}, much slower, or much shorter: "
        "recommend again for the new one."
    )
    yield (
        "Friction or inertia changes: another load, temperature, lubricant, seal or belt tension, or wear. Record the "
        "same motion again; stickslip compare tests whether friction has changed."
    )
    yield "The machine behaves otherwise than this page says. Then record it with the compensator switched on."


def export_command(result: Recommendation, setting_file: str) -> str:
    """Return the next command, empty if nothing is recommended."""
    if result.chosen is None and result.instead is None:
        return ""
    whole = result.instead is not None or result.drive.controller is not None
    what = "--controller" if whole else "--compensator recommended"
    return f"stickslip export {shlex.quote(setting_file)} --to c99 {what}"
