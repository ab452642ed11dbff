"""The attraction parameter C of GMS: how fast its elements follow the sliding curve.

From a velocity that varies within the Stribeck region without reversing (thesis 3.1.3.2.4.2, eq. 3.22), where friction
lags behind s(v); or, where no such lag can be measured, as the largest C whose response to a sudden velocity of 5 rad/s
does not overshoot (4.3.1.1.5).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.identify.estimate import Identification, Picture, Trace
from stickslip.identify.fit.noise import Noise, as_noise
from stickslip.identify.presliding.hysteresis import Loop, correlation_lags, curve_of, fit_loop, loop_misfit
from stickslip.model import Model
from stickslip.simulation.prescribed.motion import Along

Array = np.ndarray[Any, np.dtype[np.float64]]

FASTER = (
    "Swing the velocity faster and over the same few degrees: the lag grows with the rate, and what depends on the "
    "angle no longer hides it."
)
SKIPPED = 0.2
"""Part of the record left out at its start: the transient from rest."""
SUDDEN = (5.0, 1e-3, 0.2)
"""A velocity that is reached within one time step, how long that is and the response, rad/s, s, s."""
OVERSHOOT = 1e-3
"""Part of the steady torque beyond which a response overshoots."""


def identify_attraction(loop: Loop, template: Model, *, noise: Noise | float | None = None) -> Identification:
    """Fit C to the lag of friction behind the sliding curve; everything else of the law stays.

    Parameters
    ----------
    loop : Loop
        With its velocity, which must not reverse after the transient.
    template : Model
        A GMS law with identified elements and sliding curve.
    noise : Noise or float, optional
        Standard deviation of a sample, N·m; else from the residual, with its correlation.

    Returns
    -------
    Identification

    Raises
    ------
    InputError
        If the velocity reverses, or is missing.
    """
    if loop.velocity is None:
        raise InputError("the attraction parameter needs the velocity; give the loop one")
    rows = np.arange(int(SKIPPED * loop.time.size), loop.time.size)
    v = loop.velocity[rows]
    if float(np.min(v)) * float(np.max(v)) <= 0.0:
        raise InputError(
            "the velocity reverses or rests; C needs a motion in one direction (thesis eq. 3.22)"
        )
    known = as_noise(noise)
    frozen = [f.name for f in template.law.fields if f.name != "c"]
    options: dict[str, Any] = {"frozen": frozen, "noise": known, "offset": False}
    first, along = fit_loop(loop, template, rows, profiles=False, starts=6, reach=3.0, **options)
    lags = 0 if known else correlation_lags(first.optimum.residuals)
    found, along = fit_loop(loop, template, rows, starts=first, lags=lags, **options)
    curve = curve_of(along, found.vector, found.u)
    traces = (Trace("measured", v, loop.torque[rows], "dense"), Trace("GMS", v, curve[rows]))
    best, *_ = found.estimates
    said = f"C = {best.value:.4g} N·m/s" if best.identified else f"C is not identified: {best.verdict}"
    picture = Picture(
        "attraction",
        "Lag of friction in sliding",
        said,
        "velocity (rad/s)",
        f"friction torque ({loop.unit[1]})",
        traces,
    )
    return Identification(
        "attraction", found.vector.model(found.u), found.estimates, found.correlation,
        loop_misfit(loop, curve, rows, np.zeros(0, dtype=np.intp), found), (), () if best.identified else (FASTER,),
        (picture,),
    )  # fmt: skip


def response_to_velocity(
    model: Model, velocity: float, time_step: float, duration: float
) -> tuple[Array, Array]:
    """Time and torque of a contact at rest that is suddenly moved at a velocity, sampled as a drive would."""
    time: Array = time_step * np.arange(0.0, round(duration / time_step) + 1.0)
    ramp = np.minimum(time / time_step, 1.0) * velocity
    position = np.concatenate([[0.0], np.cumsum(0.5 * (ramp[1:] + ramp[:-1]) * time_step)])
    return time, Along(model.law, time, position, ramp).of(model)


def largest_without_overshoot(
    template: Model, *, lower: float = 1.0, upper: float = 1e4
) -> tuple[float, tuple[str, ...]]:
    """The largest C whose response to a sudden velocity does not overshoot its steady torque (thesis 4.3.1.1.5).

    Parameters
    ----------
    template : Model
        A GMS law.
    lower, upper : float
        Between which C is looked for, N·m/s.

    Returns
    -------
    c : float
        N·m/s; `upper` where none overshoots.
    notes : tuple of str
        What the answer is worth.
    """

    def overshoots(c: float) -> bool:
        _, torque = response_to_velocity(
            Model(template.law, {}, **{**template.parameters._asdict(), "c": c}), *SUDDEN
        )
        steady = abs(template.law.steady(SUDDEN[0], template.parameters)) if template.law.steady else 0.0
        return float(np.max(np.abs(torque))) > (1.0 + OVERSHOOT) * steady

    if overshoots(lower):
        return lower, (
            f"Even C = {lower:g} N·m/s overshoots: the elements break away above the curve at this velocity.",
        )
    if not overshoots(upper):
        return upper, (
            f"No C up to {upper:g} N·m/s overshoots: with its elements' break-away located inside the step, the law "
            "meets the curve from below, so that this criterion does not determine C. Measure the lag instead.",
        )
    for _ in range(40):
        middle = (lower * upper) ** 0.5
        lower, upper = (lower, middle) if overshoots(middle) else (middle, upper)
    return lower, ()
