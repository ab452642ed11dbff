"""Pre-sliding hysteresis: stiffness and shares of the elements of GMS from loops of torque over displacement.

Thesis 3.1.3.2.4.1 (displacement 3.21, three equal elements) and 4.3.1.1.3 (sinusoidal torque below break-away, second
cycle fitted, since the first one contains the transient from the unknown initial state). A Maxwell-slip model is linear
in its stiffnesses for given slip displacements of the elements: non-negative least squares on a grid of them gives the
shape, neighbours are merged to the requested number of elements, and the law itself is then fitted.
"""

from __future__ import annotations

import importlib
import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.identification.estimate import Identification
from stickslip.identification.fit.noise import Noise, as_noise
from stickslip.identification.fit.parameter_vector import Vector
from stickslip.identification.fit.uncertainty import Fit
from stickslip.identification.presliding.hysteresis import (
    Loop,
    correlation_lags,
    curve_of,
    fit_loop,
    loop_misfit,
    loop_picture,
    relative_error,
    turning_points,
    whole_picture,
)
from stickslip.identification.presliding.known_curve import describe_unused, static_levels, transfer_curve
from stickslip.identification.presliding.loop_uncertainty import add_systematic_errors
from stickslip.models.model import Model
from stickslip.simulation.prescribed.motion import Along

Array = np.ndarray[Any, np.dtype[np.float64]]
Rows = np.ndarray[Any, np.dtype[np.intp]]

GRID = 30
"""Slip displacements of the first, linear fit."""
MOST = 6
"""Most elements of the automatic choice."""
LAG, TURNED = 5e-3, 0.02
"""Greatest lag between torque and position due to sampling, converters and filters, s; least rotation of a loop by such
a lag, rad, for which it is fitted."""
RESOLVED = 0.005
"""Part of the travel to either side, within which a slipping element shows a torque but no stiffness."""
ATTRACTION = 24.0
"""Attraction parameter of thesis Table 1, N·m/s."""
ENOUGH = 1.1
"""Ratio to the best loop error within which the fewest elements are chosen."""


def cycles(position: Array) -> list[Rows]:
    """Return the rows of the cycles between turning points on the same side, without those before the first one.

    If there are three or more, the first one is left out too: it contains the transient.
    """
    turns = turning_points(position)
    bounds = turns[::2]
    found = [np.arange(a, b + 1) for a, b in itertools.pairwise(bounds)]
    if bounds and position.size - bounds[-1] > 0.5 * (found[-1].size if found else np.inf):
        found.append(np.arange(bounds[-1], position.size))
    return found[1:] if len(found) > 2 else found


def stops_of(position: Array, thresholds: Array) -> Array:
    """Return the deflection of a spring that slips at each threshold, along the motion, shape (n, thresholds)."""
    out = np.zeros((position.size, thresholds.size))
    for i in range(1, position.size):
        out[i] = np.clip(out[i - 1] + (position[i] - position[i - 1]), -thresholds, thresholds)
    return out


def maxwell_start(loop: Loop, rows: Rows, elements: int) -> tuple[Array, Array]:
    """Return stiffnesses (N·m/rad) and slip displacements (rad) of a Maxwell-slip model of `elements` elements."""
    optimize: Any = importlib.import_module("scipy.optimize")
    reach = 0.5 * float(np.ptp(loop.position[rows]))
    grid = reach * np.geomspace(0.02, 1.0, GRID)
    columns = np.hstack(
        [stops_of(loop.position, grid)[rows], np.ones((rows.size, 1)), -np.ones((rows.size, 1))]
    )
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    solved = optimize.nnls(columns / scale, loop.torque[rows])[0] / scale
    stiffness = np.asarray(solved[:GRID], dtype=np.float64)
    kept = stiffness > 1e-6 * float(np.max(stiffness, initial=0.0))
    if not np.any(kept):
        raise InputError("the torque does not grow with the displacement; this is no pre-sliding loop")
    k, x = stiffness[kept], grid[kept]
    while k.size > elements:
        # Merge the two closest neighbours; stiffness and slip torque are kept.
        i = int(np.argmin(np.diff(np.log(x))))
        both = float(k[i] + k[i + 1])
        x[i + 1] = (k[i] * x[i] + k[i + 1] * x[i + 1]) / both
        k[i + 1] = both
        k, x = np.delete(k, i), np.delete(x, i)
    while k.size < elements:
        i = int(np.argmax(k * x))
        k, x = np.append(k, 0.5 * k[i]), np.append(x, 1.3 * x[i])
        k[i] *= 0.5
    return k, x


@dataclass(frozen=True)
class Setup:
    """Values that a fit of elements holds, and terms that it fits in addition.

    Attributes
    ----------
    curve : Model
        A law with the sliding curve.
    equal : bool
        Whether all elements have the same share of the curve.
    c : float
        Attraction parameter, N·m/s.
    offset : bool
        Whether a constant torque is fitted.
    damping : float
        Bound of a fitted torque in step with the velocity, N·m·s/rad; 0: none is fitted.
    noise : Noise or None
        Noise of the torque.
    """

    curve: Model
    equal: bool
    c: float
    offset: bool
    damping: float
    noise: Noise | None

    @property
    def fitted(self) -> dict[str, Any]:
        """Options of `fit_loop` other than the noise."""
        return {"offset": self.offset, "damping": self.damping}

    def frozen(self, template: Model) -> list[str]:
        """Return the parameters that pre-sliding loops do not determine: all but k, and alpha unless all are equal."""
        free = {"k"} if self.equal else {"k", "alpha"}
        return [f.name for f in template.law.fields if f.name not in free]

    def start(self, loop: Loop, rows: Rows, elements: int) -> Model:
        """Return a GMS law whose elements come from the linear fit."""
        k, x = maxwell_start(loop, rows, elements)
        if self.equal:
            k, alpha = (
                np.sum(k) * np.linspace(1.5, 0.5, elements) / elements,
                np.full(elements, 1.0 / elements),
            )
        else:
            fs = sum(static_levels(self.curve)) / 2.0
            level = np.maximum(k * x, 0.02 * fs)
            # An element that the loop does not load to its limit receives the rest of the static torque.
            level[int(np.argmax(x))] += max(fs - float(np.sum(level)), 0.0)
            alpha = level / np.sum(level)
        return transfer_curve("gms", self.curve, k=k.tolist(), alpha=alpha.tolist(), c=self.c)


def identify_presliding(
    loop: Loop,
    curve: Model,
    *,
    elements: int = 0,
    shares: str = "free",
    c: float | None = None,
    noise: Noise | float | None = None,
    offset: bool = False,
    inertia: float = 0.0,
) -> Identification:
    """Find the elements of a GMS law from loops of torque over displacement.

    Parameters
    ----------
    loop : Loop
        Pre-sliding motion, two cycles or more; the first full one after the transient is fitted, the others are the
        test.
    curve : Model
        Any law with the previously identified sliding curve: of any shape, symmetric or for each direction.
    elements : int
        Number of elements; 0 for the fewest that predict the other cycles nearly as well as any.
    shares : {"free", "equal"}
        Whether each element has its own share alpha of the curve, or all have the same (thesis Tables 1 and 5).
    c : float, optional
        Attraction parameter, N·m/s, which hardly acts in pre-sliding; None for that of `curve`, or of thesis Table 1.
    noise : Noise or float, optional
        Standard deviation of a sample, N·m; else from the residual, with its correlation. Differing cycles, half a row
        of lag, counts and the torque's scale also widen the intervals.
    offset : bool
        Whether a constant torque is fitted.
    inertia : float
        Inertia between the torque measurement and the contact, kg·m²: the torque that accelerates it is not friction.

    Returns
    -------
    Identification
        ``misfit["held_out_relative"]`` is the loop error on cycles that were not fitted; ``details["loop_errors"]``
        those of the other numbers of elements tried.

    Raises
    ------
    InputError
        If there is no cycle, `shares` is neither word, or there are too many elements.
    """
    if shares not in ("free", "equal"):
        raise InputError(f"shares = {shares!r} must be 'free' or 'equal'")
    if elements > GRID:
        raise InputError(f"elements = {elements} must be at most {GRID}: a loop cannot distinguish more")
    straight, notes = loop.righted()
    straight = straight.without_inertia(inertia) if inertia > 0.0 else straight
    found = cycles(loop.position)
    if not found:
        raise InputError("no full cycle of displacement; record at least two cycles of a slow sinusoid")
    rows = found[0]
    rest = np.concatenate(found[1:]) if len(found) > 1 else np.zeros(0, dtype=np.intp)
    # A lag of the torque makes it lead or follow the velocity, which elements would represent as an unbounded
    # stiffness: the faster the loop, the more.
    cycle = float(straight.time[rows[-1]] - straight.time[rows[0]])
    damping = LAG * float(np.ptp(straight.torque[rows]) / np.ptp(straight.position[rows]))
    damping = damping if 2.0 * math.pi * LAG > TURNED * cycle else 0.0
    attraction = float(getattr(curve.parameters, "c", ATTRACTION)) if c is None else c
    setup = Setup(curve, shares == "equal", attraction, offset, damping, as_noise(noise))
    errors: dict[int, float] = {}
    if elements == 0:
        errors = loop_errors(straight, rows, rest if rest.size else rows, setup)
        elements = next(n for n in sorted(errors) if errors[n] <= ENOUGH * min(errors.values()) + 1e-4)
    wanted = elements
    while True:
        fitted, along = fitted_elements(straight, rows, elements, setup)
        unresolved = stiffest_of(fitted.vector.model(fitted.u), straight, rows)
        if not unresolved or elements <= len(unresolved):
            break
        elements -= len(unresolved)
    if elements < wanted:
        notes += (
            f"{elements} elements of {wanted}: more would slip within {100.0 * RESOLVED:g} % of the travel, where the "
            "loop shows no stiffness.",
        )
    simulated = curve_of(along, fitted.vector, fitted.u)
    model = fitted.vector.model(fitted.u)
    estimates = add_systematic_errors(
        straight, fitted, found, setup.frozen(model), {"noise": setup.noise, **setup.fitted}
    )
    notes = (*notes, *describe_unused(curve, model), *loop_notes(straight, model, rows, rest))
    return Identification(
        "presliding", model, estimates, fitted.correlation, loop_misfit(straight, simulated, rows, rest, fitted),
        notes, (),
        (loop_picture(straight, simulated, rows, rest, model), whole_picture(straight, simulated, model)),
        {"elements": elements, "loop_errors": errors, "curve": simulated, "rows": rows},
    )  # fmt: skip


def fitted_elements(loop: Loop, rows: Rows, elements: int, setup: Setup) -> tuple[Fit, Along]:
    """Fit the law's elements from several starts, then with the residuals' own correlation."""
    template = setup.start(loop, rows, elements)
    options: dict[str, Any] = {"frozen": setup.frozen(template), "noise": setup.noise, **setup.fitted}
    first, _ = fit_loop(loop, template, rows, starts=6, profiles=False, reach=0.7, **options)
    lags = 0 if setup.noise else correlation_lags(first.optimum.residuals)
    starts = stiffest_first(first.vector, first.u)[None, :]
    return fit_loop(loop, template, rows, starts=starts, lags=lags, **options)


def stiffest_of(model: Model, loop: Loop, rows: Rows) -> list[int]:
    """Return the elements that slip within `RESOLVED` of the travel."""
    p, fs = model.parameters, min(static_levels(model))
    reach = 0.5 * float(np.ptp(loop.position[rows]))
    return [i for i in range(len(p.k)) if p.alpha[i] * fs < RESOLVED * reach * p.k[i]]


def stiffest_first(vector: Vector, u: Array) -> Array:
    """Return the same elements, numbered from the stiffest to the softest."""
    named = vector.named(u)
    count = sum(1 for name in named if name.startswith("k["))
    order = sorted(range(count), key=lambda i: -named[f"k[{i}]"])
    for group in ("k", "alpha"):
        values = [named[f"{group}[{i}]"] for i in order]
        named.update({f"{group}[{i}]": v for i, v in enumerate(values)})
    return vector.coordinates(named)


def loop_errors(loop: Loop, rows: Rows, test: Rows, setup: Setup) -> dict[int, float]:
    """Return the relative error on the test rows by the number of elements."""
    out: dict[int, float] = {}
    for n in range(1, MOST + 1):
        template = setup.start(loop, rows, n)
        fitted, along = fit_loop(loop, template, rows, frozen=setup.frozen(template), starts=2, profiles=False,
                                 reach=0.7, **setup.fitted)  # fmt: skip
        out[n] = relative_error(loop, curve_of(along, fitted.vector, fitted.u), test)
        if n > 2 and out[n] > 0.97 * min(out[m] for m in range(1, n)):
            break  # one more element no longer helps
    return out


def loop_notes(loop: Loop, model: Model, rows: Rows, rest: Rows) -> tuple[str, ...]:
    """Return notes on what the loop does not show."""
    p, fs = model.parameters, max(static_levels(model))
    reach = 0.5 * float(np.ptp(loop.position[rows]))
    idle = [i for i in range(len(p.k)) if p.alpha[i] * fs / p.k[i] > reach]
    notes: list[str] = []
    if idle:
        names = ", ".join(f"alpha[{i}]" for i in idle)
        notes.append(f"Elements that never slip in this loop have a share only by the total: {names}.")
    if not rest.size:
        notes.append("There is one cycle after the transient only: the loop error is that of the fit.")
    return tuple(notes)
