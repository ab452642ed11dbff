"""How figures look: labels that can be read."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from stickslip.report import plots
from stickslip.report.styles import REFERENCE


@pytest.mark.parametrize(
    ("low", "high"),
    [(0.36, 6.5), (9.2, 9.9), (2.1, 4.4), (0.19, 11.0), (0.02, 5.0), (110.0, 160.0), (3.0, 3.01)],
)
def test_labels_of_a_logarithmic_axis_do_not_overlap_at_half_width(low: float, high: float) -> None:
    curve = plots.Curve(np.array([low, high]), np.array([0.0, 1.0]), "", REFERENCE)
    figure = plots.figure_of("title", "message", [plots.Panel([curve], "y", "x", x_scale="log")], 2.0)
    figure.canvas.draw()
    axes = figure.axes[0]
    left, right = axes.get_xlim()
    assert left < low
    assert high < right
    labels = [*axes.get_xticklabels(), *axes.get_xticklabels(minor=True)]
    shown = [
        label.get_window_extent()
        for label in labels
        if label.get_text() and left <= label.get_position()[0] <= right
    ]
    assert len(shown) >= 2
    apart = 0.5 * shown[0].height
    assert all(a.x1 + apart < b.x0 for a, b in itertools.pairwise(sorted(shown, key=lambda box: box.x0)))
