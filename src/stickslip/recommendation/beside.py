"""Test compensators of the catalogue (observers, adaptation, sliding modes, resets) and the user's own controllers on
the axes of a recommendation.

Compensators of the catalogue are designed from the identified law, and run like the settings of a law. On the best
estimate each also rests long enough for slow limit cycles to appear. Compensators that are known to be unsuitable are
not run, and the reason is reported. The user's own controllers are run unchanged.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from stickslip.analyse.observer_guard import objection
from stickslip.control.belief import Belief, believed
from stickslip.control.block import ControlBlock
from stickslip.control.catalogue import CATALOGUE, LOOPS, compensated
from stickslip.control.controller import Controller
from stickslip.control.linear import Cascade
from stickslip.core.errors import ParameterError
from stickslip.models.model import Model
from stickslip.recommendation.candidate_run import AT_REST, Drive, Trial, dangers
from stickslip.recommendation.candidates import NEAR, Bench, why_lost
from stickslip.recommendation.long_rest import swing_for_long


@dataclass(frozen=True, eq=False)
class Own:
    """A complete controller of the user to test in addition.

    Attributes
    ----------
    name : str
        Name in the output.
    controller : Controller
    """

    name: str
    controller: Controller


@dataclass(frozen=True, eq=False)
class Beside:
    """A compensator of the catalogue in a loop, or a controller of the user, with its results on every axis.

    Attributes
    ----------
    name, loop : str
        Of `stickslip.control.catalogue`, or `Own`; loop is empty if the compensator is the loop.
    errors : tuple of float
        RMS position error along the motion relative to that of the linear controller alone, one per axis, the best
        estimate first; empty if it was not run.
    why_not : str
        Reason for rejection, or "".
    controller : Controller or None
        None if it cannot be designed for this axis.
    learned : mapping
        Parameters learned on the best estimate, along the motion (`stickslip.control.learned.plain`).
    confirmed : tuple of float
        As `errors`, on axes that were not used for its selection; empty if it is not the one to switch on.
    """

    name: str
    loop: str
    errors: tuple[float, ...]
    why_not: str
    controller: Controller | None
    learned: Mapping[str, Any] = field(default_factory=dict[str, Any])
    confirmed: tuple[float, ...] = ()

    @property
    def label(self) -> str:
        """``PD + dob``"""
        parts = [part for part in (self.loop, self.name if self.name != "none" else "") if part]
        return " + ".join(parts)

    @property
    def worst(self) -> float:
        """The largest remaining share of the error, on the axes on which all were tested."""
        return max(self.errors, default=math.inf)

    @property
    def at_most(self) -> float:
        """The largest remaining share of the error on all axes."""
        return max((self.worst, *self.confirmed))

    @property
    def adapts(self) -> bool:
        """Whether its learned parameters act on the axis."""
        return self.controller is not None and any(b.law.adapts for b in self.controller.blocks.values())

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {"compensator": self.name, "loop": self.loop, "errors": list(self.errors),
                "confirmed": list(self.confirmed), "why_not": self.why_not,
                "controller": self.controller.as_dict() if self.controller else None,
                "learned": dict(self.learned)}  # fmt: skip


def belief_of(model: Model, drive: Drive, inertia: float) -> Belief:
    """Return the nominal plant: the identified law and the drive; for a given loop its effective bandwidth.

    Raises
    ------
    ParameterError
        If the loop is made of control laws, or the law has no sliding curve.
    """
    if drive.controller is not None:
        raise ParameterError(
            "compensators of the catalogue have their own loop; leave controller out, or name only files of "
            "your own controllers"
        )
    bandwidth = drive.bandwidth
    if drive.gains is not None:
        gains = drive.gains
        stiffness = gains.kv * gains.kvp if isinstance(gains, Cascade) else gains.kp
        bandwidth = math.sqrt(stiffness / inertia) / (2.0 * math.pi)
    return believed(
        model, inertia, sample_time=drive.sample_time, torque_limit=drive.torque_limit, bandwidth=bandwidth,
        counts=drive.encoder_counts,
    )  # fmt: skip


def tried_beside(
    names: Sequence[str | Own],
    belief: Belief | None,
    bench: Bench,
    others: Bench,
    inertia: float = 0.0,
    offset: float = 0.0,
) -> tuple[Beside, ...]:
    """Test the named compensators and return them, the one to switch on first: the best, or an equally good one without
    adaptation, because it cannot drift. The rest follow by their errors, then the unsafe ones.

    The best is confirmed on the other axes.

    Parameters
    ----------
    names : sequence of str or Own
        Of the catalogue, and controllers of the user.
    belief : Belief or None
        Of the axis; required for compensators of the catalogue.
    bench, others : Bench
        Axes for selection and for confirmation.
    inertia, offset : float
        Feedforward of inertia and constant torque, kg·m² and N·m, with each compensator of the catalogue.
    """
    found = [
        on_axes(Beside(own.name, "", (), "", own.controller), bench, " ")
        for own in names
        if isinstance(own, Own)
    ]
    for name in names:
        if not isinstance(name, Own):
            assert belief is not None
            found += [
                judged(name, loop, belief, bench, inertia, offset) for loop in CATALOGUE[name].loops or ("",)
            ]
    ready = sorted((b for b in found if not b.why_not), key=lambda b: b.worst)
    left = [b for b in found if b.why_not]
    while ready:
        first = min(ready, key=lambda b: (b.worst > NEAR * ready[0].worst, b.adapts))
        ready.remove(first)
        best = confirmed(first, bench, others)
        if not best.why_not:
            return (best, *(passed_over(b, first) for b in ready), *left)
        left.append(best)
    return tuple(left)


def passed_over(one: Beside, taken: Beside) -> Beside:
    """Return the reason why `tried_beside` does not select a compensator with a smaller error."""
    return (
        replace(one, why_not=f"it adapts, and {taken.label} is equally good")
        if one.worst < taken.worst
        else one
    )


def judged(
    name: str, loop: str, belief: Belief, bench: Bench, inertia: float = 0.0, offset: float = 0.0
) -> Beside:
    """Test one of them on every axis, up to the first on which it is unsafe."""
    try:
        made = compensated(name, loop or LOOPS[0], belief)
    except ParameterError as error:
        return Beside(name, loop, (), str(error).removeprefix("belief: "), None)
    made = replace(
        fed(made, inertia, offset), encoder_counts=bench.drive.encoder_counts,
        reference_velocity=bench.drive.reference_velocity,
    )  # fmt: skip
    if why := refused(name, made, belief, bench.drive):
        return Beside(name, loop, (), why, made)
    return on_axes(Beside(name, loop, (), "", made), bench, " ")


def fed(made: Controller, inertia: float, offset: float) -> Controller:
    """Return the controller with feedforward of inertia and offset; without the inertia if it has its own."""
    inertia = 0.0 if made.answers_to_acceleration else inertia
    if inertia == offset == 0.0:
        return made
    more = ControlBlock("inertia_feedforward", inertia=inertia, offset=offset)
    return replace(made, feedforward=[*made.feedforward, more])


def feeds_friction(made: Controller) -> bool:
    """Whether its feedforward contains more than inertia and offset."""
    laws = [block.law for block in made.blocks.values() if block.law.place == "feedforward"]
    return any(law.accelerating is None for law in laws)


def refused(name: str, made: Controller, belief: Belief, drive: Drive) -> str:
    """Return the reason why it is not run, or ""."""
    if name == "lugre-observer":
        stiffness, late = belief.number("sigma0"), math.ceil(drive.latest)
        said = objection(made, belief.inertia, stiffness, drive.encoder_counts, delay=late)
        if said:
            return said
    if CATALOGUE[name].against:
        return CATALOGUE[name].against
    laws = [block.law for block in made.blocks.values()]
    if any(law.adapts for law in laws) and not any(law.integrates for law in laws):
        return "it adapts, and nothing else in it moves a sticking axis"
    return ""


def confirmed(best: Beside, bench: Bench, others: Bench) -> Beside:
    """Test it on the other axes, and at long rest on the best estimate."""
    assert best.controller is not None
    if cycle := limit_cycle(best.controller, bench, 0):
        return replace(best, why_not=cycle)
    found = on_axes(best, others, " on an axis sampled later ")
    return replace(found, errors=best.errors, confirmed=found.errors)


def on_axes(beside: Beside, bench: Bench, where: str) -> Beside:
    """Test it on every axis of a bench; return errors and the reason why it is unsafe on one of them."""
    controller = beside.controller
    assert controller is not None
    errors: list[float] = []
    for i, (before, after) in enumerate(bench.trials(controller)):
        if isinstance(after, str) or isinstance(before, str):
            return replace(beside, errors=tuple(errors), why_not=why_lost(before, after) + where.rstrip())
        errors.append(after.moving["position_rms_rad"] / before.moving["position_rms_rad"])
        beside = replace(beside, learned=beside.learned or after.learned)
        unsafe = unsafe_at(beside, before, after, bench.drive)
        if AT_REST in unsafe and not limit_cycle(controller, bench, i):
            unsafe.remove(AT_REST)  # it came to rest later: a jump back after the motion is not a limit cycle
        if unsafe:
            return replace(beside, errors=tuple(errors), why_not=", ".join(unsafe) + where.rstrip())
    return replace(beside, errors=tuple(errors))


def unsafe_at(beside: Beside, before: Trial, after: Trial, drive: Drive) -> list[str]:
    """Return the dangers that it adds to those of the linear controller.

    A feedforward kicks at reversals, even in combination with an observer, so it may be as rough as a feedforward
    alone.
    """
    assert beside.controller is not None
    if math.isclose(after.moving["position_rms_rad"], before.moving["position_rms_rad"], rel_tol=1e-3):
        return []
    found = list(dangers(before, after, drive))
    if feeds_friction(beside.controller):
        bearable = list(dangers(before, after, drive, feedforward=True))
        found = [said for said in found if said == AT_REST or said in bearable]
    return found


def limit_cycle(controller: Controller, bench: Bench, axis: int) -> str:
    """Return a description of its limit cycle at long rest after the motion on one of the axes, or ""."""
    swing = swing_for_long(controller, bench, axis)
    if math.isinf(swing):
        return "at rest position or velocity exceeded all reasonable limits"
    return f"hunts at rest, {1e6 * swing:.0f} µrad peak to peak" if swing > 0.0 else ""
