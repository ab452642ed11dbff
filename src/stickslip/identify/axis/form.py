"""Whether a law means by the names of its parameters what certain sliding tells under these names."""

from __future__ import annotations

import numpy as np

from stickslip.binding import NEGATIVE
from stickslip.spec import Law

TOLD_BY_SLIDING = (
    "inertia", "offset", "gravity", "gravity_angle", "fc", "sigma2", f"fc{NEGATIVE}", f"sigma2{NEGATIVE}",
)  # fmt: skip
"""Names under which certain sliding tells numbers of an axis and of its friction's level and slope."""
FALLS_OVER = (0.3, 30.0)
"""Times the Stribeck velocity between which the curves are compared; without one between a hundredth and a hundred
rad/s (m/s)."""
ALIKE = 1e-3
"""Part of friction's level that the curves may be apart."""


def of_sliding_form(law: Law) -> bool:
    """Whether friction at constant velocity is ``sign(v) (fc + (fs - fc) exp(-|v / vs|^delta_s)) + sigma2 v``.

    Certain sliding fits that curve. A law of one's own whose ``fc`` is the level of another one (a fall as
    1 / (1 + (v / vs)^2), a square of the velocity) has its numbers from the prediction error alone, as under any other
    names. A law without ``fc``, or without a curve, is taken at its word.
    """
    p = law.parameters(dict(law.example))
    if law.steady is None or not hasattr(p, "fc"):
        return True
    has_fall = hasattr(p, "vs") and hasattr(p, "fs")
    scale = float(p.vs) if hasattr(p, "vs") else 1.0
    low, high = FALLS_OVER if hasattr(p, "vs") else (0.01, 100.0)
    v = scale * np.geomspace(low, high, 40)
    level, slope = float(p.fc), float(getattr(p, "sigma2", 0.0))
    expected = level + slope * v
    if has_fall:
        expected += (float(p.fs) - level) * np.exp(-((v / scale) ** float(getattr(p, "delta_s", 2.0))))
    curve = np.array([float(law.steady(float(x), p)) for x in v])
    return bool(np.all(np.abs(curve - expected) <= ALIKE * level + 1e-9 * np.abs(expected)))


def never_falls(law: Law) -> bool:
    """Whether friction at constant velocity nowhere falls as the velocity rises, by the law's example; one without a
    curve may."""
    if law.steady is None:
        return False
    p = law.parameters(dict(law.example))
    v = float(getattr(p, "vs", 0.1)) * np.geomspace(0.01, 1000.0, 200)
    return bool(np.all(np.diff([float(law.steady(float(x), p)) for x in v]) >= 0.0))
