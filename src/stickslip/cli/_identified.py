"""What `stickslip identify` prints of a result: the numbers in words, how far they hold, and the next command."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stickslip.identify.estimate import Estimate, Identification
    from stickslip.report.answers import Answers

__all__ = ["show"]

JUDGED = ("force_relative", "inverse_dynamics_relative", "position_", "rms_Nm", "rms_N")
"""Misfits that sentences say, or that say little (the position of an open loop drifts); all are in --json."""


def show(found: Identification, answers: Answers | None = None) -> None:
    """Estimates with 95 % intervals, what is not identified and why, how far the torque is off, and what to do now."""
    from stickslip.report.answers import answers_of, meaning_of, one_number_each

    answers = answers_of(found, []) if answers is None else answers
    law = f": law {found.model.law.name!r}" if found.model else ""
    print(f"{found.method.replace('_', ' ')}{law}\n")
    width = max(16, *(len(e.name) + 2 for e in found.estimates)) if found.estimates else 16
    meanings = meaning_of(found)
    for e in found.estimates:
        value = f"{'not determined':<40}" if e.undetermined else f"{e.value:>12.5g}  {interval(e):<26}"
        verdict = "identified" if e.identified else "not identified"
        print(f"{e.name:<{width}}{value} {e.unit:<11} {verdict:<16}{meanings[e.name]}".rstrip())
    print()
    for line in one_number_each(found.estimates):
        print(line)
    print(f"trust: {answers.trust}")
    for line in answers.evidence:
        print(line)
    for name, number in found.misfit.items():
        if not any(name.removeprefix("held_out_").startswith(n) for n in JUDGED):
            print(f"{name:<32}{number:>12.5g}  {found.misfit_unit(name)}".rstrip())
    for sentence in found.notes:
        if sentence not in answers.told:
            print(sentence)
    for step in answers.steps:
        print(f"next: {step.command}" if step.command else f"measure next: {step.what}")


def interval(e: Estimate) -> str:
    """The 95 % interval."""
    if math.isnan(e.lower) or math.isnan(e.upper):
        return "[unknown]"
    return f"[{e.lower:.5g}, {e.upper:.5g}]"
