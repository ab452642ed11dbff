"""Draw a sweep: best controller by uncertainty, percentiles, most important parameter, best gain."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.report.plots import Curve, Panel, one_prefix, scaled
from stickslip.report.plots import draw as draw_panels
from stickslip.report.styles import Style, styles_of
from stickslip.report.swept_names import metric_named, number_named
from stickslip.studies.planned_run import PlannedRun
from stickslip.sweeps.dataset import read
from stickslip.sweeps.gains import GAIN, recommended
from stickslip.sweeps.plan import Sweep
from stickslip.sweeps.sample import LEVEL, widest
from stickslip.sweeps.summary import influences, within
from stickslip.sweeps.tune import Tuned, front

Array = np.ndarray[Any, np.dtype[np.float64]]
LEVELS = 13
HIGH = 95.0
"""The percentile for evaluating a design."""
KINDS = ("percentiles", "gain", "uncertainty", "tornado")
"""Prefix of the figures' names."""
BAND = Style("#0072B2", "-", 4.0)
MEDIAN = Style("#000000", "-", 1.0)
ALL = Style("#000000", "-", 0.8)
LOWER, HIGHER = Style("#0072B2", "-", 4.0), Style("#E69F00", "-", 4.0)


def draw(folder: Path, sweep: Sweep) -> list[Path]:
    """Draw the possible figures of a sweep into ``figures/`` of its folder, replacing those of an earlier run; return
    the PNG files."""
    for kind in KINDS:
        for old in (folder / "figures").glob(f"{kind}-*"):
            old.unlink()
    made: list[Path] = []
    groups: dict[tuple[str, str, str], list[PlannedRun]] = {}
    for run in sweep.runs:
        groups.setdefault((run.slip_rule, run.reference, run.friction), []).append(run)
    for (rule, reference, friction), runs in groups.items():
        stem = f"{rule}-{reference}-{friction}"
        target = folder / "figures"
        made.append(_percentiles(target / f"percentiles-{stem}", folder, sweep, runs))
        if GAIN in sweep.drawn.names:
            made += [p for p in [_gains(target / f"gain-{stem}", folder, sweep, runs)] if p]
        elif sweep.drawn.nested:
            made += [p for p in [_uncertainty(target / f"uncertainty-{stem}", folder, sweep, runs)] if p]
        changed = [run for run in runs if sweep.varied(run)]
        made += [_tornado(target / f"tornado-{stem}-{run.controller}", folder, sweep, run) for run in changed]
    return made


def _sentence(words: str) -> str:
    return words[0].upper() + words[1:]


def _columns(folder: Path, sweep: Sweep, run: PlannedRun) -> tuple[list[Array], Array]:
    """Return the drawn numbers and the sweep's first metric."""
    names = [*sweep.drawn.names, sweep.metrics[0]]
    found = read(folder, sweep, run, names)
    return [found[name] for name in sweep.drawn.names], found[sweep.metrics[0]]


def _saved(stem: Path, title: str, message: str, panels: list[Panel], height: float) -> Path:
    draw_panels(stem, title, message, panels, height)
    return stem.with_name(stem.name + ".png")


# ---- which controller for how much uncertainty ----------------------------------------------------------------


def _uncertainty(stem: Path, folder: Path, sweep: Sweep, runs: list[PlannedRun]) -> Path | None:
    """Draw percentiles over the uncertainty; None with too few cases."""
    what, unit = metric_named(sweep.metrics[0])
    data: dict[str, tuple[Array, Array]] = {}
    for run in runs:
        drawn, values = _columns(folder, sweep, run)
        data[run.controller] = drawn[sweep.drawn.names.index(LEVEL)], values
    levels = np.linspace(0.0, 1.0, LEVELS + 1)[1:]
    lines = {name: within(levels, off, values, HIGH) for name, (off, values) in data.items()}
    if not any(np.any(np.isfinite(y)) for y in lines.values()):
        return None
    largest = max(_or_zero(float(np.max(y[np.isfinite(y)], initial=0.0))) for y in lines.values())
    factor, shown = scaled(largest, unit)
    label = f"{what},\n95th percentile ({shown})"
    percent = 100.0 * widest(sweep.drawn.spreads)
    kinds = {run.controller: run.compensation for run in runs}
    linear = [n for n in lines if not kinds[n]]
    panels: list[Panel] = []
    for kind in ("feedforward", "feedback"):
        if members := [n for n in lines if kinds[n] == kind]:
            panels.append(_lines(percent * levels, lines, [*linear, *members], factor, label, kind))
    if not panels:
        panels.append(_lines(percent * levels, lines, linear, factor, label, ""))
    message = (
        f"{_choice(lines, [n for n in lines if kinds[n]], percent)} {sweep.drawn.cases} cases; all parameters vary "
        "together, each within ± its error"
    )
    return _saved(stem, sweep.title, message, panels, 2.3)


def _choice(lines: dict[str, Array], compensated: list[str], percent: float) -> str:
    """Return the controller to choose as text: of all, and of the compensators."""

    def best(names: list[str]) -> str:
        each = {i: min(names, key=lambda n: _or_inf(lines[n][i])) for i in known}
        first, last = each[known[0]], each[known[-1]]
        if first == last:
            return first
        until = max(i for i in known if all(each[j] == first for j in known if j <= i))
        since = min(i for i in known if all(each[j] == last for j in known if j >= i))
        return (
            f"{first} up to ±{percent * (until + 1) / LEVELS:.0f} %,"
            f" {last} from ±{percent * (since + 1) / LEVELS:.0f} %"
        )

    known = [i for i in range(LEVELS) if any(math.isfinite(y[i]) for y in lines.values())]
    said = f"Lowest: {best(list(lines))}"
    return (
        f"{said}; of the compensators: {best(compensated)}."
        if 0 < len(compensated) < len(lines)
        else f"{said}."
    )


def _lines(
    levels: Array, lines: dict[str, Array], names: list[str], factor: float, label: str, note: str
) -> Panel:
    styles = styles_of(list(lines))
    curves = [Curve(levels, factor * lines[n], n, styles[n]) for n in names]
    return Panel(curves, label, "parameter error (±%)", note=note, y_scale="log")


def _or_zero(value: float) -> float:
    return value if math.isfinite(value) else 0.0


def _or_inf(value: float) -> float:
    return value if math.isfinite(value) else math.inf


# ---- percentiles ------------------------------------------------------------------------------------------------


def _percentiles(stem: Path, folder: Path, sweep: Sweep, runs: list[PlannedRun]) -> Path:
    what, unit = metric_named(sweep.metrics[0])
    rows = [np.asarray(_columns(folder, sweep, run)[1]) for run in runs]
    none = np.full(3, np.nan)
    finite = [v[np.isfinite(v)] for v in rows]
    spans = [np.percentile(v, [5, 50, 95]) if v.size else none for v in finite]
    order = sorted(range(len(runs)), key=lambda i: _or_inf(spans[i][2]))
    factor, shown = scaled(float(np.nanmax(spans)), unit)
    curves: list[Curve] = []
    for place, i in enumerate(order):
        low, middle, high = factor * spans[i]
        at = np.array([float(place), float(place)])
        curves.append(
            Curve(np.array([low, high]), at, "5th to 95th percentile" if place == 0 else "", BAND, "bar")
        )
        curves.append(
            Curve(np.array([middle]), at[:1], "median" if place == 0 else "", MEDIAN, "points")
        )  # fmt: skip
    message = (
        f"{_sentence(what)} over {sweep.drawn.cases} cases; ordered by the 95th percentile, lowest on top"
    )
    panel = Panel(curves, "", f"{what} ({shown})", y_names=[runs[i].controller for i in order], x_scale="log")
    return _saved(stem, sweep.title, message, [panel], 0.7 + 0.17 * len(runs))


# ---- what matters most ------------------------------------------------------------------------------------------


def _tornado(stem: Path, folder: Path, sweep: Sweep, run: PlannedRun) -> Path:
    what, unit = metric_named(sweep.metrics[0])
    drawn, values = _columns(folder, sweep, run)
    names = sweep.varied(run)
    columns = [drawn[i] for i in sorted(sweep.places(run).values())]
    if sweep.drawn.nested:
        # Relative to the range of its case; otherwise its ends would represent large uncertainty of all other
        # parameters.
        middles = [0.5 * (s.low + s.high) for s in sweep.drawn.spreads if s.name in names]
        columns = [(c - m) / drawn[-1] for c, m in zip(columns, middles)]
    pairs = influences(columns, values)
    known = values[np.isfinite(values)]
    middle = float(np.median(known)) if known.size else math.nan
    order = sorted(range(len(pairs)), key=lambda i: -max(abs(x - middle) for x in pairs[i]))
    factor, shown = scaled(max(abs(x) for pair in pairs for x in pair), unit)
    curves: list[Curve] = []
    for place, i in enumerate(order):
        for end, style, label in ((0, LOWER, "lowest tenth"), (1, HIGHER, "highest tenth")):
            at = np.full(2, place + (0.13 if end else -0.13))
            ends = factor * np.array([middle, pairs[i][end]])
            curves.append(Curve(ends, at, label if place == 0 else "", style, "bar"))
    curves.append(Curve(np.array([factor * middle]), np.zeros(1), "all cases", ALL, "vertical"))
    words = [number_named(run, name)[0] for name in names]
    message = (
        f"{run.controller}: median with one parameter in its lowest or highest tenth and the others anywhere; "
        f"{words[order[0]]} matters most"
    )
    panel = Panel(curves, "", f"median {what} ({shown})", y_names=[words[i] for i in order])
    return _saved(stem, sweep.title, message, [panel], 0.75 + 0.2 * len(pairs))


# ---- which gain -------------------------------------------------------------------------------------------------


def _gains(stem: Path, folder: Path, sweep: Sweep, runs: list[PlannedRun]) -> Path | None:
    what, unit = metric_named(sweep.metrics[0])
    helped = [run for run in runs if run.control.is_short and run.control.compensator]
    found = {run.controller: recommended(folder, sweep, run) for run in helped}
    found = {name: choice for name, choice in found.items() if choice.gains.size}
    if not found:
        return None
    factor, shown = scaled(max(float(np.nanmax(c.high)) for c in found.values()), unit)
    styles = styles_of([run.controller for run in runs])
    curves = [Curve(c.gains, factor * c.high, n, styles[n]) for n, c in found.items()]
    best = [
        Curve(np.array([c.gain]), factor * np.array([c.least]), "lowest", ALL, "points")
        for c in found.values()
    ]
    said = ", ".join(f"{n}\u00a0{c.gain:.2f}" for n, c in found.items())
    label = f"{what},\n95th percentile ({shown})"
    panels = [Panel([*curves, *best], label, "compensator gain (-)")]
    width = max(c.width for c in found.values())
    steps = f"; resolution {width:.2g}" if width else ""
    message = f"Best gain: {said} ({sweep.drawn.cases} cases{steps})"
    return _saved(stem, sweep.title, message, panels, 2.1)


# ---- what a setting costs ---------------------------------------------------------------------------------------


def trade_off(stem: Path, sweep: Sweep, tuned: Tuned) -> Path:
    """Draw the first two metrics of every setting tried, and the Pareto front; return the PNG file."""
    (what, unit), (price, price_unit) = (metric_named(name) for name in sweep.metrics[:2])
    scores = tuned.scores[np.all(np.isfinite(tuned.scores), axis=1)]
    usual = [float(np.percentile(scores[:, i], 90)) for i in (0, 1)]
    x, x_shown = scaled(usual[0], unit)
    y, y_shown = scaled(usual[1], price_unit)
    if unit == price_unit:
        x, prefix = one_prefix(*usual)
        y, x_shown, y_shown = x, prefix + unit, prefix + unit
    best = front(scores)
    curves = [
        Curve(x * scores[:, 0], y * scores[:, 1], "settings tried", Style("#999999"), "open points"),
        Curve(x * scores[best, 0], y * scores[best, 1], "best compromises", Style("#0072B2", "-", 1.2, "o")),
        Curve(x * tuned.scores_before[:1], y * tuned.scores_before[1:2], "before", Style("#D55E00"), "points"),
        Curve(x * tuned.scores_after[:1], y * tuned.scores_after[1:2], "chosen", Style("#000000"), "points"),
    ]  # fmt: skip
    chosen = ", ".join(
        f"{words} {before:.3g} to {after:.3g} {own}".rstrip()
        for (words, own), before, after in zip(
            [number_named(tuned.run, n) for n in tuned.names], tuned.before, tuned.after, strict=True
        )
    )
    rank = f"percentile {sweep.percentile:g} over {sweep.drawn.cases} cases"
    message = f"{tuned.run.controller}: {chosen}. Axes: {rank}"
    panel = Panel(curves, f"{price} ({y_shown})", f"{what} ({x_shown})", x_scale="log", y_scale="log")
    return _saved(stem, sweep.title, message, [panel], 2.4)
