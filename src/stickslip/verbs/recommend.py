"""From an identified model to a setting that is safe to switch on: the verb `recommend`."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from stickslip.control.controller import Controller
from stickslip.control.files import read_controller, sample_time_in
from stickslip.control.linear import Cascade, Gains
from stickslip.control.own_loop import ReferenceVelocity, kind_of_loop, loop_text, split_loop
from stickslip.core.arguments import arguments_checked
from stickslip.core.code_approval import allow_code
from stickslip.core.errors import InputError
from stickslip.core.messages import name_loop, name_option
from stickslip.identification.identified_file import Identified
from stickslip.machines.files import load_machine
from stickslip.machines.machine import Machine
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.recommendation import recommend as setting
from stickslip.recommendation.candidate_run import Drive
from stickslip.recommendation.resolution import encoder_for
from stickslip.recommendation.sample_time import refuse_filter, sample_time_for
from stickslip.verbs.candidates_given import Given, compensators_of, made_for
from stickslip.verbs.compare import IdentifiedModel, identified_of
from stickslip.verbs.motion_given import Given as MotionGiven
from stickslip.verbs.motion_given import motion_along, motion_in
from stickslip.verbs.reading import Log
from stickslip.verbs.recommendation import RecommendationResult

USUAL: Mapping[str, Any] = {
    "loop": None,
    "linear": "PD",
    "bandwidth": 10.0,
    "damping": 1.0,
    "sample_time": None,
}
"""What `recommend` takes where nothing is given."""


@arguments_checked
def recommend(
    model: IdentifiedModel | Model | RigidAxis,
    *,
    bandwidth: float | None = 10.0,
    damping: float | None = 1.0,
    linear: Literal["PD", "PID", "PR"] = "PD",
    loop: str | Mapping[str, float | ReferenceVelocity] | None = None,
    controller: Controller | str | os.PathLike[str] | None = None,
    machine: Machine | str | os.PathLike[str] | None = None,
    sample_time: float | None = None,
    delay: float | None = None,
    reference_velocity: ReferenceVelocity | None = None,
    counts_per_rev: float | None = None,
    torque_limit: float = math.inf,
    motion: Reference | Log | None = None,
    duration: float | None = None,
    motion_map: Mapping[str, str] | Sequence[str] = (),
    remember: bool = False,
    amplitude: float | None = None,
    frequency: float | None = None,
    inertia: float | None = None,
    feed_inertia: bool = True,
    compensators: Sequence[Given] = (),
    axes: int = 6,
    confirm: int = 39,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> RecommendationResult:
    """Choose law, structure, gain, lead and deadband of a compensator, and say what to expect.

    Candidates are simulated on the best estimate and on axes drawn from the model's intervals, along the motion of the
    log and at rest behind it, sampled as in the drive. Recommended is what limit-cycles on none of them and leaves the
    least error on the worst; then it is simulated on other axes sampled from the intervals. A candidate is simulated on
    more axes only while it can still be the best.

    Parameters
    ----------
    model : IdentificationResult, path, RigidAxis or Model
        What `identify` gave, or the model.toml that it saved; or an axis of your own, or a friction law with `inertia`.
        Such a law has no intervals: candidates then run on that one axis, and no interval of the reduction is given.
    bandwidth, damping : float, optional
        Of the position loop's poles, Hz and -; None: 10 Hz and 1. Refused beside `loop` and `controller`, which have
        their gains.
    linear : {"PD", "PID", "PR"}
        What they place.
    loop : str or mapping, optional
        The drive's own loop instead: kp (N·m/rad), ki, kd, kr of a PID, or kv (1/s), kvp (N·m·s/rad), kvi (N·m/rad),
        feed (part of the reference velocity fed forward) of position P around velocity PI; with filter (Hz,
        first-order low-pass on its velocity), limit (N·m) and reference_velocity, as below.
    controller : Controller or path, optional
        The drive's own loop made of control laws instead, observers and all, but without friction laws; a path is that
        of a file with a table [controller].
    machine : Machine or path, optional
        The machine at hand (a name of the library, or the path of its TOML file): candidates then run on it, with its
        resonances, delay, amplifier, encoder and noise, and the identified friction and inertia. Without it on rigid
        axes.
    sample_time : float, optional
        Of the drive, s; the machine's, else the time between the rows of the identified record, or 1e-3 where the model
        does not tell it, or the loop would be hardly damped at those rows. A note says which. Refused beside a
        `controller` that has its own.
    delay : float, optional
        Samples by which a command acts late, as on a bus of two or three cycles; drawn, up to one sample, unless given.
        A `machine` has its own.
    reference_velocity : {"difference", "instant"}, optional
        How the drive forms its reference velocity: as the difference of two reference positions, or as the
        trajectory's velocity at the sample. Not stated, the best estimate has the difference, and the sampled axes have
        either.
    counts_per_rev : float, optional
        Of the encoder; 0: exact. The machine's or the controller's, else by the position step of the identified record,
        else exact; a note says which. Of a linear axis the counts in 2π m: 2π over the scale's step in m, 12.57e6 for
        0.5 µm.
    torque_limit : float
        N·m
    motion : log or Reference, optional
        Time and position of the motion that matters, or a reference; that of the identification's log unless given.
        Tried from rest to rest; one that never rests is begun and braked smoothly, which is not judged.
    duration : float, optional
        Of a reference, s; two periods, or until it rests, unless given.
    motion_map : mapping of str to str, or sequence of str
        Which of its columns is which channel, in which unit, as `map` of `identify`. Positions in counts are read by
        `counts_per_rev`.
    remember : bool
        Whether its file is read by the profile kept for files with its columns, as the command line does.
    amplitude, frequency : float, optional
        Of a slow sinusoid as the motion instead, rad (m) and Hz (0.5).
    inertia : float, optional
        kg·m², where the model has none, or another one.
    feed_inertia : bool
        Whether the inertia times the reference's acceleration is fed forward, too; then it is tried alone as well.
    compensators : sequence of str, Controller or path
        Of the catalogue of `stickslip study compensators` (observers, adaptation, sliding modes, resets), which are
        tried besides and switched on where one leaves less; ("all",) for all of them. A controller of your own, or the
        path of its file with a table [controller], is tried as it is, in place of the loop: feedforward is its own.
        The file may name the identified law, ``friction = "identified"``.
    axes : int
        Drawn from the intervals for all candidates.
    confirm : int
        Drawn for the recommended one; what it does on them holds with (confirm - 1)/(confirm + 1).
    progress : callable, optional
        ``progress(finished, all)``

    Returns
    -------
    RecommendationResult

    Raises
    ------
    InputError
        One line that names the thing, its value and the remedy.
    """
    bandwidth = float(USUAL["bandwidth"]) if bandwidth is None else bandwidth
    damping = float(USUAL["damping"]) if damping is None else damping
    refuse_numbers(axes, confirm)
    refuse_together(motion, amplitude, frequency)
    if motion_map and (motion is None or isinstance(motion, Reference)):
        raise InputError(
            f"{name_option('motion_map')} says how the log of {name_option('motion')} is read; give that, too"
        )
    if duration is not None and not isinstance(motion, Reference):
        raise InputError(
            f"recommend: duration = {duration:g} s is that of a Reference; give one as motion, too"
        )
    if loop is not None:
        refuse_beside_loop(loop, linear=linear, bandwidth=bandwidth, damping=damping)
    gains, corner, limit, stated = own_loop(loop, torque_limit)
    tried = compensators_of(compensators)
    found = identified_for(model, inertia)
    at_hand = load_machine(machine) if isinstance(machine, (str, os.PathLike)) else machine
    known_counts = (
        at_hand.encoder.counts if at_hand is not None and counts_per_rev is None else counts_per_rev
    )
    if (
        found.trajectory is None
        and isinstance(model, (Model, RigidAxis))
        and motion is None
        and amplitude is None
    ):
        raise InputError(
            'recommend: give the motion, such as motion=Reference("sine", amplitude=0.1, frequency=0.5)'
        )
    hertz = 0.5 if frequency is None else frequency
    path, told = None, tuple[str, ...]()
    if isinstance(motion, Reference):
        path = motion_along(motion, duration)
    elif motion is not None:
        path, told = motion_in(
            motion, MotionGiven(motion_map, known_counts or 0.0, remember, found.unit("rad"))
        )
    if controller is not None:
        refuse_beside(controller, loop=loop, linear=linear, bandwidth=bandwidth, damping=damping)

        def holding(made: Controller, told_by: str) -> Drive:
            counts, source = encoder_for(found, counts_per_rev, at_hand, made.encoder_counts)
            return Drive(
                sample_time=made.sample_time, encoder_counts=counts, encoder_from=source,
                torque_limit=torque_limit, amplitude=amplitude, frequency=hertz, motion=path,
                controller=made, sample_time_from=told_by,
                reference_velocity=one_of(reference_velocity, made.reference_velocity, "the controller"),
            )  # fmt: skip

        drive = drive_with(controller, holding, found, inertia, sample_time, at_hand)
    else:
        counts, source = encoder_for(found, counts_per_rev, at_hand)
        formed = one_of(reference_velocity, stated, name_option("loop"))

        def sampled(period: float, told_by: str = "") -> Drive:
            return Drive(
                bandwidth, damping, period, counts, limit, amplitude, hertz, linear, gains, corner, path,
                sample_time_from=told_by, encoder_from=source, reference_velocity=formed,
            )  # fmt: skip

        known_inertia = inertia or found.axis.get("inertia")
        drive = sampled(*sample_time_for(found, sample_time, at_hand, sampled, known_inertia))
        refuse_filter(drive)
    if at_hand is not None:
        most = at_hand.limits.get("torque", math.inf)
        drive = replace(drive, machine=at_hand, torque_limit=min(drive.torque_limit, most))
    if delay is not None:
        drive = replace(drive, delay=delay)
    besides = made_for(tried, drive, inertia or found.axis.get("inertia"), found.model)
    with allow_code(bool(found.law_file)):  # its model has been read: whoever must approve it has
        try:
            result = setting.recommend(
                found, drive, inertia=inertia, axes=axes, confirm=confirm, progress=progress,
                feed_inertia=feed_inertia, compensators=besides,
            )  # fmt: skip
        except InputError as error:
            # A motion in a wrong unit is refused as one that no drive can follow.
            raise InputError("; ".join([str(error), *told])) from None
    return RecommendationResult(replace(result, notes=(*told, *result.notes)), found)


def identified_for(given: IdentifiedModel | Model | RigidAxis, inertia: float | None) -> Identified:
    """Return an identified model, or one without intervals from an axis or a friction law.

    Raises
    ------
    InputError
        As `identified_of`; if a law comes without an inertia, or an axis with a load or temperature of its own.
    """
    if isinstance(given, RigidAxis):
        if (given.load, given.temperature) != (RigidAxis.load, RigidAxis.temperature):
            raise InputError(
                f"recommend: the axis has load = {given.load:g} and temperature = {given.temperature:g} °C; give an "
                "axis whose friction holds at load 1 and 20 °C"
            )
        known = {"inertia": given.inertia}
        return Identified(Path("the axis given"), given.friction, (), np.zeros((0, 0)), known)
    if isinstance(given, Model):
        if inertia is None:
            raise InputError("recommend: a Model has no inertia; give inertia in kg·m², or a RigidAxis")
        return Identified(Path("the model given"), given, (), np.zeros((0, 0)), {"inertia": inertia})
    return identified_of(given)


def refuse_numbers(axes: int, confirm: int) -> None:
    """Refuse numbers of axes that show nothing.

    Raises
    ------
    InputError
    """
    if axes < 1:
        raise InputError(
            f"{name_option('axes', axes)} must be at least 1: what is safe on the best estimate alone need not "
            "be on the machine"
        )
    if confirm < 0:
        raise InputError(
            f"{name_option('confirm', confirm)} must be at least 0, which confirms nothing; leave it out for 39"
        )


def refuse_together(motion: object | None, amplitude: float | None, frequency: float | None) -> None:
    """Refuse what excludes each other.

    Raises
    ------
    InputError
    """
    if motion is not None and amplitude is not None:
        raise InputError(
            f"{name_option('motion')} and {name_option('amplitude')} exclude each other; give one of them"
        )
    if frequency is not None and amplitude is None:
        raise InputError(
            f"{name_option('frequency', f'{frequency:g}')} needs a sinusoid; give "
            f"{name_option('amplitude')} too"
        )


def refuse_beside_loop(loop: object, **given: object) -> None:
    """Refuse a loop without gains, and what would place them.

    Raises
    ------
    InputError
    """
    if not loop:
        raise InputError(
            f"{name_option('loop')}: {loop!r} names no gain; give them, such as {name_loop('kp=8,kd=0.08')}, or "
            "leave it out"
        )
    for name, value in given.items():
        if value != USUAL[name]:
            raise InputError(
                f"{name_option(name, value)} cannot be combined with {name_option('loop')}, which sets the "
                "gains; leave one out"
            )


def refuse_beside(controller: object, **given: object) -> None:
    """Refuse what a controller's own file sets, where it was given too.

    Raises
    ------
    InputError
    """
    for name, value in given.items():
        if value != USUAL[name]:
            file = f" {controller}" if isinstance(controller, (str, os.PathLike)) else ""
            raise InputError(
                f"{name_option(name)} cannot be combined with {name_option('controller')}{file}, which sets it; "
                "leave it out"
            )


def drive_with(
    controller: Controller | str | os.PathLike[str], holding: Callable[[Controller, str], Drive], found: Identified,
    inertia: float | None, sample_time: float | None, machine: Machine | None,
) -> Drive:  # fmt: skip
    """The drive whose loop is made of control laws: at the controller's sample time, else as any loop is sampled.

    Parameters
    ----------
    controller : Controller or path
    holding : callable
        The drive that holds a controller with a sample time, and where that is from.
    found : Identified
    inertia : float, optional
        kg·m², where the model has none, or another one.
    sample_time : float, optional
        That was given, s; refused where the controller has its own.
    machine : Machine, optional
        At hand.

    Raises
    ------
    InputError
    """
    known = inertia or found.axis.get("inertia")

    def sampled(period: float, told_by: str = "") -> Drive:
        if isinstance(controller, Controller):
            return holding(replace(controller, sample_time=period), told_by)
        return holding(read_controller(Path(controller), known, sample_time=period), told_by)

    own = controller.sample_time if isinstance(controller, Controller) else sample_time_in(controller)
    if own > 0.0:
        refuse_beside(controller, sample_time=sample_time)
        return sampled(own, "that of the controller")
    return sampled(*sample_time_for(found, sample_time, machine, sampled, known))


def one_of(
    given: ReferenceVelocity | None, own: ReferenceVelocity | None, owner: str
) -> ReferenceVelocity | None:
    """Return how the drive forms its reference velocity: as given, or as its loop states.

    Raises
    ------
    InputError
        If both differ.
    """
    if given is not None and own is not None and given != own:
        raise InputError(
            f"{name_option('reference_velocity', given)}, and {owner} states {own}; leave one of them out"
        )
    return given or own


def own_loop(
    given: str | Mapping[str, float | ReferenceVelocity] | None, torque_limit: float
) -> tuple[Gains | Cascade | None, float, float, ReferenceVelocity | None]:
    """Return the gains of the drive's own loop, None without one; the corner of its filter, Hz; the limit, N·m; and how
    it forms its reference velocity, if that is stated.

    Raises
    ------
    InputError
        As of `loop_of`, or if the loop has a limit and another one was given.
    """
    if given is None:
        return None, 0.0, torque_limit, None
    gains, own, formed = loop_of(given)
    if "limit" in own and math.isfinite(torque_limit):
        raise InputError(
            f"{name_option('torque_limit', f'{torque_limit:g}')} and the limit of {name_option('loop')} exclude "
            "each other; give one of them"
        )
    return gains, own.get("filter", 0.0), own.get("limit", torque_limit), formed


def loop_of(
    given: str | Mapping[str, float | ReferenceVelocity],
) -> tuple[Gains | Cascade, dict[str, float], ReferenceVelocity | None]:
    """Return the gains of a loop as the drive has it, its filter and limit, and how it forms its reference velocity.

    Raises
    ------
    InputError
        If a name is unknown, both kinds of loop are mixed, or a number is out of bounds.
    """
    numbers, formed = split_loop(given)
    kind = kind_of_loop(numbers, ("filter", "limit"))
    for name, value in numbers.items():
        above = value > 0.0 if name == "limit" else value >= 0.0 and math.isfinite(value)
        if not above:
            raise InputError(
                f"{name_option('loop')}: {name} = {value:g} must be a number of 0 or more, a limit greater than 0"
            )
    if kind is Gains and not numbers.get("kp", 0.0) > 0.0:
        raise InputError(f"{name_loop(loop_text(given))}: give kp, greater than 0")
    own = {name: numbers.pop(name) for name in ("filter", "limit") if name in numbers}
    return kind(**numbers), own, formed
