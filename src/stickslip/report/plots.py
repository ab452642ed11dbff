"""Draw and save figures: small enough to embed, legible at half a page's width.

matplotlib is imported inside the functions, so importing this module is fast.
"""

from __future__ import annotations

import base64
import importlib
import io
import math
import re
import struct
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.errors import unwritable
from stickslip.core.whole_files import draft_of
from stickslip.report.styles import MARKS, Style

Array = np.ndarray[Any, np.dtype[np.float64]]

WIDTH = 4.4  # inches: printed at half a page's width, 8 points stay above 5
DPI = 144
LETTER = 0.068  # inches, of a name along y
MARKED = 5  # marks along a line
LEGEND = 80  # characters in a row of the legend, 9 of them an entry's line and gap
FORMATS = (".svg", ".png", ".pdf")
BEFORE_UNIT = re.compile(r"(?<=\d) (?=(?:[mµ]?(?:rad|N·m|s|Hz|A|V|N)|kg·m²|%|/s)(?![\w·]))")
DATES = {".svg": "Date", ".pdf": "CreationDate"}
RC: dict[str, Any] = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "legend.handlelength": 2.6,
    "lines.solid_capstyle": "round",
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
    "svg.hashsalt": "stickslip",
    "svg.fonttype": "path",
}


@dataclass(frozen=True)
class Curve:
    """One line: its points, shape (n,), label (empty for none in the legend) and style.

    ``kind`` is "line" (as is any word not named here), "points", "open points", "cloud" (many small points), "bar" (a
    line with plain ends), "vertical" (a line across the panel at every x), "rug" (a mark at the foot of the panel at
    every x), "band" (filled between y and y2) or "area" (filled where y2, shape (len(y), len(x)), is above 0).
    """

    x: Array
    y: Array
    label: str
    style: Style
    kind: str = "line"
    y2: Array | None = None


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes
    ----------
    curves : sequence of Curve
    y_label, x_label : str
        With the unit.
    x_limits, y_limits : tuple of float or None
        None fits the data.
    note : str
        A text line above the axes.
    x_scale, y_scale : str
        "linear" or "log".
    legend : str
        Where inside the axes its lines are named ("lower right"); empty: in the figure's one legend below.
    y_names : sequence of str
        What stands at y = 0, 1, 2 ..., from the top down, in place of numbers.
    """

    curves: Sequence[Curve]
    y_label: str
    x_label: str = ""
    x_limits: tuple[float, float] | None = None
    y_limits: tuple[float, float] | None = None
    note: str = ""
    x_scale: str = "linear"
    legend: str = ""
    y_scale: str = "linear"
    y_names: Sequence[str] = ()


def envelope(x: Array, y: Array, bins: int = 380) -> tuple[Array, Array]:
    """The least and the greatest point of each of `bins` stretches of x (ascending), in their order.

    What is left draws the same picture as all points where a stretch is no wider than a dot.
    """
    if x.size <= 2 * bins:
        return x, y
    group = np.minimum((bins * (x - x[0]) / (x[-1] - x[0])).astype(np.int64), bins - 1)
    order = np.lexsort((y, group))
    first = np.flatnonzero(np.diff(group[order], prepend=-1))
    last = np.append(first[1:] - 1, x.size - 1)
    keep = np.unique(np.concatenate([[0, x.size - 1], order[first], order[last]]))
    return x[keep], y[keep]


def scaled(largest: float, unit: str) -> tuple[float, str]:
    """Return factor and unit for values up to `largest`: milli or micro below 0.1 and 1e-4."""
    if not math.isfinite(largest) or largest >= 0.1 or largest == 0.0:
        return 1.0, unit
    return (1e3, f"m{unit}") if largest >= 1e-4 else (1e6, f"µ{unit}")


def one_prefix(*largest: float) -> tuple[float, str]:
    """Return factor and prefix (none, m or µ) for all values of a figure, from the largest of each panel.

    One figure has one prefix, so its panels can be compared.
    """
    known = [x for x in largest if math.isfinite(x) and x > 0.0]
    if not known or min(known) >= 0.1 or max(known) >= 10.0:
        return 1.0, ""
    return (1e3, "m") if max(known) >= 1e-4 else (1e6, "µ")


def quantity(value: float, unit: str) -> str:
    """Return a quantity with three digits in a readable unit: 3.67 mN·m."""
    factor, shown = scaled(abs(value), unit)
    return f"{factor * value:.3g} {shown}"


def tied(text: str) -> str:
    """Return the text with non-breaking spaces between numbers and units."""
    return BEFORE_UNIT.sub("\N{NO-BREAK SPACE}", text)


def draw(path: Path, title: str, message: str, panels: Sequence[Panel], height: float = 2.0) -> None:
    """Draw panels one above the other and save them as path.svg and path.png.

    Parameters
    ----------
    path : Path
        Without a suffix; its folder is made.
    title, message : str
        What it is; what it shows.
    panels : sequence of Panel
        Curves of the same label and style are named once, in one legend below.
    height : float
        Of one panel, inches.
    """
    targets = [path.with_name(path.name + suffix) for suffix in (".svg", ".png")]
    save(targets, title, message, panels, height)


def save(
    targets: Sequence[Path], title: str, message: str, panels: Sequence[Panel], height: float = 2.0,
    option: str = "folder",
) -> None:  # fmt: skip
    """Draw panels as `draw` does and save them in the formats that the suffixes name.

    Parameters
    ----------
    targets : sequence of Path
        Files that end in one of `FORMATS`; their folders are made.
    title, message, panels, height
        As for `draw`.
    option : str
        Of the command line, that chooses where they are written.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    with house_style():
        figure = figure_of(title, message, panels, height)
        for target in targets:
            # No date in the file: the same study gives the same bytes.
            undated = {"metadata": {DATES[target.suffix]: None}} if target.suffix in DATES else {}
            try:
                target.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise unwritable(target, error, option) from None
            with draft_of(target, option) as draft:
                figure.savefig(draft, format=target.suffix[1:], dpi=DPI, **undated)


def house_style() -> Any:
    """Return the context in which Matplotlib draws and saves as all figures of the package are."""
    return importlib.import_module("matplotlib").rc_context(RC)


def embedded_figure(figure: Any) -> dict[str, Any]:
    """Return a Matplotlib figure as the data URI of an SVG, and its size in pixels."""
    file = io.BytesIO()
    with house_style():
        figure.savefig(file, format="svg", metadata={"Date": None})
    return embedded_bytes(file.getvalue(), ".svg")


def embedded(file: Path) -> dict[str, Any]:
    """Return an SVG or PNG as a data URI, and its size in pixels."""
    return embedded_bytes(file.read_bytes(), file.suffix)


def embedded_bytes(data: bytes, suffix: str) -> dict[str, Any]:
    """Return the content of a file whose name ends in `suffix` as a data URI, and its size in pixels."""
    if suffix == ".png":
        kind, (width, height) = "image/png", (72.0 / DPI * x for x in struct.unpack(">II", data[16:24]))
    else:
        kind, head = "image/svg+xml", data[:2000].decode("utf-8", "ignore")
        size = re.search(r'width="([\d.]+)pt" height="([\d.]+)pt"', head) or re.search(
            r'viewBox="0 0 ([\d.]+) ([\d.]+)"', head
        )
        width, height = (float(x) for x in size.groups()) if size else (317.0, 317.0)
    return {
        "source": f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}",
        "width": round(width * 2), "height": round(height * 2),
    }  # fmt: skip


def figure_of(title: str, message: str, panels: Sequence[Panel], height: float = 2.0) -> Any:
    """Return panels one above the other as a Matplotlib figure, without pyplot; arguments as of `draw`.

    Within `house_style` it looks as all figures of the package. A notebook shows it.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from stickslip.report.shown_figure import ShownFigure

    common = [p for p in panels if not p.legend]
    named = dict.fromkeys(c.label for p in common for c in p.curves if c.label)
    longest = max((len(name) for name in named), default=0)
    columns = max(1, min(4, len(named), LEGEND // (longest + 9)))
    rows = math.ceil(len(named) / columns)
    heading = textwrap.wrap(title, 60)
    lines = textwrap.wrap(tied(message), 74, break_on_hyphens=False)
    head = 0.24 + 0.13 * (len(heading) + max(1, len(lines)))
    shared = len({p.x_label for p in panels if p.x_label}) == 1
    total = head + height * len(panels) + (0.26 if common or shared else 0.0) + 0.17 * rows
    figure: Any = ShownFigure(figsize=(WIDTH, total))
    FigureCanvasAgg(figure)
    figure.text(0.02, 1.0 - 0.07 / total, "\n".join(heading), va="top", fontsize=8.0, fontweight="bold")
    figure.text(
        0.02, 1.0 - (0.12 + 0.13 * len(heading)) / total, "\n".join(lines), va="top", fontsize=7.5, color="#444444"
    )  # fmt: skip
    axes: list[Any] = []
    for i, panel in enumerate(panels):
        top = head + height * i
        # Fixed margins: matplotlib's layout engines take longer than the drawing.
        foot = 0.2 if shared else 0.52  # Room for every panel's own label where the axes differ.
        left = _left(panel)
        box = (left, 1.0 - (top + height + 0.06 - foot) / total, 0.97 - left, (height - foot) / total)
        axes.append(figure.add_axes(box, sharex=axes[0] if axes and shared else None))
        _fill(axes[-1], panel, bare=shared and i < len(panels) - 1)
    handles = {line.get_label(): line for a in axes for line in a.get_lines() if line.get_label()[0] != "_"}
    if len(named) > 1:
        shown = [handles[name] for name in named]
        figure.legend(
            handles=shown, loc="lower center", ncols=columns, bbox_to_anchor=(0.53, 0.0), columnspacing=1.4,
            borderaxespad=0.3,
        )  # fmt: skip
    return figure


def _left(panel: Panel) -> float:
    """Where the axes begin, of the figure's width: right of the names along y."""
    if not panel.y_names:
        return 0.17 if "\n" in panel.y_label else 0.14
    letters = max(len(re.sub(r"[\\${}_]", "", name)) for name in panel.y_names)
    return min(max(0.19, (0.16 + LETTER * letters) / WIDTH), 0.45)


def _line(axes: Any, curve: Curve) -> None:
    style, label = curve.style, curve.label or "_nolegend_"
    if curve.kind == "bar":
        axes.plot(
            curve.x, curve.y, color=style.colour, linewidth=style.width, solid_capstyle="butt", label=label
        )
    elif curve.kind == "vertical":
        for x in curve.x:
            axes.axvline(x, color=style.colour, linestyle=style.dashes, linewidth=style.width, label=label)
    elif curve.kind == "area" and curve.y2 is not None:
        colour = style.colour
        axes.contourf(curve.x, curve.y, curve.y2, levels=[0.0, np.inf], colors=[colour], alpha=0.45)
        axes.plot([], [], color=colour, linewidth=6.0, alpha=0.45, label=label)
    elif curve.kind == "rug":
        axes.plot(
            curve.x, np.full(curve.x.size, 0.03), color=style.colour, linestyle="", marker="|", markersize=7.0,
            markeredgewidth=0.7, label=label, transform=axes.get_xaxis_transform(), clip_on=True,
        )  # fmt: skip
    elif curve.kind == "cloud":
        axes.plot(
            curve.x, curve.y, color=style.colour, linestyle="", marker="o", markersize=1.8, markeredgewidth=0.0,
            label=label,
        )  # fmt: skip
    elif curve.kind in ("points", "open points"):
        fill = style.colour if curve.kind == "points" else "none"
        axes.plot(
            curve.x, curve.y, color=style.colour, linestyle="", marker="o", markersize=3.2, label=label,
            markerfacecolor=fill, markeredgewidth=0.8,
        )  # fmt: skip
    else:
        if curve.kind == "band" and curve.y2 is not None:
            axes.fill_between(curve.x, curve.y, curve.y2, color=style.colour, alpha=0.25, linewidth=0.0)
            axes.plot(
                curve.x,
                curve.y2,
                color=style.colour,
                linestyle=style.dashes,
                linewidth=style.width,
                label="_",
            )
            axes.plot([], [], color=style.colour, linewidth=6.0, alpha=0.35, label=label)
            label = "_"
        if style.mark:
            _marks(axes, curve, label)
            label = "_"
        axes.plot(
            curve.x, curve.y, color=style.colour, linestyle=style.dashes, linewidth=style.width, label=label,
            marker=style.marker, markersize=3.5,
        )  # fmt: skip


def _marks(axes: Any, curve: Curve, label: str) -> None:
    """Marks at a few places of a line whose x rises, each style's at other places; in the legend on its line."""
    style = curve.style
    look = {
        "color": style.colour, "marker": style.mark, "markersize": 3.6, "markeredgewidth": 0.8,
        "markerfacecolor": "#ffffff" if style.hollow else style.colour,
    }  # fmt: skip
    axes.plot([], [], linewidth=style.width, label=label, **look)
    if curve.x.size > 1:
        first, span = float(curve.x[0]), float(curve.x[-1] - curve.x[0])
        shift = (0.5 + MARKS.index(style.mark)) / len(MARKS)
        at = [int(np.searchsorted(curve.x, first + span * (i + shift) / MARKED)) for i in range(MARKED)]
        axes.plot(curve.x[at], curve.y[at], linestyle="", label="_", zorder=2.5, **look)


def _plain_ticks(axis: Any, low: float, high: float) -> None:
    """1, 2 and 5 of each decade, or even steps where they are fewer than three: matplotlib's own labels overlap."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    ticks = [m * 10.0**d for d in decades for m in (1, 2, 5) if low * 0.999 <= m * 10.0**d <= high * 1.001]
    if len(ticks) < 3:
        from matplotlib.ticker import MaxNLocator

        ticks = [t for t in MaxNLocator(6, steps=[1, 2, 5, 10]).tick_values(low, high) if low <= t <= high]
    axis.set_ticks(ticks, [f"{t:g}" for t in ticks])
    axis.set_ticks([], minor=True)


def _fill(axes: Any, panel: Panel, bare: bool) -> None:
    axes.set_xscale(panel.x_scale)
    axes.set_yscale(panel.y_scale)
    for curve in panel.curves:
        _line(axes, curve)
    low, high = panel.x_limits or axes.get_xlim()
    if panel.x_scale == "log" and high < 300.0 * low:
        _plain_ticks(axes.xaxis, low, high)
        axes.set_xlim(low, high)  # Ticks may have widened it.
    elif panel.x_scale == "log":
        # Decades as 0.01, not as powers of ten, whose typesetting takes as long as the rest of the picture.
        axes.xaxis.set_major_formatter("{x:g}")
    bottom, top = panel.y_limits or axes.get_ylim()
    if panel.y_scale == "log" and not panel.y_names and top < 300.0 * bottom:
        _plain_ticks(axes.yaxis, bottom, top)
        axes.set_ylim(bottom, top)
    if panel.y_names:
        axes.set_yticks(range(len(panel.y_names)), panel.y_names)
        axes.set_ylim(len(panel.y_names) - 0.5, -0.5)
        axes.grid(visible=False, axis="y")
    axes.set_ylabel(panel.y_label)
    # A label of two lines begins nearer to the axis, where its second line ends.
    axes.yaxis.set_label_coords(-0.122 if "\n" not in panel.y_label else -0.095, 0.5)
    if panel.x_limits:
        axes.set_xlim(*panel.x_limits)
    if panel.y_limits:
        axes.set_ylim(*panel.y_limits)
    if panel.legend:
        axes.legend(loc=panel.legend, borderaxespad=0.2, labelspacing=0.3, fontsize=7.0)
    if panel.note:
        axes.text(
            1.0,
            1.015,
            panel.note,
            transform=axes.transAxes,
            ha="right",
            va="bottom",
            fontsize=6.3,
            color="#444444",
        )
    if bare:
        axes.tick_params(labelbottom=False)
    else:
        axes.set_xlabel(panel.x_label)
        axes.xaxis.labelpad = 1.5
