"""The velocity's column against the derivative of the position: its unit, its sign and its delay.

A delayed or filtered column differs from the position's derivative without a wrong unit, most of all in a short record
that is mostly the start of a motion. Both are therefore compared away from the ends, where filters settle, and once
more with the delay or the low-pass that explains the most.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, cast

import numpy as np

from stickslip.core.finding import Finding
from stickslip.core.messages import name_columns, name_option
from stickslip.identification.doctor.units import explained, in_counts
from stickslip.identification.doctor.view import Array, View

LATE, EXPLAINS = 1.0, 0.5
"""Delay of a velocity that is reported, rows: a difference from row to row has half a row; least share of the mismatch
that the delay explains."""
LEAST = 1e-100
"""Least plausible speed; its inverse is the greatest."""
LOOKS = 6
"""Iterations of the delay, each from the result before."""
EDGE, FEWEST, STEPS, MOST = 20, 20, 20.0, 0.5
"""Rows at either end affected by the filter of 4 rows; fewest rows between them; least travel between them in steps of
the encoder and as a part of all travel."""
SAME = 1.25
"""Ratio of a correct velocity's size to the derivative's: torque ripple and coarse counts cause as much."""
BY_CHANCE = 2.0
"""Standard deviations of a velocity's size due to its counts, within which it may be right."""
ALIKE = 1.3
"""Greatest ratio of the sizes in both halves of the motion for one unit to explain them."""
FOLLOWS, LONG = 0.6, 500
"""Correlation with the position's derivative above which a velocity follows it; fewest rows to show that it does
not."""
DEPARTS, INTEGRATES = 0.02, 0.5
"""Least departure of the position from a constant speed, part of the travel, to compare it with the integral of the
velocity; squared correlation of both above which the velocity belongs to the position."""


class Size(NamedTuple):
    """Size of the column relative to the position's derivative.

    Noise in the derivative lowers `least`, noise in the column raises `most`.
    """

    least: float
    most: float

    @property
    def middle(self) -> float:
        """Geometric mean of both bounds."""
        return math.sqrt(abs(self.least * self.most))

    @property
    def right(self) -> bool:
        """Whether both may have the same unit."""
        return self.least < SAME and self.most > 1.0 / SAME


class Late(NamedTuple):
    """Delay of a velocity, s, with its relative size.

    `left` is the residual part; `explains` is whether the delay lowers it to `EXPLAINS` or less.
    """

    time: float
    size: Size
    left: float
    explains: bool


@dataclass(frozen=True, eq=False)
class Compared:
    """The velocity's column and the position's derivative, filtered alike, away from the ends of the record.

    Attributes
    ----------
    period : float
        s
    given, velocity, acceleration : array, shape (n,)
        In SI units: the column, and the position's derivatives.
    counts : float
        Greatest number of encoder counts behind the column, if it is their differences: each falls into a row by
        chance.
    """

    period: float
    given: Array
    velocity: Array
    acceleration: Array
    counts: float = math.inf

    @property
    def correlation(self) -> float:
        """Correlation of both."""
        size = math.sqrt(float(np.mean(self.given**2) * np.mean(self.velocity**2)))
        return float(np.mean(self.given * self.velocity)) / size

    @property
    def size(self) -> float:
        """Root mean square of the column over that of the position's derivative."""
        return math.sqrt(float(np.mean(self.given**2) / np.mean(self.velocity**2)))

    @property
    def integrates(self) -> bool:
        """Whether the column's integral explains most of the position's departure from a constant speed.

        Noise, a delay and a filter change the velocity but hardly its integral. True if the position departs too little
        to decide.
        """
        times = np.linspace(-1.0, 1.0, self.given.size)
        travel, integral = (np.cumsum(x) * self.period for x in (self.velocity, self.given))
        even = np.stack([np.ones_like(times), times]).T
        travel, integral = (x - even @ np.linalg.lstsq(even, x, rcond=None)[0] for x in (travel, integral))
        own, other = float(np.sum(travel**2)), float(np.sum(integral**2))
        if (
            own < DEPARTS**2 * self.given.size * float(np.sum(np.abs(self.velocity)) * self.period) ** 2
            or other == 0.0
        ):
            return other > 0.0
        return float(np.sum(travel * integral)) ** 2 > INTEGRATES * own * other

    @property
    def alike(self) -> bool:
        """Whether both halves of the motion have about the same relative size."""
        work: Array = np.cumsum(self.velocity**2)
        half = int(np.count_nonzero(work < 0.5 * float(work[-1])))
        sizes = [
            float(np.mean(self.given[part] ** 2)) / max(float(np.mean(self.velocity[part] ** 2)), 1e-300)
            for part in (slice(None, half), slice(half, None))
            if self.given[part].size
        ]
        return max(sizes) <= ALIKE**2 * min(sizes)

    @property
    def sizes(self) -> list[Size]:
        """Relative sizes with the delay or the low-pass that explains the most.

        Both if they explain as much; without either if neither does.
        """
        found = [late for late in (lateness(self), filtered(self)) if late.explains]
        smallest = min((late.left for late in found), default=0.0)
        told = [late.size for late in found if late.left <= smallest / EXPLAINS]
        chance = 1.0 + BY_CHANCE / math.sqrt(max(self.counts, 1.0))
        return [Size(x.least / chance, x.most * chance) for x in told or [self.as_they_are]]

    @property
    def as_they_are(self) -> Size:
        """Size of the column relative to the position's derivative, without a delay."""
        follows = self.correlation if abs(self.correlation) > LEAST else LEAST
        return Size(self.size * follows, self.size / follows)


def compared(view: View) -> Compared | None:
    """Return both velocities; None if one is missing, or the record is too short or too coarse to compare them."""
    smooth = view.smooth
    if smooth is None or not (view.has("position") and view.has("velocity")) or smooth.fast <= 0.0:
        return None
    inside = slice(EDGE, max(smooth.velocity.size - EDGE, EDGE))
    given, velocity = view.given_velocity[inside], smooth.velocity[inside]
    moved, in_all = (float(np.sum(np.abs(v))) * smooth.period for v in (velocity, smooth.velocity))
    step = view.step or least(np.diff(view.values("position")))
    if given.size < FEWEST or moved < max(STEPS * step, MOST * in_all):
        return None
    sizes = [float(np.sqrt(np.mean(x**2))) for x in (given, velocity)]
    if not all(LEAST < x < 1.0 / LEAST for x in sizes):
        return None
    logged = view.values("velocity")[EDGE:-EDGE]
    counts = float(np.sum(np.abs(logged))) / max(least(logged), LEAST)
    return Compared(smooth.period, given, velocity, smooth.acceleration[inside], counts)


def least(values: Array) -> float:
    """Return the smallest nonzero magnitude; 0 if all values are 0."""
    sizes = np.abs(values[values != 0.0])
    return float(np.min(sizes)) if sizes.size else 0.0


def lateness(both: Compared) -> Late:
    """Return the delay that explains the most.

    Least squares of given = c (v(t) - late dv/dt), about the delay of the iteration before.
    """
    given, period = both.given, both.period
    sizes = [float(np.sqrt(np.mean(x**2))) for x in (both.velocity, both.acceleration)]
    if not all(LEAST < x < 1.0 / LEAST for x in sizes):
        return Late(0.0, both.as_they_are, 1.0, False)
    times = period * np.arange(given.size)
    late = left = before = size = 0.0
    for look in range(LOOKS):
        known = (times >= late) & (times <= times[-1] + late)
        if np.count_nonzero(known) < FEWEST:
            return Late(0.0, both.as_they_are, 1.0, False)
        v, a = (np.interp((times - late)[known], times, x) for x in (both.velocity, both.acceleration))
        scaled = np.linalg.lstsq(np.stack([v, a]).T / sizes, given[known], rcond=None)[0]
        size, change = (float(x) / each for x, each in zip(scaled, sizes, strict=True))
        left = float(np.mean((given[known] - size * v) ** 2))
        before = left if look == 0 else before
        if size == 0.0 or look == LOOKS - 1:
            break
        late -= change / size
    part = left / float(np.mean(given**2))
    return Late(late, Size(size, size / max(1.0 - part, LEAST)), part, left <= EXPLAINS * before)


def filtered(both: Compared) -> Late:
    """Return the first-order low-pass that explains the most, its time constant as the delay.

    Least squares of v = (given + late d given/dt) / c.
    """
    change = np.gradient(both.given, both.period)
    matrix = np.stack([both.given, change]).T
    sizes = np.maximum(np.sqrt(np.mean(matrix**2, axis=0)), LEAST)
    solved = cast("tuple[Array, ...]", np.linalg.lstsq(matrix / sizes, both.velocity, rcond=None))[0]
    scaled: Array = solved / sizes
    one, late = float(scaled[0]), float(scaled[1])
    alone = float(np.mean(both.given * both.velocity) / np.mean(both.given**2))
    left = float(np.mean((both.velocity - one * both.given - late * change) ** 2))
    before = float(np.mean((both.velocity - alone * both.given) ** 2))
    if one == 0.0 or late / one < 0.0:
        return Late(0.0, both.as_they_are, 1.0, False)
    part = left / float(np.mean(both.velocity**2))
    return Late(late / one, Size((1.0 - part) / one, 1.0 / one), part, left <= EXPLAINS * before)


def velocity_late(view: View) -> Iterator[Finding]:
    """Yield a note on a velocity that is filtered, or logged for another row than its position."""
    both = compared(view)
    if both is None:
        return
    late = lateness(both)
    rows = late.time / view.period
    if abs(rows) < LATE or not late.explains:
        return
    said = "lags" if rows > 0.0 else "leads"
    why = (
        "the drive filters it, or logs it cycles later"
        if rows > 0.0
        else "the position is logged cycles later"
    )
    yield Finding(
        "note",
        "velocity-late",
        f"velocity {said} the derivative of position by {abs(late.time) * 1e3:.3g} ms ({abs(rows):.3g} rows): {why}",
        remedy=f"an axis is identified by its position; {name_option('method', 'breakaway')} takes the "
        "velocity, and derives it with "
        f"{name_columns(velocity='none')}",
    )


def velocity_scale(view: View) -> Iterator[Finding]:
    """Yield an error if the velocity differs from the position's derivative in unit or sign."""
    both = compared(view)
    if both is None or (in_counts(view) and not view.stated("position")):
        return
    follows = both.correlation
    if turned := follows < -FOLLOWS:
        remedy = (
            f"say {view.mapped('velocity', '-')}, or say {name_columns(velocity='none')} to derive it from the "
            "position"
        )
        yield Finding(
            "error", "velocity-sign", "velocity is positive where the position falls", remedy=remedy
        )
    if Size(both.size, both.size).right and abs(follows) > FOLLOWS:
        return
    sizes = [Size(-x.least, -x.most) if turned else x for x in both.sizes]
    if any(x.right for x in sizes if abs(follows) > FOLLOWS or x.least > FOLLOWS * x.most):
        return
    if abs(follows) < FOLLOWS:
        belongs = both.integrates
        if both.given.size < LONG and belongs:
            return
        message = f"velocity does not follow the position (correlation {follows:.2f})"
        if not belongs:
            message += ", and its integral is another motion"
        remedy = f"check that both belong to one axis; {name_columns(velocity='none')} derives it from the position"
        yield Finding("warning" if belongs else "error", "velocity-mismatch", message, remedy=remedy)
    elif both.alike:
        yield _another_unit(abs(sizes[0].middle), view)


def _another_unit(size: float, view: View) -> Finding:
    """Return the finding on a velocity of another size than the position's derivative, with units that explain it."""
    message = (
        f"velocity is {size:.4g} times the change of position per second, where both are taken in SI"
        f" ({view.record.units['velocity']})"
    )
    if guesses := explained(size, view):
        words = " or ".join(g[1] for g in guesses[:2])
        return Finding("error", guesses[0][0], f"{message}: {words}", remedy=f"say {guesses[0][2]}")
    remedy = (
        f"check both units, and whether one is on the other side of a gear: {name_option('gear_ratio', 'N')} "
        "and, for the load's, "
        f"{name_columns(CHANNEL='COLUMN:UNIT@load')}"
    )
    return Finding("error", "velocity-mismatch", message, remedy=remedy)
