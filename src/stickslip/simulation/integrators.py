"""Which integrator runs a case, and why a run of one ended."""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from stickslip.core.errors import (
    Divergence,
    EventStorm,
    InputError,
    ParameterError,
    SimulationError,
    StepFailure,
    UnknownName,
)
from stickslip.simulation import case_arrays
from stickslip.simulation.case_arrays import Case, Outcome
from stickslip.simulation.no_torque import no_torque

INTEGRATORS = ("exact", "adaptive", "sampled", "fixed")
"""In the order in which `integrator="auto"` tries them."""

MOST_STEPS = 1e9
"""Of a fixed length"""
NO_STEPS = (case_arrays.NO_STEP, case_arrays.TOO_STIFF, case_arrays.ROWS_FULL)
"""How a run ends that another integrator may well come through."""

REASONS: dict[int, tuple[type[SimulationError], str]] = {
    case_arrays.DIVERGED: (Divergence, "position or velocity left every reasonable bound"),
    case_arrays.NOT_FINITE: (Divergence, "the state is no longer a number"),
    case_arrays.STORM: (
        EventStorm,
        f"more than {case_arrays.STORM_EVENTS} switches within {case_arrays.STORM_TIME * 1e3:g} ms",
    ),
    case_arrays.NO_STEP: (StepFailure, "no step that meets the tolerance was found"),
    case_arrays.ROWS_FULL: (StepFailure, "the record is full"),
    case_arrays.TOO_STIFF: (
        StepFailure,
        "far more steps than a motion of its length takes",
    ),
    case_arrays.TOO_FAST: (
        StepFailure,
        "a part of the motion is so fast that its metrics take more than a million nodes of a single step; lower "
        "the controller's gains or bandwidth, or raise the inertia",
    ),
    case_arrays.NO_TORQUE: (Divergence, "the controller gave no finite number"),
}


class Choice(NamedTuple):
    """The integrator for a case: its name, its ``run``, and why those that "auto" tries before it cannot run it."""

    name: str
    run: Any
    refused: Mapping[str, str]


def integrator_for(case: Case, name: str = "auto") -> Choice:
    """That integrator, or the first that can run the case; `InputError` if none can."""
    if name != "auto":
        if name not in INTEGRATORS:
            raise UnknownName("integrator", name, (*INTEGRATORS, "auto"))
        module = importlib.import_module(f"stickslip.simulation.{name}.engine")
        if why := module.can_run(case):
            raise InputError(f"the {name} integrator cannot run this: {why}")
        return Choice(name, module.run, {})
    refused: dict[str, str] = {}
    if found := _first(case, refused):
        return found
    raise InputError(
        "no integrator can run this (" + "; ".join(f"{k}: {why}" for k, why in refused.items()) + ")"
    )


def _first(case: Case, refused: dict[str, str]) -> Choice | None:
    """The first integrator that is not `refused` and can run the case; those before it are added with what they say."""
    for candidate in (c for c in INTEGRATORS if c not in refused):
        module = importlib.import_module(f"stickslip.simulation.{candidate}.engine")
        why = module.can_run(case)
        if not why:
            return Choice(candidate, module.run, dict(refused))
        refused[candidate] = why
    return None


class Integrated(NamedTuple):
    """What ran a case, how it ended, and why not those that "auto" takes before it; where none came to the end, why not
    the others."""

    name: str
    outcome: Outcome
    refused: Mapping[str, str]


def integrated(case: Case, integrator: str, time_step: float) -> Integrated:
    """Run a case by that integrator; by "auto" with the next one that can where one finds no step.

    Where none comes to the end, the outcome is that of the one that came farthest.
    """
    first = integrator_for(case, integrator)
    if first.name == "fixed":
        _insist_on_time_step(case, time_step)
    runs = [_run(case, first, time_step)]
    refused = dict(first.refused)
    while integrator == "auto" and runs[-1].outcome.code in NO_STEPS:
        refused[runs[-1].name] = _ended(runs[-1].outcome)
        if (following := _first(case, refused)) is None:
            break
        if following.name == "fixed":
            # By now there is a record, which a time_step that is of no use must not lose.
            try:
                _insist_on_time_step(case, time_step)
            except ParameterError as error:
                refused[following.name] = str(error)
                break
        runs.append(_run(case, following, time_step))
    if runs[-1].outcome.code == case_arrays.DONE:
        return runs[-1]
    refused |= {r.name: _ended(r.outcome) for r in runs}
    farthest = max(runs, key=lambda r: r.outcome.time)
    return farthest._replace(refused={k: why for k, why in refused.items() if k != farthest.name})


def _ended(outcome: Outcome) -> str:
    return f"ended at {outcome.time:.6g} s: {REASONS[outcome.code][1]}"


def _run(case: Case, choice: Choice, time_step: float) -> Integrated:
    outcome: Outcome = choice.run(case, time_step) if choice.name == "fixed" else choice.run(case)
    return Integrated(choice.name, outcome, choice.refused)


def _insist_on_time_step(case: Case, time_step: float) -> None:
    insist_on_steps("time_step", time_step, float(case.numbers[case_arrays.DURATION]))


def without_tolerance(meta: Mapping[str, Any], time_step: float) -> str:
    """What is said where "auto" was left with fixed steps; else ""."""
    if meta["integrator"] != "fixed" or not (refused := meta.get("refused")):
        return ""
    why = refused.get("adaptive", next(iter(refused.values()))).split("; use the fixed")[0]
    return (
        f"the fixed integrator ran this, whose steps of {time_step:g} s keep no tolerance ({why}); compare with a "
        "tenth of the time_step"
    )


def insist_on_steps(name: str, step: float, duration: float) -> None:
    """Refuse more steps than a computer takes within an hour or so; every integrator bounds its own besides.

    Raises
    ------
    ParameterError
    """
    if not (step > 0.0 and duration / step <= MOST_STEPS):
        count = duration / step if step > 0.0 else math.inf
        raise ParameterError(
            f"simulate: {name} = {step:g} s makes {count:.3g} steps of {duration:g} s, {MOST_STEPS:g} at most; use a "
            "longer one or a shorter duration"
        )


def reason(case: Case, ran: Integrated) -> tuple[type[SimulationError], str]:
    """The error of a run that ended early, and why it did, with what to try that was not tried."""
    name, outcome, refused = ran
    kind, why = REASONS[outcome.code]
    if outcome.code == case_arrays.TOO_STIFF:
        why += _in_numbers(case, outcome)
    elif outcome.code in (case_arrays.DIVERGED, case_arrays.NOT_FINITE):
        why += f"; {calmed(case.controller.torque_limit, float(case.numbers[case_arrays.SAMPLE_TIME]))}"
    elif outcome.code == case_arrays.NO_TORQUE:
        period = float(case.numbers[case_arrays.SAMPLE_TIME])
        why = no_torque(case.controller, outcome.memory, outcome.time, period)
    if outcome.code not in NO_STEPS or name == "fixed":
        return kind, why
    remedies = [f"a tolerance above {case.numbers[case_arrays.TOLERANCE]:g} rad"]
    if case.numbers[case_arrays.SAMPLE_TIME] == 0.0:
        remedies += ['integrator="adaptive"'] if name == "exact" and "adaptive" not in refused else []
        if "fixed" not in refused:
            remedies.append("or use the fixed integrator")
        elif "time_step" in refused["fixed"]:
            remedies.append("or a longer time_step, with which fixed steps end")
    return kind, f"{why}; try {', '.join(remedies)}"


def calmed(torque_limit: float, sample_time: float) -> str:
    """What keeps a loop of that torque limit (N·m) and sample time (s; 0 in continuous time) from running away."""
    sooner = " or the sample time" if sample_time > 0.0 else ""
    limited = ", or give a torque limit" if math.isinf(torque_limit) else ""
    return f"lower the bandwidth{sooner}{limited}"


def _in_numbers(case: Case, outcome: Outcome) -> str:
    """What a run that took too many steps would have taken, and what to do."""
    steps = outcome.counts["steps"]
    duration = float(case.numbers[case_arrays.DURATION])
    whole = f"some {steps * duration / outcome.time:.2g}" if outcome.time > 0.0 else "no number of them"
    return (
        f", {steps:,} so far; at this pace {duration:g} s take {whole}: friction is too stiff for the inertia, or the "
        f"reference too fast; check them or give a shorter duration"
    )
