"""The thesis's figure numbers."""

from __future__ import annotations

__all__ = ["motion_number", "result_number"]

REFERENCES, FRICTIONS, KINDS = (
    ("low", "high", "step"),
    ("nominal", "plus10", "minus10"),
    ("feedforward", "feedback"),
)


def result_number(reference: str, friction: str, kind: str) -> str:
    """Figures 3.21 to 3.38: friction by friction, reference by reference, feedforward then feedback."""
    if reference not in REFERENCES or friction not in FRICTIONS or kind not in KINDS:
        return ""
    place = 6 * FRICTIONS.index(friction) + 2 * REFERENCES.index(reference) + KINDS.index(kind)
    return f"3.{21 + place}"


def motion_number(reference: str) -> str:
    """Figures 3.15 to 3.17: the references."""
    return f"3.{15 + REFERENCES.index(reference)}" if reference in REFERENCES else ""
