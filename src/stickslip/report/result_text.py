"""An identification in lines of text: the numbers, how far they hold, and the next command."""

from __future__ import annotations

import math

from stickslip.analyse.wording import ends
from stickslip.identify.estimate import Estimate, Identification
from stickslip.report.answers import Answers, meaning_of, one_number_each
from stickslip.report.next_steps import BY_A_RIG, Step

JUDGED = (
    "force_relative", "inverse_dynamics_relative", "position_", "drive_relative", "sliding_rms", "fall_missing",
    "rms_Nm", "rms_N", "slowest_sliding", "friction_rebuilt_within",
)  # fmt: skip
"""Misfits that sentences say, or that say little (the position of an open loop drifts); all are in `as_dict`."""


def result_lines(found: Identification, answers: Answers) -> list[str]:
    """Estimates with 95 % intervals, what is not identified and why, how far the torque is off, and what to do now."""
    steps = [measured(s) or f"next: {s.command}" for s in answers.steps]
    return [*numbers_and_trust(found, answers), *steps]


def measured(step: Step) -> str:
    """A step that is a record to make; nothing of another."""
    if step.command and not step.command.startswith(BY_A_RIG):
        return ""
    return f"measure next: {step.what} {step.command}".rstrip()


def result_lines_in_python(found: Identification, answers: Answers) -> list[str]:
    """The same, what to do now in Python where it can be done there."""
    steps = [f"next: {s.python}" if s.python else step_in_python(s) for s in answers.steps]
    return [*numbers_and_trust(found, answers), *steps]


def step_in_python(step: Step) -> str:
    """A step that has no function: a record to make, or a command of the shell."""
    if not measured(step):
        return f"next, in a shell: {step.command}"
    command = f"`{step.command}` in a shell" if step.command else ""
    return f"measure next: {step.what} {command}".rstrip()


def numbers_and_trust(found: Identification, answers: Answers) -> list[str]:
    """What was found, in lines."""
    law = f": law {found.model.law.name!r}" if found.model else ""
    out = [f"{found.method.replace('_', ' ')}{law}", ""]
    width = max([16, *(len(e.name) + 2 for e in (*found.estimates, *found.held))])
    meanings = meaning_of(found)
    for e in found.estimates:
        value = f"{'not determined':<40}" if e.undetermined else f"{e.value:>12.5g}  {interval_text(e):<26}"
        verdict = "identified" if e.identified else "not identified"
        out.append(f"{e.name:<{width}}{value} {e.unit:<11} {verdict:<16}{meanings[e.name]}".rstrip())
    for h in found.held:
        out.append(
            f"{h.name:<{width}}{h.value:>12.5g}  {'':<26} {h.unit:<11} {'given':<16}{meanings[h.name]}".rstrip()
        )
    out += ["", *one_number_each(found.estimates), f"trust: {answers.trust}", *answers.evidence]
    for name, number in found.misfit.items():
        if not any(name.removeprefix("held_out_").startswith(n) for n in JUDGED):
            out.append(f"{name:<32}{number:>12.5g}  {found.misfit_unit(name)}".rstrip())
    return [*out, *(sentence for sentence in found.notes if sentence not in answers.told)]


def interval_text(e: Estimate) -> str:
    """The 95 % interval."""
    if math.isnan(e.lower) or math.isnan(e.upper):
        return "[unknown]"
    return "[{}, {}]".format(*ends(e.value, e.lower, e.upper, ".5g"))
