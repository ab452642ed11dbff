"""What the report says of how the study was done."""

from __future__ import annotations

from stickslip.report._view import StudyView
from stickslip.thesis.edition import SLIP, Note

__all__ = ["notes"]

READING = Note(
    "Reading the metrics",
    "A standstill is |v| below 1e-3 rad/s for at least 10 ms while |v_d| is above 2e-3 rad/s. Reversals are sign "
    "changes of the velocity through a trigger of ±1e-3 rad/s. A limit cycle has at least 5 periods in the last "
    "40 % whose amplitudes and periods spread by less than 5 %. Settling is the entry for good into 2 % of the "
    "step. The steady-state error is the mean over the last 20 %.",
)


def notes(view: StudyView) -> list[Note]:
    """The notes that apply to a study."""
    edition = view.edition
    ruled = () if edition.before or view.rules == ["signed"] else (SLIP,)
    return [*edition.before, *ruled, *starts(view), *edition.after, READING, *edition.last]


def starts(view: StudyView) -> list[Note]:
    """Which runs depend on their start, if any do."""
    named = [run.key for run in view.runs.values() if run.depends_on_start]
    text = (
        "From an initial position shifted by 1e-9 rad, these runs take another branch of the motion, and their "
        "metrics are those of "
        f"one branch: {', '.join(named)}."
    )
    return [Note("Runs that depend on their start", text)] if named else []
