"""Draw pictures of an identification (`stickslip.identification.estimate.Picture`) in the house style."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.identification.estimate import Picture, Trace
from stickslip.report import plots
from stickslip.report.styles import REFERENCE, Style

Array = np.ndarray[Any, np.dtype[np.float64]]

HEIGHT = 2.7
"""Height of a picture's axes, inches."""
LINES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
DASHES: tuple[Any, ...] = (
    "-",
    (0, (5, 1.5)),
    (0, (3, 1, 1, 1)),
    (0, (1.5, 0.8)),
    (0, (7, 1.5, 1.5, 1.5)),
    (0, (1, 1)),
)


def draw_picture_to(picture: Picture, target: Path) -> Path:
    """Draw one picture into a file; the suffix determines the format (.png, .svg, .pdf).

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    plots.save([target], picture.title, picture.message, [panel_of(picture)], HEIGHT, option="plot")
    return target


def panel_of(picture: Picture) -> plots.Panel:
    """Return the picture in the house style: colours, dashes, small values in milli and micro."""
    styles = iter(zip(LINES, DASHES, strict=True))
    x_factor, x_label = _readable(picture.x_label, [t.x for t in picture.traces])
    if picture.x_scale == "log":
        x_factor, x_label = 1.0, picture.x_label
    y_factor, y_label = _readable(
        picture.y_label, [t.y for t in picture.traces if t.kind not in ("vertical", "rug")]
    )
    curves: list[plots.Curve] = []
    below: Trace | None = None
    for trace in picture.traces:
        if trace.kind == "own band":
            below = trace
            continue
        curve = _curve(trace, x_factor, y_factor, styles)
        if below is not None and below.y2 is not None:
            edge = Style(curve.style.colour, "-", 0.6)
            x, low, high = x_factor * below.x, y_factor * below.y, y_factor * below.y2
            curves.append(plots.Curve(x, low, below.label, edge, kind="band", y2=high))
            below = None
        curves.append(curve)
    return plots.Panel(curves, y_label, x_label, x_scale=picture.x_scale)


def _readable(label: str, values: Sequence[Array]) -> tuple[float, str]:
    """Return factor and label for small values: milli or micro before the unit in the label."""
    words, _, unit = label.rpartition(" (")
    if not words or unit in ("-)", "s)"):
        return 1.0, label
    largest = max((float(np.nanmax(np.abs(v))) for v in values if v.size), default=1.0)
    factor, shown = plots.scaled(largest, unit.rstrip(")"))
    return factor, f"{words} ({shown})"


def _curve(trace: Trace, x_factor: float, y_factor: float, styles: Iterator[tuple[str, Any]]) -> plots.Curve:
    if trace.label == "reference":
        style = REFERENCE
    elif trace.kind == "points":
        style = Style("#000000", "", 1.1)
    elif trace.kind == "open points":
        style = Style("#D55E00", "", 1.1)
    elif trace.kind == "wide":
        style = Style("#E69F00", "-", 3.2)
    elif trace.kind == "cloud":
        style = Style("#000000", "", 1.0)
    elif trace.kind == "rug":
        style = Style("#555555", "", 0.8)
    elif trace.kind == "faint":
        style = Style("#E69F00", "-", 0.5)
    elif trace.kind in ("band", "dense"):
        style = Style("#56B4E9", "-", 0.6)
    elif trace.kind == "vertical":
        style = Style("#D55E00", (0, (1.5, 1)), 1.3)
    elif not trace.label:
        style = Style("#555555", (0, (1, 1.5)), 0.8)
    else:
        colour, dashes = next(styles)
        style = Style(colour, dashes, 1.4)
    y2 = None if trace.y2 is None else y_factor * trace.y2
    return plots.Curve(x_factor * trace.x, y_factor * trace.y, trace.label, style, kind=trace.kind, y2=y2)
