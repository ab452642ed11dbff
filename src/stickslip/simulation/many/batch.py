"""Many closed loops that differ in numbers: perturbed friction, inertia, gains.

`prepare` lays them out for the exact integrator from one case and columns of numbers, without Python for each of
them; `Batch.run` runs them in one compiled loop that releases the interpreter's lock, so that threads share them. Each
loop is what `stickslip.simulate(..., integrator="exact")` would run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError, ParameterError, UnknownName
from stickslip.simulation import _meter, case_arrays
from stickslip.simulation._meter import LONG_WINDOW, MAX_WINDOW
from stickslip.simulation.case_arrays import (
    DURATION,
    FROM_MEASUREMENT,
    FROM_REFERENCE,
    GAIN,
    INERTIA,
    KD,
    SOURCE,
    Array,
    Case,
)
from stickslip.simulation.exact import state as col
from stickslip.simulation.exact.engine import NODES, TURNS, can_run
from stickslip.simulation.exact.engine import prepare as prepare_one
from stickslip.simulation.exact.kernel import LONGEST_STEP
from stickslip.simulation.exact.state import AT_ELEMENTS, AT_SIDES, Laid, Output
from stickslip.simulation.many.batch_kernel import Found, solve_all
from stickslip.simulation.many.batch_layout import Member, member, share_curves
from stickslip.simulation.metrics import COARSE, METRICS, columns, settle_band_of

NUMBERS = {
    "inertia": INERTIA, "kp": case_arrays.KP, "ki": case_arrays.KI, "kd": KD, "kr": case_arrays.KR, "gain": GAIN,
}  # fmt: skip
"""What may vary besides parameters of laws: ``friction.NAME`` and, of a feedback compensator, ``law.NAME``."""


@dataclass(frozen=True)
class Results:
    """How n loops went.

    Attributes
    ----------
    codes : array of int, shape (n,)
        0 where the loop ran to its end; else why not (`stickslip.simulation.integrators.REASONS`).
    time, position, velocity : array, shape (n,)
        Where it ended, s, rad, rad/s.
    metrics : mapping of str to array, shape (n,)
        NaN where there is none; empty if none was asked for.
    """

    codes: np.ndarray[Any, np.dtype[np.int64]]
    time: Array
    position: Array
    velocity: Array
    metrics: Mapping[str, Array]


@dataclass(frozen=True)
class Batch:
    """Closed loops laid out for the kernel, one in each row of `parameters`, `plans` and `starts`."""

    case: Case
    parameters: Array
    plans: Array
    cells: Array
    breaks: Array
    starts: Array

    def __len__(self) -> int:
        return self.parameters.shape[0]

    def __getitem__(self, some: slice) -> Batch:
        """Some of the loops."""
        return replace(
            self, parameters=self.parameters[some], plans=self.plans[some], starts=self.starts[some]
        )

    def run(self, metrics: Sequence[str] = METRICS, jobs: int = 1) -> Results:
        """Run all of them.

        Parameters
        ----------
        metrics : sequence of str
            Those requested. If `stickslip.simulation.metrics.COARSE` has all of them, nothing is counted, which is
            a little faster. None at all is the fastest.
        jobs : int
            Threads; each runs a part of the loops by the same kernel, so the results do not depend on their number.

        Raises
        ------
        UnknownName
            If there is no such metric.
        """
        for name in metrics:
            if name not in METRICS:
                raise UnknownName("metric", name, METRICS)
        if jobs > 1 and len(self) > 1:
            size = max(1, math.ceil(len(self) / jobs))

            def part(first: int) -> Results:
                return self[first : first + size].run(metrics)

            with ThreadPoolExecutor(jobs) as pool:
                return _joined(list(pool.map(part, range(0, len(self), size))))
        n, duration = len(self), float(self.case.numbers[DURATION])
        coarse = all(name in COARSE for name in metrics)
        band = settle_band_of(self.case.reference, duration)
        accs = np.tile(_meter.new_meter(duration, band, LONG_WINDOW if coarse else MAX_WINDOW), (n, 1))
        cycles, codes, ends = np.full((n, 2), np.nan), np.zeros(n, dtype=np.int64), np.empty((n, 3))
        nothing = np.zeros((0, 2))
        scratch, turns = np.zeros(AT_SIDES + self.starts.shape[1]), np.zeros((0 if coarse else TURNS, 2))
        solve_all(
            Laid(self.parameters, self.plans, self.cells, self.breaks, np.zeros(1), scratch), self.starts,
            Output(nothing, nothing, accs[0], turns, NODES.copy()), Found(accs, cycles, codes, ends), bool(metrics),
        )  # fmt: skip
        found = columns(accs, cycles[:, 0], cycles[:, 1])
        ran = codes == case_arrays.DONE
        wanted = {name: np.where(ran, found[name], np.nan) for name in metrics}
        return Results(codes, ends[:, 0], ends[:, 1], ends[:, 2], wanted)


def _joined(parts: Sequence[Results]) -> Results:
    """Join the results of consecutive parts of a batch."""
    codes, time, position, velocity = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("codes", "time", "position", "velocity")
    )
    names = parts[0].metrics
    metrics = {name: np.concatenate([part.metrics[name] for part in parts]) for name in names}
    return Results(codes, time, position, velocity, metrics)


def refusal(case: Case, names: Sequence[str]) -> str:
    """Say why `names` cannot be varied in a batch of this case, in one sentence; "" if they can."""
    if why := can_run(case):
        return why
    fed_forward = case.numbers[SOURCE] == FROM_REFERENCE
    for name in names:
        if name not in NUMBERS and not name.startswith(("friction.", "law.")):
            return f"{name!r} cannot vary in a batch"
        if name.startswith("law.") and fed_forward:
            return "the torque of a feedforward compensator is tabulated once for all cases"
        if (name == "gain" or name.startswith("law.")) and case.compensator.model is None:
            return f"{name!r} cannot vary: there is no compensator"
    return ""


def prepare(case: Case, columns: Mapping[str, Array]) -> Batch:
    """Lay out the loops that `columns` make of `case`.

    Parameters
    ----------
    case : Case
        What `stickslip.simulation.closed_loop.prepare` returns; its own numbers hold where none vary.
    columns : mapping of str to array, shape (n,) or (n, elements)
        By the names of `NUMBERS`, ``friction.fs``, ``law.k``; SI units.

    Raises
    ------
    InputError
        If `refusal` has a reason, or a number is out of bounds.
    """
    if why := refusal(case, list(columns)):
        raise InputError(f"no batch: {why}")
    numbers, members = laid_out(case, columns)
    n, one = len(numbers), prepare_one(case)
    parameters = np.tile(one.parameters, (n, 1))
    parameters[:, : numbers.shape[1]] = numbers
    at = numbers.shape[1]
    for m in members:
        parameters[:, at : at + m.packed.shape[1]] = m.packed
        at += m.packed.shape[1]
    plans = np.tile(one.plan, (n, 1))
    plan = plans.view(col.PLAN)[:, 0]
    if len(members) > 1:
        plan["shared"] = share_curves(*members)
    plan["stiffness_floor"] = _floors(numbers, members)
    return Batch(case, parameters, plans, one.cells, one.breaks, _starts(one.work, numbers, members, n))


def laid_out(case: Case, columns: Mapping[str, Array]) -> tuple[Array, list[Member]]:
    """`Case.numbers` of every loop, shape (n, NUMBERS), and the laws in the loop: the plant's, that of feedback.

    Raises
    ------
    InputError
        If nothing varies, or a number is out of bounds.
    """
    if not columns:
        raise InputError("no batch: nothing varies; give at least one column")
    n = len(next(iter(columns.values())))
    data = {name: np.ascontiguousarray(values, dtype=np.float64) for name, values in columns.items()}
    numbers = _numbers(case, data, n)
    members = [member(case.plant, _of("friction", data), n)]
    if case.numbers[SOURCE] == FROM_MEASUREMENT:
        members.append(member(case.compensator, _of("law", data), n))
    return numbers, members


def _of(family: str, columns: Mapping[str, Array]) -> dict[str, Array]:
    """The columns ``family.NAME`` by NAME."""
    return {name.split(".", 1)[1]: v for name, v in columns.items() if name.startswith(f"{family}.")}


def _numbers(case: Case, columns: Mapping[str, Array], n: int) -> Array:
    """`Case.numbers` of every case."""
    numbers = np.tile(case.numbers, (n, 1))
    for name, place in NUMBERS.items():
        if name in columns:
            low, high = float(np.min(columns[name])), float(np.max(columns[name]))
            if (
                not np.isfinite(high - low)
                or (name in ("inertia", "kp") and low <= 0.0)
                or (name != "gain" and low < 0.0)
            ):
                raise ParameterError(
                    f"{name} from {low:g} to {high:g} is out of bounds; keep it positive and finite"
                )
            numbers[:, place] = columns[name]
    return numbers


def _floors(numbers: Array, members: Sequence[Member]) -> Array:
    """The least stiffness of each flow, N·m/rad (`exact.prepare`)."""
    weights = [np.ones(len(numbers)), -numbers[:, GAIN]]
    torque = sum((w * m.columns["viscous"] for w, m in zip(weights, members)), np.zeros(len(numbers)))
    damping, inertia = numbers[:, KD] + torque, numbers[:, INERTIA]
    return np.maximum(0.01 * damping * damping / inertia, 0.01 * inertia / LONGEST_STEP**2)


def _starts(work: Array, numbers: Array, members: Sequence[Member], n: int) -> Array:
    """Sides and elements of every case, as its work begins."""
    starts = np.tile(work[AT_SIDES:], (n, 1))
    elements = starts[:, AT_ELEMENTS - AT_SIDES :].copy().view(col.ELEMENT)
    for i, m in enumerate(members):
        of_one = work[AT_SIDES + i * col.SIDE_SIZE :][: col.SIDE_SIZE].view(col.SIDE)[0]
        for name in ("curve", "law", "literal", "first", "last"):
            m.columns[name] = of_one[name]
        m.columns["weight"] = 1.0 if i == 0 else -numbers[:, GAIN]
        starts[:, i * col.SIDE_SIZE : (i + 1) * col.SIDE_SIZE] = m.columns.view(np.float64).reshape(n, -1)
        own = elements[:, of_one["first"] : of_one["last"]]
        own["stiffness"], own["share"] = m.elements[:, :, 0], m.elements[:, :, 1]
    starts[:, AT_ELEMENTS - AT_SIDES :] = elements.view(np.float64)
    return starts
