"""Comparison of two identified models, with their uncertainty: has the friction changed?"""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from html import escape
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.identification.compare.levels import (
    Change,
    believed,
    common_speeds,
    levels_of,
    said_of,
    unseen,
)
from stickslip.identification.compare.motor_or_load import on_one_side
from stickslip.identification.compare.same_turn import ANGLE, in_one_turn, without_angle
from stickslip.identification.compare.text import lines
from stickslip.identification.compare.trains import on_trains
from stickslip.identification.estimate import Estimate, Picture, Trace
from stickslip.identification.identified_file import Identified, covariance
from stickslip.identification.monte_carlo import curve_band, resisting_torque

Array = np.ndarray[Any, np.dtype[np.float64]]

DRAWS = 400
RARE = 0.005
"""Part of the draws outside the limits at a velocity, on either side: far less than the level of the test."""


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """The result of a comparison; its text is the output of `stickslip compare`.

    Attributes
    ----------
    changes : tuple of Change
        Parameters that both models identified; for different laws only inertia, offset and the like.
    p : float
        p-value of the joint test on the law's parameters (chi-square); NaN if the law has some that are not identified.
    velocity, difference, band : array, shape (n,)
        Second curve minus first, and the half-width that contains 95 % of the whole curves.
    curve_p : float
        Greatest probability that curves of the same friction differ as much somewhere: from `DRAWS` draws, plus one.
    changed : bool
        Whether the joint test, the curves or a single parameter show a change; only the curves, if a parameter of the
        law is not identified.
    notes : tuple of str
    picture : Picture
    levels : tuple of Change
        Torques at break-away and at speeds that both records contain, whatever the laws.
    summary : str
        The verdict, the size of the change, and the parameters it does not cover.
    """

    changes: tuple[Change, ...]
    p: float
    velocity: Array
    difference: Array
    band: Array
    curve_p: float
    changed: bool
    notes: tuple[str, ...]
    picture: Picture
    levels: tuple[Change, ...] = ()
    summary: str = ""

    @property
    def largest(self) -> float:
        """The greatest difference of the curves relative to its band; above 1 the curve has changed."""
        return float(np.max(np.abs(self.difference) / self.band))

    def __str__(self) -> str:
        return "\n".join(lines(self))

    def __repr__(self) -> str:
        return f"<Comparison: {self.summary}>"

    def _repr_html_(self) -> str:
        return f"<pre>{escape(str(self))}</pre>"

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "changed": self.changed, "p": self.p, "curve_difference_over_band": self.largest, "curve_p": self.curve_p,
            "summary": self.summary,
            "parameters": [_row(c) for c in self.changes], "levels": [_row(c) for c in self.levels],
            "curve": {
                "velocity": self.velocity.tolist(), "difference": self.difference.tolist(), "band": self.band.tolist()
            },
            "notes": list(self.notes),
        }  # fmt: skip


def _row(c: Change) -> dict[str, Any]:
    """Return plain data."""
    return {**asdict(c), "percent": c.percent, "percent_span": list(c.percent_span), "changed": c.changed}


def compare_models(
    first: Identified, second: Identified, *, top: float | None = None, level: float = 0.05
) -> Comparison:
    """Test whether friction differs between two identifications on different records.

    Parameters
    ----------
    first, second : Identified
        Curves, levels, inertia and offset are compared whatever the laws; parameters of the law only for the same law.
        Between two sides of a gear, the second is converted to the first one's.
    top : float, optional
        Highest velocity of the curves, rad/s; otherwise the highest that both records contain or, if a file does not
        state it, 30 times the law's own velocity, or 1 rad/s.
    level : float
        Level of all tests together: half for the curves, half for the parameters, jointly and individually.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        If a file has no estimates of its law, or the axes move differently.
    """
    for x in (first, second):
        if not x.law_estimates[0]:
            raise InputError(
                f"{x.path} has no intervals of its law's parameters; only what `stickslip identify` wrote can be "
                "compared"
            )
    if first.motion != second.motion:
        raise InputError(f"{first.path} is a {first.motion} axis and {second.path} a {second.motion} one")
    # For a load behind a gear, whole turns of either shaft are not whole turns of the other.
    second, moved = on_one_side(first, second)
    second = without_angle(second) if moved else in_one_turn(first, second)
    changes, p, notes = compared_parameters(first, second)
    notes = [moved, *notes] if moved else notes
    hashes = {str(d.get("sha256", "")) for d in first.data} & {str(d.get("sha256", "")) for d in second.data}
    if hashes - {""}:
        notes.append(
            "Both come from a record in common: their errors are not independent, and the test is too mild."
        )
    velocity, low, said = grid_of(first, second, top)
    levels = levels_of(first, second, low, float(velocity[-1]))
    difference, band, curve_p, sides = compared_curves(first, second, velocity, 1.0 - 0.5 * level)
    own = {f.name for m in (first, second) for f in m.model.law.fields}
    single = min((c.p for c in changes if c.of(own) and not math.isnan(p + c.p)), default=1.0)
    changed = bool(np.any(np.abs(difference) > band)) or min(p, single) < 0.25 * level
    # A single change that the tests together do not confirm is not called a change.
    changes = tuple(replace(c, decides=changed) if c.of(own) else c for c in changes)
    levels = tuple(replace(c, decides=changed) for c in levels)
    summary = said_of(changes, levels, own, changed, untold(first, second))
    return Comparison(
        changes, p, velocity, difference, band, curve_p, changed,
        (*notes, *on_trains(first, second), *unseen(changes, levels), said),
        picture_of(first, velocity, sides, summary, (first, second)), levels, summary,
    )  # fmt: skip


def untold(first: Identified, second: Identified) -> tuple[str, ...]:
    """Return the parameters of a common law that are not identified in both; none for different laws."""
    if first.model.law.name != second.model.law.name:
        return ()
    missing = {e.name: None for m in (first, second) for e in m.law_estimates[0] if not e.identified}
    return tuple(missing)


def compared_parameters(first: Identified, second: Identified) -> tuple[tuple[Change, ...], float, list[str]]:
    """Return each difference with its interval and p-value, and the joint p-value."""
    special: Any = importlib.import_module("scipy.special")
    laws = first.model.law.name, second.model.law.name
    own = {f.name for m in (first, second) for f in m.model.law.fields}
    names = [
        e.name
        for e in first.estimates
        if e.identified
        and e.name in {x.name for x in second.estimates if x.identified}
        and (laws[0] == laws[1] or e.name.partition("[")[0] not in own)
    ]
    words = (
        [f"The laws differ ({laws[0]}, {laws[1]}): only the curves, levels, inertia and offset are compared."]
        if laws[0] != laws[1]
        else []
    )
    if not names:
        return (), math.nan, words or ["No parameter is identified in both models."]
    a, ca = chosen(first, names)
    b, cb = chosen(second, names)
    logs = [
        x.name != ANGLE and min(x.lower, y.lower, x.value, y.value) > 0.0 for x, y in zip(a, b, strict=True)
    ]
    total = covariance(a, ca, logs) + covariance(b, cb, logs)
    step = np.array([
        math.log(y.value / x.value) if log else y.value - x.value for x, y, log in zip(a, b, logs, strict=True)
    ])  # fmt: skip
    std = np.sqrt(np.diag(total))
    chance = np.array([math.erfc(abs(s) / d / math.sqrt(2.0)) for s, d in zip(step, std, strict=True)])
    chance = holm(chance)
    # Inertia and offset are not friction: their change is reported separately.
    rows = [i for i, n in enumerate(names) if n.partition("[")[0] in own]
    joint = math.nan
    if rows and not words:
        part = total[np.ix_(rows, rows)]
        statistic = float(step[rows] @ np.linalg.pinv(part, hermitian=True) @ step[rows])
        joint = float(special.gammaincc(0.5 * len(rows), 0.5 * statistic))
    changes: list[Change] = []
    for x, y, log, s, d, p in zip(a, b, logs, step, std, chance, strict=True):
        low, high = float(s - 1.96 * d), float(s + 1.96 * d)
        if log:
            low, high = x.value * math.expm1(low), x.value * math.expm1(high)
        changes.append(Change(x.name, x.unit, x.value, y.value, low, high, float(p)))
    left = sorted({e.name for e in (*first.estimates, *second.estimates)} - set(names))
    notes = [f"Not compared, since not identified in both: {', '.join(left)}."] if left else []
    # Parameters that are not identified may compensate those that are, whose intervals then depend on them: a joint
    # test would take two equally good descriptions of one friction for a change.
    if untold(first, second):
        notes.append(
            "As parameters of the law are not identified, the curves alone decide: others may have changed in exchange."
        )
        joint = math.nan
    return tuple(changes), joint, [*words, *notes]


def chosen(model: Identified, names: Sequence[str]) -> tuple[tuple[Estimate, ...], Array]:
    """Return some estimates and their correlation."""
    places = [next(i for i, e in enumerate(model.estimates) if e.name == n) for n in names]
    return tuple(model.estimates[i] for i in places), model.correlation[np.ix_(places, places)]


def holm(p: Array) -> Array:
    """Correct p-values for the number of tests (Holm 1979)."""
    order = np.argsort(p)
    factors = np.arange(p.size, 0, -1)
    out = np.empty(p.size)
    out[order] = np.minimum(np.maximum.accumulate(p[order] * factors), 1.0)
    return out


def grid_of(first: Identified, second: Identified, top: float | None) -> tuple[Array, float, str]:
    """Return the velocities in both directions, the least of them, and a note on them."""
    unit, common = first.unit("rad/s"), common_speeds(first, second)
    if top is not None and not (math.isfinite(top) and top > 0.0):
        raise InputError(f"the highest velocity {top:g} must be greater than 0")
    if common is not None and (top is None or top > common[0]):
        low, high = common[0], min(common[1], top or common[1])
        low = max(low, 0.003 * high)
        said = f"Compared from {low:.3g} to {high:.3g} {unit}, the speeds that both records have."
    else:
        own = [
            float(m.model.law.velocity_scale(m.model.parameters))
            for m in (first, second)
            if m.model.law.velocity_scale
        ]
        high = top or (30.0 * max(own) if own else 1.0)
        low = 0.003 * high
        said = f"Compared up to {high:.3g} {unit}, whether such speeds were recorded or not: the files do not say."
    half = np.geomspace(low, high, 60)
    return np.concatenate([-half[::-1], half]), low, said


def compared_curves(
    first: Identified, second: Identified, velocity: Array, inside: float
) -> tuple[Array, Array, float, list[tuple[Array, Array]]]:  # fmt: skip
    """Return the difference of the curves, its half-width towards 0, its p-value, and each curve's own draws.

    The half-width contains a part `inside` of whole curves: it is the same multiple, at all velocities, of the limits
    that contain nearly all draws at one velocity.
    """
    sides: list[tuple[Array, Array]] = []
    for seed, model in enumerate((first, second)):
        drawn = curve_band(model.model, *believed(model), velocity, DRAWS, seed)
        sides.append((resisting_torque(model.model, velocity), drawn))
    count = min(len(drawn) for _, drawn in sides)
    if count < 20:
        raise InputError(
            "the laws refuse nearly all parameters inside the intervals; identify them from more data"
        )
    rest = (sides[1][1][:count] - sides[1][0]) - (sides[0][1][:count] - sides[0][0])
    # Not standard deviations: the effect of an unidentified parameter in a few draws at one speed would widen the band
    # at all speeds.
    ends: Array = np.quantile(rest, [RARE, 1.0 - RARE], axis=0)
    least = 1e-12 * float(np.max(np.abs(sides[0][0])))
    below: Array = np.maximum(-ends[0], least)
    above: Array = np.maximum(ends[1], least)
    farthest = np.max(np.maximum(-rest / below, rest / above), axis=1)
    difference = sides[1][0] - sides[0][0]
    towards: Array = np.where(difference > 0.0, below, above)
    as_far = int(np.sum(farthest >= np.max(np.abs(difference) / towards)))
    band = float(np.quantile(farthest, inside)) * towards
    return difference, band, (as_far + 1) / (count + 1), sides


def picture_of(
    model: Identified, velocity: Array, sides: Sequence[tuple[Array, Array]], message: str,
    both: tuple[Identified, Identified],
) -> Picture:  # fmt: skip
    """Return both curves with their bands and the recorded speeds, in the positive direction."""
    rows = velocity > 0.0
    names = [m.path.name for m in both]
    labels = names if names[0] != names[1] else [str(m.path) for m in both]
    traces: list[Trace] = []
    for (best, drawn), label, model_ in zip(sides, labels, both, strict=True):
        low, high = np.percentile(drawn[:, rows], [2.5, 97.5], axis=0)
        traces += [Trace("", velocity[rows], low, "own band", high)]
        traces += [Trace(f"{label}, 95 % band", velocity[rows], best[rows])]
        seen = model_.speeds.get("positive", np.zeros(0))
        if seen.size:
            points = np.clip(seen, velocity[rows][0], velocity[rows][-1])
            traces += [
                Trace(
                    f"tenths of the speeds of {label}",
                    points,
                    np.interp(points, velocity[rows], best[rows]),
                    "points",
                )
            ]
    return Picture(
        "comparison", "Friction at constant velocity", message, f"velocity ({model.unit('rad/s')})",
        f"friction torque ({model.unit('N·m')})", tuple(traces), "log",
    )  # fmt: skip
