"""One record, one machine: friction, inertia, load or temperature that change within the record.

A curve of friction over the velocity, an inertia and a torque over the position are fitted to the whole filtered
record (whatever the law of friction). In blocks of equal motion the torque is then regressed on the inertia's part, the
curve and a constant: how many times as large is each here? A step or a trend from block to block counts as a change
where it stands out of the scatter of the blocks themselves, which holds coloured noise, cogging, sticking and what
else the fit does not know (a random-effects comparison: DerSimonian and Laird 1986).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from stickslip.core.finding import Finding
from stickslip.core.messages import name_option
from stickslip.identification.doctor.view import Array, Mask, Smooth, View, row
from stickslip.identification.fit.profile import long_run
from stickslip.identification.notes import drift_of

Rows = np.ndarray[Any, np.dtype[np.intp]]

DRIFTS_BY = 0.05
"""Of friction at the first row, that a drift is worth a warning from."""
MOST_ROWS = 30_000
BLOCKS, FEWEST_BLOCKS = 16, 8
PER_BLOCK = 150
"""Moving rows of the filtered record that a block needs: a dozen independent ones."""
SETTLED = 15
KNOTS, HARMONICS, PLACES = 6, 6, 8
"""Of the friction curve in each direction; of the torque over a turn; over a way of less than a turn."""
SURE, SURE_OF_FEW = 5.0, 30.0
"""A change counts from SURE + SURE_OF_FEW / degrees of freedom standard deviations on: 7 at 16 blocks. Of 16 blocks in
which nothing changes, the largest of all splits, trends and parameters passes 5 in one record of a hundred."""
WORTH = {"inertia": 0.1, "friction": 0.1, "load": 0.15}
"""Parts of itself (of the friction) that a change must have to spoil a result."""
SHARE = 0.04
"""Of the torque that a change must be: edges of a staircase that the filter blurs pass for an inertia of less."""
OWN = 0.1
"""Part of the acceleration that is no function of the position, below which no inertia is told (a single sine)."""
THIRD, OTHER_MOTION = 1.0 / 3.0, 3.0
"""Of a trend, which is an end of it; times the acceleration, or that over the velocity, at one end that it is at the
other in another motion: of 24 sweeps of another program's logs 3 were called changes, with it 2, whose rate rises by 2
to 2.8."""
WARMER = 5.0
"""K."""
UNTOLD, WORSE = 1.0, 4.0
"""What is left of a block's torque, over the part that something makes of it by itself, from which on the block does
not tell that thing; and times the lower quartile of the blocks. Where an axis creeps after it accelerated, cogging and
blurred edges pass for an inertia: false changes in 3 logs of 187 and 8 of 240 without these, in none with them."""
BOTH = 0.05
"""Share of the moving rows in either direction that tells friction from a load."""


@dataclass(frozen=True, slots=True)
class Blocks:
    """Each block's parts: estimates (b, 3) of inertia, friction, load against the whole record's, their variances,
    whether the block tells them."""

    values: Array
    variances: Array
    told: Mask
    first_rows: Any


@dataclass(frozen=True, slots=True)
class Change:
    """Which part changes, how sure that is, the last block before the step and the first behind it, and whether it is
    a trend instead."""

    part: str
    sure: float
    before: int
    split: int
    gradual: bool


def changes(view: View) -> Iterator[Finding]:
    """Friction, inertia or load of another size in one part of the record than in the other; or a drift."""
    found = list(_between_blocks(view))
    yield from found or _drifting(view)


def _drifting(view: View) -> Iterator[Finding]:
    """Friction that drifts with time, as gross sliding shows it, by more than a few percent."""
    found = None if view.smooth is None else view.sliding  # times that are none make neither
    drift = None if found is None else drift_of(found)
    if drift is None or abs(drift.share) < DRIFTS_BY:
        return
    message = f"friction {drift} over the record: what is identified is that of its middle"
    remedy = (
        f"let the machine warm up before, or identify parts alone, with {name_option('start')} and "
        f"{name_option('end')}"
    )
    yield Finding("warning", "change", message, remedy=remedy)


def _between_blocks(view: View) -> Iterator[Finding]:
    """What is of another size in some blocks than in the others."""
    smooth = view.smooth
    if smooth is None or view.torque_channel != "motor_torque" or smooth.fast <= 0.0:
        return
    rows = _rows(smooth)
    count = min(BLOCKS, rows.size // PER_BLOCK)
    if count < FEWEST_BLOCKS:
        return
    torque = smooth.torque[rows]
    system = _system(smooth, rows)
    parts = system.parts(torque)
    if parts is None:
        return
    blocks = _blocks(parts, torque, count)
    size = np.sqrt(np.mean(parts**2, axis=0))
    size[2] = size[1]  # the load's unit is the friction
    weight = size / float(np.std(torque))
    found = [c for part in range(3) if (c := _change(blocks, part, float(weight[part]))) is not None]
    if not found:
        return
    first = max(found, key=lambda c: c.sure)
    if first.gradual:
        shape, cut = np.linspace(0.0, 1.0, rows.size), 0
    else:
        cut = _where(parts, torque, blocks, first)
        shape = np.heaviside(np.arange(rows.size) - cut, 1.0)
    sizes = system.changes(torque, parts, shape)
    if other_motion(smooth.acceleration[rows], smooth.velocity[rows], shape):
        return
    # All rows together must say what the blocks say.
    small = {n for n, s in zip(WORTH, sizes, strict=True) if n != "load" and abs(s) < WORTH[n]}
    told, alone = {c.part for c in found} - small, system.own_acceleration() > OWN
    if not told:
        return
    message = " and ".join(_words(n, s, view, alone) for n, s in zip(WORTH, sizes, strict=True) if n in told)
    if first.gradual:
        message += " over the record: it is not one machine throughout"
        remedy = (
            f"let the machine warm up, or identify parts alone, with {name_option('start')} and "
            f"{name_option('end')}"
        )
        yield Finding("warning", "change", message, remedy=remedy)
        return
    moment = float(view.time[0]) + int(rows[cut]) * smooth.period
    index = int(np.nanargmin(np.abs(view.record.time - moment)))
    at = float(view.record.time[index])
    remedy = f"identify each part alone: {name_option('end', f'{at:.6g}')}, and {name_option('start', f'{at:.6g}')}"
    message += ": before and after it is not the same machine"
    yield Finding("warning", "change", message, row(index, view), remedy)


def other_motion(acceleration: Array, velocity: Array, shape: Array) -> bool:
    """Whether the motion is another where the shape ends than where it begins: slower, or of other frequencies.

    What friction and inertia are not, springs and bristles among it, then looks like a change of them.
    """
    ends = [shape < THIRD, shape > 1.0 - THIRD]
    pulls, speeds = ([float(np.sqrt(np.mean(x[end] ** 2))) for end in ends] for x in (acceleration, velocity))
    rates = [pull / max(speed, 1e-300) for pull, speed in zip(pulls, speeds, strict=True)]
    return any(max(pair) > OTHER_MOTION * min(pair) for pair in (pulls, rates))


def _words(name: str, size: float, view: View, alone: bool) -> str:
    if name == "load":
        return f"the constant torque changes by {size:+.3g} {view.record.units['motor_torque']}"
    if name == "inertia" and not alone:
        return "the inertia, or a torque that grows with the position, changes"
    return f"{name} changes by {100.0 * size:+.0f} %"


def temperature(view: View) -> Iterator[Finding]:
    """A machine that warms up or cools down by more than friction stands."""
    if not view.has("temperature"):
        return
    values = view.values("temperature")
    values = values[np.isfinite(values)]
    if values.size < 100:
        return
    tenth = values.size // 10
    begin, end = float(np.median(values[:tenth])), float(np.median(values[-tenth:]))
    if abs(end - begin) >= WARMER:
        message = f"the temperature goes from {begin:.4g} to {end:.4g} °C; friction changes with it"
        remedy = f"identify parts alone, with {name_option('start')} and {name_option('end')}, or record a warm machine"
        yield Finding("warning", "temperature-change", message, remedy=remedy)


# ---- the whole record ------------------------------------------------------------------------------------------


def _rows(smooth: Smooth) -> Rows:
    """Rows of steady direction: the filter mixes what lies within `SETTLED` rows of a stop or a reversal."""
    still = (~smooth.moving).astype(int)
    still[1:] |= np.diff(np.sign(smooth.velocity)) != 0.0
    still[:60] = still[-60:] = 1
    near = np.convolve(still, np.ones(2 * SETTLED + 1, dtype=int), "same") > 0
    rows = np.flatnonzero(~near)
    return rows[:: max(1, rows.size // MOST_ROWS)]


@dataclass(frozen=True, eq=False)
class System:
    """Columns of the whole record's regression: acceleration, friction's curve, place."""

    velocity: Array
    matrix: Array
    curve: slice

    def parts(self, torque: Array) -> Array | None:
        """The parts of the torque that the fit gives: inertia's, friction's, all else (n, 3); None where it fits badly,
        or an axis that moves one way leaves friction and load one."""
        if not BOTH < float(np.mean(self.velocity > 0.0)) < 1.0 - BOTH:
            return None
        values = _least(self.matrix, torque)
        friction = self.matrix[:, self.curve] @ values[self.curve]
        inertia = self.matrix[:, 0] * values[0]
        whole = self.matrix @ values
        if not float(np.mean((torque - whole) ** 2)) < 0.5 * float(np.var(torque)):
            return None
        return np.column_stack([inertia, friction, whole - inertia - friction])

    def changes(self, torque: Array, parts: Array, shape: Array) -> Array:
        """By what part of themselves inertia and friction change along with a shape, and the load in its unit, (3,)."""
        more = np.column_stack([shape * parts[:, 0], shape * parts[:, 1], shape])
        values = _least(np.column_stack([self.matrix, more]), torque)
        inertia, friction, load = values[-3:]
        before = self.matrix[:, self.curve] @ values[self.curve]
        scale = float(np.mean(parts[:, 1] * before) / np.mean(parts[:, 1] ** 2))
        own = (
            values[0]
            * float(np.mean(self.matrix[:, 0] ** 2))
            / float(np.mean(parts[:, 0] * self.matrix[:, 0]))
        )
        return np.array([inertia / own, friction / scale, load])

    def own_acceleration(self) -> float:
        """Part of the acceleration that the other columns do not make."""
        others = self.matrix[:, 1:]
        rest = self.matrix[:, 0] - others @ _least(others, self.matrix[:, 0])
        return float(np.sqrt(np.mean(rest**2)))


def _system(smooth: Smooth, rows: Any) -> System:
    v = smooth.velocity[rows]
    curve = _curve(np.abs(v))
    # What friction has in common in both directions cannot be distinguished from a torque over the position.
    odd = curve * np.sign(v)[:, None]
    matrix = np.column_stack([smooth.acceleration[rows], odd, curve, _place(smooth.position[rows])])
    size: Array = np.sqrt(np.mean(matrix**2, axis=0))
    return System(v, matrix / np.where(size > 0.0, size, 1.0), slice(1, 1 + curve.shape[1]))


def _least(matrix: Array, target: Array) -> Array:
    """Least squares; the smallest values where several serve."""
    return cast("tuple[Array, ...]", np.linalg.lstsq(matrix, target, rcond=1e-9))[0]


def _hats(x: Array, knots: Array) -> Array:
    """Piecewise linear functions, one at each knot, (n, k)."""
    return np.stack([np.interp(x, knots, e) for e in np.eye(knots.size)], axis=1)


def _curve(speed: Array) -> Array:
    """Piecewise linear functions of the speed."""
    return _hats(speed, np.unique(np.percentile(speed, np.linspace(0.0, 100.0, KNOTS))))


def _place(q: Array) -> Array:
    """Functions of the position: harmonics of a turn, or of a shorter way piecewise linear ones."""
    if np.ptp(q) > 2.2 * math.pi:
        angles = [k * q for k in range(1, HARMONICS + 1)]
        return np.stack([f(x) for x in angles for f in (np.sin, np.cos)], axis=1)
    return _hats(q, np.linspace(float(np.min(q)), float(np.max(q)), PLACES))[:, 1:]


# ---- blocks ----------------------------------------------------------------------------------------------------


def _blocks(parts: Array, torque: Array, count: int) -> Blocks:
    """Every block's regression of the torque on the parts; variances allow for correlated residuals."""
    pieces: list[Any] = np.array_split(np.arange(torque.size), count)
    friction = float(np.mean(np.abs(parts[:, 1])))
    values, variances = np.zeros((count, 3)), np.full((count, 3), np.inf)
    left = np.zeros((count, 3))
    for k, piece in enumerate(pieces):
        x = np.column_stack([parts[piece, 0], parts[piece, 1], np.full(piece.size, friction)])
        y = torque[piece] - parts[piece, 2]
        inverse: Array = np.linalg.pinv(x.T @ x, rcond=1e-10)
        values[k] = inverse @ (x.T @ y)
        scores = x * (y - x @ values[k])[:, None]
        covariance = inverse @ long_run(scores, max(10, piece.size // 10)) @ inverse
        variances[k] = np.maximum(np.diag(covariance), 1e-10)
        left[k] = np.linalg.norm(y - x @ values[k]) / np.maximum(_by_itself(x), 1e-300)
    told = (left <= UNTOLD) & (left <= WORSE * np.percentile(left, 25.0, axis=0))
    return Blocks(values, variances, told, np.array([p[0] for p in pieces]))


def _by_itself(x: Array) -> Array:
    """Size of what of each column the others do not make: nothing of friction and load where a block moves one way."""
    each = [
        x[:, k] - x[:, others] @ _least(x[:, others], x[:, k])
        for k, others in enumerate(([1, 2], [0, 2], [0, 1]))
    ]
    return np.array([float(np.linalg.norm(own)) for own in each])


def _change(blocks: Blocks, part: int, weight: float) -> Change | None:
    """The step or trend that stands out most; None where none does, or it is of no weight in the torque."""
    told = np.flatnonzero(blocks.told[:, part])
    count = told.size
    if count < FEWEST_BLOCKS // 2:
        return None
    x, noise = blocks.values[told, part], blocks.variances[told, part]
    name = tuple(WORTH)[part]
    step = np.arange(count)
    shapes = [(step >= k).astype(float) for k in range(2, count - 1)] + [told / (len(blocks.values) - 1.0)]
    fits = [_contrast(x, noise, shape) for shape in shapes]
    sure = [abs(slope) / spread for _, slope, spread in fits]
    best = int(np.argmax(sure))
    start, slope, _ = fits[best]
    if not sure[best] > SURE + SURE_OF_FEW / (count - 2):
        return None
    if (
        abs(slope) < WORTH[name]
        or abs(slope) * weight < SHARE
        or (name != "load" and min(start, start + slope) <= 0.0)
    ):
        return None
    gradual = best == len(shapes) - 1
    before, split = (0, 0) if gradual else told[best + 1 : best + 3].tolist()
    return Change(name, sure[best], before, split, gradual)


def _contrast(x: Array, noise: Array, shape: Array) -> tuple[float, float, float]:
    """Value at 0 and rise of a shape over the blocks, and the rise's standard deviation, from each block's own noise
    and from the scatter that is left between the blocks."""
    matrix = np.column_stack([np.ones(x.size), shape])

    def solved(between: float) -> tuple[Array, Array, float, float]:
        weight = np.asarray(1.0 / (noise + between), dtype=np.float64)
        inverse = np.asarray(np.linalg.pinv((matrix.T * weight) @ matrix), dtype=np.float64)
        values: Array = inverse @ ((matrix.T * weight) @ x)
        excess = float(weight @ (x - matrix @ values) ** 2) / (x.size - 2) - 1.0
        return values, inverse, excess, float(np.mean(weight))

    between = 0.0
    values, inverse, excess, weight = solved(between)
    for _ in range(30):
        # The scatter between the blocks at which their residuals are as large as they should be.
        step = excess / weight
        if abs(step) < 1e-3 * (between + 1e-12) or (excess <= 0.0 and between == 0.0):
            break
        between = max(0.0, between + step)
        values, inverse, excess, weight = solved(between)
    return float(values[0]), float(values[1]), math.sqrt(float(inverse[1, 1]))


def _where(parts: Array, torque: Array, blocks: Blocks, change: Change) -> int:
    """The row at which what holds before passes to what holds behind, with the least squared error."""
    friction = float(np.mean(np.abs(parts[:, 1])))
    x = np.column_stack([parts[:, 0], parts[:, 1], np.full(torque.size, friction)])
    y = torque - parts[:, 2]
    begin, behind = int(blocks.first_rows[change.before]), change.split + 1
    end = int(blocks.first_rows[behind]) if behind < blocks.first_rows.size else torque.size
    errors: list[Array] = []
    for rows in (slice(0, begin), slice(end, None)):
        values = _least(x[rows], y[rows])
        errors.append((y[begin:end] - x[begin:end] @ values) ** 2)
    before, after = errors
    total: Array = np.cumsum(before) + np.sum(after) - np.cumsum(after)
    return begin + int(np.argmin(total))
