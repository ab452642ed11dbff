"""Interface and execution of a procedure.

A procedure states its plan in advance (`Procedure.plan`), generates its steps one by one from the measurements so far
(`Procedure.steps`), and checks the record (`Procedure.checks`). Its options are the fields of a dataclass, in SI units,
so the command line and files can set them by name.
"""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, ClassVar, cast

import numpy as np

from stickslip.control.controller import Controller
from stickslip.core.errors import InputError, RigError, suggestion
from stickslip.core.record import Record
from stickslip.core.resources import insist_on_memory
from stickslip.rigs.loop import Loop
from stickslip.rigs.loop_sample import COLUMNS, UNITS, begin_learned, end_learned
from stickslip.rigs.realtime import Account
from stickslip.rigs.rig import Rig

Array = np.ndarray[Any, np.dtype[np.float64]]
KEPT = (
    "position", "motor_torque", "torque_command", "sensor_torque", "temperature", "position_reference",
    "velocity_reference", "torque_setpoint", "compensation_torque",
)  # fmt: skip
"""Channels of a procedure's record, without the loop's raw velocity, which is a difference of two counts."""
BYTES = 480
"""Memory of a sample, bytes: its setpoint, its row, copies of both, and their sources"""
DAY = 86400.0
LONGEST, LONGEST_REST = 30.0 * DAY, 3650.0 * DAY
"""Longest running time and rest of a plan, s"""
TIME, POSITION = COLUMNS.index("time"), COLUMNS.index("position")


class CheckFailed(RigError):
    """A run was completed, but failed a check; its record is kept."""


@dataclass(frozen=True)
class Plan:
    """The plan of a procedure.

    Attributes
    ----------
    duration : float
        Longest time with the loop running, s; ramps that end at a break-away may be shorter.
    pauses : float
        Additional time at rest, s.
    held : float
        Part of the duration that is in memory at once, s; 0: all of it.
    travel, speed, torque : float
        Largest displacement from the start (rad), speed (rad/s) and torque (N·m).
    text : tuple of str
        Description, one line for each part.
    """

    duration: float
    travel: float
    speed: float
    torque: float
    text: tuple[str, ...] = ()
    pauses: float = 0.0
    held: float = 0.0

    def within(self, rig: Rig) -> None:
        """Refuse a plan that exceeds the rig's limits, the available memory or a reasonable duration.

        Raises
        ------
        InputError
        """
        limits = rig.limits
        for what, value, limit, unit in (
            ("torque", self.torque, limits.torque, "N·m"), ("speed", self.speed, limits.speed, "rad/s"),
        ):  # fmt: skip
            if value > limit:
                raise InputError(
                    f"the plan requires a {what} of {value:.4g} {unit}; {rig.name} allows {limit:.4g}; reduce it"
                )
        room = limits.position[1] - limits.position[0]
        if self.travel > room:
            raise InputError(f"the plan travels {self.travel:.4g} rad; {rig.name} has {room:.4g}; reduce it")
        for what, seconds, most in (
            ("runs", self.duration, LONGEST), ("rests", self.pauses, LONGEST_REST),
        ):  # fmt: skip
            if not seconds <= most:
                raise InputError(
                    f"the plan {what} for {seconds / DAY:.3g} days; at most {most / DAY:g} are allowed; reduce it"
                )
        held = self.held or self.duration
        insist_on_memory(
            BYTES * held / rig.sample_time, f"the plan's {held / rig.sample_time:.3g} samples at once"
        )


@dataclass(frozen=True, eq=False)
class Step:
    """A segment of the loop.

    ``setpoints`` are those of its samples, ``keep`` determines whether it is recorded (every ``average`` samples as
    their mean), ``pause`` is a rest before it (s), ``travel`` ends it early; ``learned`` is what the controller's laws
    have learned before, and afterwards what they have learned in total.
    """

    setpoints: Array
    controller: Controller | None = None
    keep: bool = False
    average: int = 1
    pause: float = 0.0
    travel: float = math.inf
    label: str = ""
    learned: dict[str, Any] | None = None


Steps = Generator[Step, Array, None]
"""Steps, each answered by the rows that were recorded (`stickslip.rigs.loop_sample.COLUMNS`)."""


@dataclass(frozen=True)
class Check:
    """An acceptance check: whether it passed, and a sentence with the measured number."""

    name: str
    passed: bool
    text: str


@dataclass(frozen=True)
class Procedure:
    """Base of every procedure; its fields are its options."""

    name: ClassVar[str] = ""
    title: ClassVar[str] = ""
    signed: ClassVar[tuple[str, ...]] = ()
    """Options that may be negative, because they have a direction; all others are compared with limits."""

    def __post_init__(self) -> None:
        for option in (f.name for f in dataclasses.fields(self) if f.name not in self.signed):
            value: Any = getattr(self, option)
            numbers = cast("tuple[Any, ...]", value) if isinstance(value, tuple) else (value,)
            for number in numbers:
                if isinstance(number, (int, float)) and number < 0.0:
                    raise InputError(f"{self.name}: {option} = {number:g} must be 0 or greater")

    def plan(self, rig: Rig) -> Plan:
        """Return the plan for this rig."""
        raise NotImplementedError

    def steps(self, rig: Rig) -> Steps:
        """Generate the steps."""
        raise NotImplementedError

    def checks(self, record: Record, rig: Rig) -> tuple[Check, ...]:
        """Check the record."""
        raise NotImplementedError

    def finished(self, record: Record) -> Record:
        """Return the record for identification."""
        return record

    def options(self) -> dict[str, Any]:
        """Return the options as plain data."""
        return {f.name: _plain(getattr(self, f.name)) for f in dataclasses.fields(self)}

    @classmethod
    def with_options(cls, given: Mapping[str, str]) -> Procedure:
        """Return this procedure with options given as text: numbers, words, numbers separated by commas.

        Raises
        ------
        InputError
            For an unknown option, or a value of another type.
        """
        known = {f.name: f for f in dataclasses.fields(cls)}
        values: dict[str, Any] = {}
        for name, text in given.items():
            if name not in known:
                raise InputError(f"{cls.name} has no option {name!r}; {suggestion(name, known)}")
            values[name] = _parsed(name, text, known[name].default)
        return cls(**values)


def _plain(value: Any) -> Any:
    return list(cast("tuple[float, ...]", value)) if isinstance(value, tuple) else value


def _parsed(name: str, text: str, like: Any) -> Any:
    try:
        if isinstance(like, str):
            return text
        if isinstance(like, tuple):
            return tuple(float(x) for x in text.split(","))
        if isinstance(like, int):
            return int(text)
        number = float(text)
        if not math.isfinite(number):
            raise ValueError
        return number
    except ValueError:
        kind = "numbers separated by commas" if isinstance(like, tuple) else "a number"
        raise InputError(f"{name} = {text!r} must be {kind}") from None


@dataclass(frozen=True, eq=False)
class Performed:
    """The record of a procedure, with the results of its checks."""

    record: Record
    checks: tuple[Check, ...]
    plan: Plan
    segments: tuple[tuple[str, int, int], ...] = field(default=())
    """Label, first and last row (exclusive) of every recorded step."""

    @property
    def passed(self) -> bool:
        """Whether every check passed."""
        return all(c.passed for c in self.checks)

    def insist(self) -> Performed:
        """Return this, or raise the first failed check as an error.

        Raises
        ------
        CheckFailed
        """
        for check in self.checks:
            if not check.passed:
                raise CheckFailed(f"{check.name}: {check.text}", record=self.record)
        return self

    def part(self, label: str) -> Record:
        """Return the rows of one step."""
        for name, begin, end in self.segments:
            if name == label:
                channels = {k: v[begin:end] for k, v in self.record.channels.items()}
                return Record(self.record.time[begin:end], channels, self.record.units, self.record.meta)
        raise InputError(f"no step {label!r}; {suggestion(label, [s[0] for s in self.segments])}")


def perform(
    procedure: Procedure,
    rig: Rig,
    *,
    path: str | os.PathLike[str] | None = None,
    progress: Callable[[str], None] | None = None,
    without_watchdog: bool = False,
    realtime: bool | None = None,
) -> Performed:
    """Perform a procedure on a rig.

    Parameters
    ----------
    procedure : Procedure
    rig : Rig
    path : path, optional
        File to which every sample is written immediately (`stickslip.core.stream`). Without it a virtual rig's
        unrecorded samples are discarded after each step, so long runs need little memory.
    progress : callable, optional
        Called with the label of every labelled step.
    without_watchdog, realtime
        As `Loop`. In real time the record's ``meta["loop"]`` has the timing statistics.

    Raises
    ------
    InputError
        If the plan exceeds the rig's limits.
    RigError
        If the run was stopped.
    """
    plan = planned(procedure, rig)
    plan.within(rig)
    with _blamed(procedure):
        return _performed(procedure, rig, plan, path, progress, without_watchdog, realtime)


def planned(procedure: Procedure, rig: Rig) -> Plan:
    """Return the plan of a procedure on a rig.

    Raises
    ------
    InputError
        If its options give no valid plan.
    """
    with _blamed(procedure):
        return procedure.plan(rig)


@contextmanager
def _blamed(procedure: Procedure) -> Generator[None]:
    """Report failed arithmetic as an error of the options, none of which is bounded by itself."""
    try:
        yield
    except (ArithmeticError, ValueError, MemoryError) as error:
        usual = {f.name: f.default for f in dataclasses.fields(procedure)}
        given = {k: v for k, v in vars(procedure).items() if v != usual.get(k)}
        words = ", ".join(f"{name} = {value}" for name, value in given.items()) or "its own options"
        raise InputError(
            f"{procedure.name}: no plan is possible with {words} ({error}); give other numbers"
        ) from error


def _performed(
    procedure: Procedure, rig: Rig, plan: Plan, path: Any, progress: Any, without_watchdog: bool,
    realtime: bool | None,
) -> Performed:  # fmt: skip
    meta = {"procedure": procedure.name, "options": procedure.options()}
    described: Any = getattr(rig, "machine", None)
    if described is not None:
        meta["machine"] = described.as_dict()
    kept, account = _run(procedure, rig, path, meta, progress, without_watchdog, realtime)
    if account is not None:
        meta["loop"] = account.plain()
    if not any(len(rows) for _, rows in kept):
        raise InputError(
            f"{procedure.name}: no row was recorded: every part is shorter than a row of the record; request longer "
            "ones, or fewer samples per row"
        )
    record = _record(rig, [rows for _, rows in kept], meta)
    ends = np.cumsum([len(rows) for _, rows in kept]).tolist()
    segments = tuple((label, end - len(rows), end) for (label, rows), end in zip(kept, ends, strict=True))
    record = procedure.finished(record)
    checks = procedure.checks(record, rig)
    told = {"checks": [dataclasses.asdict(c) for c in checks], "segments": [list(s) for s in segments]}
    record = Record(record.time, record.channels, record.units, {**record.meta, **told})
    return Performed(record, checks, plan, segments)


def _run(
    procedure: Procedure, rig: Rig, path: Any, meta: Mapping[str, Any], progress: Any, without_watchdog: bool,
    realtime: bool | None,
) -> tuple[list[tuple[str, Array]], Account | None]:  # fmt: skip
    """Return the recorded rows, by the label of their step, and in real time the timing statistics."""
    kept: list[tuple[str, Array]] = []
    steps = procedure.steps(rig)
    paced = rig.capabilities.real_clock or bool(realtime)
    account: Account | None = None
    step = next(steps, None)
    # Without a file the loop is restarted after a pause, and unrecorded rows are dropped.
    single = path is not None or paced
    while step is not None:
        with Loop(rig, path=path, meta=meta, without_watchdog=without_watchdog, realtime=realtime) as loop:
            while step is not None:
                step = _next(steps, _one(loop, step, kept, meta, progress))
                if not single and step is not None and step.pause > 0.0:
                    break
        account = loop.account()
    return kept, account if paced else None


def _next(steps: Steps, rows: Array) -> Step | None:
    """Return the step after one that recorded these rows; None at the end.

    An exception at the end would mark the loop as failed and hide the error that the rig raises when it is closed.
    """
    try:
        return steps.send(rows)
    except StopIteration:
        return None


def _one(loop: Loop, step: Step, kept: list[tuple[str, Array]], meta: Any, progress: Any) -> Array:
    if step.label and progress is not None:
        progress(step.label)
    control = loop.prepare(step.controller)
    begin_learned(control, step.controller, step.learned)
    if step.pause > 0.0:
        loop.pause(step.pause)
    rows = loop.run(step.setpoints, step.controller, travel=step.travel)
    end_learned(control, step.controller, step.learned, loop.rig.sample_time, meta)
    if step.keep:
        kept.append((step.label, averaged(rows, step.average)))
    return rows


def averaged(rows: Array, count: int) -> Array:
    """Return the means of `count` rows; the last, incomplete ones are dropped."""
    if count <= 1:
        return np.array(rows)
    whole = len(rows) // count
    if whole == 0:
        return rows[:0]
    return rows[: whole * count].reshape(whole, count, -1).mean(axis=1)


def _record(rig: Rig, parts: Sequence[Array], meta: Mapping[str, Any]) -> Record:
    rows = np.concatenate(parts)
    able = rig.capabilities
    lacks = {"sensor_torque": not able.torque_sensor, "temperature": not able.temperature}
    names = [n for n in KEPT if not lacks.get(n, False)]
    channels = {n: np.ascontiguousarray(rows[:, COLUMNS.index(n)]) for n in names}
    return Record(
        np.ascontiguousarray(rows[:, TIME]), channels, {n: UNITS[n] for n in names},
        {"rig": rig.name, "sample_time": rig.sample_time, **meta},
    )  # fmt: skip
