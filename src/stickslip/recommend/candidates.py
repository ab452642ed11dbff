"""Settings of a compensator on a bench of axes, judged against what the linear controller alone does there."""

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
from stickslip.friction_levels import static_level
from stickslip.identify.fit.parallel import in_turn
from stickslip.identify.monte_carlo import resisting_torque
from stickslip.machines.rigid import RigidAxis
from stickslip.model import Model
from stickslip.recommend.candidate_run import Drive, Trial, dangers, rings, run
from stickslip.recommend.pushed import AfterPushes, swings_on
from stickslip.recommend.ringing import by_counts, hunting, integral_of, swing_at_rest, within_counts
from stickslip.recommend.swings import between_counts

AFTER_A_PUSH = "limit cycle at rest after a push"

WORTH = 0.95
"""A compensator that leaves more than this part of the error is not worth its risk."""
HARDLY = f"hardly less error (more than {100.0 * WORTH:g} % left)"
"""Why a safe setting is not worth it."""

FOLLOWS, LIVELY = 3.0, 5.0
"""An axis that the drive's own loop does not hold is not the user's: times the best estimate's error, and swings per
second beyond the best estimate's, from which on it does not."""
NEAR = 1.1
"""Errors within this factor of the best are alike; what is simpler, or has the lower gain, is then taken."""
TRIES = 4
"""Times as many axes are drawn at most, for so many that are held."""
LOOKED_AT = 16
"""Axes on which the linear controller alone is judged: the best estimate and some drawn ones."""
SLOWER = (0.7, 0.5, 0.35, 0.25, 0.1)
"""Of the bandwidth: where a linear controller that rings alone is tried for one that is calm."""


@dataclass(frozen=True)
class Setting:
    """What is switched on: a law with its numbers.

    Attributes
    ----------
    law, kind : str
        ``kind`` is "feedforward" or "feedback".
    gain : float
        0: no friction is compensated, but inertia and offset are fed forward.
    lead : float
        s, by which a feedforward looks ahead of the reference.
    deadband : float
        rad/s, velocities below which a feedback's law sees rest.
    inertia_feedforward : float
        kg·m², times the reference's acceleration: torque that is given too.
    offset : float
        N·m, constant torque that is given too.
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
        """Return the setting in words."""
        if not self.compensates:
            return "inertia feedforward alone, without friction compensation"
        return f"{self.kind} of law {self.law!r}, gain {self.gain:g}"

    @property
    def label(self) -> str:
        """The law that compensates friction, or what is fed forward without one."""
        return self.law if self.compensates else "inertia alone"

    def on(self, linear: Controller, model: Model) -> Controller:
        """The linear controller with this compensator."""
        if not linear.is_short:
            return self.beside(linear, model)
        compensator = COMPENSATORS[self.kind](
            model, self.gain, lead=self.lead, deadband=self.deadband,
            inertia_feedforward=self.inertia_feedforward, offset=self.offset,
        )  # fmt: skip
        return replace(linear, compensator=compensator)

    def beside(self, loop: Controller, model: Model) -> Controller:
        """The loop made of control laws with this compensator's beside its own."""
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
    """One setting and what it did on every axis.

    Attributes
    ----------
    setting : Setting
    errors : tuple of float
        RMS position error along the motion over that of the linear controller alone, one per axis; the best
        estimate first. The first axis on which it is not safe is the last.
    unsafe : tuple of str
        Why it is not safe to switch on; empty where it is.
    useless : str
        Why it is not worth it where it is safe; empty where it is.
    refused_as : Setting or None
        The setting with which it was refused at the confirmation, with its lead and the gain tried; None: it was not.
    finished : bool
        Whether the verdict is final. False: the remaining axes were not simulated, since the candidate is beaten
        whatever happens on them; it is neither safe nor unsafe then.
    """

    setting: Setting
    errors: tuple[float, ...]
    unsafe: tuple[str, ...]
    useless: str = ""
    refused_as: Setting | None = None
    finished: bool = True

    @property
    def refused(self) -> tuple[str, ...]:
        """Why it is not to be switched on; empty where it may be."""
        return (*self.unsafe, *([self.useless] if self.useless else []))

    @property
    def worst(self) -> float:
        """The greatest remaining part of the error; a lower bound of it while the candidate is not finished."""
        return max(self.errors)

    @property
    def usual(self) -> float:
        """The part of the error that remains at most on half of the axes; the best estimate counts where it is the only
        one."""
        return median(self.errors[1:] or self.errors)

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {**asdict(self.setting), "errors": list(self.errors), "unsafe": list(self.unsafe),
                "useless": self.useless, "finished": self.finished}  # fmt: skip


class Account:
    """How many axes are simulated, of how many at most; what is unsafe is left early, and the rest of it counted."""

    def __init__(self, progress: Callable[[int, int], None], settings: int, axes: int, more: int) -> None:
        self.progress, self.axes, self.done = progress, axes, 0
        self.total = axes * settings + more
        progress(0, self.total)

    def one(self) -> None:
        """Another axis is simulated."""
        self._reach(self.done + 1)

    def tried(self, settings: int) -> None:
        """So many settings have been judged on the first axes."""
        self._reach(max(self.done, self.axes * settings))

    def end(self) -> None:
        """Nothing is left."""
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
    """Axes, each with what the linear controller alone does on it, and the laws that may be switched on.

    `ran` is called after every axis that was simulated. `left_out` are axes that were drawn and not held; `rested` is
    what the linear controller alone swings by at rest for long, once it is known; `longest_rest` is the longest rest
    that was simulated, and `hunted_within` the longest in which an axis hunted, s.
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
        """The best estimate, which is drawn first, and the first `count` others that the linear controller holds."""
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
        """The linear controller alone on axis i."""
        while len(self.alone) <= i:
            self.alone.append(run(self.plants[len(self.alone)], self.linear, self.drive))
            self.ran()
        return self.alone[i]

    def trials(
        self, controller: Controller, axes: Sequence[int] | None = None
    ) -> Iterator[tuple[Trial | str, Trial | str]]:
        """Run the linear controller alone and this one on one axis after the other (None: on all), some ahead in
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
        """The axes, of the first `LOOKED_AT`, on which the linear controller alone oscillates, and where."""
        for i, plant in enumerate(self.plants[:LOOKED_AT]):
            if where := rings(plant, self.linear, self.drive, self.before(i)):
                yield plant, where

    def judged(self, setting: Setting, most: float = math.inf) -> Candidate:
        """Judge the setting on every axis, up to the first on which it is not safe.

        The candidate is left unfinished once more than `most` of the error is left on an axis. A later call goes on
        from there: nothing is simulated twice.
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
        """Yield the part of the error left, and the reasons why the setting is not safe, axis by axis."""
        for i, (error, unsafe) in enumerate(self._along_motion(setting)):
            yield error, unsafe or self._after_a_push(setting, i)

    def error_on(self, i: int, setting: Setting) -> float:
        """Return the part of the error that a setting leaves on axis i."""
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
        """Return why a setting is not safe where axis i is pushed at rest; a feedforward does not react to a push."""
        if setting.kind != "feedback":
            return ()
        if (setting, i) not in self._swings_on:
            controller = setting.on(self.linear, self.laws[setting.law])
            self._swings_on[setting, i] = self.swings_on(i, controller)
        return (AFTER_A_PUSH,) if self._swings_on[setting, i] else ()

    def swings_on(self, i: int, controller: Controller) -> bool:
        """Return whether after a push at rest axis i swings on under this controller, and not under the linear one."""
        plant, before = self.plants[i], self.before(i)
        if not isinstance(before, Trial):
            return False
        least = before.swing(self.drive)
        if i not in self._pushed:
            self._pushed[i] = AfterPushes(plant, self.linear, self.drive, least)
        return swings_on(plant, controller, self.drive, least, self._pushed[i])


def why_lost(before: Trial | str, after: Trial | str) -> str:
    """Why an axis is not held, of the linear controller alone and with a compensator: what fails alone is not the
    compensator's."""
    if isinstance(before, str):
        return f"the linear controller alone fails ({before})"
    return after if isinstance(after, str) else ""


def lost(trial: Trial | str, best: Trial | str, drive: Drive) -> bool:
    """Whether a linear controller does not hold an axis, where it holds the best estimate."""
    if isinstance(trial, str) or isinstance(best, str):
        return isinstance(trial, str) and not isinstance(best, str)
    swing = best.swing(drive)
    (beyond, _), (usual, _) = trial.restless(swing), best.restless(swing)
    error, least = (x.moving["position_rms_rad"] for x in (trial, best))
    return error > FOLLOWS * least or beyond > max(usual, 0.0) + LIVELY


def on_both(setting: Setting, bench: Bench, others: Bench) -> Candidate:
    """The setting on the bench; if it is safe there but not on the other axes, that is why it is not safe."""
    here = bench.judged(setting)
    there = here if here.unsafe else others.judged(setting)
    return replace(here, unsafe=there.unsafe)


def breakaway(model: Model) -> float:
    """The torque that the contact withstands at rest, of both directions the greater, N·m; 0 where the law does not
    tell it."""
    return max(static_level(model), static_level(model, -1.0)) if model.law.steady else 0.0


def resistance(model: Model, drive: Drive) -> float:
    """The greatest friction along the motion, break-away among it, N·m; 0 where the law does not tell it."""
    if not model.law.steady:
        return 0.0
    v = drive.path.top_speed * np.concatenate([np.linspace(0.0, 1.0, 200), -np.linspace(1e-9, 1.0, 200)])
    return max(breakaway(model), float(np.max(np.abs(resisting_torque(model, v)))))


def rings_alone(bench: Bench, inertia: float, torque: str) -> str:
    """Where the linear controller alone oscillates, by how much, why, and what to change; empty where it is calm."""
    drive, gains, count = bench.drive, bench.linear.gains, len(bench.plants[:LOOKED_AT])
    push = bench.linear.linear.kd * drive.deadband(1.0) if gains is not None else 0.0
    ringing = list(_telling(bench, push))
    if not ringing:
        return ""
    where = " and ".join(sorted({where for _, where, _ in ringing}))
    on = f"on {len(ringing)} of {count} axes" if count > 1 else "on the best estimate"
    if gains is None:
        return f"{where} {on}; lower its gains, or take a finer encoder or a shorter sample time"
    swing, plants = max(swing for _, _, swing in ringing), [plant for plant, _, _ in ringing]
    size = (
        f" (at rest by up to {swing:.2g} {'m' if torque == 'N' else 'rad'} peak to peak)" if math.isfinite(swing)
        else " (it diverges)"
    )  # fmt: skip
    # What swings wider than counts allow is at most set off by them: an exact encoder only delays it.
    wide = integral_of(gains)[1] > 0.0 and swing > between_counts(drive.encoder_counts)
    counts = not wide and by_counts(plants, bench.linear, drive)
    if not counts and integral_of(gains)[1] > 0.0:
        return f"{where} {on}{hunting(gains, drive.given)}{size}"
    why = (
        f": a count of the encoder makes it push {push:.2g} {torque} for a sample{size}"
        if counts and push
        else size
    )
    finer = ", or take a finer encoder" if counts and push else ", or a shorter sample time"
    if drive.given:
        return f"{where} {on}{why}; lower the gain on the velocity ({velocity_gain(gains):.4g}){finer}"
    return f"{where} {on}{why}; {_calmer(bench, plants, inertia)}{finer}"


def _telling(bench: Bench, push: float) -> Iterator[tuple[RigidAxis, str, float]]:
    """The axes that oscillate, where, and peak to peak at rest, rad; not those that stay within an encoder's counts."""
    index = {id(plant): i for i, plant in enumerate(bench.plants)}
    for plant, where in bench.ringing():
        swing = swing_at_rest(plant, bench.linear, bench.drive, bench.before(index[id(plant)]))
        if where != "at rest" or not within_counts(swing, push, breakaway(plant.friction), bench.drive):
            yield plant, where, swing


def _calmer(bench: Bench, plants: Sequence[RigidAxis], inertia: float) -> str:
    """At which bandwidth the axes do not oscillate."""
    drive = bench.drive
    for share in SLOWER:
        slower = replace(drive, bandwidth=share * drive.bandwidth)
        linear = replace(bench.linear, gains=place(drive.linear, inertia, slower.bandwidth, drive.damping))
        if not any(Bench(plants, linear, slower, {}).ringing()):
            return f"lower the bandwidth ({slower.bandwidth:.3g} Hz is calm)"
    return f"no bandwidth down to {SLOWER[-1] * drive.bandwidth:.3g} Hz is calm"


def velocity_gain(gains: Gains | Cascade) -> float:
    """On the measured velocity, N·m·s/rad."""
    return gains.kvp if isinstance(gains, Cascade) else gains.kd
