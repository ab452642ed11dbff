"""A Matplotlib figure without pyplot that a notebook shows."""

from __future__ import annotations

import io
from typing import Any, cast

from matplotlib.figure import Figure

from stickslip.report.plots import DPI


class ShownFigure(Figure):
    """A figure that a notebook displays as the value of a cell, whether or not it has loaded pyplot.

    `savefig` writes it. It belongs to no window, so that a script that makes many keeps none open.
    """

    def _repr_png_(self) -> bytes:
        file, figure = io.BytesIO(), cast("Any", self)
        figure.savefig(file, format="png", dpi=DPI)
        return file.getvalue()
