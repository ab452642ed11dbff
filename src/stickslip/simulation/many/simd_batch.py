"""Many closed loops side by side: a fixed step, several cases in one instruction.

For batches whose motion switches so often that going from event to event (`stickslip.simulation.many.batch`) takes
long.
The step is the trapezoid of `many.simd_step`, compiled for the laws at hand from what they say of themselves (`modes`
and their sliding curve). It does not choose its step: run twice, with twice the step, to see in which cases it was
short enough.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.errors import InputError, UnknownName
from stickslip.jit import compiled_lanes
from stickslip.simulation import case_arrays
from stickslip.simulation._forcing import feedforward
from stickslip.simulation.case_arrays import (
    DURATION,
    FROM_REFERENCE,
    GAIN,
    INERTIA,
    KD,
    KI,
    KP,
    KR,
    POSITION_0,
    SOURCE,
    VELOCITY_0,
    Array,
    Case,
)
from stickslip.simulation.exact import state as col
from stickslip.simulation.exact.engine import curve_of, is_literal
from stickslip.simulation.many.batch import Results, laid_out, refusal
from stickslip.simulation.many.batch_layout import Member
from stickslip.simulation.many.simd_source import Curve, Numbers, Refused, source

LANES = 32
STEP = 1e-4
"""Step in s, unless another is given."""
DEVICES = ("cpu", "gpu")
METRICS = (
    "position_rms_rad", "position_peak_rad", "steady_state_error_rad", "end_error_rad", "velocity_rms_rad_s",
    "velocity_peak_rad_s", "torque_rms_Nm", "torque_peak_Nm", "friction_residual_rms_Nm",
    "second_half_position_rms_rad", "second_half_position_peak_rad", "second_half_position_span_rad",
    "second_half_velocity_rms_rad_s", "second_half_torque_rms_Nm", "motor_work_J", "friction_loss_J",
)  # fmt: skip
"""Metrics that lanes give: those of `stickslip.simulation.metrics.COARSE`."""
LIGHT = (
    "position_rms_rad",
    "position_peak_rad",
    "second_half_position_rms_rad",
    "second_half_position_peak_rad",
)
"""Metrics that a program without the others measures as well."""
(
    ERROR_2, ERROR_PEAK, ERROR_SUM, ERROR_LOW, ERROR_HIGH, RATE_2, SPEED_PEAK, MOTOR_2, MOTOR_PEAK, RESIDUAL_2, WORK,
    LOSS, ROWS,
) = range(13)  # fmt: skip
"""What is measured, in the order of `many.simd_step`."""
NUDGE = 1e-11  # s, by which one-sided values of the reference lie inside the step


@dataclass(frozen=True)
class Lanes:
    """Closed loops laid out for the kernel.

    Attributes
    ----------
    case : Case
    varied : mapping of str to array
        The columns that it was made of.
    text : str
        The specialised program, without `METERED`.
    shared : tuple of float
    columns : array, shape (n, varied)
    reference : array, shape (steps, 7)
    step : float
        s.
    """

    case: Case
    varied: Mapping[str, Array]
    text: str
    shared: tuple[float, ...]
    columns: Array
    reference: Array
    step: float

    def __len__(self) -> int:
        return self.columns.shape[0]

    def __getitem__(self, some: slice) -> Lanes:
        """Some of the loops."""
        varied = {name: values[some] for name, values in self.varied.items()}
        return replace(self, varied=varied, columns=self.columns[some])

    def run(self, metrics: Sequence[str] = METRICS, jobs: int = 1, device: str = "cpu") -> Results:
        """Run all of them; a loop that ran away has code `NOT_FINITE` and no metrics.

        Parameters
        ----------
        metrics : sequence of str
            Of `METRICS`; with none, or those of `LIGHT` alone, it is a tenth faster.
        jobs : int
            Threads.
        device : {"cpu", "gpu"}
            A GPU runs one case a thread (``pip install 'stickslip[gpu]'``).

        Raises
        ------
        UnknownName
            If there is no such metric or device.
        InputError
            If there is no GPU.
        """
        for name in metrics:
            if name not in METRICS:
                raise UnknownName("metric of lanes", name, METRICS)
        if device not in DEVICES:
            raise UnknownName("device", device, DEVICES)
        metered = any(name not in LIGHT for name in metrics)
        solve = program(f"METERED = {metered}\n{self.text}", device)
        n, steps = len(self), len(self.reference)
        cuts = np.array([0, round(0.5 * steps), round(0.8 * steps), steps])
        sums, ends = np.zeros((n, 3, ROWS)), np.zeros((n, 3))
        v = float(self.case.numbers[VELOCITY_0])
        start = np.array([self.case.numbers[POSITION_0], v, -1.0 if v < 0.0 else 1.0])

        def part(begin: int, end: int) -> None:
            some = slice(begin, end)
            solve(
                self.shared,
                self.columns[some],
                start,
                self.step,
                self.reference,
                cuts,
                sums[some],
                ends[some],
            )

        size = LANES * max(1, math.ceil(n / LANES / max(1, jobs)))
        parts = [(i, min(i + size, n)) for i in range(0, n, size)] if device == "cpu" else [(0, n)]
        if len(parts) == 1:
            part(*parts[0])
        else:
            with ThreadPoolExecutor(jobs) as pool:
                list(pool.map(part, *zip(*parts)))
        fine = np.all(np.isfinite(ends), axis=1)
        codes = np.where(fine, case_arrays.DONE, case_arrays.NOT_FINITE)
        found = self._metrics(sums, ends)
        wanted = {name: np.where(fine, found[name], np.nan) for name in metrics}
        times = np.full(n, self.case.numbers[DURATION])
        unresolved = np.where(fine, ends[:, 2], 0.0).astype(np.int64)
        return Results(codes, times, ends[:, 0], ends[:, 1], wanted, unresolved)

    def _metrics(self, sums: Array, ends: Array) -> dict[str, Array]:
        duration, half = float(self.case.numbers[DURATION]), 0.5 * float(self.case.numbers[DURATION])
        whole, second = sums, sums[:, 1:]

        def rms(parts: Array, row: int, time: float) -> Array:
            return np.sqrt(np.maximum(self.step * parts[:, :, row].sum(axis=1), 0.0) / time)

        def peak(parts: Array, row: int) -> Array:
            return parts[:, :, row].max(axis=1)

        return {
            "position_rms_rad": rms(whole, ERROR_2, duration),
            "position_peak_rad": peak(whole, ERROR_PEAK),
            "steady_state_error_rad": self.step * sums[:, 2, ERROR_SUM] / (0.2 * duration),
            "end_error_rad": self.reference[-1, 1] - ends[:, 0],
            "velocity_rms_rad_s": rms(whole, RATE_2, duration),
            "velocity_peak_rad_s": peak(whole, SPEED_PEAK),
            "torque_rms_Nm": rms(whole, MOTOR_2, duration),
            "torque_peak_Nm": peak(whole, MOTOR_PEAK),
            "friction_residual_rms_Nm": rms(whole, RESIDUAL_2, duration),
            "second_half_position_rms_rad": rms(second, ERROR_2, half),
            "second_half_position_peak_rad": peak(second, ERROR_PEAK),
            "second_half_position_span_rad": peak(second, ERROR_HIGH) + peak(second, ERROR_LOW),
            "second_half_velocity_rms_rad_s": rms(second, RATE_2, half),
            "second_half_torque_rms_Nm": rms(second, MOTOR_2, half),
            "motor_work_J": self.step * sums[:, :, WORK].sum(axis=1),
            "friction_loss_J": self.step * sums[:, :, LOSS].sum(axis=1),
        }


def check_gpu() -> None:
    """Refuse where there is no GPU.

    Raises
    ------
    InputError
        It says what was looked for.
    """
    from stickslip import gpu

    gpu.check()


def program(text: str, device: str) -> Any:
    """What runs a specialised text."""
    if device == "cpu":
        return compiled_lanes(text).solve_lanes
    # Imported only here: numba.cuda takes long, and few have a GPU.
    from stickslip import gpu

    return gpu.solver(text, LANES)


def prepare(case: Case, columns: Mapping[str, Array], step: float = STEP) -> Lanes:
    """Lay out the loops that `columns` make of `case`; arguments as of `stickslip.simulation.many.batch.prepare`.

    Parameters
    ----------
    step : float
        s; shortened so that a whole number of steps makes up the run.

    Raises
    ------
    InputError
        If lanes cannot run the case; it says why.
    """
    if why := refusal(case, list(columns)):
        raise InputError(f"no lanes: {why}")
    if not (step > 0.0 and math.isfinite(step)):
        raise InputError(f"no lanes: step = {step:g} s must be greater than 0")
    numbers, members = laid_out(case, columns)
    try:
        text, kept = specialised(numbers, members)
    except Refused as error:
        raise InputError(f"no lanes: {error}; integrator exact runs it") from None
    steps = 10 * math.ceil(float(case.numbers[DURATION]) / step / 10.0 - 1e-9)
    n = len(numbers)
    varied = np.column_stack([np.zeros((n, 0)), *kept.varied]) if kept.varied else np.zeros((n, 0))
    exact_step = float(case.numbers[DURATION]) / steps
    return Lanes(
        case,
        dict(columns),
        text,
        tuple(kept.shared),
        np.ascontiguousarray(varied),
        reference_of(case, steps),
        exact_step,
    )


def specialised(numbers: Array, members: Sequence[Member]) -> tuple[str, Numbers]:
    """The program for these laws, and the numbers that it reads."""
    kept = Numbers()
    scalars = {
        name: kept.place(numbers[:, place])
        for name, place in (
            ("inertia", INERTIA), ("kp", KP), ("kd", KD), ("kr", KR), ("ki", KI), ("gain", GAIN),
        )
    }  # fmt: skip
    sides: dict[str, list[str]] = {"attraction": [], "viscous": [], "lag": [], "rigid": []}
    elements: dict[str, list[str]] = {"stiffness": [], "share": []}
    sizes: dict[str, Any] = {"LANES": LANES, "KIND_0": 0, "KIND_1": -1, "RIGID_0": False, "RIGID_1": False}
    curves: list[Curve] = []
    for i, m in enumerate(members):
        kind, held = m.columns["kind"][0], m.columns["rigid"] + m.columns["steep"]
        if i == 0 and np.any(held > 0.0):
            raise Refused("an axis that rigid friction holds at rest needs its events")
        sizes[f"KIND_{i}"], sizes[f"RIGID_{i}"] = int(kind), bool(np.any(held > 0.0))
        pull = m.columns["bristle" if kind == col.BENDS else "attraction"]
        sides["attraction"].append(kept.place(np.where(np.isfinite(pull), pull, 0.0)))
        sides["viscous"].append(kept.place(m.columns["viscous"]))
        sides["lag"].append(kept.place(m.columns["lag"]))
        sides["rigid"].append(kept.place(held))
        for j in range(m.elements.shape[1]):
            elements["stiffness"].append(kept.place(m.elements[:, j, 0]))
            elements["share"].append(kept.place(m.elements[:, j, 1]))
        curves.append(curve_for(m, kept))
    sizes["ELEMENTS"] = len(elements["share"])
    sizes["VARIED"] = len(kept.varied)
    sizes["FIRST_1"] = members[0].elements.shape[1]
    return source(sizes, scalars, sides, elements, curves, kept), kept


def curve_for(m: Member, kept: Numbers) -> Curve:
    """The sliding curve of a law, with its numbers kept."""
    model = m.side.model
    assert model is not None
    if is_literal(m.side):
        raise Refused("slip rule 'literal' needs its events")
    if not m.curve:
        return Curve(None, None, [kept.place(m.columns["breakaway"])])
    places = [kept.place(m.packed[:, j]) for j in range(m.packed.shape[1])]
    return Curve(model.law, curve_of(m.side).function, places)


def reference_of(case: Case, steps: int) -> Array:
    """The reference over every step: goal and its velocity at begin and end, feedforward mean, at end, at begin."""
    times = np.linspace(0.0, float(case.numbers[DURATION]), steps + 1)
    out = np.zeros((steps, 7))
    nudge = min(NUDGE, 0.25 * float(times[1]))
    late, early = case.reference.sample(times[:-1] + nudge), case.reference.sample(times[1:] - nudge)
    out[:, 0], out[:, 1] = late[:, 0], early[:, 0]
    out[:, 2], out[:, 3] = late[:, 1], early[:, 1]
    if case.numbers[SOURCE] == FROM_REFERENCE:
        cells, _ = feedforward(case)
        total = integral(cells, times)
        out[:, 4] = np.diff(total) / np.diff(times)
        out[:, 5], out[:, 6] = torque_at(cells, times[1:] - nudge), torque_at(cells, times[:-1] + nudge)
    return out


def torque_at(cells: Array, times: Array) -> Array:
    """The tabulated torque, N·m."""
    some = cells[np.clip(np.searchsorted(cells[:, 0], times, side="right") - 1, 0, len(cells) - 1)]
    x = (times - some[:, 0]) * some[:, 1]
    return sum(some[:, 2 + i] * x**i for i in range(5))  # pyright: ignore[reportReturnType]


def integral(cells: Array, times: Array) -> Array:
    """The integral of the tabulated torque from the first cell on, N·m·s."""
    powers = 1.0 / np.arange(1.0, 6.0)
    whole = np.concatenate([[0.0], np.cumsum(cells[:, 2:] @ powers / cells[:, 1])])
    at = np.clip(np.searchsorted(cells[:, 0], times, side="right") - 1, 0, len(cells) - 1)
    x = np.clip((times - cells[at, 0]) * cells[at, 1], 0.0, 1.0)
    inside = sum(cells[at, 2 + i] * powers[i] * x ** (i + 1) for i in range(5))
    return whole[at] + inside / cells[at, 1]
