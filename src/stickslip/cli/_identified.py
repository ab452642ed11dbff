"""What `stickslip identify` and `stickslip rig` print of a result."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stickslip.identify.estimate import Identification
    from stickslip.report.answers import Answers

__all__ = ["show"]


def show(found: Identification, answers: Answers | None = None) -> None:
    """The lines of `stickslip.report.result_text`."""
    from stickslip.report.answers import answers_of
    from stickslip.report.result_text import result_lines

    for line in result_lines(found, answers_of(found, []) if answers is None else answers):
        print(line)
