"""A panel as the text of an SVG, looking as `stickslip.report.plots` draws it, without matplotlib.

Loading matplotlib and drawing the nine pictures of an identification took a third of `stickslip identify`
(docs/decisions/0022). What is drawn is plain: lines, points, bands and marks over one pair of axes. Letters are
letters here, in a font of the viewer.
"""

from __future__ import annotations

import base64
import math
import textwrap
from collections.abc import Callable, Sequence
from html import escape
from typing import Any

import numpy as np

from stickslip.report.plots import LEGEND, WIDTH, Curve, Panel, tied
from stickslip.report.styles import Style

Array = np.ndarray[Any, np.dtype[np.float64]]
Points = Callable[[Array], Array]

INCH = 72.0
FONT = "DejaVu Sans, Verdana, Helvetica, Arial, sans-serif"
MARGIN = 0.05
"""Of the data's range, left free at either end."""
LETTER = 0.6
"""Width of a letter on average, of its height: for the places of a legend's entries."""
GREY, GRID = "#444444", "#dddddd"
MOST = 9.0
"""Steps of the numbers along an axis."""
CELL = 0.5
"""Points (1/72 inch) below which two places look the same."""
SIZES = {"points": 3.2, "open points": 3.2, "cloud": 1.8}
"""Diameter of a point, points (1/72 inch)."""


def embedded_svg(title: str, message: str, panel: Panel, height: float) -> dict[str, Any]:
    """The picture as a data URI, and its size in pixels."""
    text, size = svg_of(title, message, panel, height)
    source = f"data:image/svg+xml;base64,{base64.b64encode(text.encode()).decode('ascii')}"
    return {"source": source, "width": round(size[0] * 2), "height": round(size[1] * 2)}


def svg_of(title: str, message: str, panel: Panel, height: float) -> tuple[str, tuple[float, float]]:
    """The text of an SVG, and its width and height, points (1/72 inch).

    Parameters
    ----------
    title, message : str
        What it is; what it shows.
    panel : Panel
        With curves of every kind but "area", numbers along y.
    height : float
        Of the panel, inches.
    """
    names = list(dict.fromkeys(c.label for c in panel.curves if c.label))
    columns = max(1, min(4, len(names), LEGEND // (max(map(len, names), default=0) + 9)))
    rows = math.ceil(len(names) / columns)
    heading, lines = textwrap.wrap(title, 60), textwrap.wrap(tied(message), 74, break_on_hyphens=False)
    head = INCH * (0.24 + 0.13 * (len(heading) + max(1, len(lines))))
    wide, high = INCH * WIDTH, head + INCH * (height + 0.26 + 0.17 * rows)
    box = (0.14 * wide, head + 0.06 * INCH, 0.83 * wide, (height - 0.2) * INCH)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{wide:.2f}pt" height="{high:.2f}pt" '
        f'viewBox="0 0 {wide:.2f} {high:.2f}" font-family="{FONT}" font-size="8">',
        f'<rect width="{wide:.2f}" height="{high:.2f}" fill="#ffffff"/>',
        *(written(line, 0.02 * wide, 0.07 * INCH + 7.5 + 0.13 * INCH * i, ' font-weight="bold"')
          for i, line in enumerate(heading)),
        *(written(line, 0.02 * wide, INCH * (0.12 + 0.13 * (len(heading) + i)) + 7.0, f' font-size="7.5" fill="{GREY}"')
          for i, line in enumerate(lines)),
        *axes(panel, box),
    ]  # fmt: skip
    if len(names) > 1:
        parts += legend(panel.curves, names, columns, (0.53 * wide, high - INCH * 0.17 * rows))
    return "\n".join([*parts, "</svg>"]), (wide, high)


def axes(panel: Panel, box: tuple[float, float, float, float]) -> list[str]:
    """Grid, curves, frame and numbers in a box: left, top, width and height, points."""
    left, top, width, height = box
    x_low, x_high = panel.x_limits or limits([c.x for c in panel.curves if c.kind != "rug"], panel.x_scale)
    y_low, y_high = panel.y_limits or limits(
        [y for c in panel.curves if c.kind not in ("vertical", "rug") for y in (c.y, c.y2) if y is not None],
        panel.y_scale,
    )
    across = scale(x_low, x_high, panel.x_scale, left, left + width)
    up = scale(y_low, y_high, panel.y_scale, top + height, top)
    x_ticks, y_ticks = (
        ticks_between(x_low, x_high, panel.x_scale),
        ticks_between(y_low, y_high, panel.y_scale),
    )
    bottom, right = top + height, left + width
    grid = [f"M{x:.2f} {top:.2f}V{bottom:.2f}" for x in across(np.array([t for t, _ in x_ticks]))]
    grid += [f"M{left:.2f} {y:.2f}H{right:.2f}" for y in up(np.array([t for t, _ in y_ticks]))]
    marks = [f"M{x:.2f} {bottom:.2f}v3.5" for x in across(np.array([t for t, _ in x_ticks]))]
    marks += [f"M{left:.2f} {y:.2f}h-3.5" for y in up(np.array([t for t, _ in y_ticks]))]
    if panel.x_scale == "log":
        marks += [f"M{x:.2f} {bottom:.2f}v2" for x in across(np.array(between_decades(x_low, x_high)))]
    place = f' x="{left - 0.122 * width:.2f}" y="{top + 0.5 * height:.2f}"'
    turned = f"rotate(-90 {left - 0.122 * width:.2f} {top + 0.5 * height:.2f})"
    return [
        f'<clipPath id="in"><rect x="{left:.2f}" y="{top:.2f}" width="{width:.2f}" height="{height:.2f}"/></clipPath>',
        f'<path d="{"".join(grid)}" stroke="{GRID}" stroke-width="0.5"/>',
        '<g clip-path="url(#in)" fill="none" stroke-linejoin="round" stroke-linecap="round">',
        *(filled for c in panel.curves if (filled := band(c, across, up))),
        *(drawn(c, across, up, top, bottom) for c in panel.curves),
        "</g>",
        f'<path d="M{left:.2f} {top:.2f}h{width:.2f}v{height:.2f}h-{width:.2f}z{"".join(marks)}" fill="none" '
        'stroke="#000000" stroke-width="0.6"/>',
        *(written(text, x, bottom + 12.0, ' text-anchor="middle"')
          for (_, text), x in zip(x_ticks, across(np.array([t for t, _ in x_ticks])), strict=True)),
        *(written(text, left - 5.5, y + 2.9, ' text-anchor="end"')
          for (_, text), y in zip(y_ticks, up(np.array([t for t, _ in y_ticks])), strict=True)),
        written(panel.x_label, left + 0.5 * width, bottom + 22.5, ' text-anchor="middle"'),
        f'<text{place} text-anchor="middle" transform="{turned}">{escape(panel.y_label)}</text>',
    ]  # fmt: skip


# ---- scales ---------------------------------------------------------------------------------------------------


def limits(values: Sequence[Array], kind: str) -> tuple[float, float]:
    """Least and greatest value, with a margin."""
    every = np.concatenate([v[np.isfinite(v)] for v in values]) if values else np.zeros(0)
    every = every[every > 0.0] if kind == "log" else every
    if not every.size:
        return (0.1, 1.0) if kind == "log" else (0.0, 1.0)
    low, high = (float(f(every)) for f in (np.min, np.max))
    if kind == "log":
        stretch = max(high / low, 1.0 + 1e-9) ** MARGIN
        return low / stretch, high * stretch
    room = MARGIN * (high - low) if high > low else 0.05 * max(abs(low), 1.0)
    return low - room, high + room


def scale(low: float, high: float, kind: str, begin: float, end: float) -> Points:
    """From values to points of the picture."""
    if kind == "log":
        low, high = math.log10(low), math.log10(high)

    def points(values: Array) -> Array:
        if kind == "log":
            values = np.log10(np.where(values > 0.0, values, np.nan))
        return begin + (values - low) * ((end - begin) / (high - low))

    return points


def ticks_between(low: float, high: float, kind: str) -> list[tuple[float, str]]:
    """Round values and how they are written; 1, 2 and 5 of a decade where few decades show."""
    if kind == "log":
        decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        few = high < 300.0 * low
        found = [
            m * 10.0**d for d in decades for m in ((1, 2, 5) if few else (1,)) if low <= m * 10.0**d <= high
        ]
        if len(found) >= 3 or not few:
            return [(t, f"{t:g}") for t in found]
    size = 10.0 ** math.floor(math.log10((high - low) / MOST))
    step = next(m * size for m in (1.0, 2.0, 2.5, 5.0, 10.0) if (high - low) / (m * size) <= MOST)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    found = [step * k for k in range(first, last + 1)]
    form = f".{digits(step)}f" if 1e-4 <= step < 1e6 else ".6g"
    return [(t, format(t, form).replace("-", "\N{MINUS SIGN}")) for t in found]


def digits(step: float) -> int:
    """Decimals that a step of ticks needs."""
    return next((k for k in range(9) if abs(step * 10.0**k - round(step * 10.0**k)) < 1e-6), 9)


def between_decades(low: float, high: float) -> list[float]:
    """2 to 9 of every decade."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return [m * 10.0**d for d in decades for m in range(2, 10) if low <= m * 10.0**d <= high]


# ---- curves ---------------------------------------------------------------------------------------------------


def drawn(curve: Curve, across: Points, up: Points, top: float, bottom: float) -> str:
    """The marks of one curve."""
    style = curve.style
    x = across(curve.x)
    if curve.kind == "vertical":
        path = "".join(f"M{p:.2f} {top:.2f}V{bottom:.2f}" for p in x)
        return f'<path d="{path}"{stroke(style)}/>'
    if curve.kind == "rug":
        foot = bottom - 0.03 * (bottom - top)
        path = "".join(f"M{p:.2f} {foot - 3.5:.2f}v7" for p in x)
        return f'<path d="{path}" stroke="{style.colour}" stroke-width="0.7"/>'
    if curve.kind in SIZES:
        return dots(curve.kind, style, x, up(curve.y))
    lines = [path_of(x, up(curve.y)), *([] if curve.y2 is None else [path_of(x, up(curve.y2))])]
    return f'<path d="{"".join(lines)}"{stroke(style)}/>'


def dots(kind: str, style: Style, x: Array, y: Array) -> str:
    """Points: round caps of lines without length, or rings."""
    good = np.isfinite(x) & np.isfinite(y)
    at = np.column_stack([x[good], y[good]])
    seen = np.sort(np.unique(np.round(at / CELL), axis=0, return_index=True)[1])
    pairs, size = at[seen].tolist(), SIZES[kind]
    if kind == "open points":
        r = 0.5 * size
        path = "".join(
            f"M{a - r:.2f} {b:.2f}a{r} {r} 0 1 0 {size} 0a{r} {r} 0 1 0 -{size} 0" for a, b in pairs
        )
        return f'<path d="{path}" stroke="{style.colour}" stroke-width="0.8"/>'
    path = "".join(f"M{a:.2f} {b:.2f}h0" for a, b in pairs)
    width = size if kind == "cloud" else size + 0.8
    return f'<path d="{path}" stroke="{style.colour}" stroke-width="{width:g}"/>'


def band(curve: Curve, across: Points, up: Points) -> str:
    """The area between a band's edges; nothing of other curves."""
    if curve.kind != "band" or curve.y2 is None:
        return ""
    good = np.isfinite(curve.x) & np.isfinite(curve.y) & np.isfinite(curve.y2)
    x = np.concatenate([curve.x[good], curve.x[good][::-1]])
    y = np.concatenate([curve.y[good], curve.y2[good][::-1]])
    return (
        f'<path d="{path_of(across(x), up(y))}z" fill="{curve.style.colour}" fill-opacity="0.25"/>'
        if x.size
        else ""
    )


def path_of(x: Array, y: Array) -> str:
    """A line through points, interrupted where one is no number; points where the last one lies are left out."""
    cells = np.round(np.column_stack([x, y]) / CELL)
    other = np.ones(x.size, dtype=np.bool_)
    other[1:-1] = np.any(cells[1:-1] != cells[:-2], axis=1)
    x, y, out = x[other], y[other], list[str]()
    pen = "M"
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        if not (math.isfinite(a) and math.isfinite(b)):
            pen = "M"
            continue
        out.append(f"{pen}{a:.2f} {b:.2f}")
        pen = "L"
    return "".join(out)


def stroke(style: Style) -> str:
    """Colour, width and dashes of a line; dashes are given in widths."""
    dashes = (
        "" if isinstance(style.dashes, str) else " ".join(f"{style.width * d:.2f}" for d in style.dashes[1])
    )
    more = f' stroke-dasharray="{dashes}"' if dashes else ""
    return f' stroke="{style.colour}" stroke-width="{style.width:g}"{more}'


# ---- letters --------------------------------------------------------------------------------------------------


def written(text: str, x: float, y: float, more: str = "") -> str:
    """A line of text, y its base line."""
    return f'<text x="{x:.2f}" y="{y:.2f}"{more}>{escape(text)}</text>'


def legend(
    curves: Sequence[Curve], names: Sequence[str], columns: int, place: tuple[float, float]
) -> list[str]:
    """Samples and names in columns around the middle, below y."""
    middle, top = place
    size, rows = 7.5, math.ceil(len(names) / columns)
    lists = [names[i : i + rows] for i in range(0, len(names), rows)]
    widths = [3.4 * size + LETTER * size * max(map(len, part)) for part in lists]
    x = middle - 0.5 * (sum(widths) + 1.4 * size * (len(widths) - 1))
    out: list[str] = []
    for part, width in zip(lists, widths, strict=True):
        for row, name in enumerate(part):
            y = top + INCH * 0.17 * row + 4.0
            curve = [c for c in curves if c.label == name][-1]
            out += [
                sample(curve, x, y, 2.6 * size),
                written(name, x + 3.4 * size, y + 2.7, f' font-size="{size}"'),
            ]
        x += width + 1.4 * size
    return out


def sample(curve: Curve, x: float, y: float, width: float) -> str:
    """What stands before a name: a piece of the line, or one of the points."""
    centre = np.array([x + 0.5 * width]), np.array([y])
    if curve.kind in SIZES:
        return f'<g fill="none" stroke-linecap="round">{dots(curve.kind, curve.style, *centre)}</g>'
    if curve.kind == "rug":
        return f'<path d="M{x + 0.5 * width:.2f} {y - 3.5:.2f}v7" stroke="{curve.style.colour}" stroke-width="0.7"/>'
    if curve.kind == "band":
        wide = f'stroke="{curve.style.colour}" stroke-width="6" stroke-opacity="0.35"'
        return f'<path d="M{x:.2f} {y:.2f}h{width:.2f}" {wide}/>'
    return f'<path d="M{x:.2f} {y:.2f}h{width:.2f}"{stroke(curve.style)}/>'
