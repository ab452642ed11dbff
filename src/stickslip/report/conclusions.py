"""Conclusions of a study in a few sentences, for the start of its report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from stickslip.report._view import StudyView
from stickslip.report.captions import figure_of_merit, oscillates, ranking
from stickslip.studies.result import Run

MOST = 1000.0
"""Largest ratio of errors to print."""


def study_conclusion(view: StudyView, tally: Sequence[Mapping[str, Any]] = ()) -> list[str]:
    """Return sentences on the effect of compensation on error and oscillation, and on the statements.

    Parameters
    ----------
    view : StudyView
    tally : sequence of mapping
        ``count`` and ``words`` of the thesis's statements; empty for a study without any.
    """
    pairs: dict[str, list[tuple[float, float]]] = {}
    winners: list[str] = []
    runs: list[tuple[Run, bool]] = []
    for rule in view.rules:
        for reference in view.references:
            at_rest = view.reference_kind(reference) == "step"
            merit, _ = figure_of_merit(at_rest)
            for friction in view.frictions:
                group = view.group(rule, reference, friction)
                ranked = ranking(group, merit)
                winners += [r.controller for r in ranked[:1]]
                runs += [(r, oscillates(r, at_rest)) for r in group if not r.failure]
                best = [
                    next((r for r in ranked if bool(view.compensation(r.controller)) is kind), None)
                    for kind in (False, True)
                ]
                if best[0] is not None and best[1] is not None:
                    both = (best[0].metrics[merit], best[1].metrics[merit])
                    pairs.setdefault(friction, []).append(both)
    cases = (
        "cases (reference, friction and slip rule)"
        if len(view.rules) > 1
        else "cases (reference and friction)"
    )
    said = [helped([pair for own in pairs.values() for pair in own], cases)] if pairs else []
    if len(pairs) > 1:
        listed = ", ".join(f"{name} {number(middle_of(factors_of(own)))}" for name, own in pairs.items())
        said.append(
            f"Median improvement of the best compensator over the best linear controller, by friction: {listed}."
        )
    if winners:
        most = max(dict.fromkeys(winners), key=winners.count)
        said.append(f"Smallest error most often: {most}, in {winners.count(most)} of {len(winners)} {cases}.")
    said += _calm(view, runs)
    if tally:
        listed = ", ".join(f"{item['count']} {item['words'].removeprefix('statements ')}" for item in tally)
        said.append(f"Of the thesis's statements {listed}.")
    return said


def helped(pairs: Sequence[tuple[float, float]], cases: str) -> str:
    """Return a sentence that compares the best compensator's error with the best linear controller's.

    Parameters
    ----------
    pairs : sequence of (float, float)
        The errors of the best linear controller and of the best compensator, one pair a case.
    cases : str
        Description of the cases.
    """
    factors = factors_of(pairs)
    better = sum(f > 1.0 for f in factors)
    said = (
        f"The best friction compensator has a smaller error than the best linear controller in {better} of "
    )
    times = number(middle_of(factors))
    said += f"{len(factors)} {cases}; the linear controller's error is {times} times the compensator's"
    if len(factors) == 1:
        return f"{said}."
    return f"{said} in the median case ({number(factors[0])} to {number(factors[-1])})."


def factors_of(pairs: Sequence[tuple[float, float]]) -> list[float]:
    """Return the ratios of the pairs, first to second, in ascending order."""
    return sorted(a / b if b > 0.0 else math.inf for a, b in pairs)


def middle_of(factors: Sequence[float]) -> float:
    """Return their median; between two, the geometric mean."""
    n = len(factors)
    return factors[n // 2] if n % 2 else math.sqrt(factors[n // 2 - 1] * factors[n // 2])


def number(factor: float) -> str:
    """Return a factor as text, limited because an error may be nearly zero."""
    return f"{factor:.2g}" if factor <= MOST else f"more than {MOST:g}"


def _calm(view: StudyView, runs: Sequence[tuple[Run, bool]]) -> list[str]:
    """Return a sentence on the number of oscillating runs, with and without a compensator."""
    out: list[str] = []
    for kind, words in ((True, "with a compensator"), (False, "with a linear controller alone")):
        own = [moving for run, moving in runs if bool(view.compensation(run.controller)) is kind]
        if own:
            out.append(f"{sum(own)} of {len(own)} {words}")
    return [f"Runs that oscillate: {', '.join(out)}."] if out else []


def rig_conclusion(
    tally: Sequence[Mapping[str, Any]], mains: Mapping[str, tuple[int, int]], pairs: Sequence[tuple[float, float]]
) -> list[str]:  # fmt: skip
    """Return sentences that compare the experiments on virtual machines with the thesis.

    Parameters
    ----------
    tally : sequence of mapping
        ``count`` and ``words`` of its statements.
    mains : mapping of str to (int, int)
        Number of parts in which each main statement holds, and number of parts.
    pairs : sequence of (float, float)
        As in `helped`, one pair a machine, reference and linear controller.
    """
    listed = ", ".join(f"{item['count']} {item['words'].removeprefix('statements ')}" for item in tally)
    said = [f"Of the thesis's statements {listed}."] if tally else []
    whole = [text for text, (held, of) in mains.items() if held == of]
    part = [f"{text} ({held} of {of} parts)" for text, (held, of) in mains.items() if held < of]
    if whole:
        said.append(f"Main statements that hold wherever they were tested: {'; '.join(whole)}.")
    if part:
        said.append(f"Main statements that do not hold everywhere: {'; '.join(part)}.")
    if pairs:
        said.append(helped(pairs, "cases (machine, reference and linear controller)"))
    return said
