"""Figures of the thesis that need no record and no study: phenomena of friction (2.1), fits of the curve (3.1.3.1)."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from stickslip.core.errors import InputError

if TYPE_CHECKING:
    from stickslip.report.analysis_pictures import Drawn


@dataclass(frozen=True)
class Figure:
    """One figure: the module of this package that draws it, its function there, and its title.

    Attributes
    ----------
    module, title, function : str
    """

    module: str
    title: str
    function: str = "picture"


FIGURES: Mapping[str, Figure] = {
    "2.1": Figure("breakaway", "break-away force over the rate of the applied force"),
    "2.2": Figure("presliding", "hysteresis, memory and drift in pre-sliding"),
    "2.3": Figure("frictional_lag", "frictional lag"),
    "2.10": Figure("presliding", "hysteresis with non-local memory (the picture of 2.2)"),
    "2.1.4": Figure("stick_slip", "stick-slip of a dragged mass"),
    "2.1.5": Figure("time_dependence", "friction that depends on time"),
    "2.1.6": Figure("position", "friction that depends on the position"),
    "2.1.7": Figure("direction", "friction that depends on the direction"),
    "3.7": Figure("sliding_fit", "points at constant velocity and the fitted curve"),
    "3.8": Figure("sliding_fit", "inaccurate fits without the second point", "picture_without_bend"),
}
"""By the thesis's figure, or its section where it has no figure."""


def picture_of(number: str) -> Drawn:
    """Simulate and return a figure by its number in `FIGURES`.

    Raises
    ------
    InputError
        If there is no such figure.
    """
    if number not in FIGURES:
        raise InputError(f"no figure {number!r}; choose from {', '.join(FIGURES)}")
    figure = FIGURES[number]
    drawn: Drawn = getattr(importlib.import_module(f"{__name__}.{figure.module}"), figure.function)()
    return drawn
