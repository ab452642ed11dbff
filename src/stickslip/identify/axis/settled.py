"""The values that a model takes: what is identified stands, the rest is what explains the whole record best.

A number that a record does not tell is one choice among many; the one that goes best with the numbers that it does
tell, within the bounds of physics, is the only one that is of use. The record is seen as the plain inverse dynamics
sees it (Janot, Gautier and Brunot 2019): a model is never to explain its torque worse than plain least squares do,
as far as the intervals and physics allow it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from stickslip.identify.axis.above_nothing import above_nothing, likely
from stickslip.identify.axis.gravity import hanging, of_one_weight
from stickslip.identify.axis.plain_numbers import PLAIN
from stickslip.identify.estimate import Estimate
from stickslip.identify.fit.bounded import within_bounds
from stickslip.identify.fit.uncertainty import RATIO, SHARE
from stickslip.identify.regression.inverse import InverseDynamics
from stickslip.model import Model
from stickslip.simulation.prescribed.steady import Steady

Array = np.ndarray[Any, np.dtype[np.float64]]

GRAVITY = ("gravity_sin", "gravity_cos")
LEAST = 1e-6
"""Of the plain inertia: the least that an axis can have."""
ALIKE = 1.05
"""Times the force error of plain least squares up to which a model's is about as small."""
PREFERRED = 0.98
"""Times the force error without a fall of friction, that one which is not identified must stay below."""
WORTH_A_WORD = 0.99
"""Times the force error that moved values must stay below to be talked about."""
QUANTILE = 1.96
TIES, HALVINGS = (1e-6, 1e3), 40
"""Weights between which that is looked for which moves identified values least; halvings of that search."""
MOVED = "the whole record, reversals included, asks for another value than gross sliding does"
FOLLOWED = 1.02
"""Times the force error of plain least squares up to which identified values stay where they are, and to which others
move: no farther. Between 1.02 and 1.045 as many parts of real records agree; at 1.045 it is above `ALIKE` on three
parts of a record that were held out, at 1.02 on none, but where plain friction is below 0."""
LEVEL_LAST = 10.0
"""Times the weight of others with which friction's level is then held: what play and reversals do to plain least
squares is put there first."""
APART, ALONE = 0.05, 1.6
"""Part of friction's level by which it may then be moved, and upper over lower end up to which certain sliding alone
tells it."""
TWO_METHODS = (
    "two methods are {share:.0%} apart: gross sliding gives {own:.4g}, the whole record, reversals included, "
    "{value:.4g} {unit}"
)
TOO_WIDE = (
    "the interval is too wide: gross sliding alone determines it, to within a factor of {factor:.3g}; identified means "
    "at most {most:.3g} there"
)
KEPT = (
    "Inertia and friction stay those of gross sliding: within its intervals nothing comes near the force error of "
    "plain least squares, whose numbers leave more of the torque in sliding, position-dependent torque aside "
    "(what play and reversals do is in them)."
)
BEST_WITHIN = (
    "Of the values {where} their intervals those are given that explain the whole record best, reversals included: "
    "relative force error {less:.3g} %, at the middle of the intervals {before:.3g} %."
)
CONTROLLER = (
    "Plain least squares leaves less of the torque, {plain:.3g} % against {own:.3g} %, with {names} below 0, which "
    "no friction is: its speeds and strokes are too few, or the torque comes late or is made from the velocity by a "
    "controller. Record moves at several speeds under position control, all columns by one clock."
)
SURE = 3.0
"""Standard deviations below 0 from which on a friction of plain least squares is one that cannot be."""
TURNS = 5
"""Rounds in which curve and levels are brought together."""


@dataclass(frozen=True, eq=False)
class Settling:
    """Torque and motion of the record, and the model whose values are looked for."""

    inverse: InverseDynamics
    model: Model

    def column(self, name: str) -> Array:
        """Torque per unit of a number, shape (n,)."""
        inverse = self.inverse
        return inverse.matrix[:, inverse.names.index(PLAIN.get(name, name))]

    @cached_property
    def steady(self) -> Steady:
        """The law at the velocities of the record."""
        return Steady(self.model.law, self.inverse.velocity, np.sign(self.inverse.velocity))

    def curve(self, values: Mapping[str, float]) -> Array:
        """What friction's curve has beside level and slope, N·m (N), shape (n,)."""
        law = self.model.law
        own = {f.name for f in law.fields}
        p = self.model.parameters._replace(**{k: v for k, v in values.items() if k in own})
        v = self.inverse.velocity
        return self.steady.torque(np.array(law.pack(p))) - values["fc"] * np.sign(v) - values["sigma2"] * v

    def solved(
        self, values: Mapping[str, float], bounds: Mapping[str, tuple[float, float]], level: bool,
        halves: Mapping[str, float] | None = None, tie: float = 0.0,
    ) -> tuple[dict[str, float], float]:  # fmt: skip
        """All values, those with bounds solved for, and the force error; `level`: without a fall of friction.

        `tie` is the weight with which the values in `halves` are held where they are, in these half-widths.
        """
        out, torque = dict(values), self.inverse.torque
        names, free = [n for n in (*PLAIN, *GRAVITY) if n in out], list(bounds)
        columns = np.column_stack([self.column(n) for n in free]) if free else np.zeros((torque.size, 0))
        low, high = (np.array([bounds[n][k] for n in free]) for k in (0, 1))
        high = np.maximum(high, np.nextafter(low, np.inf))
        held = [n for n in free if tie > 0.0 and n in (halves or {})]
        pull = tie * float(np.linalg.norm(torque)) / np.array([(halves or {})[n] for n in held])
        ties = pull[:, None] * np.array([[float(n == m) for m in free] for n in held]).reshape(
            len(held), len(free)
        )
        bent = self.model.law.velocity_scale is not None
        for _ in range(TURNS if bent and not level else 1):
            known = sum((out[n] * self.column(n) for n in names if n not in bounds), np.zeros(torque.size))
            target = torque - known - (self.curve(out) if bent and not level else 0.0)
            if free:
                target = np.concatenate([target, pull * np.array([values[n] for n in held])])
                found = within_bounds(np.vstack([columns, ties]), target, low, high)
                out |= dict(zip(free, found.tolist(), strict=True))
        if level and "fs" in out:
            out["fs"] = out["fc"]
        left = torque - sum((out[n] * self.column(n) for n in names), np.zeros(torque.size))
        left = left - (self.curve(out) if bent and not level else 0.0)
        return out, float(np.linalg.norm(left) / np.linalg.norm(torque))

    def weighed(
        self, values: Mapping[str, float], held: Mapping[str, tuple[float, float]]
    ) -> dict[str, float] | None:
        """What certain sliding and the whole record say together, each by its precision; none where they contradict.

        The values stay within `held`, the intervals of certain sliding: both see the same rows.
        """
        if not held:
            return None
        inverse, names = self.inverse, list(held)
        low, high = (np.array([held[n][k] for n in names]) for k in (0, 1))
        places = [inverse.names.index(PLAIN[n]) for n in names]
        own, plain = np.array([values[n] for n in names]), inverse.values[places]
        half = 0.5 * (high - low)
        if np.any(np.abs(plain - own) > np.hypot(half, QUANTILE * inverse.robust_std[places])):
            return None
        std = np.maximum(half, 1e-12 * np.abs(own)) / QUANTILE
        other = inverse.covariance[np.ix_(places, places)] / np.outer(std, std)
        toward = np.linalg.solve(np.eye(std.size) + other, (plain - own) / std)
        found = np.clip(own + std * toward, low, high)
        return dict(zip(names, found.tolist(), strict=True))

    def moved(
        self, values: Mapping[str, float], free: Mapping[str, tuple[float, float]],
        held: Mapping[str, tuple[float, float]], level: bool,
    ) -> tuple[dict[str, float], float, str]:  # fmt: skip
        """The values moved within their intervals, or next to them, the force error, and which of both."""
        found, error = self.solved(values, {**free, **held}, level)
        if error <= FOLLOWED * self.inverse.relative_error:
            return found, error, "within"
        bounds = {n: b for n, b in {**physical(self.inverse), **free}.items() if n in free or n in held}
        where = "within their intervals and, where these cannot explain it, next to"
        return *self.nearest(found, bounds, halves_of(held), level, FOLLOWED), where

    def followed(
        self, values: Mapping[str, float], free: Mapping[str, tuple[float, float]],
        held: Mapping[str, tuple[float, float]], level: bool,
    ) -> tuple[dict[str, float], float] | None:  # fmt: skip
        """The values moved within their intervals towards plain least squares that certain sliding refutes, and the
        force error: as little as these ask for, friction's level last; none where no values there come near theirs."""
        halves = halves_of(held)
        halves |= {n: halves[n] / LEVEL_LAST for n in ("fc",) if n in halves}
        found, error = self.nearest(values, {**free, **held}, halves, level, FOLLOWED)
        return (found, error) if error <= ALIKE * self.inverse.relative_error else None

    def nearest(
        self, values: Mapping[str, float], bounds: Mapping[str, tuple[float, float]], halves: Mapping[str, float],
        level: bool, times: float,
    ) -> tuple[dict[str, float], float]:  # fmt: skip
        """The values nearest to those given, in `halves`, whose force error is so many `times` plain least squares'.

        Those of the least error where the bounds allow none. Only values with bounds move.
        """
        limit = times * self.inverse.relative_error
        best = self.solved(values, bounds, level)
        if best[1] > limit:
            return best
        low, high = TIES
        for _ in range(HALVINGS):
            tie = math.sqrt(low * high)
            found = self.solved(values, bounds, level, halves, tie)
            if found[1] <= limit:
                low, best = tie, found
            else:
                high = tie
        return best


def settled(
    estimates: Sequence[Estimate],
    model: Model,
    inverse: InverseDynamics | None,
    refuted_by: Mapping[str, tuple[float, float]] | None = None,
    at_most: Mapping[str, tuple[float, float]] | None = None,
    falls: bool = False,
) -> tuple[tuple[Estimate, ...], list[str]]:
    """The estimates, what is not identified chosen so that the record's torque is explained best; and what to say.

    Parameters
    ----------
    estimates : sequence of Estimate
        All free parameters.
    model : Model
        With the law's values, those that are not free among them.
    inverse : InverseDynamics or None
        Of the same records; nothing is changed without.
    refuted_by : mapping, optional
        Intervals of certain sliding by name, where that refutes it: it then has no weight in an identified value, and
        none leaves these for it, however wide the estimate's own is so as to hold both.
    at_most : mapping, optional
        Wider intervals, where it is refuted by little: as far as a value may go where within the others nothing comes
        near the force error of the inverse dynamics.
    falls : bool
        Whether certain sliding shows that friction falls with velocity, which the inverse dynamics knows nothing of.
    """
    estimates = of_one_weight(estimates)
    by_name = {e.name: e for e in estimates}
    if inverse is None or model.law.steady is None or not set(PLAIN) <= by_name.keys():
        return tuple(estimates), []
    if not all(inverse.has(n) for n in PLAIN.values()):
        return tuple(estimates), []
    own = Settling(inverse, model)
    values = {e.name: e.value for e in estimates}
    free = {n: b for n, b in physical(inverse).items() if not by_name[n].identified}
    free |= turned(by_name, values, inverse)
    chosen, error = own.solved(values, free, False)
    if "fs" in by_name and not by_name["fs"].identified and not falls:
        plain, flat = own.solved(values, free, True)
        if not error <= PREFERRED * flat:
            chosen, error = plain, flat
    level = chosen.get("fs") == chosen["fc"] and "fs" in by_name and not by_name["fs"].identified
    held = {n: (by_name[n].lower, by_name[n].upper) for n in PLAIN if by_name[n].identified}
    both = own.weighed(chosen, held) if refuted_by is None else None
    if both is not None:
        shared, less = own.solved({**chosen, **both}, free, level)
        if less < error:
            chosen, error = shared, less
    asked, notes, moves, before = set[str](), list[str](), "", error
    if held and error > FOLLOWED * inverse.relative_error:
        if refuted_by is None:
            moved, less, where = own.moved(chosen, free, held, level)
        else:
            followed = followed_within(own, (chosen, free, level), held, refuted_by, at_most)
            (moved, less), where = followed or (chosen, error), "within"
            notes = [] if followed else [KEPT]
        if less < error:
            chosen, error, asked, moves, notes = moved, less, set(held), where, []
    chosen, error = above_nothing(
        (chosen, error), likely(estimates), free, lambda start, bounds: own.solved(start, bounds, level), 1.0
    )
    if moves and error < WORTH_A_WORD * before:
        notes = [BEST_WITHIN.format(where=moves, less=100.0 * error, before=100.0 * before)]
    notes += made_by_a_controller(inverse, error)
    friction = chosen["fc"]
    if not by_name["fc"].identified:
        friction += chosen["sigma2"] * float(np.median(np.abs(inverse.velocity)))
    out = (placed(e, chosen, inverse, friction, e.name in asked) for e in estimates)
    if refuted_by is None:
        return tuple(out), notes
    return tuple(told_alone(e, values["fc"]) if e.name == "fc" else e for e in out), notes


def followed_within(
    own: Settling, start: tuple[Mapping[str, float], Mapping[str, tuple[float, float]], bool],
    held: Mapping[str, tuple[float, float]], refuted_by: Mapping[str, tuple[float, float]],
    at_most: Mapping[str, tuple[float, float]] | None,
) -> tuple[dict[str, float], float] | None:  # fmt: skip
    """Values near plain least squares' force error, inside certain sliding's intervals, else inside those of both
    methods where it is refuted by little; none where neither holds any."""
    chosen, free, level = start
    narrow = {n: shared_part(b, refuted_by.get(n, b)) for n, b in held.items()}
    found = own.followed(chosen, free, narrow, level)
    if found or not at_most:
        return found
    return own.followed(chosen, free, {n: shared_part(at_most.get(n, b), b) for n, b in held.items()}, level)


def made_by_a_controller(inverse: InverseDynamics, error: float) -> list[str]:
    """That plain least squares explains more by a friction that cannot be, in a sentence; nothing where it does not.

    Under proportional speed control the torque falls with the velocity, whatever the friction.
    """
    below = [n for n in ("fc", "fv") if inverse[n] < -SURE * inverse.robust_std[inverse.names.index(n)]]
    if not below or error <= ALIKE * inverse.relative_error:
        return []
    names = " and ".join({"fc": "Coulomb friction", "fv": "viscous friction"}[n] for n in below)
    return [CONTROLLER.format(plain=100.0 * inverse.relative_error, own=100.0 * error, names=names)]


def told_alone(e: Estimate, own: float) -> Estimate:
    """Friction's level where certain sliding, which says `own`, refutes plain least squares.

    It is not identified where it had to be moved far towards them all the same, or where its interval is wide: no other
    estimator confirms it.
    """
    if not e.identified:
        return e
    share = abs(e.value - own) / own
    if share > APART:
        why = TWO_METHODS.format(share=share, own=own, value=e.value, unit=e.unit)
    elif e.upper > ALONE * e.lower:
        why = TOO_WIDE.format(factor=e.upper / e.lower, most=ALONE)
    else:
        return e
    return replace(e, identified=False, verdict=why)


def halves_of(held: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """Half-widths of intervals, none of them 0."""
    return {n: max(0.5 * (high - low), 1e-12 * abs(high)) for n, (low, high) in held.items()}


def shared_part(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    """What two intervals have in common; the first where that is nothing."""
    low, high = max(a[0], b[0]), min(a[1], b[1])
    return (low, high) if low <= high else a


def physical(inverse: InverseDynamics) -> dict[str, tuple[float, float]]:
    """Bounds of every number, N·m (N) and so on."""
    largest = float(np.max(np.abs(inverse.torque)))
    return {
        "inertia": (LEAST * abs(inverse["inertia"]), math.inf), "fc": (0.0, largest), "sigma2": (0.0, math.inf),
        "offset": (-largest, largest),
    }  # fmt: skip


def turned(
    by_name: Mapping[str, Estimate], values: dict[str, float], inverse: InverseDynamics
) -> dict[str, tuple[float, float]]:
    """Adds a pendulum's two amplitudes to the values; their bounds where they are not identified."""
    if "gravity" not in by_name or not all(inverse.has(n) for n in GRAVITY):
        return {}
    size, angle = values["gravity"], values.get("gravity_angle", 0.0)
    values |= {"gravity_sin": size * math.cos(angle), "gravity_cos": -size * math.sin(angle)}
    if by_name["gravity"].identified:
        return {}
    return dict.fromkeys(GRAVITY, (-math.inf, math.inf))


def placed(
    e: Estimate, values: Mapping[str, float], inverse: InverseDynamics, friction: float, asked: bool
) -> Estimate:
    """The estimate with its value chosen; its interval holds it, and reaches as far beyond one that the whole record
    `asked` for."""
    value = values[e.name]
    if e.name in ("gravity", "gravity_angle") and "gravity_sin" in values:
        pair = hanging(values["gravity_sin"], values["gravity_cos"], inverse.position)
        value = e.value if e.identified else pair[e.name == "gravity_angle"]
    if not e.identified or value == e.value or not asked:
        return replace(e, value=value, lower=min(e.lower, value), upper=max(e.upper, value))
    half = 0.5 * (e.upper - e.lower)
    lower, upper = min(e.lower, value - half), max(e.upper, value + half)
    if e.name != "offset":
        lower = max(lower, 0.0)
    told = half <= SHARE * friction if e.name == "offset" else lower > 0.0 and upper <= RATIO * lower
    told &= e.lower <= value <= e.upper
    verdict = "" if told else MOVED
    return replace(e, value=value, lower=lower, upper=upper, identified=told, verdict=verdict)
