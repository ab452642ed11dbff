"""What the user must know beside a recommended setting."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from stickslip.control.controller import Controller
from stickslip.control.linear import Cascade, Gains
from stickslip.control.own_loop import USUAL_TIME
from stickslip.core.messages import code_of, name_option
from stickslip.identification.identified_file import Identified
from stickslip.machines.machine import Machine
from stickslip.machines.rigid import RigidAxis
from stickslip.machines.two_inertias import TwoInertias
from stickslip.recommendation.candidate_run import Drive, Trial, run
from stickslip.recommendation.candidates import Bench, Candidate, resistance
from stickslip.recommendation.recommendation import ALLOWANCE, BETTER, Recommendation
from stickslip.recommendation.resolution import resolution_words
from stickslip.recommendation.sample_time import ROWS
from stickslip.recommendation.separation import separate

MOSTLY, PARTLY = 0.5, 0.15
"""Of the error: what a lag makes beyond that is most of it; and from where on it is worth a word."""
BETTER_AT_MOTOR = 5.0
"""The second where friction is simulated at the load, and may act at the motor: so it held in `benchmarks/belts.py`."""
UNSURE = f"no certain reduction (more than {100.0 / ALLOWANCE:.0f} % left)"
"""Why a safe setting is not worth it."""


def sampled_as(drive: Drive, chosen: Candidate | None, linear: bool = False) -> Iterator[str]:
    """Yield the sample time, encoder and reference velocity of the simulations, and their sources."""
    if drive.sample_time_from:
        yield f"Simulated with a sample time of {drive.sample_time:g} s, {drive.sample_time_from}."
    if drive.encoder_from:
        yield f"Simulated with {resolution_words(drive.encoder_counts, linear)}, {drive.encoder_from}."
        yield _reference_velocity(drive)
    if chosen is None and code_of(drive.sample_time_from) == ROWS and drive.sample_time > USUAL_TIME:
        yield (
            "A loop that is sampled more often than its record was kept may bear a compensator where this one does "
            f"not: give its sample time ({name_option('sample_time')})."
        )


def _reference_velocity(drive: Drive) -> str:
    """Return how the drive forms its reference velocity in the simulations, in words."""
    if drive.reference_velocity == "difference":
        return (
            "Simulated with a reference velocity that is the difference of two reference positions, as given."
        )
    if drive.reference_velocity == "instant":
        return "Simulated with a reference velocity of the instant, as given."
    return (
        "Simulated with a reference velocity that is the difference of two reference positions on the best estimate, "
        "and of either kind on the sampled axes, as it is not stated; give "
        f"{name_option('reference_velocity', 'difference')} or instant."
    )


def axes_left_out(bench: Bench, others: Bench, found: Identified) -> Iterator[str]:
    """Of the axes that the intervals allow, those that the user's own loop would not hold."""
    lost, held = [*bench.left_out, *others.left_out], [*bench.plants[1:], *others.plants[1:]]
    if lost:
        split = separate(found, [*lost, *held], [*(True for _ in lost), *(False for _ in held)])
        which = f" ({split.words})" if split else ""
        yield (
            f"{len(lost)} of {len(lost) + len(held)} axes sampled from the intervals were left out: this loop alone "
            f"does not hold them{which}, and is taken to hold the machine."
        )


def lag_of(plant: RigidAxis, alone: Trial, linear: Controller, drive: Drive) -> Iterator[str]:
    """How much of the error is the lag of a loop that does not feed all of the velocity forward, which no friction
    makes.

    The loop that feeds the velocity tells: what it leaves on the same axis is not the lag's.
    """
    fed = with_velocity_fed(linear.gains)
    if fed is None:
        return
    trial = run(plant, replace(linear, gains=fed), drive)
    if isinstance(trial, str):
        return
    left = trial.moving["position_rms_rad"] / alone.moving["position_rms_rad"]
    if left <= 1.0 - PARTLY:
        part = "Most" if left <= 1.0 - MOSTLY else f"{100.0 * (1.0 - left):.0f} %"
        yield (
            f"{part} of the error is no friction's: {lag_words(linear.gains)}; feed the velocity forward first, which "
            f"leaves {100.0 * left:.2g} % of the error without any compensator."
        )


def with_velocity_fed(gains: Gains | Cascade | None) -> Gains | Cascade | None:
    """The gains with all of the reference velocity fed forward; None where it is already, or the loop has none."""
    if isinstance(gains, Cascade):
        return gains._replace(feed=1.0) if gains.feed < 1.0 else None
    return gains._replace(kr=gains.kd) if gains is not None and gains.kr < gains.kd else None


def lag_words(gains: Gains | Cascade | None) -> str:
    """Why the position lags behind."""
    if isinstance(gains, Cascade):
        if gains.feed == 0.0:
            return "without velocity feedforward (feed = 0) the position lags behind by the velocity over kv"
        missing = f"{1.0 - gains.feed:.2g} times the velocity over kv"
        return f"with feed = {gains.feed:g} the position lags behind by {missing}"
    assert gains is not None
    return (
        f"with kr = {gains.kr:.4g} below kd = {gains.kd:.4g} the position lags behind by (kd - kr) / kp times the "
        "velocity"
    )


def beyond_torque_limit(plants: Sequence[RigidAxis], drive: Drive) -> Iterator[str]:
    """Yield on how many axes the friction is above the torque limit; nothing if on none."""
    count = sum(resistance(plant.friction, drive) >= drive.torque_limit for plant in plants)
    if count:
        yield (
            f"On {count} of {len(plants)} axes the torque limit of the drive is below their friction, though not below "
            "that of the best estimate: they do not follow."
        )


def notes_on(found: Identified, result: Recommendation) -> Iterator[str]:
    """Yield the notes on the model and on the recommendation."""
    chosen, candidates = result.chosen, result.candidates
    if float(found.axis.get("gravity", 0.0) or 0.0):
        yield (
            "The pendulum's weight is not part of the setting: the error that it makes is in the numbers above. Less "
            "is left once gravity sin(q - gravity_angle) of the model is added to the drive's torque."
        )
    yield from _intervals(found, [e.name for e in found.estimates if not e.identified])
    if chosen is None and result.instead is None:
        return
    if result.instead is None and chosen is not None and chosen.setting.compensates:
        yield from _stiff_feedback(candidates)
    if abs(float(found.axis.get("offset", 0.0))) > 0.0:
        offset = f"{float(found.axis['offset']):.4g} {found.unit('N·m')}"
        yield (
            f"A constant torque of {offset} acts in addition to friction: it is part of what is recommended, "
            "simulated and exported."
        )


def interval_allows(found: Identified, result: Recommendation) -> Iterator[str]:
    """Yield what was simulated and how the interval allows for the rest, if something is recommended."""
    if result.chosen is not None or result.instead is not None:
        yield _simulated(result.drive.machine, found.train, result.drive.delay)


def _stiff_feedback(candidates: Sequence[Candidate]) -> Iterator[str]:
    """With which laws and deadbands feedback of all of the friction is not safe."""
    whole = [c for c in candidates if c.setting.kind == "feedback" and c.setting.gain == 1.0]
    several = len({c.setting.deadband for c in whole}) > 1
    by_reason: dict[str, list[str]] = {}
    for c in (c for c in whole if c.unsafe):
        which = f" with {'a' if c.setting.deadband else 'no'} deadband" if several else ""
        by_reason.setdefault(", ".join(c.unsafe), []).append(f"law {c.setting.law!r}{which}")
    if by_reason:
        said = "; ".join(f"{', '.join(laws)} ({why})" for why, laws in by_reason.items())
        yield f"Feedback at gain 1 is not safe for {said}."


def _intervals(found: Identified, unknown: Sequence[str]) -> Iterator[str]:
    """What the sampled axes cover of the numbers that the record does not tell."""
    if not found.law_estimates[0]:
        yield "The law has no intervals: only its best estimate was simulated, and nothing is said about its error."
    elif unknown:
        static = ", fs up to twice fc" if any(n.startswith("fs") for n in unknown) else ""
        if any(n.startswith("sigma2") for n in unknown):
            static += ", sigma2 down to none, and it is fed forward at the lower end of its interval"
        yield (
            f"Not identified: {', '.join(unknown)}; the sampled axes cover at most a factor of 9 to each side for them"
            f"{static}."
        )


def beyond_inertia(chosen: Candidate | None, friction: Candidate | None, why: str) -> Iterator[str]:
    """Explain why friction is not compensated, if the inertia feedforward alone is switched on.

    `why` is the reason where no friction compensation may be switched on.
    """
    if chosen is None or chosen.setting.compensates:
        return
    if friction is not None:
        best, alone = friction.setting, chosen
        why = (
            f"on the sampled axes it adds hardly anything; the best ({best.words}) leaves {_left(friction)}, the "
            f"inertia feedforward alone {_left(alone)}"
        )
    yield f"No friction compensation beyond the inertia feedforward is recommended: {why}."
    yield "A drive that feeds its acceleration forward already has it: there is nothing more to switch on."


def _left(candidate: Candidate) -> str:
    """Return the part of the error left, in words."""
    worst = f"{100.0 * candidate.worst:.1f} % of the error on the worst axis"
    usual = f" and at most {100.0 * candidate.usual:.1f} % on half of them"
    return worst + (usual if len(candidate.errors) > 2 else "")


def better_than_simulated(machine: Machine | None, train: TwoInertias | None) -> float:
    """Times as small as simulated, that the error left may be."""
    return BETTER if train is None or machine is not None else BETTER_AT_MOTOR


def not_simulated(machine: Machine | None, train: TwoInertias | None) -> tuple[str, ...]:
    """Return the effects that the simulations leave out."""
    if machine is not None:
        return (f"what the file of machine {machine.name} leaves out",)
    return ("resonances" if train is None else "further resonances", "backlash", "noise in the current")


def _simulated(machine: Machine | None, train: TwoInertias | None, delay: float | None) -> str:
    """Return what was simulated, what was not, and how the interval allows for that."""
    axis = "a rigid axis"
    if train is not None:
        axis = (
            f"motor and load behind a spring as identified (they resonate at {train.resonance:.3g} Hz; friction at the "
            "load)"
        )
    late = "up to a sample" if delay is None else f"{delay:g} samples"
    *most, last = not_simulated(machine, train)
    simulated = (
        f"Simulated with {axis}, a current loop, {late} of delay, friction that comes late as "
        f"behind an elastic drivetrain, and position-dependent torques as large as the model's misfit; "
        f"{', '.join(most)} and {last} are not in it (in place of noise a feedback is pushed at rest): for them"
    )
    if machine is not None:
        simulated = (
            f"Simulated on the machine {machine.name}, with its resonances, delay, amplifier, encoder and noise, and "
            "friction that comes late as behind backlash; what the machine's file leaves out is not in it: for that"
        )
    return (
        f"{simulated} the interval takes the error left as up to {ALLOWANCE:g} times as large and down to "
        f"{better_than_simulated(machine, train):g} times as small."
    )
