"""Fit of any law to a measured torque along a measured motion; choice among laws by errors on blocks left out.

The offset of many records (gravity, a sensor's bias) is fitted as well. Errors are relative: root mean square of the
error over that of the torque.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError, ParameterError
from stickslip.core.messages import axis_unit
from stickslip.core.record import Record
from stickslip.core.spec import Law, Par
from stickslip.identification.estimate import Identification, Picture, Trace
from stickslip.identification.fit.noise import Noise
from stickslip.identification.fit.parameter_vector import Parameter, Vector
from stickslip.identification.fit.uncertainty import Fit, fit
from stickslip.models.model import Model
from stickslip.simulation.prescribed.motion import Along

Array = np.ndarray[Any, np.dtype[np.float64]]
Rows = np.ndarray[Any, np.dtype[np.intp]]

DAMPING = "N·m·s/rad"
OFFSET = Par("N·m", "T_0", "torque that acts besides friction")

STARTS = 3
"""Starts of the search."""
ENDS, COMPARED = 1e-8, 1e-7
"""Relative decrease of the sum of squares at which a descent stops: for the result, and for the comparison of laws."""
BLOCKS = 4
"""Blocks of the fitted rows, left out in turn in the comparison of laws."""
ELASTIC = 0.95
"""Correlation of torque and displacement above which a loop is nearly elastic."""


@dataclass(frozen=True, eq=False)
class Loop:
    """A motion and its torque.

    Attributes
    ----------
    time, position, torque : array, shape (n,)
        s, rad, N·m; the torque positive against positive velocity.
    unit : (str, str)
        Units of position and torque.
    velocity : array, shape (n,), optional
        rad/s; without it the motion is uniform from sample to sample.
    """

    time: Array
    position: Array
    torque: Array
    unit: tuple[str, str] = ("rad", "N·m")
    velocity: Array | None = None

    @classmethod
    def of(cls, record: Record, torque: str = "friction_torque", velocity: str = "") -> Loop:
        """Build the loop from a record's channels ``position`` and `torque`.

        Raises
        ------
        InputError
            If one of them is constant.
        """
        for channel in ("position", torque):
            values = record[channel]
            if values.size and np.all(values == values[0]):
                raise InputError(
                    f"{channel} is {values[0]:g} {record.units[channel]} throughout: without motion and torque there "
                    "is no loop; check that it was logged"
                )
        unit = (record.units["position"], record.units[torque])
        return cls(
            record.time, record["position"], record[torque], unit, record[velocity] if velocity else None
        )

    @property
    def work(self) -> float:
        """Work done against the torque, J: positive for friction."""
        middle = 0.5 * (self.torque[1:] + self.torque[:-1])
        return float(np.sum((middle - float(np.mean(self.torque))) * np.diff(self.position)))

    def without_inertia(self, inertia: float) -> Loop:
        """Return this loop with friction's torque only, without that which accelerates an inertia (kg·m²).

        The acceleration is that of cubic polynomials over a twentieth of the time between two turning points to either
        side (Savitzky and Golay 1964).
        """
        signal: Any = importlib.import_module("scipy.signal")
        dt = float(np.median(np.diff(self.time)))
        turns = turning_points(self.position)
        swing = float(np.median(np.diff(turns))) if len(turns) > 1 else float(self.time.size)
        half = max(2, round(swing / 20.0))
        if 2 * half + 1 > self.time.size:
            return self
        acceleration = signal.savgol_filter(self.position, 2 * half + 1, 3, deriv=2, delta=dt)
        return replace(self, torque=self.torque - inertia * np.asarray(acceleration))

    def righted(self) -> tuple[Loop, tuple[str, ...]]:
        """Return this loop, its torque's sign inverted if it would supply energy, and a note if so."""
        # A nearly elastic loop does almost no work: the sign of its stiffness decides instead.
        if self.work >= 0.0 or float(np.corrcoef(self.position, self.torque)[0, 1]) > ELASTIC:
            return self, ()
        note = "The torque does work with the motion, which friction cannot: its sign was changed."
        return replace(self, torque=-self.torque), (note,)


def fit_loop(
    loop: Loop, template: Model, rows: Rows, *, frozen: Iterable[str] = (), noise: Noise | None = None,
    offset: bool = True, starts: int | Array | Fit = 6, profiles: bool = True, reach: float = 1.5, lags: int = 0,
    tolerance: float = 1e-12, damping: float = 0.0,
) -> tuple[Fit, Along]:  # fmt: skip
    """Fit a law's torque along the motion on some rows; the returned simulation covers all rows.

    The search starts at a fit's values, at coordinates, or at that number of places. With `damping` (N·m·s/rad) a
    torque proportional to the velocity is fitted as well, within plus or minus that coefficient.
    """
    along = along_until(template.law, loop, loop.time.size)
    # Rows after the last one have no effect on it.
    seen = along_until(template.law, loop, int(np.max(rows, initial=0)) + 2)
    level = float(np.sqrt(np.mean(loop.torque[rows] ** 2)))
    extra: tuple[Parameter, ...] = (Parameter("offset", OFFSET, 0.0, scale=level),) if offset else ()
    if damping > 0.0:
        par = Par(DAMPING, "d", "torque in step with the velocity", lower=-damping, upper=damping)
        extra += (Parameter("damping", par, 0.0, scale=damping),)
    vector = Vector(template, frozen=frozen, extra=extra)
    idle = idle_parameters(seen, vector, rows)
    if len(idle) == vector.size - len(extra):
        raise InputError(
            f"along this motion, of {np.ptp(loop.position):.3g} {axis_unit(loop.unit[0])}, no parameter of "
            f"{template.law.name!r} "
            f"acts where the search starts, at {level:.3g} {axis_unit(loop.unit[1])} of friction; check the "
            "values and units given"
        )
    if idle:
        vector = Vector(template, frozen=[*frozen, *idle], extra=extra)
    target = loop.torque[rows]

    def residuals(u: Array) -> Array:
        return curve_of(seen, vector, u)[rows] - target

    scale = {"offset": level, "damping": damping} if damping > 0.0 else level
    # By name: on other rows other parameters may act.
    begin = vector.coordinates(starts.vector.named(starts.u))[None, :] if isinstance(starts, Fit) else starts
    found = fit(
        residuals, vector, noise=noise, size=float(np.max(np.abs(target))), signed_scale=scale, starts=begin,
        reach=reach, profiles=profiles, lags=lags, tolerance=tolerance,
    )  # fmt: skip
    return found, along


def along_until(law: Law, loop: Loop, end: int) -> Along:
    """Return a law that is moved along the first `end` samples of a loop."""
    velocity = None if loop.velocity is None else loop.velocity[:end]
    return Along(law, loop.time[:end], loop.position[:end], velocity)


def curve_of(along: Along, vector: Vector, u: Array) -> Array:
    """Return the sum of the law's torque, the offset and the damping torque at every sample."""
    named = vector.named(u)
    assert vector.base is not None
    # It has as many elements as the law with these parameters.
    torque = along.torque(vector.packed_named(named), vector.base.parameters) + named.get("offset", 0.0)
    damping = named.get("damping", 0.0)
    return torque + damping * along.velocity if damping else torque


def idle_parameters(along: Along, vector: Vector, rows: Rows) -> list[str]:
    """Return the free parameters that have no effect on these rows."""
    here = curve_of(along, vector, vector.start)[rows]
    idle: list[str] = []
    for p in vector.free:
        if p.shares or p.name in ("offset", "damping"):
            continue
        values = {q.name: q.value for q in vector.free}
        values[p.name] = p.value * 1.2 if p.value else 0.2 * p.scale
        moved = curve_of(along, vector, vector.coordinates(values))[rows]
        if float(np.max(np.abs(moved - here))) <= 1e-12 * float(np.max(np.abs(here)) + 1e-300):
            idle.append(p.name)
    return idle


def identify_hysteresis(
    loop: Loop,
    template: Model,
    *,
    fitted: Sequence[int] | Rows | None = None,
) -> Identification:
    """Fit any law, and a constant torque, to a torque along a motion.

    Parameters
    ----------
    loop : Loop
    template : Model
        The law with its choices; its values are the start of the search.
    fitted : sequence of int, optional
        Rows to fit; all if None. The others are the test: ``misfit["held_out_relative"]``.

    Returns
    -------
    Identification

    Raises
    ------
    InputError
        If there are fewer rows than parameters.
    """
    straight, notes = loop.righted()
    rows = np.arange(loop.time.size) if fitted is None else np.asarray(fitted, dtype=np.intp)
    rows = after_transient(straight, rows)
    if rows.size < 10:
        raise InputError(f"{rows.size} rows are too few to fit a loop; give at least 10")
    found, _ = fit_loop(straight, template, rows, starts=STARTS, profiles=False, tolerance=ENDS)
    lags = correlation_lags(found.optimum.residuals)
    found, along = fit_loop(straight, template, rows, starts=found, lags=lags, tolerance=ENDS, profiles=False)
    curve = curve_of(along, found.vector, found.u)
    rest = np.setdiff1d(np.arange(loop.time.size), rows if fitted is None else fitted)
    rest = rest[rest > rows[0]]
    try:
        model = found.vector.model(found.u)
    except ParameterError as error:
        model, notes = None, (*notes, f"The law refuses these values together: {error}.")
    return Identification(
        "hysteresis", model, found.estimates, found.correlation, loop_misfit(straight, curve, rows, rest, found),
        notes, (), (loop_picture(straight, curve, rows, rest, template),),
        {"curve": curve, "offset": found.values.get("offset", 0.0), "law": template.law.name,
         "correlated_samples": lags},
    )  # fmt: skip


def turning_points(position: Array, part: float = 0.2) -> list[int]:
    """Return the samples at which the motion turns, by at least `part` of its whole range."""
    least = part * float(np.ptp(position))
    turns: list[int] = []
    far, direction = 0, 0.0
    for i in range(1, position.size):
        moved = float(position[i] - position[far])
        if direction == 0.0:
            if abs(moved) >= least:
                direction, far = float(np.sign(moved)), i
        elif moved * direction >= 0.0:
            far = i
        elif abs(moved) >= least:
            turns.append(far)
            direction, far = -direction, i
    return turns


def after_transient(loop: Loop, rows: Rows) -> Rows:
    """Return the rows after the second turning point, if there are enough cycles: before it is a transient.

    The transient depends on the initial state of the contact (thesis 4.3.1.1.3).
    """
    turns = turning_points(loop.position)
    return rows[rows >= turns[1]] if len(turns) >= 6 else rows


def relative_error(loop: Loop, curve: Array, rows: Rows) -> float:
    """Return the root mean square of the error over that of the torque."""
    return float(np.linalg.norm((curve - loop.torque)[rows]) / np.linalg.norm(loop.torque[rows]))


def loop_misfit(loop: Loop, curve: Array, rows: Rows, rest: Rows, found: Fit) -> dict[str, float]:
    """Return the errors on the fitted rows and on those held out."""
    out = {"rms_Nm": found.rms, "relative": relative_error(loop, curve, rows)}
    if rest.size:
        out["held_out_relative"] = relative_error(loop, curve, rest)
    return out


def correlation_lags(residuals: Array) -> int:
    """Return the samples over which residuals are correlated: four times those until it falls to 1/e."""
    r = residuals - np.mean(residuals)
    total = float(r @ r)
    lag = 1
    while lag < r.size // 4 and float(r[lag:] @ r[:-lag]) > total / math.e:
        lag += max(1, lag // 8)
    return min(4 * lag, r.size // 4) if total > 0.0 else 0


def choose_hysteresis(
    loop: Loop, templates: Mapping[str, Model], *, fitted: Sequence[int] | Rows | None = None
) -> tuple[str, Identification, dict[str, dict[str, float]]]:
    """Fit several laws and choose the one with the least error on blocks of the fitted rows left out in turn.

    Returns
    -------
    name : str
    result : Identification
        Result of the chosen law; ``details["comparison"]`` has all.
    table : dict
        Per law: parameters, relative (error on the fitted rows), cross_validated (on blocks left out).
    """
    straight, _ = loop.righted()
    rows = np.arange(loop.time.size) if fitted is None else np.asarray(fitted, dtype=np.intp)
    rows = after_transient(straight, rows)
    table: dict[str, dict[str, float]] = {}
    for name, template in templates.items():
        first, along = fit_loop(straight, template, rows, starts=STARTS, profiles=False, tolerance=COMPARED)
        squares: list[Array] = []
        for block in np.array_split(rows, BLOCKS):
            kept = np.setdiff1d(rows, block)
            part, _ = fit_loop(straight, template, kept, starts=first, profiles=False, tolerance=COMPARED)
            squares.append(((curve_of(along, part.vector, part.u) - straight.torque)[block]) ** 2)
        size = float(np.mean(straight.torque[rows] ** 2))
        table[name] = {
            "parameters": float(first.vector.size),
            "relative": relative_error(straight, curve_of(along, first.vector, first.u), rows),
            "cross_validated": math.sqrt(float(np.mean(np.concatenate(squares))) / size),
        }
    chosen = min(table, key=lambda name: table[name]["cross_validated"])
    result = identify_hysteresis(loop, templates[chosen], fitted=rows)
    return chosen, replace(result, details={**result.details, "comparison": table}), table


def templates_for(loop: Loop, rows: Rows) -> dict[str, Model]:
    """Return laws of a rate-independent loop, with starting values estimated from the record.

    They are Dahl (thesis eq. 2.7), Dahl with separate level and shape for each direction, and Maxwell-slip with 4
    elements (eq. 2.15).
    """
    straight, _ = loop.righted()
    level = float(np.quantile(np.abs(straight.torque[rows]), 0.95))
    reach = 0.5 * float(np.ptp(straight.position[rows]))
    stiffness = 2.0 * level / reach
    slip = reach * np.array([0.2, 0.4, 0.6, 0.9])
    one: dict[str, Any] = {"sigma0": stiffness, "fc": level, "delta_d": 0.5}
    many: dict[str, Any] = {"k": (0.25 * level / slip).tolist(), "w": [0.25 * level] * 4}
    return {
        "Maxwell-slip, 4 elements": Model("maxwell_slip", {}, **many),
        "Dahl": Model("dahl", {}, **one),
        "Dahl, per direction": Model("dahl", {"symmetry": "asymmetric"}, **one),
    }


def loop_picture(loop: Loop, curve: Array, rows: Rows, rest: Rows, template: Model) -> Picture:
    """Return torque over displacement on the rows held out, or fitted (thesis figures 4.11, 4.35)."""
    words = f"error {100.0 * relative_error(loop, curve, rows):.2g} % on the rows fitted"
    if rest.size:
        words += f", {100.0 * relative_error(loop, curve, rest):.2g} % on the rows held out (drawn)"
    title = f"Hysteresis: {template.law.title}"
    return _loop_drawn("hysteresis", title, words, loop, curve, rest if rest.size else rows, template)


def whole_picture(loop: Loop, curve: Array, template: Model) -> Picture:
    """Return torque over displacement of the whole record, its transient included (thesis figures 4.12, 4.36)."""
    rows = np.arange(loop.time.size)
    words = f"error {100.0 * relative_error(loop, curve, rows):.2g} % from the start, where every element is unloaded"
    title = f"Hysteresis from rest: {template.law.title}"
    return _loop_drawn("hysteresis-whole", title, words, loop, curve, rows, template)


def _loop_drawn(
    name: str, title: str, words: str, loop: Loop, curve: Array, rows: Rows, template: Model
) -> Picture:
    origin = float(np.mean(loop.position))
    traces = (
        Trace("measured", loop.position[rows] - origin, loop.torque[rows]),
        Trace(template.law.title, loop.position[rows] - origin, curve[rows]),
    )
    quantity = "force" if loop.unit[1] == "N" else "torque"
    return Picture(
        name, title, words[0].upper() + words[1:], f"displacement ({axis_unit(loop.unit[0])})",
        f"friction {quantity} ({axis_unit(loop.unit[1])})", traces,
    )  # fmt: skip
