"""The attraction parameter C of GMS: how fast its elements follow the sliding curve.

It is fitted to a velocity that varies within the Stribeck region without reversing (thesis 3.1.3.2.4.2, eq. 3.22), with
friction delayed relative to s(v). If no such lag can be measured, it follows from the law alone: the first C whose
response to a sudden velocity of 5 rad/s does not overshoot (4.3.1.1.5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import axis_unit
from stickslip.identification.estimate import Identification, Picture, Trace
from stickslip.identification.fit.noise import Noise, as_noise
from stickslip.identification.presliding.hysteresis import (
    Loop,
    correlation_lags,
    curve_of,
    fit_loop,
    loop_misfit,
)
from stickslip.models.model import Model
from stickslip.simulation.prescribed.motion import Along

Array = np.ndarray[Any, np.dtype[np.float64]]

FASTER = (
    "Swing the velocity faster and over the same few degrees: the lag grows with the rate, and what depends on the "
    "angle no longer hides it."
)
SKIPPED = 0.2
"""Part of the record left out at its start: the transient from rest."""
SUDDEN, RISE, DURATION = 5.0, 1e-3, 0.2
"""Velocity step, rad/s; its rise time, one sample of the thesis's controller, s; and duration of the response, s."""
WITHIN, AFTER = 100, 1000
"""Steps of the rise and of the rest of a response, enough for the overshoot to converge; a single step of the rise
would greatly exaggerate it (thesis Table 10)."""
OVERSHOOT = 1e-3
"""Part of the steady torque above which a response overshoots: less than a line's width in figures 4.14 and 4.38."""
LEAST, MOST, PER_DECADE = 1.0, 1e4, 4
"""Range in which C is searched, N·m/s; values of C per decade at which the overshoot is computed."""


def identify_attraction(loop: Loop, template: Model, *, noise: Noise | float | None = None) -> Identification:
    """Fit C to the lag of friction behind the sliding curve; the law's other parameters are held.

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
    said = (
        f"C = {best.value:.4g} {axis_unit('N·m/s')}"
        if best.identified
        else f"C is not identified: {best.verdict}"
    )
    picture = Picture(
        "attraction",
        "Lag of friction in sliding",
        said,
        f"velocity ({axis_unit('rad/s')})",
        f"friction torque ({axis_unit(loop.unit[1])})",
        traces,
    )
    return Identification(
        "attraction", found.vector.model(found.u), found.estimates, found.correlation,
        loop_misfit(loop, curve, rows, np.zeros(0, dtype=np.intp), found), (), () if best.identified else (FASTER,),
        (picture,),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class OvershootRule:
    """Result of the rule of thesis 4.3.1.1.5 for a law, from `apply_overshoot_rule`.

    Attributes
    ----------
    model : Model
        The GMS law.
    velocity, rise_time : float
        The velocity step, rad/s, and its rise time, s.
    c : float or None
        The first C without overshoot, N·m/s; None if no C qualifies or every C does.
    values, overshoot : array, shape (n,)
        C, N·m/s, ascending, and its overshoot as a part of the steady torque.
    """

    model: Model
    velocity: float
    rise_time: float
    c: float | None
    values: Array
    overshoot: Array

    @property
    def sentence(self) -> str:
        """The result as a sentence."""
        low, high = (f"{x:.5g}" for x in self.values[[0, -1]])
        none = f"below {100.0 * OVERSHOOT:g} %"
        first, last = (f"{100.0 * x:.2g} %" if x > OVERSHOOT else none for x in self.overshoot[[0, -1]])
        trend = f"the overshoot is {first} at {low} and {last} at {high} N·m/s"
        if self.c is not None:
            return f"C = {self.c:.4g} N·m/s is the first without overshoot: {trend}"
        if np.all(self.overshoot > OVERSHOOT):
            return f"no C from {low} to {high} N·m/s qualifies: {trend}"
        return f"the rule does not determine C: no C from {low} to {high} N·m/s overshoots"

    def response(self, c: float) -> tuple[Array, Array]:
        """Return time, s, and torque, N·m, with another C."""
        return response_to_velocity(with_attraction(self.model, c), self.velocity, self.rise_time, DURATION)

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        return [f"response to a sudden {self.velocity:g} rad/s: {self.sentence}"]

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "velocity": self.velocity, "rise_time": self.rise_time, "c": self.c, "values": self.values.tolist(),
            "overshoot": self.overshoot.tolist(), "sentence": self.sentence,
        }  # fmt: skip


def apply_overshoot_rule(
    model: Model,
    *,
    velocity: float = SUDDEN,
    rise_time: float = RISE,
    lower: float = LEAST,
    upper: float = MOST,
) -> OvershootRule:
    """Find the first C whose response to a sudden velocity does not overshoot its steady torque (thesis 4.3.1.1.5).

    It is the limit between values of C with and without overshoot, whether the overshoot decreases with C (friction
    that falls up to this velocity) or increases.

    Parameters
    ----------
    model : Model
        A GMS law; its own C is ignored.
    velocity, rise_time : float
        rad/s, and its rise time, s. Without a rise time, no C overshoots.
    lower, upper : float
        Bounds of C in the search, N·m/s.

    Raises
    ------
    InputError
        If it is another law, or a number is not positive.
    """
    if model.law.name != "gms":
        raise InputError(f"law {model.law.name!r} has no attraction parameter; give a GMS law")
    if not (0.0 < velocity < math.inf and 0.0 < rise_time < DURATION and 0.0 < lower < upper):
        raise InputError(
            f"velocity = {velocity:g} rad/s and rise time = {rise_time:g} s must be greater than 0"
        )

    def overshoot(c: float) -> float:
        _, torque = response_to_velocity(with_attraction(model, c), velocity, rise_time, DURATION)
        return max(float(np.max(torque)) / model.sliding_torque(velocity) - 1.0, 0.0)

    values = np.geomspace(lower, upper, math.ceil(PER_DECADE * math.log10(upper / lower)) + 1)
    found = np.array([overshoot(c) for c in values.tolist()])
    over = found > OVERSHOOT
    changes = np.flatnonzero(over[1:] != over[:-1])
    if not changes.size:
        return OvershootRule(model, velocity, rise_time, None, values, found)
    ends = values[changes[0] : changes[0] + 2].tolist()
    good, bad = ends if over[changes[0] + 1] else ends[::-1]
    while abs(good / bad - 1.0) > 1e-9:
        middle = math.sqrt(good * bad)
        good, bad = (good, middle) if overshoot(middle) > OVERSHOOT else (middle, bad)
    return OvershootRule(model, velocity, rise_time, good, values, found)


def with_attraction(model: Model, c: float) -> Model:
    """Return a GMS law with another C, N·m/s."""
    return Model(model.law, {}, **{**model.parameters._asdict(), "c": c})


def response_to_velocity(
    model: Model, velocity: float, rise_time: float, duration: float
) -> tuple[Array, Array]:
    """Return time, s, and torque, N·m, of a contact at rest moved at a velocity, which rises at a constant rate."""
    rise = np.linspace(0.0, rise_time, WITHIN + 1)
    time = np.concatenate([rise, np.linspace(rise_time, duration, AFTER + 1)[1:]])
    ramp = np.minimum(time / rise_time, 1.0) * velocity
    position = np.concatenate([[0.0], np.cumsum(0.5 * (ramp[1:] + ramp[:-1]) * np.diff(time))])
    return time, Along(model.law, time, position, ramp).of(model)
