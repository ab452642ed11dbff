"""Pictures written as SVG without matplotlib: what is drawn where, numbers along the axes, letters that are safe."""

from __future__ import annotations

import re
import subprocess
import sys
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from stickslip.report.plots import Curve, Panel
from stickslip.report.styles import Style
from stickslip.report.svg import embedded_svg, svg_of, ticks_between

LINE = Style("#0072B2", (0, (5, 1.5)), 1.4)
SVG = "{http://www.w3.org/2000/svg}"


def tree(panel: Panel, title: str = "title", message: str = "message") -> ElementTree.Element:
    return ElementTree.fromstring(svg_of(title, message, panel, 2.7)[0])


def texts(panel: Panel) -> list[str]:
    return ["".join(t.itertext()) for t in tree(panel).iter(f"{SVG}text")]


def paths(panel: Panel) -> list[str]:
    """The paths within the axes, without the frame."""
    inside = next(g for g in tree(panel).iter(f"{SVG}g") if "clip-path" in g.attrib)
    return [p.attrib["d"] for p in inside.iter(f"{SVG}path")]


def places(path: str) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in re.findall(r"[ML](-?[\d.]+) (-?[\d.]+)", path)]


def test_a_line_reaches_from_corner_to_corner_inside_the_margins() -> None:
    panel = Panel([Curve(np.array([0.0, 10.0]), np.array([-1.0, 1.0]), "a", LINE)], "y", "x")
    frame = next(tree(panel).iter(f"{SVG}clipPath"))[0].attrib
    left, top, width, height = (float(frame[k]) for k in ("x", "y", "width", "height"))
    first, last = places(paths(panel)[0])
    part = 0.05 / 1.1  # of the width is margin
    assert first == pytest.approx((left + part * width, top + (1.0 - part) * height), abs=0.01)
    assert last == pytest.approx((left + (1.0 - part) * width, top + part * height), abs=0.01)


def test_a_line_is_interrupted_where_a_value_is_missing() -> None:
    y = np.array([0.0, 1.0, np.nan, 2.0, 3.0])
    (path,) = paths(Panel([Curve(np.arange(5.0), y, "", LINE)], "y", "x"))
    assert path.count("M") == 2
    assert path.count("L") == 2


def test_a_hundred_thousand_points_of_a_loop_stay_a_small_picture() -> None:
    angle = np.linspace(0.0, 4.0 * np.pi, 100_000)
    for kind in ("line", "cloud"):
        text, _ = svg_of(
            "t", "m", Panel([Curve(np.sin(angle), np.cos(angle), "", LINE, kind)], "y", "x"), 2.7
        )
        assert len(text) < 100_000


def test_on_a_log_scale_a_decade_has_one_width_and_what_is_not_positive_is_left_out() -> None:
    x = np.array([0.0, 0.01, 0.1, 1.0, 10.0])
    (path,) = paths(Panel([Curve(x, np.arange(5.0), "", LINE)], "y", "x", x_scale="log"))
    steps = np.diff([p[0] for p in places(path)])
    assert steps.size == 3
    assert steps == pytest.approx([steps[0]] * 3, abs=0.02)


def test_every_kind_of_curve_is_drawn_and_named() -> None:
    x = np.array([1.0, 2.0, 3.0])
    kinds = ("line", "points", "open points", "cloud", "vertical", "rug", "band")
    curves = [Curve(x, x, kind, LINE, kind, x + 1.0 if kind == "band" else None) for kind in kinds]
    panel = Panel(curves, "y (N·m)", "x (s)")
    assert set(kinds) | {"y (N·m)", "x (s)"} <= set(texts(panel))
    assert len(paths(panel)) == len(kinds) + 1  # a band has an area and two edges


def test_one_name_alone_needs_no_legend() -> None:
    assert "only" not in texts(Panel([Curve(np.arange(3.0), np.arange(3.0), "only", LINE)], "y", "x"))


def test_names_of_files_cannot_break_the_picture() -> None:
    said = svg_of(
        "<script>&.csv", "a < b & c", Panel([Curve(np.arange(3.0), np.arange(3.0), "", LINE)], "y", "x"), 2.7
    )
    assert "<script>" not in said[0]
    assert "<script>&.csv" in [t.text for t in ElementTree.fromstring(said[0]).iter(f"{SVG}text")]


@pytest.mark.parametrize(
    ("low", "high", "kind", "shown"),
    [
        (-0.45, 0.45, "linear", ["-0.4", "-0.3", "-0.2", "-0.1", "0.0", "0.1", "0.2", "0.3", "0.4"]),
        (0.0, 26.0, "linear", ["0", "5", "10", "15", "20", "25"]),
        (0.0, 2.1, "linear", ["0.00", "0.25", "0.50", "0.75", "1.00", "1.25", "1.50", "1.75", "2.00"]),
        (0.009, 12.0, "log", ["0.01", "0.1", "1", "10"]),
        (0.9, 12.0, "log", ["1", "2", "5", "10"]),
        (3.0, 4.0, "log", ["3.0", "3.2", "3.4", "3.6", "3.8", "4.0"]),
    ],
)  # fmt: skip
def test_numbers_along_an_axis(low: float, high: float, kind: str, shown: list[str]) -> None:
    assert [text.replace("\N{MINUS SIGN}", "-") for _, text in ticks_between(low, high, kind)] == shown


def test_axes_of_one_value_or_none_are_drawn() -> None:
    nothing: Any = np.full(3, np.nan)
    for y in (np.full(3, 2.0), np.zeros(3), nothing):
        assert "x" in texts(Panel([Curve(np.arange(3.0), y, "a", LINE)], "y", "x"))


def test_the_embedded_picture_says_its_size() -> None:
    panel = Panel([Curve(np.arange(3.0), np.arange(3.0), "a", LINE)], "y", "x")
    found = embedded_svg("t", "m", panel, 2.7)
    assert found["source"].startswith("data:image/svg+xml;base64,")
    assert found["width"] == 634  # 4.4 inches at 144 pixels
    assert found["height"] > 400


def test_no_picture_of_a_report_loads_matplotlib() -> None:
    code = (
        "import sys, numpy as np; from stickslip.report import identified;"
        "from stickslip.identification.estimate import *;"
        "x = np.arange(3.0); p = Picture('a', 't', 'm', 'x (s)', 'y (N)', (Trace('l', x, x),));"
        "assert len(identified.figures([p])) == 1; assert 'matplotlib' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
