"""The map of stability: which gain every compensator bears, over sample time and over filter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stickslip.analyse.stability import FILTERS, MOST_GAIN, TIMES, Stability
from stickslip.report.plots import Curve, Panel, Style, style_of

__all__ = ["picture_of_stability"]

Array = np.ndarray[Any, np.dtype[np.float64]]

ONE = Style("#000000", (0, (1, 1.5)), 1.0)
NOW = Style("#999999", "-", 0.9)


def picture_of_stability(found: Stability) -> tuple[str, str, Sequence[Panel], float]:
    """Gain margins over sample time and over the filter's corner: stable below each line."""
    now, names = 1e3 * found.drive.sample_time, list(found.over_time)
    left = [_line(name, 1e3 * TIMES, found.over_time[name], names) for name in names]
    right = [_line(name, FILTERS, found.over_filter[name], names) for name in names]
    top = min(MOST_GAIN, 1.6)
    one = "gain 1"
    panels = (
        Panel(
            [*left, Curve(np.array([1e3 * TIMES[0], 1e3 * TIMES[-1]]), np.ones(2), one, ONE),
             Curve(np.array([now]), np.array([0.0]), "this drive", NOW, "vertical")],
            "largest stable gain", "sample time (ms)", (1e3 * TIMES[0], 1e3 * TIMES[-1]), (-0.03, top),
            "without filter", "log",
        ),
        Panel(
            [*right, Curve(np.array([FILTERS[0], FILTERS[-1]]), np.ones(2), one, ONE)],
            "largest stable gain", "corner of the filter (Hz)", (FILTERS[0], FILTERS[-1]), (-0.03, top),
            f"at {now:g} ms", "log",
        ),
    )  # fmt: skip
    alone = found.linear.at_one
    if alone.stable:
        advice = [f"{r.name} with gain {r.gain:g}" + (f" and {r.filter_hz:g} Hz" if r.filter_hz else "")
                  for r in found.recommended.values() if r]  # fmt: skip
        message = "stable below each line; safe: " + (", ".join(advice) or "none of them")
    else:
        message = f"the linear controller alone is unstable here ({alone.growth:+.0f}/s at {alone.frequency:.0f} Hz)"
    return "Gain that feedback compensation bears", message, panels, 2.0


def _line(name: str, x: Array, margin: Array, names: Sequence[str]) -> Curve:
    return Curve(x, np.minimum(margin, MOST_GAIN), name, style_of(name, names))
