"""Why statements on the thesis's experiments do not hold on the virtual machines, in the numbers of the runs.

A reason is a function of the runs of one variant. It states only what these runs show, and returns "" otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from stickslip.analyse.wording import quantity
from stickslip.thesis.checks import cases
from stickslip.thesis.evidence import QUANTITIES, Evidence

Reason = Callable[[Evidence], str]

SLOW = 30.0
"""Hz, below which an oscillation is a cycle of sticking and slipping; the machines' elastic modes are above 200 Hz."""


def _value(evidence: Evidence, name: str, case: str) -> str:
    return quantity(evidence(name, case), QUANTITIES[name].unit)


def _short(case: str) -> str:
    return case.rpartition("/")[2]


def _listed(evidence: Evidence, name: str, names: Sequence[str]) -> str:
    return ", ".join(f"{_short(case)} {_value(evidence, name, case)}" for case in names)


def already_oscillates(alone: str, name: str = "shake") -> Reason:
    """The linear controller alone already oscillates, on the elastic drivetrain."""

    def reason(evidence: Evidence) -> str:
        at = evidence("strongest", alone)
        if at < SLOW:
            return ""
        return (
            f"{_short(alone)} alone oscillates at {at:.0f} Hz on the elastic drivetrain, with "
            f"{_value(evidence, name, alone)} RMS; its error is {_value(evidence, 'rms', alone)} RMS."
        )

    return reason


def calm_feedback(run: str, alone: str, name: str = "shake") -> Reason:
    """Feedback oscillates less than expected: it calms the linear controller's oscillation, or sticks and slips."""

    def reason(evidence: Evidence) -> str:
        at, mode = evidence("strongest", run), evidence("strongest", alone)
        here, there = _value(evidence, name, run), _value(evidence, name, alone)
        if evidence(name, run) < evidence(name, alone):
            return f"{_short(run)} calms the {mode:.0f} Hz of {_short(alone)}: {here} instead of {there} RMS."
        if at >= SLOW:
            return ""
        return (
            f"{_short(run)} sticks and slips at {at:.2g} Hz, away from the {mode:.0f} Hz of {_short(alone)}."
        )

    return reason


def filter_lags(group: str, name: str = "shake") -> Reason:
    """A cycle as slow as the filter's own lag is left."""
    run = f"{group}/FB-gms10"

    def reason(evidence: Evidence) -> str:
        at = evidence("strongest", run)
        if at >= SLOW:
            return ""
        return f"Behind the filter a slow cycle is left, {_value(evidence, name, run)} RMS, strongest at {at:.2g} Hz."

    return reason


def slow_cycle(run: str, name: str = "shake") -> Reason:
    """Feedback leaves a cycle of sticking and slipping."""

    def reason(evidence: Evidence) -> str:
        at = evidence("strongest", run)
        return f"{_short(run)} cycles at {at:.2g} Hz, {_value(evidence, name, run)} RMS." if at < SLOW else ""

    return reason


def better(name: str, group: str, laws: str, than: str) -> Reason:
    """Which of the laws are better, and which not, than another one in feedforward."""
    (rival,) = cases(group, "FF", than)

    def reason(evidence: Evidence) -> str:
        limit = evidence(name, rival)
        names = cases(group, "FF", laws)
        ahead = [c for c in names if evidence(name, c) < limit]
        if not ahead:
            return ""
        share = 100.0 * (1.0 - min(evidence(name, c) for c in ahead) / limit)
        label = QUANTITIES[name].label
        return (
            f"{' and '.join(map(_short, ahead))}: less {label} than {_short(rival)}, by up to {share:.2g} %."
        )

    return reason


def excess(group: str) -> Reason:
    """By how much LuGre's error exceeds Stribeck's over the period, and what it is near zero velocity."""
    lugre, stribeck = cases(group, "FF", "lugre stribeck")

    def reason(evidence: Evidence) -> str:
        more = 100.0 * (evidence("rms", lugre) / evidence("rms", stribeck) - 1.0)
        if more <= 0.0:
            return ""
        near = evidence("near", lugre) < evidence("near", stribeck)
        found = f"The error of LuGre over the period is {more:.2g} % above Stribeck's"
        values = _listed(evidence, "near", (lugre, stribeck))
        return f"{found}; near zero velocity it is {'smaller' if near else 'greater'} ({values})."

    return reason


def dynamic_ahead(group: str) -> Reason:
    """Which dynamic laws are better near zero velocity than both static ones."""

    def reason(evidence: Evidence) -> str:
        limit = min(evidence("near", c) for c in cases(group, "FF", "coulomb stribeck"))
        ahead = [c for c in cases(group, "FF", "lugre gms") if evidence("near", c) < limit]
        which = f"only {_short(ahead[0])}" if ahead else "no dynamic law"
        return f"Near zero velocity {which} is better than both static laws."

    return reason


def integral_removes(group: str) -> Reason:
    """The integral action removes an error that feedforward leaves."""

    def reason(evidence: Evidence) -> str:
        pid, least = (
            f"{group}/PID",
            min(cases(group, "FF", "stribeck lugre gms"), key=lambda c: evidence("rms", c)),
        )
        if evidence("rms", pid) >= evidence("rms", least):
            return ""
        return f"The integral action removes error that feedforward leaves: {_listed(evidence, 'rms', (pid, least))}."

    return reason


def least_oscillation(group: str, expected: str) -> Reason:
    """Which feedback oscillates less than the one that is expected to oscillate least."""
    case = f"{group}/FB-{expected}"

    def reason(evidence: Evidence) -> str:
        limit = evidence("shake", case)
        less = [c for c in cases(group, "FB") if evidence("shake", c) < limit]
        if not less:
            return ""
        share = 100.0 * (1.0 - min(evidence("shake", c) for c in less) / limit)
        return f"{' and '.join(map(_short, less))} oscillates up to {share:.2g} % less than {_short(case)}."

    return reason


def not_stuck(group: str) -> Reason:
    """Which laws in feedforward never stop the axis away from the reversals, and for how long the others do."""

    def reason(evidence: Evidence) -> str:
        shares = {c: 100.0 * evidence("sticking", c) for c in cases(group, "FF")}
        never = [_short(c) for c, share in shares.items() if share == 0.0]
        if not never:
            return ""
        others = ", ".join(f"{_short(c)} {share:.2g} %" for c, share in shares.items() if share)
        found = f"Away from the reversals the axis never stops with {', '.join(never)}"
        return f"{found}; part of the time stuck with the others: {others}." if others else f"{found}."

    return reason


def steady_errors(group: str, laws: str) -> Reason:
    """Which laws reduce the steady-state error of the linear controller alone, and which do not."""
    alone = f"{group}/PID"

    def reason(evidence: Evidence) -> str:
        limit = evidence("steady", alone)
        names = cases(group, "FF", laws)
        less = [c for c in names if evidence("steady", c) < limit]
        more = [c for c in names if c not in less]
        parts = [f"PID alone ends {_value(evidence, 'steady', alone)} away"]
        parts += [f"less with {_listed(evidence, 'steady', less)}"] if less else []
        parts += [f"not with {_listed(evidence, 'steady', more)}"] if more else []
        return "; ".join(parts) + "."

    return reason


def mode_at(case: str) -> Reason:
    """The mode of the machine's drivetrain is where its assumed inertias put it."""
    return lambda evidence: (
        f"The loop oscillates at {evidence('strongest', case):.0f} Hz with the assumed inertias of the drivetrain; the "
        "thesis prints none."
    )


LOW, HIGH, HIGH_PID, STEP, STEP_PID = (
    f"dry-{name}" for name in ("low-PD36", "high-PD10", "high-PID10", "step-PD35", "step-PID10")
)
GREASE_LOW, GREASE_HIGH, GREASE_HIGH_PID = (
    f"grease-{name}" for name in ("low-PD25", "high-PD10", "high-PID10")
)
GREASE_LOW_PID, GREASE_STEP_PID = "grease-low-PID10", "grease-step-PID10"
WHY: dict[str, Reason] = {
    **dict.fromkeys(
        ("dry-low-deformed", "dry-low-dynamic", "dry-low-closer", "dry-low-alike", "dry-low-PID-more", "51-low"),
        already_oscillates(f"{LOW}/PD"),
    ),
    "dry-step-PD": already_oscillates(f"{STEP}/PD", "late shake"),
    "dry-low-FB-gms": calm_feedback(f"{LOW}/FB-gms", f"{LOW}/PD"),
    "dry-low-FB-gms-worst": calm_feedback(f"{LOW}/FB-gms", f"{LOW}/PD"),
    "dry-step-FB-gms": calm_feedback(f"{STEP}/FB-gms", f"{STEP}/PD", "late shake"),
    "dry-low-FB-gms10": filter_lags(LOW),
    "grease-low-FB-gms10": filter_lags(GREASE_LOW),
    "grease-high-FB-gms10": filter_lags(GREASE_HIGH),
    "dry-high-dynamic": dynamic_ahead(HIGH),
    "dry-high-FF-nonzero": not_stuck(HIGH),
    "grease-high-FF-nonzero": not_stuck(GREASE_HIGH),
    "dry-high-FB-smoother": slow_cycle(f"{HIGH}/FB-lugre"),
    "dry-high-PID10-FB-lugre": slow_cycle(f"{HIGH_PID}/FB-lugre"),
    "dry-step-PID10-FB-lugre": slow_cycle(f"{STEP_PID}/FB-lugre", "late shake"),
    "grease-low-dynamic": excess(GREASE_LOW),
    "grease-low-lugre": better("near", GREASE_LOW, "coulomb stribeck gms", "lugre"),
    "grease-low-order": better("rms", GREASE_LOW, "coulomb stribeck gms", "lugre"),
    "grease-low-PID10-lugre": better("rms", GREASE_LOW_PID, "coulomb stribeck gms", "lugre"),
    "grease-high-lugre": better("rms", GREASE_HIGH, "coulomb stribeck gms", "lugre"),
    "grease-high-PID10-lugre": better("near", GREASE_HIGH_PID, "coulomb stribeck gms", "lugre"),
    "grease-high-PID": integral_removes(GREASE_HIGH),
    "grease-high-PID10-FB": least_oscillation(GREASE_HIGH_PID, "coulomb"),
    "grease-step-PID10-steady": steady_errors(GREASE_STEP_PID, "coulomb lugre gms"),
    "45-PD36": mode_at(f"{LOW}/PD"),
    "45-PID25": mode_at(f"{GREASE_LOW}/PID"),
}  # fmt: skip
"""By the statement's id."""
