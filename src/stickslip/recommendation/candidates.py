"""Test settings of a compensator on a bench of axes, compared with the linear controller alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from stickslip.control.block import ControlBlock
from stickslip.control.compensator import COMPENSATORS
from stickslip.control.controller import Controller
from stickslip.control.linear import Cascade, Gains, place
from stickslip.identification.fit.parallel import in_turn
from stickslip.identification.monte_carlo import resisting_torque
from stickslip.machines.rigid import RigidAxis
from stickslip.models.friction_levels import static_level
from stickslip.models.model import Model
from stickslip.recommendation.candidate_run import Drive, Trial, dangers, rings, run
from stickslip.recommendation.pushed import AfterPushes, swings_on
from stickslip.recommendation.ringing import by_counts, hunting, integral_of, swing_at_rest, within_counts
from stickslip.recommendation.swings import between_counts

AFTER_A_PUSH = "limit cycle at rest after a push"

WORTH = 0.95
"""A compensator with more than this share of the error remaining is not worth its risk."""
HARDLY = f"hardly less error (more than {100.0 * WORTH:g} % left)"
"""Reason against a safe setting."""

FOLLOWS, LIVELY = 3.0, 5.0
"""An axis that the drive's own loop does not hold cannot be the user's: multiples of the best estimate's error, and
additional swings per second, above which it does not hold it."""
NEAR = 1.1
"""Errors within this factor of the best are equivalent; the simpler setting, or the lower gain, is then selected."""
TRIES = 4
"""Largest number of drawn axes, relative to the number required."""
LOOKED_AT = 16
"""Number of axes for testing the linear controller alone: the best estimate and some sampled ones."""
SLOWER = (0.7, 0.5, 0.35, 0.25, 0.1)
"""Lower bandwidths, relative to the drive's, that are tried for a linear controller that rings alone."""


@dataclass(frozen=True)
class Setting:
    """A setting: a law with its numbers.

    Attributes
    ----------
    law, kind : str
        ``kind`` is "feedforward" or "feedback".
    gain : float
        0: no friction compensation, only feedforward of inertia and offset.
    lead : float
        Lead of a feedforward, s.
    deadband : float
        Velocity below which a feedback treats the axis as resting, rad/s.
    inertia_feedforward : float
        kg·m²; times the reference acceleration: additional torque.
    offset : float
        Additional constant torque, N·m.
    """

    law: str
    kind: str
    gain: float
    lead: float = 0.0
    deadband: float = 0.0
    inertia_feedforward: float = 0.0
    offset: float = 0.0

    @property
    def compensates(self) -> bool:
        """Whether friction is compensated."""
        return self.gain > 0.0

    @property
    def words(self) -> str:
        """Return the setting as text."""
        if not self.compensates:
            return "inertia feedforward alone, without friction compensation"
        return f"{self.kind} of law {self.law!r}, gain {self.gain:g}"

    @property
    def label(self) -> str:
        """The law that compensates friction, or the name of the feedforward without one."""
        return self.law if self.compensates else "inertia alone"

    def on(self, linear: Controller, model: Model) -> Controller:
        """Return the linear controller with this compensator."""
        if not linear.is_short:
            return self.beside(linear, model)
        compensator = COMPENSATORS[self.kind](
            model, self.gain, lead=self.lead, deadband=self.deadband,
            inertia_feedforward=self.inertia_feedforward, offset=self.offset,
        )  # fmt: skip
        return replace(linear, compensator=compensator)

    def beside(self, loop: Controller, model: Model) -> Controller:
        """Return the loop of control laws with this compensator in addition to its own."""
        more: list[ControlBlock] = []
        if self.inertia_feedforward or self.offset:
            fed = {"inertia": self.inertia_feedforward, "offset": self.offset}
            more.append(ControlBlock("inertia_feedforward", None, None, **fed))
        numbers: dict[str, Any] = {"gain": self.gain, "deadband": self.deadband}
        if not self.compensates:
            return loop.with_blocks([*loop.blocks.values(), *more])
        if self.kind == "feedforward":
            more.append(ControlBlock("friction_feedforward", model, lead=self.lead, **numbers))
        else:
            more.append(ControlBlock("friction_feedback", model, **numbers))
        return loop.with_blocks([*loop.blocks.values(), *more])


@dataclass(frozen=True)
class Candidate:
    """One setting and its results on every axis.

    Attributes
    ----------
    setting : Setting
    errors : tuple of float
        RMS position error along the motion over that of the linear controller alone, one per axis; the best
        estimate first. The first axis on which it is not safe is the last.
    unsafe : tuple of str
        Reasons why it is unsafe; empty if it is safe.
    useless : str
        Reason why a safe setting is not worth it; empty if it is.
    refused_as : Setting or None
        The setting, with its lead and gain, that failed the confirmation; None if none failed.
    finished : bool
        Whether the verdict is final. False: the remaining axes were not simulated, because the candidate cannot become
        the best; it is then neither safe nor unsafe.
    """

    setting: Setting
    errors: tuple[float, ...]
    unsafe: tuple[str, ...]
    useless: str = ""
    refused_as: Setting | None = None
    finished: bool = True

    @property
    def refused(self) -> tuple[str, ...]:
        """Reason for rejection; empty if it may be switched on."""
        return (*self.unsafe, *([self.useless] if self.useless else []))

    @property
    def worst(self) -> float:
        """The largest remaining share of the error; a lower bound while the candidate is not finished."""
        return max(self.errors)

    @property
    def usual(self) -> float:
        """The median remaining share of the error over the sampled axes; that of the best estimate if it is the only
        axis."""
        return median(self.errors[1:] or self.errors)

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {**asdict(self.setting), "errors": list(self.errors), "unsafe": list(self.unsafe),
                "useless": self.useless, "finished": self.finished}  # fmt: skip


class Account:
    """Progress in simulated axes, of the largest number; unsafe candidates end early and count as finished."""

    def __init__(self, progress: Callable[[int, int], None], settings: int, axes: int, more: int) -> None:
        self.progress, self.axes, self.done = progress, axes, 0
        self.total = axes * settings + more
        progress(0, self.total)

    def one(self) -> None:
        """Count another simulated axis."""
        self._reach(self.done + 1)

    def tried(self, settings: int) -> None:
        """Count settings tested on the first axes."""
        self._reach(max(self.done, self.axes * settings))

    def end(self) -> None:
        """Finish."""
        self._reach(self.total)

    def _reach(self, done: int) -> None:
        self.done = min(done, self.total)
        self.progress(self.done, self.total)


class Moved(NamedTuple):
    """Result of a setting along the motion on one axis.

    Attributes
    ----------
    error : float
        RMS position error over that of the linear controller alone.
    unsafe : tuple of str
        Why the setting is not safe there; empty where it is.
    """

    error: float
    unsafe: tuple[str, ...]


class Bench:
    """Axes, each with the result of the linear controller alone, and the candidate laws.

    `ran` is called after every simulated axis. `left_out` are sampled axes that the loop does not hold; `rested` is the
    swing of the linear controller alone at long rest, once it is known; `longest_rest` is the longest rest that was
    simulated, and `hunted_within` the longest in which an axis hunted, s.
    """

    def __init__(
        self, plants: Sequence[RigidAxis], linear: Controller, drive: Drive, laws: Mapping[str, Model],
        ran: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        self.plants, self.linear, self.drive, self.laws, self.ran = plants, linear, drive, laws, ran
        self.alone: list[Trial | str] = []
        self.left_out: list[RigidAxis] = []
        self.rested: list[float] | None = None
        self.longest_rest = self.hunted_within = 0.0
        self._moved: dict[Setting, dict[int, Moved]] = {}
        self._swings_on: dict[tuple[Setting, int], bool] = {}
        self._pushed: dict[int, AfterPushes] = {}

    @staticmethod
    def held(
        drawn: Iterator[RigidAxis], count: int, linear: Controller, drive: Drive, laws: Mapping[str, Model],
        ran: Callable[[], None] = lambda: None,
    ) -> Bench:  # fmt: skip
        """Return the best estimate, which is drawn first, and the first `count` others that the linear controller
        holds."""
        bench = Bench([next(drawn)], linear, drive, laws, ran)
        best, kept, alone = bench.before(0), list(bench.plants), list(bench.alone)
        for plant, trial in in_turn(lambda plant: (plant, run(plant, linear, drive)), drawn) if count else ():
            ran()
            if lost(trial, best, drive):
                bench.left_out.append(plant)
                continue
            kept.append(plant)
            alone.append(trial)
            if len(kept) > count:
                break
        bench.plants, bench.alone = kept, alone
        return bench

    def before(self, i: int) -> Trial | str:
        """Return the trial of the linear controller alone on axis i."""
        while len(self.alone) <= i:
            self.alone.append(run(self.plants[len(self.alone)], self.linear, self.drive))
            self.ran()
        return self.alone[i]

    def trials(
        self, controller: Controller, axes: Sequence[int] | None = None
    ) -> Iterator[tuple[Trial | str, Trial | str]]:
        """Run the linear controller alone and this one on one axis after the other (None: on all), some in advance in
        parallel."""

        def both(i: int) -> tuple[Trial | str, Trial | str]:
            plant, known = self.plants[i], i < len(self.alone)
            before = self.alone[i] if known else run(plant, self.linear, self.drive)
            return before, run(plant, controller, self.drive)

        axes = range(len(self.plants)) if axes is None else axes
        for i, (before, after) in zip(axes, in_turn(both, axes), strict=True):
            if i >= len(self.alone):
                self.alone.append(before)
                self.ran()
            self.ran()
            yield before, after

    def ringing(self) -> Iterator[tuple[RigidAxis, str]]:
        """Return the axes, of the first `LOOKED_AT`, on which the linear controller alone oscillates, and when."""
        for i, plant in enumerate(self.plants[:LOOKED_AT]):
            if where := rings(plant, self.linear, self.drive, self.before(i)):
                yield plant, where

    def judged(self, setting: Setting, most: float = math.inf) -> Candidate:
        """Test the setting on every axis, up to the first on which it is unsafe.

        The candidate stays unfinished once more than the share `most` of the error remains on an axis. A later call
        continues from there: nothing is simulated twice.
        """
        errors: list[float] = []
        for i, (error, unsafe) in enumerate(self._along_motion(setting)):
            errors.append(error)
            more = len(errors) < len(self.plants) or setting.kind == "feedback"
            if not unsafe and max(errors) > most and more:
                return Candidate(setting, tuple(errors), (), finished=False)
            if unsafe := unsafe or self._after_a_push(setting, i):
                return Candidate(setting, tuple(errors), unsafe)
        return Candidate(setting, tuple(errors), (), HARDLY if max(errors) > WORTH else "")

    def every(self, setting: Setting) -> Iterator[tuple[float, tuple[str, ...]]]:
        """Yield the remaining share of the error and the reasons why the setting is unsafe, axis by axis."""
        for i, (error, unsafe) in enumerate(self._along_motion(setting)):
            yield error, unsafe or self._after_a_push(setting, i)

    def error_on(self, i: int, setting: Setting) -> float:
        """Return the remaining share of the error with a setting on axis i."""
        self.before(i)
        return next(self._along_motion(setting, [i])).error

    def _along_motion(self, setting: Setting, axes: Sequence[int] | None = None) -> Iterator[Moved]:
        """Yield the results of a setting along the motion, axis by axis (None: on all); each is simulated once."""
        known = self._moved.setdefault(setting, {})
        axes = range(len(self.plants)) if axes is None else axes
        controller = setting.on(self.linear, self.laws[setting.law])
        runs = self.trials(controller, [i for i in axes if i not in known])
        for i in axes:
            if i not in known:
                known[i] = self._compared(setting, *next(runs))
            yield known[i]

    def _compared(self, setting: Setting, before: Trial | str, after: Trial | str) -> Moved:
        """Compare a setting along the motion with the linear controller alone."""
        if isinstance(after, str) or isinstance(before, str):
            return Moved(math.inf, (why_lost(before, after),))
        error = after.moving["position_rms_rad"] / before.moving["position_rms_rad"]
        return Moved(error, tuple(dangers(before, after, self.drive, setting.kind == "feedforward")))

    def _after_a_push(self, setting: Setting, i: int) -> tuple[str, ...]:
        """Return why a setting is unsafe if axis i is pushed at rest; a feedforward does not react to a push."""
        if setting.kind != "feedback":
            return ()
        if (setting, i) not in self._swings_on:
            controller = setting.on(self.linear, self.laws[setting.law])
            self._swings_on[setting, i] = self.swings_on(i, controller)
        return (AFTER_A_PUSH,) if self._swings_on[setting, i] else ()

    def swings_on(self, i: int, controller: Controller) -> bool:
        """Return whether axis i continues to swing after a push at rest with this controller, but not with the linear
        one."""
        plant, before = self.plants[i], self.before(i)
        if not isinstance(before, Trial):
            return False
        least = before.swing(self.drive)
        if i not in self._pushed:
            self._pushed[i] = AfterPushes(plant, self.linear, self.drive, least)
        return swings_on(plant, controller, self.drive, least, self._pushed[i])


def why_lost(before: Trial | str, after: Trial | str) -> str:
    """Return why an axis is not held, by the linear controller alone or only with a compensator."""
    if isinstance(before, str):
        return f"the linear controller alone fails ({before})"
    return after if isinstance(after, str) else ""


def lost(trial: Trial | str, best: Trial | str, drive: Drive) -> bool:
    """Whether a linear controller that holds the best estimate does not hold an axis."""
    if isinstance(trial, str) or isinstance(best, str):
        return isinstance(trial, str) and not isinstance(best, str)
    swing = best.swing(drive)
    (beyond, _), (usual, _) = trial.restless(swing), best.restless(swing)
    error, least = (x.moving["position_rms_rad"] for x in (trial, best))
    return error > FOLLOWS * least or beyond > max(usual, 0.0) + LIVELY


def on_both(setting: Setting, bench: Bench, others: Bench) -> Candidate:
    """Test the setting on the bench and, if it is safe there, on the other axes."""
    here = bench.judged(setting)
    there = here if here.unsafe else others.judged(setting)
    return replace(here, unsafe=there.unsafe)


def breakaway(model: Model) -> float:
    """Return the larger break-away torque of both directions, N·m; 0 if the law does not define it."""
    return max(static_level(model), static_level(model, -1.0)) if model.law.steady else 0.0


def resistance(model: Model, drive: Drive) -> float:
    """Return the largest friction along the motion, including break-away, N·m; 0 if the law does not define it."""
    if not model.law.steady:
        return 0.0
    v = drive.path.top_speed * np.concatenate([np.linspace(0.0, 1.0, 200), -np.linspace(1e-9, 1.0, 200)])
    return max(breakaway(model), float(np.max(np.abs(resisting_torque(model, v)))))


def rings_alone(bench: Bench, inertia: float, torque: str) -> str:
    """Return where and how much the linear controller alone oscillates, the cause and the remedy; empty if it is
    calm."""
    drive, gains, count = bench.drive, bench.linear.gains, len(bench.plants[:LOOKED_AT])
    push = bench.linear.linear.kd * drive.deadband(1.0) if gains is not None else 0.0
    ringing = list(_telling(bench, push))
    if not ringing:
        return ""
    where = " and ".join(sorted({where for _, where, _ in ringing}))
    on = f"on {len(ringing)} of {count} axes" if count > 1 else "on the best estimate"
    if gains is None:
        return f"{where} {on}; lower its gains, or use a finer encoder or a shorter sample time"
    swing, plants = max(swing for _, _, swing in ringing), [plant for plant, _, _ in ringing]
    size = (
        f" (at rest by up to {swing:.2g} {'m' if torque == 'N' else 'rad'} peak to peak)" if math.isfinite(swing)
        else " (it diverges)"
    )  # fmt: skip
    # Larger swings than by counts are at most triggered by them: an exact encoder only delays them.
    wide = integral_of(gains)[1] > 0.0 and swing > between_counts(drive.encoder_counts)
    counts = not wide and by_counts(plants, bench.linear, drive)
    if not counts and integral_of(gains)[1] > 0.0:
        return f"{where} {on}{hunting(gains, drive.given)}{size}"
    why = (
        f": one encoder count causes a torque pulse of {push:.2g} {torque} for one sample{size}"
        if counts and push
        else size
    )
    finer = ", or use a finer encoder" if counts and push else ", or a shorter sample time"
    if drive.given:
        return f"{where} {on}{why}; lower the gain on the velocity ({velocity_gain(gains):.4g}){finer}"
    return f"{where} {on}{why}; {_calmer(bench, plants, inertia)}{finer}"


def _telling(bench: Bench, push: float) -> Iterator[tuple[RigidAxis, str, float]]:
    """Return the axes that oscillate, when, and peak to peak at rest, rad; without those within encoder counts."""
    index = {id(plant): i for i, plant in enumerate(bench.plants)}
    for plant, where in bench.ringing():
        swing = swing_at_rest(plant, bench.linear, bench.drive, bench.before(index[id(plant)]))
        if where != "at rest" or not within_counts(swing, push, breakaway(plant.friction), bench.drive):
            yield plant, where, swing


def _calmer(bench: Bench, plants: Sequence[RigidAxis], inertia: float) -> str:
    """Return the bandwidth at which the axes do not oscillate, as text."""
    drive = bench.drive
    for share in SLOWER:
        slower = replace(drive, bandwidth=share * drive.bandwidth)
        linear = replace(bench.linear, gains=place(drive.linear, inertia, slower.bandwidth, drive.damping))
        if not any(Bench(plants, linear, slower, {}).ringing()):
            return f"lower the bandwidth ({slower.bandwidth:.3g} Hz is calm)"
    return f"no bandwidth down to {SLOWER[-1] * drive.bandwidth:.3g} Hz is calm"


def velocity_gain(gains: Gains | Cascade) -> float:
    """Return the gain on the measured velocity, N·m·s/rad."""
    return gains.kvp if isinstance(gains, Cascade) else gains.kd
