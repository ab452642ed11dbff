"""What the report says of how the study was done: the thesis's open points and how they were closed."""

from __future__ import annotations

from dataclasses import dataclass

from stickslip.report._view import StudyView, is_thesis

__all__ = ["Note", "notes"]


@dataclass(frozen=True)
class Note:
    """A paragraph with a heading."""

    title: str
    text: str


SLIP = Note(
    "From stick to slip",
    "Eq. 2.17 lets an element slip when |F_i| > α_i s(v). Read literally, an element may slip while its force "
    "pushes with the motion: after a fast reversal s(v) falls faster than |F_i|, and friction feeds energy in "
    "for about 12 ms. The signed rule, slip when sign(v) F_i ≥ α_i s(v), is passive. Both agree in open loop and "
    "with PD, PID, and feedforward by LuGre and GMS; they differ most in feedback compensation by Coulomb, "
    "Stribeck and LuGre.",
)
STEP = Note(
    "The step",
    "The thesis gives its step only as a picture. With an ideal step the desired velocity is zero and every "
    "feedforward run is the PD run, against the text. The step here passes through a critically damped filter, "
    "θ_d = A (1 − (1 + t/τ) exp(−t/τ)) with A = 0.01 rad and τ = 0.02 s. The profile was chosen because it shows "
    "what the text says of feedforward on the step; those statements are no independent evidence.",
)
SIGN = Note(
    "Sign feedback",
    "Feedback by Coulomb and Stribeck switches with the sign of the measured velocity. The limit in continuous "
    "time is exact here, with no boundary layer and no sampling. At v = 0 the start lies on a repelling "
    "discontinuity, so that 1e-9 rad can decide the first direction: orderings within one per cent of such runs "
    "mean nothing.",
)
MISSING = Note(
    "Figures that are not here",
    "Figures 3.7 and 3.8 (curve fitting) belong to the identification. Figures 3.1 to 3.4, 3.6 and 3.9 are "
    "schematics and block diagrams.",
)
NUMERICS = Note(
    "Numerics",
    "Gains come from eqs. 3.10 and 3.15, not from the rounded tables; runs start at rest with all elements "
    "sticking; controllers act in continuous time unless a sample time is given. Metrics are accumulated inside "
    "the integrators, not from the records' grid.",
)
READING = Note(
    "Reading the metrics",
    "A standstill is |v| below 1e-3 rad/s for at least 10 ms while |v_d| is above 2e-3 rad/s. Reversals are sign "
    "changes of the velocity through a trigger of ±1e-3 rad/s. A limit cycle has at least 5 periods in the last "
    "40 % whose amplitudes and periods spread by less than 5 %. Settling is the entry for good into 2 % of the "
    "step. The steady-state error is the mean over the last 20 %.",
)


def notes(view: StudyView) -> list[Note]:
    """The notes that apply to a study."""
    if is_thesis(view.result):
        return [SLIP, STEP, SIGN, *starts(view), NUMERICS, READING, MISSING]
    return [*([] if view.rules == ["signed"] else [SLIP]), *starts(view), READING]


def starts(view: StudyView) -> list[Note]:
    """Which runs depend on their start, if any do."""
    named = [run.key for run in view.runs.values() if run.depends_on_start]
    text = (
        "From a start 1e-9 rad beside, these runs take another branch of the motion, and their metrics are those of "
        f"one branch: {', '.join(named)}."
    )
    return [Note("Runs that depend on their start", text)] if named else []
