"""Whether a law means by the names of its parameters what certain sliding tells under these names."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.binding import NEGATIVE
from stickslip.identify.regression.regression import Regression
from stickslip.model import Model
from stickslip.simulation.prescribed.steady import Steady
from stickslip.spec import Elements, Law

Array = np.ndarray[Any, np.dtype[np.float64]]

TOLD_BY_SLIDING = (
    "inertia", "offset", "gravity", "gravity_angle", "fc", "sigma2", f"fc{NEGATIVE}", f"sigma2{NEGATIVE}",
)  # fmt: skip
"""Names under which certain sliding tells numbers of an axis and of its friction's level and slope."""
OTHERWISE = {"fc": 1.3, "fs": 1.6, "vs": 3.0, "sigma2": 2.0}
"""Factors of a second set of values at which the curves must be the same, so that it is their form that is."""
SPEEDS = 40
USUAL_SPEEDS = 1e-3, 1e2
"""rad/s (m/s)."""
ALIKE = 1e-3
"""Part of friction's level that the curves may be apart."""
EXCEEDS = 1.05
"""Times static and Coulomb torque that friction below the Stribeck velocity may be."""
WIDE = np.geomspace(1e-6, 1e4, 500)
"""rad/s (m/s), over which a fall is looked for."""
ROUNDING = 1e-9
"""Of the largest torque: what a curve may fall by without falling."""


def of_sliding_form(model: Model, slowest: float, fastest: float) -> bool:
    """Whether friction is ``sign(v) (fc + (fs - fc) exp(-|v / vs|^delta_s)) + sigma2 v`` between two speeds.

    Certain sliding fits that curve there. On a steep slope through zero, below it, a contact only creeps. A law of
    one's own whose ``fc`` is the level of another one (a fall as 1 / (1 + (v / vs)^2), a square of the velocity) has
    its numbers from the prediction error alone, as under any other names. A law without ``fc``, or without a curve, is
    taken at its word.

    Parameters
    ----------
    model : Model
        With values as they may be on this axis: a fall far from the speeds does not count.
    slowest, fastest : float
        Of certain sliding, rad/s (m/s).
    """
    law, p = model.law, model.parameters
    if law.steady is None or not hasattr(p, "fc"):
        return True
    v = np.geomspace(max(slowest, 1e-6 * fastest), fastest, SPEEDS)
    steady = Steady(law, v, np.ones(v.size))
    for factors in ({}, OTHERWISE):
        q = p._replace(**{n: f * getattr(p, n) for n, f in factors.items() if hasattr(p, n)})
        usual = usual_curve(q, v)
        apart = np.abs(steady.torque(np.array(law.pack(q))) - usual) > ALIKE * abs(q.fc)
        if np.any(apart & (usual < slope_through_zero(law, q) * v)):
            return False
    return True


def slope_through_zero(law: Law, p: Any) -> float:
    """N·m·s/rad (N·s/m), with which a law lets a contact at rest creep, up to its curve; infinite where it does not."""
    contact = law.modes(p) if law.modes else None
    return contact.slope if isinstance(contact, Elements) else math.inf


def usual_curve(p: Any, v: Array) -> Array:
    """The curve of certain sliding with a law's parameters at speeds above 0, shape (n,)."""
    out = float(p.fc) + float(getattr(p, "sigma2", 0.0)) * v
    if hasattr(p, "fs") and hasattr(p, "vs"):
        fall = np.exp(-((v / float(p.vs)) ** float(getattr(p, "delta_s", 2.0))))
        out = out + (float(p.fs) - float(p.fc)) * fall
    return out


def told_with(model: Model | None, found: Regression) -> bool:
    """Whether what a regression tells of friction are parameters of this law."""
    return model is None or of_sliding_form(model, found.slowest, found.fastest)


def by_usual_names(law: Law) -> bool:
    """Whether a law's ``fc`` and ``sigma2`` are level and slope of friction, by its example."""
    return of_sliding_form(Model(law, **law.example), *USUAL_SPEEDS)


def static_by_name(model: Model) -> bool:
    """Whether a law's ``fs`` bounds its friction below the Stribeck velocity, and is not, say, the excess over ``fc``.

    A steep slope or a smooth sign may never reach it: only a curve that exceeds it means another thing.
    """
    p = model.parameters
    if model.law.steady is None or not (hasattr(p, "fs") and hasattr(p, "fc")):
        return True
    v = float(getattr(p, "vs", 1.0)) * np.geomspace(1e-3, 1.0, SPEEDS)
    curve = Steady(model.law, v, np.ones(v.size)).torque(np.array(model.law.pack(p)))
    level = curve - float(getattr(p, "sigma2", 0.0)) * v
    return bool(np.max(level) <= EXCEEDS * max(float(p.fs), float(p.fc)))


def never_falls(law: Law) -> bool:
    """Whether friction at constant velocity, beside its viscous part, nowhere falls as the velocity rises, by the law's
    example; one without a curve may."""
    if law.steady is None or {"fs", "vs"} <= {f.name for f in law.fields}:
        return False
    curve = Steady(law, WIDE, np.ones(WIDE.size)).torque(
        np.array(law.pack(law.parameters(dict(law.example))))
    )
    if not np.all(np.isfinite(curve)):
        return False
    slope = (curve[-1] - curve[-100]) / (WIDE[-1] - WIDE[-100])
    level = curve - slope * WIDE
    return bool(np.all(np.diff(level) >= -ROUNDING * np.max(np.abs(curve))))
