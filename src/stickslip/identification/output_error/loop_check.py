"""Whether a controller that was given is the one that made a record: its gains, found from the record itself.

A linear controller's output is linear in its gains, u = kp e + ki (integral of e) + kr dr - kd dy, so that least
squares of the recorded signal over reference and position give them, whatever the axis is. Four things would mislead:

- Noise and rounding of the position make the gain on the velocity look smaller (errors in variables:
  ``fuller1987``). Means over segments of rows are fitted, so long that it does not matter; what
  is left counts as uncertain.
- A signal that is recorded some rows later takes from the gain on the velocity. The delay is the one that fits best.
- A reference that is recorded some rows late or early looks like another gain on its velocity: gains that explain the
  signal with the reference shifted are not doubted.
- Residuals are correlated: the intervals leave segments of time out (`stickslip.identification.fit.jackknife`).

`benchmarks/loop_doubted.py`, seeds 20 to 49: of 450 records with the right gains 2 were doubted without the
controller's period, 1 with it, all with a fifth of its rows; of 720 with all rows and 16384 counts or more, a kd of
twice the true one, a kp 41 % above it, and kr left out or put in were doubted in 717. A filter of the velocity
that was not given is another controller: one at 100 Hz is doubted in some records, slower ones in most.
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
"""Columns beside a constant, signal, time."""

GAINS = ("kp", "ki", "kr", "kd")
DELAYS = range(-2, 5)
"""Rows by which the recorded signal may follow the position."""
LATE = (0, 1, -1, 2, -2)
"""Rows by which the recorded reference may be late, likeliest first."""
CLEARLY = 0.5
"""Part of the squares left with the reference as it is that a shifted one may leave for the shift to be believed."""
LENGTHS = (1, 2, 4, 8, 16, 32)
"""Rows of which means are taken."""
NOISY = 0.01
"""Part of the variance that only the velocity has which may be noise: it lowers the gain by so much."""
BLOCK = 0.25
"""s of a segment that is left out."""
FEWEST = 100
"""Means needed."""
CUT = 0.98
"""Part of the limit, or of what is exceeded in 0.1 % of the rows, from which on a signal counts as cut off."""
EXPLAINED, MISSED, WORSE = 0.3, 0.05, 2.0
"""Parts of the signal that the shown gains may leave, and that the given ones must leave, so much more than those."""
OTHER_LOOP = "other-loop"
OTHER, FELT = 0.1, 0.03
"""Relative difference of a gain, and its part of the signal, from which on it is told."""


@dataclass(frozen=True, eq=False)
class ShownGains:
    """Gains that a record shows, beside those that were given.

    Attributes
    ----------
    given, values, half_widths : array, shape (4,)
        Of `GAINS`, in the unit of the drive's signal per rad (m); half-widths of 95 % intervals.
    parts : array, shape (4,)
        Root mean square of what each gain multiplies, over that of the signal.
    left, missed : float
        Parts of the signal (root mean squares) that the shown gains and the given ones do not explain, each with the
        reference shifted by as many rows as suits them.
    late : int
        Rows by which the reference must be recorded late for the given gains to explain the signal; 0 where they do
        so without, or no such shift helps.
    cascade : bool
        Whether a cascade was given: the gains are those of the PID that it is (`as_pid`).
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
        """Whether every gain that was given is shown with the other sign."""
        return bool(np.any(self.given > 0.0) and np.all(self.values[self.given > 0.0] < 0.0))

    def differing(self) -> list[str]:
        """Each gain that is clearly another than given, in words; empty where the given ones explain the signal."""
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
    """Part of the signal that gains may leave where the best ones leave so much."""
    return max(MISSED, WORSE * left)


def doubted_loops(experiments: Sequence[Experiment], gain: float = 1.0) -> list[str]:
    """A sentence for each record that clearly was made by other gains than given, or whose reference is recorded rows
    late or early; `gain` as in `shown_gains`."""
    found = [(experiment.name, shown_gains(experiment, gain)) for experiment in experiments]
    return [said for name, shown in found if shown is not None and (said := doubt(name, shown))]


def doubt(name: str, shown: ShownGains) -> str:
    """What is to be said of a record's loop; empty where nothing is."""
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
    """Gains of the controller that made a record, by least squares.

    Parameters
    ----------
    experiment : Experiment
        With its drive's signal, reference and loop.
    gain : float
        Factor on the controller's output.

    Returns
    -------
    ShownGains or None
        None where the record lacks one of these, is too short, or the loop is no such sum.
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
    """What has the gains of a sum: the loop itself, or the PID that a cascade is; None where that has one more gain, on
    the position itself."""
    if loop.kv == 0.0:
        return loop
    if loop.kvi != 0.0 and loop.feed != 1.0:
        return None
    return Cascade(loop.kv, loop.kvp, loop.kvi, loop.feed).pid


def shifted(experiment: Experiment, late: int) -> Experiment:
    """The same with the reference that many rows earlier."""
    assert experiment.reference is not None
    rows = np.clip(np.arange(experiment.time.size) + late, 0, experiment.time.size - 1)
    return replace(experiment, reference=experiment.reference[rows])


def delayed(experiment: Experiment, columns: Array, length: int, factor: float) -> list[Means]:
    """Means with the signal each of the `DELAYS` later, without a factor on it."""
    tries = [means(experiment, columns, length, delay) for delay in DELAYS]
    return [(x, u / factor, time) for x, u, time in tries]


def best_of(tries: Sequence[Means]) -> Means:
    """Those in which gains explain most."""
    return min(tries, key=lambda t: residual(t[0], t[1]))


def likeliest(tries: Mapping[int, Sequence[Means]]) -> int:
    """Rows by which the reference is late: 0 unless others leave clearly less, as kr stands for them nearly."""
    left = {late: residual(*best_of(some)[:2]) for late, some in tries.items()}
    least = min(left, key=lambda row: left[row])
    return least if left[least] < CLEARLY * left[0] else 0


def residual(x: Array, u: Array) -> float:
    """Mean square of what no gains explain."""
    return float(np.mean((u - x @ solved(x, u)) ** 2))


def unexplained(x: Array, u: Array, given: Array) -> float:
    """Part of a signal that gains leave, but for a constant."""
    missed = u - x[:, :-1] @ given
    return rms(missed - np.mean(missed)) / max(rms(u), 1e-300)


def columns_of(experiment: Experiment, loop: Loop) -> Array:
    """What each gain multiplies, shape (rows, 4): the controller with this gain 1 and no other."""
    assert experiment.reference is not None
    plain = Loop(velocity_span=loop.velocity_span, filter=loop.filter)
    columns = np.column_stack([
        control_signal(replace(plain, **{name: 1.0}), experiment.time, experiment.reference, experiment.position)
        for name in GAINS
    ])  # fmt: skip
    if 0.0 < loop.period < 0.75 * experiment.period:
        # It acts between the rows too, so that its velocities are those at a row, not the mean until then.
        columns[:, GAINS.index("kr")] = np.gradient(experiment.reference, experiment.time)
        columns[:, GAINS.index("kd")] = -np.gradient(experiment.position, experiment.time)
    return columns


def means(experiment: Experiment, columns: Array, length: int, delay: int) -> Means:
    """Columns beside a constant, signal and time, as means over `length` rows, where nothing is cut off."""
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
    """Gains and the half-widths of their 95 % intervals, each of shape (4,)."""
    kd, count = GAINS.index("kd"), len(GAINS)
    scale = scales(x)
    values = solved(x, u)
    blocks: Any = np.unique((time - time[0]) // BLOCK, return_inverse=True)[1]
    spread = leave_blocks_out(x / scale, u - x @ values, blocks, 1e-9 * u.size * np.eye(count + 1))
    freedom = [max(spread.freedom(row) - 1.0, 1.0) for row in np.eye(count + 1)]
    std = np.sqrt(np.diag(spread.covariance)) / scale
    half: Array = np.array([student_quantile(n) for n in freedom]) * std
    # Without the noise of the velocity in the normal equations they would be these (``fuller1987``).
    normal = (x / scale).T @ (x / scale) / u.size
    own = own_variance(x, kd)
    normal[kd, kd] -= min(velocity_noise, 0.99 * own) / scale[kd] ** 2
    # A gain that the record does not excite has a column of 0.
    cleared = np.linalg.lstsq(normal, (x / scale).T @ u / u.size, rcond=None)[0] / scale
    half += np.abs(cleared - values) if velocity_noise < 0.5 * own else np.inf
    return values[:count], half[:count]


def own_variance(x: Array, place: int) -> float:
    """Mean square of what a column has that no combination of the others has."""
    others = np.delete(x, place, axis=1)
    return float(np.mean((x[:, place] - others @ solved(others, x[:, place])) ** 2))


def solved(x: Array, u: Array) -> Array:
    """Least squares of u over columns of very different sizes."""
    scale = scales(x)
    return np.asarray(np.linalg.lstsq(x / scale, u, rcond=None)[0] / scale, dtype=np.float64)


def scales(x: Array) -> Array:
    """Root mean square of every column; 1 where it is 0."""
    size = np.sqrt(np.mean(x**2, axis=0))
    return np.where(size > 0.0, size, 1.0)


def rms(x: Array) -> float:
    """Root mean square."""
    return math.sqrt(float(np.mean(x * x)))


def position_noise(position: Array) -> float:
    """Standard deviation of a position's noise, rad (m): that of its rounding, or what third differences show."""
    return max(white_std(position), encoder_step(position) / math.sqrt(12.0))
