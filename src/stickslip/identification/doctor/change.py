"""Changes within one record: friction, inertia, load or temperature.

A friction curve over velocity, an inertia and a torque over position are fitted to the whole filtered record (whatever
the law of friction). In blocks of equal length the torque is then regressed on the inertia's part, the curve and a
constant, which gives the size of each relative to the whole record. A step or a trend over the blocks counts as a
change if it exceeds the scatter between the blocks, which includes coloured noise, cogging, sticking and other
unmodelled effects (a random-effects comparison: DerSimonian and Laird 1986).
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
"""Drift from which on a warning is given, part of friction at the first row."""
MOST_ROWS = 30_000
BLOCKS, FEWEST_BLOCKS = 16, 8
PER_BLOCK = 150
"""Fewest moving rows of the filtered record in a block: a dozen independent ones."""
SETTLED = 15
KNOTS, HARMONICS, PLACES = 6, 6, 8
"""Knots of the friction curve in each direction; harmonics of the torque over a turn; knots over less than a turn."""
SURE, SURE_OF_FEW = 5.0, 30.0
"""A change counts from SURE + SURE_OF_FEW / degrees of freedom standard deviations on, 7 with 16 blocks: the maximum
over all splits, trends and parameters is compared, and few blocks have heavier tails."""
WORTH = {"inertia": 0.1, "friction": 0.1, "load": 0.15}
"""Least change that would spoil a result, as a part of the parameter itself (for a load: of friction)."""
SHARE = 0.04
"""Least change as a part of the torque: blurred edges of a staircase resemble a smaller inertia."""
OWN = 0.1
"""Least part of the acceleration that is independent of the position; below it (a single sine) the inertia is
undetermined."""
THIRD, OTHER_MOTION = 1.0 / 3.0, 3.0
"""Part of a trend that counts as its start or end; ratio between both ends of the acceleration, or of acceleration to
velocity, from which on the motion itself differs."""
WARMER = 5.0
"""Temperature change that gives a warning, K."""
UNTOLD, WORSE = 1.0, 4.0
"""Greatest residual of a block's torque relative to a parameter's independent part of it, for the block to determine
the parameter; and greatest ratio of it to the lower quartile of the blocks. If an axis creeps after it accelerated,
cogging and blurred edges otherwise resemble an inertia."""
BOTH = 0.05
"""Least share of the moving rows in either direction for friction and load to be distinguished."""


@dataclass(frozen=True, slots=True)
class Blocks:
    """Estimates of inertia, friction and load in each block relative to the whole record, shape (b, 3).

    `variances` are theirs; `told` is whether the block determines them.
    """

    values: Array
    variances: Array
    told: Mask
    first_rows: Any


@dataclass(frozen=True, slots=True)
class Change:
    """The parameter that changes, its significance, and where.

    `before` and `split` are the last block before the step and the first after it; `gradual` means a trend.
    """

    part: str
    sure: float
    before: int
    split: int
    gradual: bool


def changes(view: View) -> Iterator[Finding]:
    """Yield a warning if friction, inertia or load changes within the record, or friction drifts."""
    found = list(_between_blocks(view))
    yield from found or _drifting(view)


def _drifting(view: View) -> Iterator[Finding]:
    """Yield a warning if friction in gross sliding drifts with time by more than a few percent."""
    found = None if view.smooth is None else view.sliding  # Without usable times neither exists.
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
    """Yield a warning if a parameter differs between blocks."""
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
    size[2] = size[1]  # The load is in units of friction.
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
    # The fit to all rows must agree with the blocks.
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
    """Return whether the motion at the end of the shape differs from that at its start: slower, or other frequencies.

    Effects other than friction and inertia, springs and bristles among them, then look like a change of these.
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
    """Yield a warning if the temperature changes enough to change friction."""
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
    """Return rows of steady direction: the filter mixes rows within `SETTLED` rows of a stop or a reversal."""
    still = (~smooth.moving).astype(int)
    still[1:] |= np.diff(np.sign(smooth.velocity)) != 0.0
    still[:60] = still[-60:] = 1
    near = np.convolve(still, np.ones(2 * SETTLED + 1, dtype=int), "same") > 0
    rows = np.flatnonzero(~near)
    return rows[:: max(1, rows.size // MOST_ROWS)]


@dataclass(frozen=True, eq=False)
class System:
    """Columns of the whole record's regression: acceleration, friction curve, position."""

    velocity: Array
    matrix: Array
    curve: slice

    def parts(self, torque: Array) -> Array | None:
        """Return the fitted parts of the torque: inertia's, friction's, all else, shape (n, 3).

        None if the fit is bad, or if an axis moves in one direction only and friction and load are one constant.
        """
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
        """Return the relative change of inertia and friction along a shape, and the load's in its unit, shape (3,)."""
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
        """Return the part of the acceleration that the other columns do not explain."""
        others = self.matrix[:, 1:]
        rest = self.matrix[:, 0] - others @ _least(others, self.matrix[:, 0])
        return float(np.sqrt(np.mean(rest**2)))


def _system(smooth: Smooth, rows: Any) -> System:
    v = smooth.velocity[rows]
    curve = _curve(np.abs(v))
    # Friction common to both directions cannot be distinguished from a torque over the position.
    odd = curve * np.sign(v)[:, None]
    matrix = np.column_stack([smooth.acceleration[rows], odd, curve, _place(smooth.position[rows])])
    size: Array = np.sqrt(np.mean(matrix**2, axis=0))
    return System(v, matrix / np.where(size > 0.0, size, 1.0), slice(1, 1 + curve.shape[1]))


def _least(matrix: Array, target: Array) -> Array:
    """Solve least squares with the minimum norm."""
    return cast("tuple[Array, ...]", np.linalg.lstsq(matrix, target, rcond=1e-9))[0]


def _hats(x: Array, knots: Array) -> Array:
    """Return piecewise linear functions, one at each knot, shape (n, k)."""
    return np.stack([np.interp(x, knots, e) for e in np.eye(knots.size)], axis=1)


def _curve(speed: Array) -> Array:
    """Return piecewise linear functions of the speed."""
    return _hats(speed, np.unique(np.percentile(speed, np.linspace(0.0, 100.0, KNOTS))))


def _place(q: Array) -> Array:
    """Return functions of the position: harmonics of a turn, or piecewise linear ones over a shorter range."""
    if np.ptp(q) > 2.2 * math.pi:
        angles = [k * q for k in range(1, HARMONICS + 1)]
        return np.stack([f(x) for x in angles for f in (np.sin, np.cos)], axis=1)
    return _hats(q, np.linspace(float(np.min(q)), float(np.max(q)), PLACES))[:, 1:]


# ---- blocks ----------------------------------------------------------------------------------------------------


def _blocks(parts: Array, torque: Array, count: int) -> Blocks:
    """Regress the torque on the parts in every block; variances allow for correlated residuals."""
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
    """Return the norm of each column's part independent of the others: 0 for friction and load in one-way motion."""
    each = [
        x[:, k] - x[:, others] @ _least(x[:, others], x[:, k])
        for k, others in enumerate(([1, 2], [0, 2], [0, 1]))
    ]
    return np.array([float(np.linalg.norm(own)) for own in each])


def _change(blocks: Blocks, part: int, weight: float) -> Change | None:
    """Return the most significant step or trend; None if none is significant or large enough in the torque."""
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
    """Fit value at 0 and rise of a shape over the blocks; return both with the rise's standard deviation.

    It includes each block's own noise and the remaining scatter between the blocks.
    """
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
        # Scatter between the blocks at which their residuals have the expected size.
        step = excess / weight
        if abs(step) < 1e-3 * (between + 1e-12) or (excess <= 0.0 and between == 0.0):
            break
        between = max(0.0, between + step)
        values, inverse, excess, weight = solved(between)
    return float(values[0]), float(values[1]), math.sqrt(float(inverse[1, 1]))


def _where(parts: Array, torque: Array, blocks: Blocks, change: Change) -> int:
    """Return the row of the change, at which the models before and after it have the least squared error."""
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
