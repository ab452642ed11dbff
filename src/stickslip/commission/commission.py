"""Commissioning: procedures in order, an identification after each, at the end one model.

Each stage takes from those before it only what they identified: the inertia sets the loops, the break-away torque the
amplitudes of the pre-sliding and stick-slip stages, the running torque the velocities. Nothing is known of the machine
but its rig's limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from stickslip.commission.curve import fitted_curve, moving
from stickslip.commission.friction_lag import lag_of
from stickslip.commission.known import Known, resolution_of
from stickslip.commission.recommended import SLOWER, Following, TrackedRecommendation, recommend_and_track
from stickslip.commission.result import Stage, result_of
from stickslip.commission.resume import kept, stamped
from stickslip.commission.stiffness import joined_model, resolved, with_lag, with_stiffness
from stickslip.core.errors import InputError, LimitCrossed
from stickslip.identification.cogging import identify_cogging
from stickslip.identification.estimate import Identification
from stickslip.identification.experiment import experiment_of
from stickslip.identification.presliding.breakaway import WINDOW, identify_breakaway
from stickslip.identification.presliding.hysteresis import Loop as Hysteresis
from stickslip.identification.presliding.lugre_dynamics import Response, identify_lugre_dynamics
from stickslip.identification.presliding.presliding import identify_presliding
from stickslip.identification.response.drivetrain import fit_drivetrain, identified_drivetrain, loop_response
from stickslip.identification.response.inertia import inertia
from stickslip.identification.response.nyquist import fastest_pd
from stickslip.identification.steady_friction.position_dependence import identify_angle
from stickslip.machines.angle import AngleMap
from stickslip.machines.position_map import PositionMap
from stickslip.machines.servo import ServoAxis
from stickslip.models.model import Model
from stickslip.rigs.procedures.attraction import Attraction
from stickslip.rigs.procedures.base import CheckFailed, Performed, Plan, Procedure, perform
from stickslip.rigs.procedures.breakaway import Breakaway
from stickslip.rigs.procedures.cogging import Cogging
from stickslip.rigs.procedures.inertia import Inertia
from stickslip.rigs.procedures.presliding import Presliding
from stickslip.rigs.procedures.resonance import Resonance
from stickslip.rigs.procedures.sliding import Sliding
from stickslip.rigs.procedures.standstill import Standstill
from stickslip.rigs.procedures.stickslip import Stickslip
from stickslip.rigs.procedures.track import Track
from stickslip.rigs.rig import Rig

VELOCITIES = (25.0, 18.0, 10.0, 5.0, 3.0, 2.0, 1.4, 1.0, 0.7, 0.5, 0.3, 0.2, 0.1, 0.06, 0.04, 0.02)
"""rad/s; those that the rig can run at are taken."""
FEWEST = 5
"""Velocities that a sliding curve takes."""
BELOW, BEYOND = 0.6, 1.25
"""Of the break-away torque: amplitudes that stick, and that slip."""
RAMP = 1.5
"""s in which a break-away ramp reaches the torque of running, at least."""
SLOWEST, COUNTS = 0.01, 4.0
"""rad/s, and counts of the encoder within `WINDOW`, that are motion."""
MAPS = {"rotation": Cogging, "standstill": Standstill}
"""Procedures that map the torque over the angle."""
GENTLER = 5
"""Amplitudes of the stick-slip stage that are tried."""
SWUNG, LIVELY = ((0.3, 0.5), (0.3, 0.25), (0.6, 0.5), (0.6, 0.25)), 4.0
"""Mean velocities of the attraction stage, rad/s, and the part of them by which they swing, the first that does not
stick; and its frequency, Hz: above what the angle brings at these speeds."""
QUIET = 0.04
"""Of the break-away torque, RMS of the noise that looks for the sticking mode."""


@dataclass(frozen=True, eq=False)
class Commissioned:
    """What is known of the machine in the end.

    Attributes
    ----------
    stages : tuple of Stage
    inertia : float
        kg·m²
    model : Model
        GMS: its sliding curve is the mean of both directions, its springs are what the encoder sees.
    lugre : Model or None
        LuGre with sigma0 and sigma1 from the stick-slip response.
    angle : AngleMap
        What friction and the torque beside it vary by over a revolution.
    recommended : TrackedRecommendation or None
        What to switch on, and what it did.
    stiffness : float
        Total pre-sliding stiffness at the encoder, N·m/rad: contact and shaft in series.
    result : Identification
        All of it, for `stickslip.identification.model_file.write_model` and the report.
    """

    stages: tuple[Stage, ...]
    inertia: float
    model: Model
    lugre: Model | None
    angle: AngleMap
    recommended: TrackedRecommendation | None
    stiffness: float
    result: Identification

    def stage(self, name: str) -> Stage:
        """One stage by its procedure's name."""
        return next(s for s in self.stages if s.name == name)


@dataclass
class _Course:
    """What the stages have in common, and what they know so far."""

    rig: Rig
    folder: Path | None
    progress: Callable[[str], None]
    without_watchdog: bool
    resume: bool = False
    stages: list[Stage] = field(default_factory=list[Stage])
    notes: list[str] = field(default_factory=list[str])
    last: tuple[str, float] | None = None
    """The stage whose record was taken last, and the angle at which it ended, rad"""

    def run(self, procedure: Procedure, *, insist: bool = True, name: str = "") -> Performed:
        """Perform, save under a name (the procedure's) and insist on the checks; or take the record that lies there."""
        called = name or procedure.name
        file = self.folder / f"{called}.npz" if self.folder is not None else None
        if file and self.resume:
            done = kept(file, procedure, self.rig, insist=insist)
            if isinstance(done, Performed):
                self.progress(f"{called}: as recorded with the same settings in {file}")
                self.last = called, float(done.record["position"][-1])
                return done
            if done:
                self.progress(f"{called}: measured again; {file} was recorded {done}")
        self.progress(f"{called}: {'; '.join(procedure.plan(self.rig).text)}")
        done = perform(procedure, self.rig, without_watchdog=self.without_watchdog)
        self._note_resumption(called, float(done.record["position"][0]))
        if file is not None:
            stamped(done.record, procedure, self.rig).save(file)
        return done.insist() if insist else done

    def _note_resumption(self, name: str, angle: float) -> None:
        """Report that a stage did not start where an uninterrupted commissioning would have started it."""
        if self.last is None:
            return
        before, ended = self.last
        self.last = None
        self.notes.append(
            f"Resumed: {name} starts at {angle:.4g} rad, while {before} had ended at {ended:.4g}"
            " rad. The records from here on differ from those of an uninterrupted run in angle and temperature."
        )
        self.progress(self.notes[-1])

    def add(self, name: str, done: Performed, found: Identification | None, note: str = "") -> None:
        """Keep a stage."""
        self.stages.append(Stage(name, done, found, note))


def planned(
    rig: Rig, velocities: tuple[float, ...] = VELOCITIES, duration: float = 60.0, cogging: str = ""
) -> tuple[Plan, ...]:
    """The plans of all stages, with what is known before the first of them."""
    speeds = tuple(v for v in velocities if v <= 0.5 * rig.limits.speed)
    if len(speeds) < FEWEST:
        raise InputError(
            f"the limit speed = {rig.limits.speed:g} rad/s leaves {len(speeds)} of the velocities that friction is "
            f"measured at; allow {2.0 * sorted(velocities)[FEWEST - 1]:g} rad/s for {FEWEST} of them"
        )
    stages: tuple[Procedure, ...] = (
        Inertia(duration=duration), Breakaway(), Sliding(velocities=speeds), Presliding(), Stickslip(),
        *(Attraction(mean=m, swing=s * m, frequency=LIVELY) for m, s in SWUNG), Resonance(),
        *((MAPS[cogging](),) if cogging else ()),
    )  # fmt: skip
    track, shares = Track().plan(rig), (1.0, *SLOWER)
    runs = 3 * len(shares)
    said = (
        f"follow low {runs} times for {track.duration:.2g} s: the PD alone, with the compensator and without what that "
        f"knows of the angle, at {', '.join(f'{100.0 * s:g}' for s in shares)} % of the bandwidth that is found",
    )
    whole = replace(track, duration=runs * track.duration, pauses=runs * track.pauses, text=said)
    return (*(s.plan(rig) for s in stages), whole)


def commission(
    rig: Rig,
    *,
    folder: Path | None = None,
    progress: Callable[[str], None] | None = None,
    velocities: tuple[float, ...] = VELOCITIES,
    duration: float = 60.0,
    interval: float = 10.0,
    lugre_too: bool = True,
    track_too: bool = True,
    cogging: Literal["", "rotation", "standstill"] = "",
    without_watchdog: bool = False,
    resume: bool = False,
) -> Commissioned:
    """Commission a rig.

    Parameters
    ----------
    rig : Rig
    folder : Path, optional
        Where the record of every stage is saved.
    progress : callable, optional
        Called with a line per stage.
    velocities : tuple of float
        Of the sliding stage, rad/s; those beyond the running speed that the inertia stage found are left out.
    duration : float
        Of each part of the inertia stage, s.
    interval : float
        Between the angles of the break-away stage, degrees.
    lugre_too : bool
        Whether LuGre's dynamics are identified as well, from a stick-slip response: the longest of the computations.
    track_too : bool
        Whether a compensator is recommended and tried.
    cogging : {"", "rotation", "standstill"}
        Whether the torque over the angle is mapped besides, up to high orders, and by which procedure.
    without_watchdog : bool
        Arm a rig that declares no watchdog.
    resume : bool
        Whether a record in `folder` that was made with the same settings is taken instead of measured again.

    Raises
    ------
    InputError, RigError
        If a stage that the others rest on cannot be performed or identified.
    """
    course = _Course(rig, folder, progress or (lambda _: None), without_watchdog, resume)
    j, top, level = _inertia(course, duration)
    fs, fs_std, resolution = _breakaway(course, j, level, interval)
    able = tuple(v for v in velocities if v <= 1.05 * top)
    sliding, curve, angle = _sliding(course, j, (fs, fs_std), able, resolution)
    stuck = _presliding(course, j, fs, sliding, resolution)
    model, stiffness, said = joined_model(curve, stuck)
    lag, unknown = _attraction(course, j, angle, model)
    model, said = with_lag(model, lag, said)
    said = (*said, *unknown)
    lugre, missed = _stickslip(course, j, fs, sliding) if lugre_too else (None, ())
    said = (*said, *missed)
    the_map, unmapped = _cogging(course, j, cogging) if cogging else (None, ())
    said = (*said, *unmapped)
    recommended = None
    if track_too:
        recommended, unsaid = tried(
            lambda: _recommended(course, j, top, fs, model, stiffness, angle, lugre.model if lugre else None)
        )
        said = (*said, *unsaid)
    said = (*said, *course.notes)
    result = result_of(course.stages, model, j, stiffness, said, angle, recommended, the_map)
    return Commissioned(
        tuple(course.stages), j, model, lugre.model if lugre else None, angle, recommended, stiffness, result,
    )  # fmt: skip


# ---- stages ---------------------------------------------------------------------------------------------------


def _inertia(course: _Course, duration: float) -> tuple[float, float, float]:
    """Inertia, and the speed and the mean torque with which the axis ran."""
    done = course.run(Inertia(duration=duration))
    axis = ServoAxis()
    found = inertia([experiment_of(done.part(label), axis, name=label) for label, *_ in done.segments], axis)
    course.add("inertia", done, found)
    running = float(np.max(done.record["velocity_reference"])), float(np.mean(done.record["motor_torque"]))
    return found["inertia"].value, running[0], abs(running[1])


def _breakaway(course: _Course, j: float, level: float, interval: float) -> tuple[float, float, float]:
    """Mean break-away torque of both directions, its standard deviation, and the position's resolution (rad); `level`
    is the torque while running."""
    done = course.run(Breakaway(inertia=j, interval=interval, rate=min(Breakaway.rate, level / RAMP)))
    # A few counts of the encoder are creep before break-away, or noise.
    resolution = resolution_of(done.record)
    threshold = max(SLOWEST, COUNTS * resolution / WINDOW)
    found = identify_breakaway(done.record, threshold=threshold)
    course.add("breakaway", done, found)
    levels = [e for e in found.estimates if e.name.startswith("fs_")]
    mean, std = float(np.mean([e.value for e in levels])), math.hypot(*(e.std for e in levels)) / len(levels)
    return mean, std, resolution


def _sliding(
    course: _Course, j: float, breaking: tuple[float, float], velocities: tuple[float, ...], resolution: float
) -> tuple[Mapping[str, float], Identification, AngleMap]:
    """A Stribeck curve for the methods that need one, the best curve, and what depends on the angle."""
    if len(velocities) < FEWEST:
        raise InputError(
            f"sliding: the rig runs at {velocities} only of the velocities asked for; give five slower ones"
        )
    done = course.run(Sliding(velocities=velocities, inertia=j), insist=False)
    runs = moving(done.record, breaking[0], resolution)
    plain, chosen = fitted_curve(runs, *breaking)
    course.add("sliding", done, chosen)
    around = identify_angle(done.record, runs.segments)
    course.add("angle", done, around)
    return plain, chosen, around.details["angle"]


def _presliding(
    course: _Course, j: float, fs: float, sliding: Mapping[str, float], resolution: float
) -> Identification:
    """Elements of GMS from a loop below break-away; a loop that breaks away is made smaller."""
    share = BELOW
    while True:
        last = share < 0.2
        try:
            done = course.run(Presliding(amplitude=share * fs), insist=last)
        except LimitCrossed:
            if last:
                raise
        else:
            if done.passed:
                break
        share *= 0.75
    level = Model("stribeck_plain", {}, **{**sliding, "fs": fs, "fc": fs, "sigma2": 0.0})
    loop = Hysteresis.of(done.record, "motor_torque")
    found = identify_presliding(loop, level, elements=3, offset=True, inertia=j)
    found = with_stiffness(resolved(found, share * fs), done.record, resolution)
    course.add("presliding", done, found)
    return found


def _cogging(course: _Course, j: float, by: str) -> tuple[PositionMap | None, tuple[str, ...]]:
    """The torque over the angle, or why there is none."""
    try:
        done = course.run(MAPS[by](inertia=j), insist=False)
        found = identify_cogging([done.record])
    except (InputError, LimitCrossed) as error:
        return None, (f"cogging: {str(error).rstrip('.')}.",)
    course.add("cogging", done, found)
    return found.details["map"], ()


def _attraction(
    course: _Course, j: float, angle: AngleMap, model: Model
) -> tuple[Identification | None, tuple[str, ...]]:
    """What the lag of friction tells of C: nothing where the axis does not run in one direction, and why."""
    done, why = None, ""
    for mean, swing in SWUNG:
        procedure = Attraction(inertia=j, mean=mean, swing=swing * mean, frequency=LIVELY)
        try:
            done = course.run(procedure, insist=False)
            found = lag_of(done.record, j, angle, model, course.rig.sample_time)
        except (InputError, LimitCrossed) as error:
            why = str(error).rstrip(".")
            continue
        course.add("attraction", done, found)
        return found, ()
    if done is None:
        return None, (f"attraction: {why}.",)
    course.add("attraction", done, None, why)
    return None, ()


def _stickslip(
    course: _Course, j: float, fs: float, sliding: Mapping[str, float]
) -> tuple[Identification | None, tuple[str, ...]]:
    """LuGre's sigma0 and sigma1, or why there are none; the amplitude is lowered where the axis would run too fast."""
    first = amplitude = BEYOND * max(fs, sliding["fs"], sliding["fc"])
    crossed: LimitCrossed | None = None
    for _ in range(GENTLER):
        try:
            done = course.run(Stickslip(amplitude=amplitude, cycles=2.0), insist=False)
        except LimitCrossed as error:
            crossed, amplitude = error, amplitude * 0.93
            continue
        try:
            found = identify_lugre_dynamics(
                Response.of(done.record), j, Model("stribeck_plain", {}, **sliding)
            )
        except InputError as error:
            course.add("stickslip", done, None, str(error).rstrip("."))
            return None, ()
        course.add("stickslip", done, found)
        return found, ()
    return None, (
        f"LuGre's dynamics are not identified and LuGre was not tried as a compensator: the stick-slip stage crossed a "
        f"limit at each of {GENTLER} amplitudes from {first:.3g} down to {amplitude / 0.93:.3g} N·m (the last time: "
        f"{str(crossed).rstrip('.')}). Widen the rig's limits, or identify LuGre from a record of your own.",
    )


# ---- the whole ------------------------------------------------------------------------------------------------


def tried(
    recommend: Callable[[], TrackedRecommendation],
) -> tuple[TrackedRecommendation | None, tuple[str, ...]]:
    """The recommendation; where it fails, why: no stage rests on it, and the model that is had is kept."""
    try:
        return recommend(), ()
    except (InputError, CheckFailed, LimitCrossed) as error:
        return None, (f"No compensator is recommended: {str(error).rstrip('.')}.",)


def _recommended(
    course: _Course, j: float, top: float, fs: float, model: Model, stiffness: float, angle: AngleMap,
    lugre: Model | None,
) -> TrackedRecommendation:  # fmt: skip
    """The response of the loop, the bandwidth that it bears, the compensator, and what both do."""
    done = course.run(Resonance(speed=0.6 * top, inertia=j, stuck=QUIET * fs))
    sliding, sticking = (loop_response(done.part(label), label) for label in ("sliding", "sticking"))
    drivetrain, fastest = fit_drivetrain(sliding, sticking, j), fastest_pd([sliding, sticking], j)
    known = Known(j, model, angle, drivetrain, stiffness, resolution_of(done.part("sticking")), fastest)
    course.add("resonance", done, identified_drivetrain([sliding, sticking], drivetrain, fastest.sentence))
    course.progress("recommend: simulating the machine that was identified")

    def follow(procedure: Following, name: str) -> Performed:
        return course.run(procedure, name=name)

    return recommend_and_track(known, course.rig, lugre, follow)
