"""A Matplotlib figure without pyplot that a notebook shows."""

from __future__ import annotations

import io
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from stickslip.report.plots import DPI


class ShownFigure(Figure):
    """A figure that a notebook displays as the value of a cell, whether or not it has loaded pyplot.

    `savefig` writes it. It belongs to no window, so that a script that makes many keeps none open.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        FigureCanvasAgg(self)

    def _repr_png_(self) -> bytes:
        file = io.BytesIO()
        self.savefig(file, format="png", dpi=DPI)
        return file.getvalue()
