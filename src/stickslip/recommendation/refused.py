"""Reason why no compensator is recommended, with its numbers and the remedy.

The closest candidate determines it: the best one that failed the confirmation, else the one that passes most axes. It
is run on every sampled axis, and the attribute that separates the failed axes is named.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from stickslip.core.messages import code_of, name_option
from stickslip.identification.identified_file import Identified
from stickslip.machines.rigid import RigidAxis
from stickslip.recommendation.candidate_run import AT_REST, IN_MOTION, LARGER, LEFT, ROUGH_MOTION
from stickslip.recommendation.candidates import AFTER_A_PUSH, WORTH, Bench, Candidate, Setting
from stickslip.recommendation.long_rest import HUNTS
from stickslip.recommendation.recommendation import ALLOWANCE
from stickslip.recommendation.separation import separate

CALMER = (
    f"lower the gains of the loop ({name_option('bandwidth')}, {name_option('loop')}), shorten its sample "
    "time, or use a finer encoder"
)
REMEDIES = {
    AT_REST: CALMER, AFTER_A_PUSH: CALMER, IN_MOTION: CALMER, ROUGH_MOTION: CALMER,
    LARGER: "leave compensation off for this loop and motion, or give the motion that matters "
        f"({name_option('motion')})",
    HUNTS: "lower the integral gain, or hold the integral while the error is small",
    LEFT: f"check the gains of the loop and the inertia ({name_option('inertia')})",
}  # fmt: skip
"""Remedy, by reason."""
NOT_FRICTION = (
    "most of the error left is not caused by the friction of the model; leave compensation off, or give the motion "
    f"that matters ({name_option('motion')})"
)
NARROWER = "identify a record that narrows the intervals of the model (measure_next in its file)"


def closest(candidates: Sequence[Candidate]) -> Candidate | None:
    """Return the candidate that comes closest to a recommendation; None if none was tried.

    First those that failed the confirmation, then those that pass on the best estimate, then those that pass most axes,
    then those with the smallest error.
    """
    return min(
        candidates,
        key=lambda c: (c.refused_as is None, _bad(c.errors[0], c.unsafe if len(c.errors) == 1 else ()),
                       -len(c.errors), c.errors[0] if c.unsafe else c.worst),
        default=None,
    )  # fmt: skip


def why_refused(found: Identified, candidates: Sequence[Candidate], bench: Bench, others: Bench) -> str:
    """Return why the closest candidate is refused, and what to do: one sentence without a full stop."""
    best = closest(candidates)
    if best is None:
        return "no candidate was tried"
    setting = best.refused_as or best.setting
    name = f"{setting.words}{_guarded(best)}"
    if best.refused_as is None and len(best.errors) == 1 and len(bench.plants) > 1:
        return f"the closest candidate ({name}) is refused on the best estimate already: {_on_one(best)}"
    plants, errors, unsafe = on_every_axis(setting, bench, others)
    bad = [_bad(e, u) for e, u in zip(errors, unsafe, strict=True)]
    if not any(bad):  # It failed for another reason: the long rest after the motion.
        said = best.refused[0]
        return f"the closest candidate ({name}) {said}; {remedy_of(said)}"
    kinds = [word for u in unsafe for word in u]
    decided = max(kinds, key=kinds.count) if kinds else ""
    what = decided or f"more than {100.0 / ALLOWANCE:.0f} % of the error left"
    worst = max(e for e, b in zip(errors, bad, strict=True) if b)
    left = "" if math.isinf(worst) else f" (up to {100.0 * worst:.0f} % of the error left)"
    if not decided:
        left += f", and {ALLOWANCE:g} times as much is allowed for what is not simulated"
    said = f"the closest candidate ({name}) is refused on {sum(bad)} of {len(bad)} axes: {what}{left}"
    if (split := separate(found, plants[1:], bad[1:])) is not None:
        return f"{said}; {split.words}: {split.remedy}"
    if all(bad):
        return f"{said}; {remedy_of(decided)}"
    remedy = remedy_of(decided) if decided else NARROWER
    return f"{said}; no single sampled attribute separates these axes from the others: {remedy}"


def on_every_axis(
    setting: Setting, bench: Bench, others: Bench
) -> tuple[list[RigidAxis], list[float], list[tuple[str, ...]]]:
    """Return all axes of both benches, the best estimate first, with the error left and the dangers on each."""
    here, there = list(bench.every(setting)), list(others.every(setting))[1:]
    results = [*here, *there]
    plants = [*bench.plants, *others.plants[1:]]
    return plants, [e for e, _ in results], [u for _, u in results]


def remedy_of(reason: str) -> str:
    """Return what to do about a reason."""
    return REMEDIES.get(code_of(reason) or reason, NOT_FRICTION)


def _bad(error: float, unsafe: Sequence[str]) -> bool:
    """Whether the result on one axis forbids a setting."""
    return bool(unsafe) or ALLOWANCE * error > 1.0


def _guarded(best: Candidate) -> str:
    """Return the gain at which the setting is refused, if it is not its own; else an empty text."""
    decided = best.refused_as
    if decided is None or decided.gain == best.setting.gain:
        return ""
    return f", {decided.gain / best.setting.gain:.3g} times the gain to be recommended"


def _on_one(best: Candidate) -> str:
    """Return the result on the best estimate, and the remedy."""
    error = best.errors[0]
    left = "" if math.isinf(error) else f", {100.0 * error:.1f} % of the error left"
    if best.unsafe:
        return f"{best.unsafe[0]}{left}; {remedy_of(best.unsafe[0])}"
    return f"more than {100.0 * WORTH:g} % of the error left{left}; {NOT_FRICTION}"
