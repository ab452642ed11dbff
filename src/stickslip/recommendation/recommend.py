"""From an identified model to a setting that is safe to switch on: by simulating the axes that the data allow.

A compensator that gives more than the friction there is pushes the axis: around rest it limit-cycles (thesis 3.2.3).
The true friction is unknown but for the model's intervals, so every candidate (law, feedforward or feedback, gain,
deadband) is run on axes drawn from them, sampled, counted, held and limited as in the drive. The best is then run on
other axes, with a tenth more gain too: what it does there, not where it was picked, is what to expect of it. The linear
controller alone is judged first: what rings without a compensator is not the compensator's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from stickslip.core.errors import InputError
from stickslip.core.messages import Note
from stickslip.identification.identified_file import Identified
from stickslip.models.model import Model
from stickslip.recommendation.axes import plants_of
from stickslip.recommendation.beside import Own, belief_of, limit_cycle, tried_beside
from stickslip.recommendation.candidate_run import Drive, Trial, run
from stickslip.recommendation.candidates import (
    NEAR,
    TRIES,
    Account,
    Bench,
    Candidate,
    Setting,
    on_both,
    rings_alone,
)
from stickslip.recommendation.late import hardly_damped_where_late, refuse_late, seconds_meant
from stickslip.recommendation.long_rest import hunts_alone, hunts_with, long_rests, rest_words, unsure_at_rest
from stickslip.recommendation.motion_notes import by_attribute, on_motion
from stickslip.recommendation.notes import (
    ALLOWANCE,
    UNSURE,
    axes_left_out,
    better_than_simulated,
    beyond_inertia,
    beyond_torque_limit,
    interval_allows,
    lag_of,
    notes_on,
    sampled_as,
)
from stickslip.recommendation.plant import Plant
from stickslip.recommendation.question import cautious, inertia_of, laws_of, with_motion
from stickslip.recommendation.recommendation import Comparison, Recommendation
from stickslip.recommendation.refusals import (
    held,
    refuse_endless,
    refuse_loaded,
    refuse_unknown,
    refuse_weak,
)
from stickslip.recommendation.refused import why_refused

GAINS = (0.5, 0.7, 0.8, 0.9, 1.0)
BEYOND = (1.1, 1.25, 1.5)
"""Gains above 1, for the margin only."""
GUARD = 1.1
"""What is recommended is safe with so many times its gain too: friction falls as an axis warms up."""
LEADS = (0.0, 0.5, 1.0, 2.0)
"""In sample times."""
DEADBAND = 1.5
"""In counts per sample time: a single count, which an axis at rest may give, is then rest."""
ALIKE = 1.02
"""As `NEAR`, for leads: the shorter one is taken."""


def recommend(
    found: Identified, drive: Drive, *, inertia: float | None = None, axes: int = 6, confirm: int = 39, seed: int = 0,
    feed_inertia: bool = True, compensators: Sequence[str | Own] = (),
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> Recommendation:  # fmt: skip
    """Choose law, structure, gain, lead and deadband.

    Parameters
    ----------
    found : Identified
    drive : Drive
    inertia : float, optional
        kg·m², where the model has none.
    axes : int
        Besides the best estimate, drawn from the model's intervals: for all candidates; none where the law has none.
    confirm : int
        Drawn besides, on which the best candidate is confirmed: its `Recommendation.reduction` is theirs.
    seed : int
        Of the draws.
    feed_inertia : bool
        Whether the inertia times the reference's acceleration is part of every setting; not where the drive feeds it
        forward itself, or knows no acceleration.
    compensators : sequence of str or Own
        Of `stickslip.control.catalogue.CATALOGUE`, and controllers of the user's: they are tried besides.
    progress : callable
        Called with the axes that are simulated, and all of them that may be.

    Returns
    -------
    Recommendation

    Raises
    ------
    InputError
        If there is no inertia, friction's level is not identified, the drive is too weak for the motion, or the linear
        controller alone cannot be simulated or is unstable.
    """
    j = inertia_of(found, inertia)
    drive = with_motion(found, drive)
    refuse_unknown(found)
    refuse_loaded(found)
    refuse_weak(found, drive)
    refuse_late(found, drive, j)
    linear = drive.loop(j)
    if not found.law_estimates[0]:
        axes = confirm = 0  # Nothing of the friction would be drawn.
    laws = laws_of(cautious(found))
    offset = float(found.axis.get("offset", 0.0) or 0.0)
    fed = j if feed_inertia and not linear.answers_to_acceleration else 0.0
    tried = (*inertia_alone(found.model, fed), *settings_of(laws, drive, fed, GAINS))
    settings = [replace(setting, offset=offset) for setting in tried]
    # Each with the linear controller alone; then leads, the guard, the gains beyond and long rests.
    more = (
        (axes + 1) * (len(LEADS) + 1 + len(BEYOND)) + (confirm + 1) * (4 + len(BEYOND)) + long_rests(linear)
    )
    account = Account(progress, len(settings), axes + 1, more)
    refuse_endless(account.total, drive, axes, confirm)
    bench, others = (
        drawn(found, inertia, count, start_of_draws, Bench([], linear, drive, laws, account.one))
        for count, start_of_draws in ((axes, seed), (confirm, seed + 1))
    )
    first = held(found, bench.before(0), drive, inertia)
    told = of_more_axes(bench, others)
    rung = rings_alone(told, j, found.unit("N·m")) or hunts_alone(told, found.unit("N·m"))
    choice = picked(settings, bench, others, account)
    chosen = choice.chosen
    beside, hunts = (), ""
    if compensators:
        listed = any(isinstance(name, str) for name in compensators)
        belief = belief_of(found.model, drive, j) if listed else None
        beside = tried_beside(compensators, belief, bench, others, fed, offset)
        hunts = limit_cycle(chosen.setting.on(linear, laws[chosen.setting.law]), bench, 0) if chosen else ""
    account.end()
    result = Recommendation(
        chosen, laws[chosen.setting.law] if chosen else None, linear.numbers(),
        first.moving["position_rms_rad"], choice.margin, choice.unsafe_gain, choice.candidates, len(bench.plants),
        (), drive, rung, j, beside, hunts, better_than_simulated(drive.machine, found.train), choice.inertia_alone,
        choice.friction,
    )  # fmt: skip
    if chosen is None and result.instead is None:
        result = replace(result, why_none=why_refused(found, result.candidates, bench, others))
    warnings = [
        *on_motion(drive, found.unit("rad")), *axes_left_out(bench, others, found), *seconds_meant(drive),
        *hardly_damped_where_late(found, drive, j), *lag_of(bench.plants[0], first, linear, drive),
        *beyond_torque_limit([*bench.plants, *others.plants[1:]], drive),
        *(() if rung else unsure_at_rest(found, linear)),
    ]  # fmt: skip
    notes = [
        *sampled_as(drive, chosen, found.motion == "linear"), *warnings, *notes_on(found, result),
        *_reasons(found, result, bench, others), *interval_allows(found, result),
    ]  # fmt: skip
    comparisons = tuple(compared(result, first, bench, others))
    return replace(
        result,
        notes=tuple(notes),
        warnings=tuple(warnings),
        comparisons=comparisons,
        hunting=rest_words(told),
    )


def compared(result: Recommendation, first: Trial, bench: Bench, others: Bench) -> Iterator[Comparison]:
    """Run what is recommended on the best estimate and on the sampled axis with the most error left.

    `first` is the linear controller alone on the best estimate.
    """
    instead, chosen = result.instead, result.switched_on
    if instead is not None and instead.controller is not None:
        controller = instead.controller
        there = others if instead.confirmed else bench
    elif chosen is not None:
        controller = chosen.setting.on(bench.linear, bench.laws[chosen.setting.law])
        there = others
    else:
        yield Comparison("best estimate", first)
        return
    worst = max(range(len(result.errors)), key=lambda i: result.errors[i])
    axes = {"best estimate": (bench, 0)}
    if worst > 0:
        axes[f"worst of {len(result.errors) - 1} sampled axes"] = (there, worst)
    for name, (where, i) in axes.items():
        before, after = where.before(i), run(where.plants[i], controller, result.drive)
        if isinstance(before, Trial) and isinstance(after, Trial):
            yield Comparison(name, before, after)


def _reasons(found: Identified, result: Recommendation, bench: Bench, others: Bench) -> Iterator[str]:
    """Yield the attribute on which the error left depends, or the reason against compensation (of friction)."""
    chosen = result.switched_on
    if result.why_none:
        yield f"No compensator is recommended: {result.why_none}."
    if chosen is None:
        return
    yield from by_attribute(found, chosen, others.plants)
    if not chosen.setting.compensates:
        friction = [c for c in result.candidates if c.setting.compensates]
        why = "" if result.friction else why_refused(found, friction, bench, others)
        yield from beyond_inertia(chosen, result.friction, why)


def recommend_on(
    plants: Sequence[Plant],
    drive: Drive,
    laws: Mapping[str, Model],
    inertia: float,
    gains: Sequence[float] = GAINS,
) -> Recommendation:
    """As `recommend`, on machines that are measured so well that none is drawn: those of a commissioning.

    Parameters
    ----------
    plants : sequence of Plant
        The best estimate first; a setting must be safe on all: they are the guard.
    drive : Drive
        With a motion.
    laws : mapping of str to Model
        That may be switched on.
    inertia : float
        kg·m², that the linear controller is placed with and that is fed forward.
    gains : sequence of float
        That are tried.

    Returns
    -------
    Recommendation
        Its errors are those on the machines that the setting was picked on: no promise follows from them.

    Raises
    ------
    InputError
        If the linear controller alone cannot be simulated on the best estimate.
    """
    linear = drive.loop(inertia)
    bench = Bench(plants, linear, drive, laws)
    first = bench.before(0)
    if isinstance(first, str):
        raise InputError(
            f"the linear controller alone is unstable on the machine that was identified: {first}"
        )
    candidates = [bench.judged(s) for s in settings_of(laws, drive, inertia, gains)]
    # Every machine is as likely as the others.
    chosen, margin, unsafe_gain = best_of(candidates, lambda c: math.prod(c.errors)), math.nan, math.inf
    if chosen is not None:
        chosen = with_lead(chosen, bench)
        beyond = [bench.judged(replace(chosen.setting, gain=gain)) for gain in BEYOND]
        unsafe, safe = (
            [c.setting for c in (*candidates, *beyond) if bool(c.unsafe) is bad] for bad in (True, False)
        )
        margin, unsafe_gain = margin_of(chosen.setting, unsafe, safe)
        candidates += beyond
    return Recommendation(
        chosen, laws[chosen.setting.law] if chosen else None, linear.numbers(), first.moving["position_rms_rad"],
        margin, unsafe_gain, tuple(candidates), len(plants), (), drive, rings_alone(bench, inertia, "N·m"), inertia,
    )  # fmt: skip


def drawn(found: Identified, inertia: float | None, count: int, seed: int, empty: Bench) -> Bench:
    """The best estimate and `count` axes from the model's intervals, in place of the empty bench's; `inertia` is one
    that was given, kg·m²."""
    linear, drive, laws, ran = empty.linear, empty.drive, empty.laws, empty.ran
    own = drive.given  # Only of a loop that somebody runs is it known that it holds the axis.
    plants = plants_of(
        found, inertia_of(found, inertia), (TRIES if own else 1) * count, seed, float(drive.course.whole.position[0]),
        inertia is not None, drive.machine, drive.delay, drive.reference_velocity,
    )  # fmt: skip
    return (
        Bench.held(plants, count, linear, drive, laws, ran) if own else Bench(list(plants), linear, drive, laws, ran)
    )  # fmt: skip


def inertia_alone(model: Model, inertia: float) -> Iterator[Setting]:
    """The setting that feeds the inertia forward, kg·m², and compensates no friction; none without inertia."""
    if inertia > 0.0:
        yield Setting(model.law.name, "feedforward", 0.0, inertia_feedforward=inertia)


def settings_of(
    laws: Mapping[str, Model], drive: Drive, inertia: float, gains: Sequence[float]
) -> Iterator[Setting]:
    """All settings that are tried, each with this inertia fed forward, kg·m²."""
    for law in laws:
        for gain in gains:
            yield Setting(law, "feedforward", gain, inertia_feedforward=inertia)
        for deadband in (0.0, drive.deadband(DEADBAND)) if drive.encoder_counts else (0.0,):
            for gain in gains:
                yield Setting(law, "feedback", gain, deadband=deadband, inertia_feedforward=inertia)


@dataclass(frozen=True)
class Choice:
    """The setting to switch on, and what it was chosen among.

    Attributes
    ----------
    chosen : Candidate or None
    candidates : tuple of Candidate
        All, gains beyond the chosen one too.
    margin, unsafe_gain : float
        As of `Recommendation`.
    inertia_alone, friction : Candidate or None
        As of `Recommendation`.
    """

    chosen: Candidate | None
    candidates: tuple[Candidate, ...]
    margin: float = math.nan
    unsafe_gain: float = math.inf
    inertia_alone: Candidate | None = None
    friction: Candidate | None = None


def picked(settings: Sequence[Setting], bench: Bench, others: Bench, account: Account) -> Choice:
    """Choose what to switch on: the best setting that compensates friction, or the inertia feedforward alone if that is
    as good.

    Every setting is tried on the best estimate. Further axes are simulated only for those that may still be chosen, and
    for those whose safety is reported (`reported`).
    """
    tried = {setting: bench.judged(setting, 0.0) for setting in settings}
    compensating, without = (
        {s: c for s, c in tried.items() if s.compensates is kind} for kind in (True, False)
    )
    for some in (compensating, without):
        find_best(some, bench)
    account.tried(len(tried))
    friction, unsafe = confirmed(compensating, bench, others)
    alone, _ = confirmed(without, bench, others)
    tried |= without | compensating
    # Its errors on the axes of the confirmation, also where it is not to be switched on.
    there = next((others.judged(s) for s in settings if not s.compensates), None) if friction else alone
    if alone and not (friction and adds(friction, alone)):
        return Choice(alone, tuple(tried.values()), inertia_alone=alone, friction=friction)
    if friction is None:
        return Choice(None, tuple(tried.values()))
    tried |= {
        s: bench.judged(s) for s, c in tried.items() if not c.finished and reported(s, friction.setting)
    }
    unsafe += [c.setting for c in tried.values() if c.unsafe and c.refused_as is None]
    beyond = [on_both(replace(friction.setting, gain=gain), bench, others) for gain in BEYOND]
    unsafe += [c.setting for c in beyond if c.unsafe]
    guarded = replace(friction.setting, gain=GUARD * friction.setting.gain)  # it was insisted on
    safe = [guarded, *(c.setting for c in beyond if not c.unsafe)]
    margin, unsafe_gain = margin_of(friction.setting, unsafe, safe)
    return Choice(friction, (*tried.values(), *beyond), margin, unsafe_gain, there, friction)


def find_best(candidates: dict[Setting, Candidate], bench: Bench) -> Candidate | None:
    """Return the best of the candidates (`best_of`), and finish in `candidates` those that may be it.

    The error left on the axes so far is a lower bound of the worst one. A candidate whose bound is beyond `NEAR` times
    the least worst error of a finished one is not the best, whatever its remaining axes give.
    """
    while True:
        least = min((c.worst for c in candidates.values() if c.finished and not c.refused), default=math.inf)
        possible = [c for c in candidates.values() if not c.finished and c.worst <= NEAR * least]
        if not possible:
            return best_of([c for c in candidates.values() if c.finished])
        setting = min(possible, key=lambda c: c.worst).setting
        candidates[setting] = bench.judged(setting, NEAR * least)


def reported(setting: Setting, chosen: Setting) -> bool:
    """Whether the safety of a setting is part of the answer: that of higher gains (`margin_of`), and of feedback of all
    of the friction (`stickslip.recommendation.notes`)."""
    whole = setting.kind == "feedback" and setting.gain == 1.0
    return whole or (alike(setting, chosen) and setting.gain > chosen.gain)


def adds(friction: Candidate, alone: Candidate) -> bool:
    """Whether friction compensation leaves less than the inertia feedforward alone by more than `NEAR`, on the same
    axes: on the worst, or on half of them and as little on the worst."""
    if NEAR * friction.worst < alone.worst:
        return True
    return NEAR * friction.usual < alone.usual and friction.worst <= NEAR * alone.worst


def alike(one: Setting, other: Setting) -> bool:
    """Whether they differ at most in gain and lead."""
    return (one.law, one.kind, one.deadband) == (other.law, other.kind, other.deadband)


def margin_of(chosen: Setting, unsafe: Sequence[Setting], safe: Sequence[Setting]) -> tuple[float, float]:
    """The highest safe gain over the chosen one, below the lowest higher one that is not safe; and that one."""
    first = min((s.gain for s in unsafe if alike(s, chosen) and s.gain > chosen.gain), default=math.inf)
    last = max(s.gain for s in (chosen, *safe) if alike(s, chosen) and s.gain < first)
    return last / chosen.gain, first


def best_of(
    candidates: Sequence[Candidate], tie: Callable[[Candidate], float] = lambda c: c.worst
) -> Candidate | None:
    """Of the safe candidates with about the least worst error the one with the lowest gain, feedforward first; among
    those alike the one with the least `tie`."""
    safe = [c for c in candidates if not c.refused]
    near = (c for c in safe if c.worst <= NEAR * min(x.worst for x in safe))
    return min(near, key=lambda c: (c.setting.kind == "feedback", c.setting.gain, tie(c)), default=None)


def confirmed(
    candidates: dict[Setting, Candidate], bench: Bench, others: Bench
) -> tuple[Candidate | None, list[Setting]]:
    """Return the best candidate that is safe on other axes too, with its errors there, and the settings that are not.

    Those that are refused there are replaced in `candidates` by what they are refused for.
    """
    unsafe: list[Setting] = []
    while best := find_best(candidates, bench):
        final, where = insisted(with_lead(best, bench).setting, bench, others)
        if not final.refused:
            return final, unsafe
        if final.unsafe:
            unsafe.append(final.setting)
        candidates[best.setting] = replace(
            best,
            unsafe=tuple(Note(w + where, w) for w in final.unsafe),
            useless=final.useless,
            refused_as=final.setting,
        )
    return None, unsafe


def insisted(setting: Setting, bench: Bench, others: Bench) -> tuple[Candidate, str]:
    """The setting on other axes; or what is not safe, and where: that, or more of its gain here or there."""
    guarded, later = f" with {GUARD:g} times the gain", " on an axis sampled later"
    more = replace(setting, gain=GUARD * setting.gain)
    if (trial := bench.judged(more)).unsafe:
        return trial, guarded
    final = others.judged(setting)
    if final.unsafe:
        return final, later
    if final.useless:
        return replace(final, useless=final.useless + later), ""
    if ALLOWANCE * final.worst > 1.0:
        return replace(final, useless=UNSURE + later), ""
    if (trial := others.judged(more)).unsafe:
        return trial, guarded + later
    told = of_more_axes(bench, others)
    if hunts := hunts_with(setting.on(told.linear, told.laws[setting.law]), told):
        return replace(final, unsafe=(hunts,)), ""
    return final, ""


def of_more_axes(bench: Bench, others: Bench) -> Bench:
    """What is said of the linear controller alone is said by the confirmation's axes, if there are more of them: it is
    then the same however many the settings were chosen on."""
    return max(others, bench, key=lambda b: len(b.plants))


def with_lead(candidate: Candidate, bench: Bench) -> Candidate:
    """Return the candidate with the lead under which its worst error is least; the shortest of those alike.

    Every lead is tried on the worst axis of the shortest one first. If none is better there, none is better at all.
    """
    if candidate.setting.kind != "feedforward" or not candidate.setting.compensates:
        return candidate
    longer = [replace(candidate.setting, lead=n * bench.drive.sample_time) for n in LEADS[1:]]
    hardest = candidate.errors.index(candidate.worst)
    if all(candidate.worst <= ALIKE * bench.error_on(hardest, setting) for setting in longer):
        return candidate
    safe, least = [candidate], candidate.worst
    for setting in longer:
        # Beyond the least worst error, a longer lead is not taken.
        tried = bench.judged(setting, least)
        if tried.finished and not tried.unsafe:
            safe.append(tried)
            least = min(least, tried.worst)
    return next(c for c in safe if c.worst <= ALIKE * least)
