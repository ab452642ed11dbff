"""Print an identification as lines of text: the numbers, their reliability, and the next command."""

from __future__ import annotations

import math

from stickslip.analyse.wording import ends
from stickslip.identification.estimate import Estimate, Identification
from stickslip.report.answers import Answers, meaning_of, one_number_each
from stickslip.report.next_steps import BY_A_RIG, Step

JUDGED = (
    "force_relative", "inverse_dynamics_relative", "position_", "drive_relative", "sliding_rms", "fall_missing",
    "rms_Nm", "rms_N", "slowest_sliding", "friction_rebuilt_within",
)  # fmt: skip
"""Misfits that are stated in sentences, or are not informative (the position of an open loop drifts); all are in
`as_dict`."""


def result_lines(found: Identification, answers: Answers) -> list[str]:
    """Return estimates with 95 % intervals, numbers that are not identified with reasons, the torque error, and next
    steps."""
    steps = [measured(s) or f"next: {s.command}" for s in answers.steps]
    return [*numbers_and_trust(found, answers), *steps]


def measured(step: Step) -> str:
    """Return the text of a step that is a record to make, else nothing."""
    if step.command and not step.command.startswith(BY_A_RIG):
        return ""
    return f"measure next: {step.what} {step.command}".rstrip()


def result_lines_in_python(found: Identification, answers: Answers) -> list[str]:
    """Return the same with next steps in Python where possible."""
    steps = [f"next: {s.python}" if s.python else step_in_python(s) for s in answers.steps]
    return [*numbers_and_trust(found, answers), *steps]


def step_in_python(step: Step) -> str:
    """Return the text of a step without a function: a record to make, or a shell command."""
    if not measured(step):
        return f"next, in a shell: {step.command}"
    command = f"`{step.command}` in a shell" if step.command else ""
    return f"measure next: {step.what} {command}".rstrip()


def numbers_and_trust(found: Identification, answers: Answers) -> list[str]:
    """Return the results as lines."""
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
    """Return the 95 % interval as text."""
    if math.isnan(e.lower) or math.isnan(e.upper):
        return "[unknown]"
    return "[{}, {}]".format(*ends(e.value, e.lower, e.upper, ".5g"))
