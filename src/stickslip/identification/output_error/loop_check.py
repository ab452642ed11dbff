"""Check of a given controller against a record: its gains, estimated from the record itself.

A linear controller's output is linear in its gains, u = kp e + ki (integral of e) + kr dr - kd dy, so least squares of
the recorded signal over reference and position determine them, whatever the axis. Four effects are allowed for:

- Noise and rounding of the position reduce the estimated gain on the velocity (errors in variables: ``fuller1987``).
Means over segments long enough to make this negligible are fitted; the rest counts as uncertainty.
- A signal recorded some rows later reduces the gain on the velocity. The delay with the best fit is used.
- A reference recorded some rows late or early resembles another gain on its velocity: gains that explain the signal
with a shifted reference are accepted.
- Residuals are correlated: the intervals leave segments of time out (`stickslip.identification.fit.jackknife`).

A filter of the velocity that was not given is another controller; a slow one usually causes a warning. False warnings
and missed ones are counted by `benchmarks/loop_doubted.py`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.control.linear import Cascade, Gains
from stickslip.core.messages import Note, name_option
from stickslip.core.record import encoder_step
from stickslip.identification.experiment import Experiment
from stickslip.identification.fit.jackknife import leave_blocks_out
from stickslip.identification.fit.noise import white_std
from stickslip.identification.fit.student import student_quantile
from stickslip.simulation.recorded_input.simulation import Loop, control_signal

Array = np.ndarray[Any, np.dtype[np.float64]]
Means = tuple[Array, Array, Array]
"""Columns besides a constant, signal, time."""

GAINS = ("kp", "ki", "kr", "kd")
DELAYS = range(-2, 5)
"""Delays of the recorded signal relative to the position, rows."""
LATE = (0, 1, -1, 2, -2)
"""Delays of the recorded reference, rows, the likeliest first."""
CLEARLY = 0.5
"""Greatest ratio of squared residuals, shifted to unshifted, for a shift to be accepted."""
LENGTHS = (1, 2, 4, 8, 16, 32)
"""Rows per mean."""
NOISY = 0.01
"""Greatest share of noise in the variance that only the velocity explains: it lowers the gain by as much."""
BLOCK = 0.25
"""Length of a segment that is left out, s."""
FEWEST = 100
"""Fewest means."""
CUT = 0.98
"""Part of the limit, or of the level exceeded in 0.1 % of the rows, above which a signal counts as cut off."""
EXPLAINED, MISSED, WORSE = 0.3, 0.05, 2.0
"""Residual parts of the signal: greatest with the estimated gains; least with the given ones; least ratio of both."""
OTHER_LOOP = "other-loop"
OTHER, FELT = 0.1, 0.03
"""Relative difference of a gain, and its part of the signal, above which it is reported."""


@dataclass(frozen=True, eq=False)
class ShownGains:
    """Gains that a record shows, together with those that were given.

    Attributes
    ----------
    given, values, half_widths : array, shape (4,)
        Values for `GAINS`, in the unit of the drive's signal per rad (m); half-widths of 95 % intervals.
    parts : array, shape (4,)
        Root mean square of each gain's column, relative to that of the signal.
    left, missed : float
        Unexplained parts of the signal (root mean squares) with the estimated gains and with the given ones, each with
        the best shift of the reference.
    late : int
        Delay of the recorded reference with which the given gains explain the signal, rows; 0 if none is needed or
        helps.
    cascade : bool
        Whether a cascade was given: the gains are those of its equivalent PID (`as_pid`).
    """

    given: Array
    values: Array
    half_widths: Array
    parts: Array
    left: float
    missed: float
    late: int = 0
    cascade: bool = False

    @property
    def turned(self) -> bool:
        """Whether every given gain is estimated with the opposite sign."""
        return bool(np.any(self.given > 0.0) and np.all(self.values[self.given > 0.0] < 0.0))

    def differing(self) -> list[str]:
        """Describe each gain that clearly differs from the given one; empty if the given ones explain the signal."""
        if self.late or self.left > EXPLAINED or self.missed < bound(self.left):
            return []
        shown = np.maximum(self.values, 0.0)
        off = np.abs(shown - self.given)
        told = (
            (off > OTHER * np.maximum(shown, self.given))
            & (off > self.half_widths)
            & (off * self.parts > FELT)
        )
        return [
            f"{name} {g:.4g} given, {v:.4g} ± {h:.2g} shown"
            for name, g, v, h, is_told in zip(
                GAINS, self.given, self.values, self.half_widths, told, strict=True
            )
            if is_told
        ]


def bound(left: float) -> float:
    """Return the acceptable residual part of the signal if the best gains have this one."""
    return max(MISSED, WORSE * left)


def doubted_loops(experiments: Sequence[Experiment], gain: float = 1.0) -> list[str]:
    """Return a warning for each record of another loop, or with a delayed or early reference.

    `gain` is that of `shown_gains`.
    """
    found = [(experiment.name, shown_gains(experiment, gain)) for experiment in experiments]
    return [said for name, shown in found if shown is not None and (said := doubt(name, shown))]


def doubt(name: str, shown: ShownGains) -> str:
    """Return the warning about a record's loop; empty without one."""
    if shown.late:
        rows = f"{abs(shown.late)} row{'s' if abs(shown.late) > 1 else ''} {'late' if shown.late > 0 else 'early'}"
        return f"{name}: the reference seems recorded {rows}; so shifted, the loop given makes the recorded signal."
    differing = shown.differing()
    if not differing:
        return ""
    why = (
        "every gain shown is negative: the recorded signal's sign may be turned."
        if shown.turned
        else f"check {name_option('loop')}, its period too; a filter or a feedforward in the controller can "
        "look like this as well."
    )
    which = " (as a PID)" if shown.cascade else ""
    return Note(
        f"{name} shows another controller than the loop given{which}: {'; '.join(differing)}. The gains given miss the "
        f"recorded signal by {shown.missed:.0%}, those shown by {shown.left:.1%}: {why}",
        OTHER_LOOP,
    )


def shown_gains(experiment: Experiment, gain: float = 1.0) -> ShownGains | None:
    """Estimate the gains of the controller that made a record, by least squares.

    Parameters
    ----------
    experiment : Experiment
        With its drive's signal, reference and loop.
    gain : float
        Factor on the controller's output.

    Returns
    -------
    ShownGains or None
        None if the record lacks one of these or is too short, or the loop is not such a sum.
    """
    if experiment.drive is None or experiment.reference is None or experiment.loop is None:
        return None
    columns, noise = columns_of(experiment, experiment.loop), position_noise(experiment.position)
    span = experiment.loop.velocity_span
    length, velocity_noise = 0, 0.0
    for length in LENGTHS:
        x, u, _ = means(experiment, columns, length, 0)
        if u.size < FEWEST:
            return None
        velocity_noise = 2.0 * (noise / (max(length, span) * experiment.period)) ** 2
        if velocity_noise < NOISY * own_variance(x, GAINS.index("kd")):
            break
    if (pid := as_pid(experiment.loop)) is None:
        return None
    given = np.array([getattr(pid, name) for name in GAINS])
    tries = {0: delayed(experiment, columns, length, gain)}
    if unexplained(*best_of(tries[0])[:2], given) >= MISSED:
        for late in LATE[1:]:
            columns = columns_of(shifted(experiment, late), experiment.loop)
            tries[late] = delayed(experiment, columns, length, gain)
    x, u, time = best_of(tries[likeliest(tries)])
    values, half_widths = with_intervals(x, u, time, velocity_noise)
    parts = np.sqrt(np.mean(x[:, :-1] ** 2, axis=0)) / max(rms(u), 1e-300)
    left = math.sqrt(residual(x, u)) / max(rms(u), 1e-300)
    by_row = {late: min(unexplained(x, u, given) for x, u, _ in some) for late, some in tries.items()}
    late = min(by_row, key=lambda row: by_row[row])
    needed = by_row[late] < bound(left) <= by_row[0]
    cascade = experiment.loop.kv > 0.0
    return ShownGains(given, values, half_widths, parts, left, by_row[late], late if needed else 0, cascade)


def as_pid(loop: Loop) -> Loop | Gains | None:
    """Return the loop itself, or a cascade's equivalent PID.

    None if the cascade has one more gain, on the position itself.
    """
    if loop.kv == 0.0:
        return loop
    if loop.kvi != 0.0 and loop.feed != 1.0:
        return None
    return Cascade(loop.kv, loop.kvp, loop.kvi, loop.feed).pid


def shifted(experiment: Experiment, late: int) -> Experiment:
    """Return the experiment with the reference `late` rows earlier."""
    assert experiment.reference is not None
    rows = np.clip(np.arange(experiment.time.size) + late, 0, experiment.time.size - 1)
    return replace(experiment, reference=experiment.reference[rows])


def delayed(experiment: Experiment, columns: Array, length: int, factor: float) -> list[Means]:
    """Return the means with the signal delayed by each of `DELAYS`, divided by `factor`."""
    tries = [means(experiment, columns, length, delay) for delay in DELAYS]
    return [(x, u / factor, time) for x, u, time in tries]


def best_of(tries: Sequence[Means]) -> Means:
    """Return the means in which gains explain most."""
    return min(tries, key=lambda t: residual(t[0], t[1]))


def likeliest(tries: Mapping[int, Sequence[Means]]) -> int:
    """Return the reference's delay, rows: 0 unless another has a clearly smaller residual (kr nearly replaces it)."""
    left = {late: residual(*best_of(some)[:2]) for late, some in tries.items()}
    least = min(left, key=lambda row: left[row])
    return least if left[least] < CLEARLY * left[0] else 0


def residual(x: Array, u: Array) -> float:
    """Return the mean square that no gains explain."""
    return float(np.mean((u - x @ solved(x, u)) ** 2))


def unexplained(x: Array, u: Array, given: Array) -> float:
    """Return the part of a signal that gains do not explain, apart from a constant."""
    missed = u - x[:, :-1] @ given
    return rms(missed - np.mean(missed)) / max(rms(u), 1e-300)


def columns_of(experiment: Experiment, loop: Loop) -> Array:
    """Return the column of each gain, shape (rows, 4): the controller with this gain 1 and no other."""
    assert experiment.reference is not None
    plain = Loop(velocity_span=loop.velocity_span, filter=loop.filter)
    columns = np.column_stack([
        control_signal(replace(plain, **{name: 1.0}), experiment.time, experiment.reference, experiment.position)
        for name in GAINS
    ])  # fmt: skip
    if 0.0 < loop.period < 0.75 * experiment.period:
        # It also acts between rows, so its velocities are those at a row, not the mean up to it.
        columns[:, GAINS.index("kr")] = np.gradient(experiment.reference, experiment.time)
        columns[:, GAINS.index("kd")] = -np.gradient(experiment.position, experiment.time)
    return columns


def means(experiment: Experiment, columns: Array, length: int, delay: int) -> Means:
    """Return columns with a constant, signal and time, as means over `length` rows without cut-off values."""
    assert experiment.drive is not None
    assert experiment.loop is not None
    size = np.abs(experiment.drive)
    whole = size < CUT * min(experiment.loop.limit, float(np.quantile(size, 0.999)))
    margin = max(abs(d) for d in DELAYS)
    count = (experiment.time.size - 2 * margin) // length
    rows = margin + np.arange(count * length).reshape(count, length)
    keep = whole[rows + delay].all(axis=1)
    rows = rows[keep]
    x: Array = np.column_stack([columns[rows].mean(axis=1), np.ones(rows.shape[0])])
    return x, experiment.drive[rows + delay].mean(axis=1), experiment.time[rows].mean(axis=1)


def with_intervals(x: Array, u: Array, time: Array, velocity_noise: float) -> tuple[Array, Array]:
    """Return the gains and the half-widths of their 95 % intervals, each of shape (4,)."""
    kd, count = GAINS.index("kd"), len(GAINS)
    scale = scales(x)
    values = solved(x, u)
    blocks: Any = np.unique((time - time[0]) // BLOCK, return_inverse=True)[1]
    spread = leave_blocks_out(x / scale, u - x @ values, blocks, 1e-9 * u.size * np.eye(count + 1))
    freedom = [max(spread.freedom(row) - 1.0, 1.0) for row in np.eye(count + 1)]
    std = np.sqrt(np.diag(spread.covariance)) / scale
    half: Array = np.array([student_quantile(n) for n in freedom]) * std
    # The estimate with the velocity's noise removed from the normal equations (``fuller1987``).
    normal = (x / scale).T @ (x / scale) / u.size
    own = own_variance(x, kd)
    normal[kd, kd] -= min(velocity_noise, 0.99 * own) / scale[kd] ** 2
    # A gain that the record does not excite has a column of 0.
    cleared = np.linalg.lstsq(normal, (x / scale).T @ u / u.size, rcond=None)[0] / scale
    half += np.abs(cleared - values) if velocity_noise < 0.5 * own else np.inf
    return values[:count], half[:count]


def own_variance(x: Array, place: int) -> float:
    """Return the mean square of a column's part that no combination of the others explains."""
    others = np.delete(x, place, axis=1)
    return float(np.mean((x[:, place] - others @ solved(others, x[:, place])) ** 2))


def solved(x: Array, u: Array) -> Array:
    """Solve least squares of u over columns of very different sizes."""
    scale = scales(x)
    return np.asarray(np.linalg.lstsq(x / scale, u, rcond=None)[0] / scale, dtype=np.float64)


def scales(x: Array) -> Array:
    """Return the root mean square of every column; 1 if it is 0."""
    size = np.sqrt(np.mean(x**2, axis=0))
    return np.where(size > 0.0, size, 1.0)


def rms(x: Array) -> float:
    """Return the root mean square."""
    return math.sqrt(float(np.mean(x * x)))


def position_noise(position: Array) -> float:
    """Return the standard deviation of a position's noise, rad (m): from its rounding or third differences."""
    return max(white_std(position), encoder_step(position) / math.sqrt(12.0))
