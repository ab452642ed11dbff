"""The exact integrator: event-driven flow of a loop that is linear between events.

J dv/dt = T_m - T_f with linear control (thesis eqs. 3.1 and 3.3) and friction made of elements that stick as
springs and slip along one curve (eqs. 2.16 to 2.18; rigid elements: eq. 2.1), or of a bristle (eqs. 2.8, 2.9).
Between two events the motion is a matrix exponential under smooth forcing; slipping forces and the integral
controller enter through a corrector.
Nothing is stepped over: break-aways and reversals are located on the exact flow. Tolerance is the error in
position per step, rad.

A law is taken as `Elements` or as a `Bristle` (LuGre). `exact.flow` the flow, `exact.state` what is remembered,
`exact.forces` torques, `exact.step` one step, `exact.segment` the motion inside it, `exact.events` what ends a mode and
where, `exact.transition` what changes there, and rest, `exact.output` rows, `exact.kernel` the loop; `exact.metering`,
`exact.window`, `exact.scan` and `exact.ringing` hand the motion to the meter. `_forcing` feedforward.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from stickslip.core.progress import Reached, watched
from stickslip.core.spec import Bristle, Elements, Law, Option
from stickslip.jit import flat
from stickslip.simulation._forcing import NO_CELLS, feedforward
from stickslip.simulation._meter import SIZE, close_standstill, new_meter
from stickslip.simulation.case_arrays import (
    COLUMNS,
    DURATION,
    FILTER,
    FROM_MEASUREMENT,
    FROM_REFERENCE,
    GAIN,
    KD,
    KP,
    METERED,
    SAMPLE_TIME,
    SOURCE,
    Array,
    Case,
    Outcome,
    Side,
    StepBudget,
)
from stickslip.simulation.exact import state as col
from stickslip.simulation.exact.kernel import LONGEST_STEP, solve
from stickslip.simulation.exact.state import AT_NOW, AT_SIDES, Laid, Output
from stickslip.simulation.metrics import settle_band_of

EVENT_ROWS = 20_000
STEPS = StepBudget(1_000_000, 300_000, 1_000, 50_000_000)
"""The thesis's runs take 90,000 a second at most."""
TURNS = 20_000
NOTHING: Array = np.zeros((0, 2))
NOTHING_1: Array = np.zeros(1)
NODES: Array = np.zeros((8, 5))
CURVE_SPEEDS: Array = np.concatenate([np.linspace(0.0, 10.0, 21), np.geomspace(10.0, 1e4, 13)])
"""Velocities over a curve's scale at which its least value is looked for."""


def can_run(case: Case) -> str:
    """Say why the exact integrator cannot run `case`, in one sentence; "" if it can."""
    controller = case.controller
    if case.numbers[SAMPLE_TIME] > 0.0:
        return "the exact integrator runs controllers in continuous time, not with a sample time"
    if math.isfinite(controller.torque_limit):
        return "the exact integrator needs a controller without a torque limit"
    for side in (case.plant, case.compensator):
        if side.model is not None and side.model.law.reads_surroundings:
            return f"law {side.model.law.name!r} depends on its surroundings ({modulations(side.model.law)})"
    if case.numbers[FILTER] > 0.0:
        return "the exact integrator needs a compensator without a velocity filter"
    sides = [("plant", case.plant)]
    if case.numbers[SOURCE] == FROM_MEASUREMENT:
        sides.append(("compensator", case.compensator))
    for where, side in sides:
        complaint = _complaint(side)
        if complaint:
            return f"the exact integrator cannot take the {where}: {complaint}"
    plant = case.plant.elements
    springs = isinstance(plant, Elements) and any(math.isfinite(k) for k in plant.stiffness)
    if springs and case.numbers[KP] == 0.0:
        return (
            "the exact integrator needs a proportional gain with this plant: in a free slide, every spring slipping,"
            " it loses digits"
        )
    if isinstance(plant, Elements) and math.isfinite(plant.slope):
        return "the exact integrator cannot take the plant: it creeps on its steep slope instead of resting"
    return ""


def modulations(law: Law) -> str:
    """The options that make the law depend on its surroundings, for people."""
    named = [f"{c.name} = {law.chosen[c.name]}" for c in law.choices if law.option(c).reads_surroundings]
    return ", ".join(named)


def lacks_modes(side: Side) -> str:
    """Say why a side has no elements or bristle: an option that no element has, or a law without `modes`."""
    if side.model is None:
        return "no law gives no `modes`"
    law = side.model.law
    odd = [f"{c.name} = {law.option_of(c.name)}" for c in law.choices if not law.option(c).keeps_elements]
    if odd and law.having(**{c.name: c.default for c in law.choices}).modes is not None:
        return f"law {law.name!r} has {' and '.join(odd)}, for which its flow has no closed form"
    return f"law {law.name!r} gives no `modes`"


def is_literal(side: Side) -> bool:
    """Whether a side's elements break away by the literal slip rule (`stickslip.laws.slip_rule`)."""
    return side.model is not None and side.model.law.option_of("slip_rule") == "literal"


def _complaint(side: Side) -> str:
    name = side.model.law.name if side.model else "no law"
    e = side.elements
    if e is None:
        return lacks_modes(side)
    if isinstance(e, Elements):
        rigid = [k for k in e.stiffness if math.isinf(k)]
        if rigid and math.isfinite(e.attraction):
            return f"law {name!r} has rigid elements with a finite attraction"
        if math.isfinite(e.slope) and not crosses_once(side, e):
            return f"law {name!r} has a steep slope that meets the sliding curve more than once, or never"
    elif e.own_growth:
        return f"law {name!r} is a bristle of another form than LuGre's"
    if not e.constant_curve and not side.pointers.sliding:
        return f"law {name!r} has no sliding curve"
    if not e.constant_curve and e.velocity_scale <= 0.0:
        return f"law {name!r} has a sliding curve without a velocity scale"
    return ""


@dataclass(frozen=True)
class Prepared:
    """A case laid out for the kernel; `run` does nothing but run it.

    Attributes
    ----------
    parameters, plan, cells, breaks, work : arrays
        See `exact.state.Laid`; each run works on a copy of `work`.
    """

    case: Case
    parameters: Array
    plan: Array
    cells: Array
    breaks: Array
    work: Array

    def run(self) -> tuple[Array, int, float]:
        """Run without metrics; returns position (rad) and velocity (rad/s) on the grid, why and when it ended.

        Returns
        -------
        motion : array, shape (n, 2)
            Cut where the run ended early.
        code : int
        time : float
        """
        out = np.empty((self.case.grid.size, 2))
        work = self.work.copy()
        code = self._solve(
            self.plan, work, Output(out, NOTHING, NOTHING_1, NOTHING, NODES.copy()), light=True
        )
        return out[: int(counted(work)["grid_written"])], code, time_of(work)

    def record(self) -> Outcome:
        """Run with all rows, and the metrics if the case wants them."""
        metered, duration = bool(self.case.numbers[METERED]), float(self.case.numbers[DURATION])
        acc = (
            new_meter(duration, settle_band_of(self.case.reference, duration)) if metered else np.zeros(SIZE)
        )
        turns = np.zeros((TURNS if metered else 0, 2))
        rows = np.empty((int(self.plan.view(col.PLAN)[0]["rows"]), len(COLUMNS)))
        plan, work = self.plan.copy(), self.work.copy()
        output = Output(NOTHING, rows, acc, turns, NODES.copy())

        def stop() -> None:
            plan.view(col.PLAN)[0]["first_steps"] = -math.inf

        code = watched(
            lambda: self._solve(plan, work, output, full=True, metered=metered),
            lambda: Reached(time_of(work), duration, float(counted(work)["steps"])), stop,
        )  # fmt: skip
        time, count = time_of(work), counted(work)
        if metered:
            close_standstill(acc, time)
        named = {name: int(count[name]) for name in ("steps", "rejected", "events")}
        return Outcome(rows[: int(count["rows_written"])].copy(), code, time, acc, turns, named)

    def _solve(
        self, plan: Array, work: Array, output: Output, *, light: bool = False, full: bool = False,
        metered: bool = False,
    ) -> int:  # fmt: skip
        laid = Laid(self.parameters, plan, self.cells, self.breaks, self.case.grid, work)
        return int(solve(laid, output, light, full, metered))


def counted(work: Array) -> Any:
    """The counts of a run by name; a view."""
    return work[: col.COUNT_SIZE].view(col.COUNT)[0]


def time_of(work: Array) -> float:
    """The time that a run has come to, s."""
    return float(work[AT_NOW : AT_NOW + col.NOW_SIZE].view(col.NOW)["time"][0])


def prepare(case: Case) -> Prepared:
    """Lay `case` out for the kernel; a feedforward torque is computed here, once per reference and law.

    Raises
    ------
    ValueError
        If `can_run` refuses the case.
    """
    refusal = can_run(case)
    if refusal:
        raise ValueError(refusal)
    feedback = case.numbers[SOURCE] == FROM_MEASUREMENT
    members = [(case.plant, 1.0)]
    if feedback:
        members.append((case.compensator, -case.numbers[GAIN]))
    blocks, finite, sides = [case.numbers], list[tuple[float, float]](), np.zeros(2, col.SIDE)
    for i, (side, weight) in enumerate(members):
        e = side.elements
        assert e is not None
        into = sides[i]
        into["curve"] = 0 if e.constant_curve else side.pointers.sliding
        into["law"] = sum(b.size for b in blocks)
        into["literal"] = is_literal(side)
        blocks.append(side.parameters)
        into["first"] = len(finite)
        if isinstance(e, Elements):
            finite += [(k, a) for k, a in zip(e.stiffness, e.share, strict=True) if math.isfinite(k)]
        into["last"] = len(finite)
        fill_side(into, side, e, weight)
    elements = np.zeros(len(finite), col.ELEMENT)
    elements["stiffness"], elements["share"] = [k for k, _ in finite], [a for _, a in finite]
    cells, kinks = feedforward(case) if case.numbers[SOURCE] == FROM_REFERENCE else (NO_CELLS, [])
    plan = np.zeros(1, col.PLAN)
    plan["profile"], plan["reference"] = case.profile, sum(b.size for b in blocks)
    blocks.append(case.reference_parameters)
    plan["sides"], plan["elements"], plan["cells"] = len(members), len(finite), len(cells)
    plan["shared"] = feedback and share_curve(case.plant, case.compensator)
    plan["grid_rows"], plan["rows"] = case.grid.size, case.grid.size + EVENT_ROWS
    plan["first_steps"], plan["step_rate"] = STEPS.pace(case)
    plan["spacing"] = even_spacing(case.grid)
    damping = case.numbers[KD] + float(np.sum(sides["weight"] * sides["viscous"]))
    inertia = case.axis.inertia
    plan["stiffness_floor"] = max(0.01 * damping * damping / inertia, 0.01 * inertia / LONGEST_STEP**2)
    work = np.concatenate([np.zeros(AT_SIDES), sides.view(np.float64), elements.view(np.float64)])
    breaks = merged(case.breaks, kinks)
    return Prepared(
        case, flat(np.concatenate(blocks)), plan.view(np.float64), flat(cells.ravel()), breaks, work
    )


def fill_side(into: Any, side: Side, e: Elements | Bristle, weight: float) -> None:
    """Write the constants of one side."""
    into["weight"], into["viscous"], into["breakaway"] = weight, e.viscous, e.breakaway
    into["scale"] = 0.0 if e.constant_curve else e.velocity_scale
    into["lowest"] = lowest(side, e)
    into["velocity"] = into["velocity_before"] = math.nan
    if isinstance(e, Bristle):
        into["kind"], into["varies"] = col.BENDS, 1
        into["bristle"], into["lag"] = e.stiffness, e.damping / e.stiffness
        return
    into["kind"] = col.FOLLOWS if math.isinf(e.attraction) else col.RELAXES
    into["attraction"] = e.attraction
    into["varies"] = 0 if e.constant_curve and math.isinf(e.attraction) else 1
    rigid = sum(a for k, a in zip(e.stiffness, e.share, strict=True) if math.isinf(k))
    if math.isinf(e.slope):
        into["rigid"] = rigid
    else:
        into["steep"], into["steepness"], into["layer"] = rigid, e.slope, layer_of(side, e)


def torque_beyond(side: Side, e: Elements, v: float) -> float:
    """How far the torque on the steep slope lies above that of sliding, N·m."""
    s = e.breakaway
    if not e.constant_curve:
        assert side.model is not None
        curve = curve_of(side).function
        assert curve is not None
        s = curve(v, side.model.parameters)
    rigid = sum(a for k, a in zip(e.stiffness, e.share, strict=True) if math.isinf(k))
    return (e.slope - e.viscous) * v - rigid * s


def crosses_once(side: Side, e: Elements) -> bool:
    """Whether a steep slope meets the sliding curve exactly once."""
    scale = e.velocity_scale if e.velocity_scale > 0.0 else 1.0
    beyond = [torque_beyond(side, e, scale * v) > 0.0 for v in np.geomspace(1e-9, 1e4, 80)]
    return not beyond[0] and beyond[-1] and sum(a != b for a, b in pairwise(beyond)) == 1


def layer_of(side: Side, e: Elements) -> float:
    """Velocity at which a steep slope meets the sliding curve, rad/s."""
    scale = e.velocity_scale if e.velocity_scale > 0.0 else 1.0
    low, high = 1e-9 * scale, 1e4 * scale
    for _ in range(200):
        middle = 0.5 * (low + high)
        if torque_beyond(side, e, middle) > 0.0:
            high = middle
        else:
            low = middle
    return high


def curve_of(side: Side) -> Option:
    """The sliding curve that a side's law has chosen."""
    assert side.model is not None
    law = side.model.law
    return next(law.option(c) for c in law.choices if c.replaces == "sliding")


def share_curve(one: Side, other: Side) -> bool:
    """Whether both sides slide along the same curve with the same parameters."""
    if not (one.pointers.sliding and other.pointers.sliding and one.model and other.model):
        return False
    curve = curve_of(one)
    fields = getattr(curve.params, "_fields", ())
    p, q = one.model.parameters, other.model.parameters
    return curve is curve_of(other) and all(getattr(p, f) == getattr(q, f) for f in fields)


def lowest(side: Side, e: Elements | Bristle) -> float:
    """A level just below the sliding curve, below which no element breaks away."""
    if e.constant_curve or side.model is None:
        return 0.999 * e.breakaway
    curve = curve_of(side).function
    assert curve is not None
    return 0.99 * least_on(curve, side.model.parameters, e.velocity_scale)


@functools.lru_cache(maxsize=4096, typed=True)
def least_on(curve: Callable[..., float], p: Any, scale: float) -> float:
    """The least value of a sliding curve of that velocity scale (rad/s), N·m; kept, as a study has few of them."""
    return min(curve(sign * float(v), p) for v in scale * CURVE_SPEEDS for sign in (1.0, -1.0))


def merged(breaks: Array, kinks: list[float]) -> Array:
    """Breaks of the reference and kinks of the feedforward torque, ascending, none nearer than 1e-9 s."""
    kept: list[float] = []
    for t in sorted([*breaks.tolist(), *kinks]):
        if kept and t - kept[-1] < 1e-9:
            # The later one of a pair: the end of the run stays.
            kept[-1] = t
        else:
            kept.append(t)
    return np.array(kept)


def even_spacing(grid: Array) -> float:
    """The grid's spacing where it is even, else 0."""
    if grid.size < 3:
        return 0.0
    step = float(grid[-1] - grid[0]) / (grid.size - 1)
    steps = grid[1:] - grid[:-1]
    apart = max(step - float(steps.min()), float(steps.max()) - step)
    return step if apart < 1e-11 * max(1.0, float(grid[-1])) else 0.0


def run(case: Case) -> Outcome:
    """Run `case`; see `stickslip.simulation.case_arrays.Outcome`.

    Raises
    ------
    ValueError
        If `can_run` refuses the case.
    """
    return prepare(case).record()
