"""The springs of a commissioned machine: those that its loop resolved, and the law that they make with its curve."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from stickslip.core.record import Record
from stickslip.identification.estimate import Estimate, Identification
from stickslip.identification.fit.student import student_quantile
from stickslip.identification.monte_carlo import WIDEST
from stickslip.identification.presliding.attraction import apply_overshoot_rule
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]
Rows = np.ndarray[Any, np.dtype[np.intp]]

LAG = 5e-3
"""s, of friction in sliding, if the rule of the thesis gives no C; its own values (Tables 9 and 10) are 3.9 and
4.4 ms."""
FIRST = 0.3
"""Of a swing of the torque, along which all elements still stick."""
LEAST = 0.01
"""Of the amplitude of the pre-sliding loop, below which an element is not resolved."""
SOFTEST = 0.003
"""Of the total stiffness, below which an element is none: it would take up its share only after a long way."""


def resolved(found: Identification, amplitude: float) -> Identification:
    """Without the elements that carry less than `LEAST` of the loop, whose stiffness is that of the noise, and those
    softer than `SOFTEST`."""
    assert found.model is not None
    p: Any = found.model.parameters
    stiff = SOFTEST * math.fsum(p.k)
    keep = [i for i in range(len(p.k)) if p.alpha[i] * p.fs >= LEAST * amplitude and p.k[i] >= stiff]
    if len(keep) == len(p.k):
        return found
    total = math.fsum(p.alpha[i] for i in keep)
    values: dict[str, Any] = p._asdict()
    values |= {"k": [p.k[i] for i in keep], "alpha": [p.alpha[i] / total for i in keep]}
    gone = [i for i in range(len(p.k)) if i not in keep]
    note = left_out([p.alpha[i] * p.fs for i in gone if p.k[i] < stiff],
                    [p.alpha[i] * p.fs for i in gone if p.k[i] >= stiff])  # fmt: skip
    estimates = tuple(e for e in found.estimates if not e.name.startswith(("k[", "alpha[")))
    estimates += tuple(
        scaled(dataclasses.replace(found[f"{n}[{i}]"], name=f"{n}[{keep.index(i)}]"), over)
        for n, over in (("k", 1.0), ("alpha", 1.0 / total))
        for i in keep
        if f"{n}[{i}]" in [e.name for e in found.estimates]
    )
    return dataclasses.replace(
        found, model=Model(found.model.law, {}, **values), estimates=estimates, notes=(*found.notes, note),
        correlation=np.eye(len(estimates)),
    )  # fmt: skip


def left_out(soft: Sequence[float], small: Sequence[float]) -> str:
    """What is said of elements that are left out: too soft, or too small, each by the torque that it carries, N·m."""
    parts: list[str] = []
    if soft:
        torques = ", ".join(f"{x:.2g} N·m" for x in soft)
        parts.append(
            f"friction of {torques} that would build up only far beyond the loop's way (stiffness below "
            f"{100 * SOFTEST:g} % of the whole)"
        )
    if small:
        torques = ", ".join(f"{x:.2g} N·m" for x in small)
        parts.append(f"elements of {torques}, less than {100 * LEAST:g} % of the loop's torque")
    return f"Not in the pre-sliding model, since the loop does not determine their stiffness: {'; '.join(parts)}."


def scaled(e: Estimate, factor: float) -> Estimate:
    """The estimate with its interval times a factor."""
    return dataclasses.replace(
        e, value=factor * e.value, std=factor * e.std, lower=factor * e.lower, upper=factor * e.upper
    )


def joined_model(curve: Identification, stuck: Identification) -> tuple[Model, float, tuple[str, ...]]:
    """One GMS law from the curve, the springs and the rule for C; its total stiffness; what is to be said of C."""
    assert curve.model is not None
    assert stuck.model is not None
    springs: Any = stuck.model.parameters
    values: dict[str, Any] = {
        **curve.model.parameters._asdict(),
        "k": list(springs.k),
        "alpha": list(springs.alpha),
    }
    plain: dict[str, Any] = {k: listed(v) for k, v in values.items()}
    model = Model(curve.model.law, {}, **plain)
    rule = apply_overshoot_rule(model)
    c, said = rule.c, ()
    if c is None:
        c = math.fsum(springs.alpha) * stuck_level(stuck) / LAG
        said = (f"By thesis 4.3.1.1.5, {rule.sentence}. C is that of a lag of {1e3 * LAG:g} ms.",)
    return Model(curve.model.law, {}, **{**plain, "c": c}), math.fsum(springs.k), said


def with_lag(
    model: Model, lag: Identification | None, said: tuple[str, ...]
) -> tuple[Model, tuple[str, ...]]:
    """The law with the C that its record tells, else with that of the rule, within what the record allows.

    Parameters
    ----------
    model : Model
        With the C of the rule.
    lag : Identification or None
        Of `stickslip.commission.friction_lag`.
    said : tuple of str
        What is to be said of the rule.
    """
    if lag is None:
        return model, said
    c = lag["c"]
    rule = float(model.parameters.c)
    value = c.value if c.identified else min(max(rule, c.lower), c.upper)
    if c.identified:
        said = (f"C = {value:.3g} N·m/s is that of the lag of friction in sliding.",)
    else:
        what = (
            ""
            if value == rule
            else f"; the rule's {rule:.3g} N·m/s lies outside, so that the nearest is taken"
        )
        said = (*said, f"C = {value:.3g} N·m/s is not identified: {c.verdict}{what}.")
    values: dict[str, Any] = {k: listed(v) for k, v in model.parameters._asdict().items()}
    return Model(model.law, {}, **{**values, "c": value}), said


def listed(value: Any) -> Any:
    """Tuples as lists, as `Model` takes them."""
    return list(cast("tuple[float, ...]", value)) if isinstance(value, tuple) else value


def stuck_level(stuck: Identification) -> float:
    """The torque that the springs carry together, N·m."""
    assert stuck.model is not None
    return float(stuck.model.parameters.fs)


def with_stiffness(found: Identification, record: Record, resolution: float) -> Identification:
    """The total stiffness beside the elements, with the interval that its reversals and the encoder give.

    After each reversal of the torque every element sticks: the slope there is the sum of all stiffnesses. It is taken
    over a part of the swing, in which the motion is known to a count (`resolution`, rad).
    """
    assert found.model is not None
    total = math.fsum(found.model.parameters.k)
    slopes = np.array(slopes_after_reversals(record["motor_torque"], record["position"]))
    std = float(np.std(slopes, ddof=1)) / math.sqrt(slopes.size) if slopes.size > 1 else math.nan
    moved = FIRST * float(np.ptp(record["motor_torque"])) / total
    half = student_quantile(slopes.size - 1) * std if slopes.size > 1 else math.inf
    half = math.hypot(half, total * resolution / moved / math.sqrt(max(slopes.size, 1)))
    good = total - half > 0.0 and half < 0.33 * total
    why = "" if good else "the slopes after the reversals scatter too much"
    if not good and resolution > 0.1 * moved:
        why = f"after a reversal the axis moved by {moved / resolution:.2g} counts of the encoder only"
    whole = Estimate("stiffness", "N·m/rad", "k", total, std, total - half, total + half, good, why)
    spread = half / (1.96 * total) if good else WIDEST
    rest = [e for e in found.estimates if not e.name.startswith(("k[", "alpha["))]
    elements, correlation = within_total(found, spread)
    n = len(elements)
    whole_matrix = np.eye(n + len(rest) + 1)
    whole_matrix[:n, :n] = correlation
    return dataclasses.replace(found, estimates=(*elements, *rest, whole), correlation=whole_matrix)


def within_total(found: Identification, spread: float) -> tuple[list[Estimate], Array]:
    """Stiffnesses and shares of the elements, given their sums; with their correlation.

    One loop hardly tells the elements apart, but it does tell their total stiffness, and their shares add up to 1. As
    a normal distribution of the logarithms: the fit's own, where it set limits; else each by itself, and no element
    beyond the total; given that the sums, linear around the estimate, are known.

    Parameters
    ----------
    found : Identification
        With ``k[i]`` and ``alpha[i]``.
    spread : float
        Standard deviation of the logarithm of the total stiffness.
    """
    assert found.model is not None
    names = [f"{n}[{i}]" for n in ("k", "alpha") for i in range(len(found.model.parameters.k))]
    known = {e.name: i for i, e in enumerate(found.estimates)}
    kept = [n for n in names if n in known]
    own = [found.estimates[known[n]] for n in kept]
    k_rows = np.array([e.name.startswith("k[") for e in own])
    value = np.array([e.value for e in own])
    total = np.where(k_rows, np.sum(value[k_rows]), 1.0)
    std = np.array([own_spread(e, t) for e, t in zip(own, total.tolist(), strict=True)])
    places = [known[n] for n in kept]
    matrix = found.correlation[np.ix_(places, places)]
    # What has no limits is cut to the total: how it went with the others beyond that says nothing of it here.
    told = np.all(np.isfinite(matrix), axis=1) & [e.lower > 0.0 and math.isfinite(e.upper) for e in own]
    prior = std[:, None] * np.where(told & told[:, None], matrix, np.eye(len(own))) * std[None, :]
    # Weights of the logarithms in those of both sums.
    sums = np.array([np.where(k_rows, value / total, 0.0), np.where(k_rows, 0.0, value / total)])
    gain = prior @ sums.T @ np.linalg.pinv(sums @ prior @ sums.T, hermitian=True)
    after = prior - gain @ sums @ prior + gain @ np.diag([spread**2, 0.0]) @ gain.T
    left = np.sqrt(np.maximum(np.diag(after), 1e-12))
    out: list[Estimate] = []
    for e, s in zip(own, left.tolist(), strict=True):
        low, high = e.value * math.exp(-1.96 * s), e.value * math.exp(1.96 * s)
        why = "" if high <= 2.0 * low else "the loop determines the sum of the elements, not each"
        out.append(
            dataclasses.replace(e, std=e.value * s, lower=low, upper=high, identified=not why, verdict=why)
        )
    matrix = np.clip(after / np.outer(left, left), -1.0, 1.0)
    np.fill_diagonal(matrix, 1.0)
    return out, matrix


def own_spread(e: Estimate, total: float) -> float:
    """Standard deviation of an element's logarithm: its interval's, but up to the total at most."""
    above = math.log(max(min(e.upper, total) / e.value, 1.0)) / 1.96
    if e.lower > 0.0 and math.isfinite(e.upper):
        return min(math.log(e.upper / e.lower) / 3.92, WIDEST)
    return min(max(above, 1e-6), WIDEST)


def slopes_after_reversals(torque: Array, position: Array) -> list[float]:
    """Slope of the torque over the position along the first `FIRST` of each swing, N·m/rad."""
    turns = np.flatnonzero(np.diff(np.sign(np.diff(smooth(torque)))) != 0) + 1
    reach = 0.5 * float(np.ptp(torque))
    out: list[float] = []
    for begin, end in itertools.pairwise(int(i) for i in turns):
        rows: Rows = np.arange(begin, end)
        rows = rows[np.abs(torque[rows] - torque[begin]) < FIRST * 2.0 * reach]
        if rows.size > 4 and np.ptp(torque[rows]) > 0.5 * FIRST * 2.0 * reach:
            out.append(1.0 / float(np.polyfit(torque[rows], position[rows], 1)[0]))
    return out


def smooth(x: Array) -> Array:
    """A mean over 9 rows, so that noise makes no reversals."""
    return np.convolve(np.pad(x, 4, mode="edge"), np.full(9, 1.0 / 9.0), mode="valid")
