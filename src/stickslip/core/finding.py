"""What a check found in the user's data: one line that says what, where, and what to do about it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from stickslip.core.messages import render

Level = Literal["error", "warning", "note"]

LEVELS: tuple[Level, ...] = ("error", "warning", "note")
"""Worst first. An error makes the data unusable, a warning makes a result doubtful, a note is good to know."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing found in a record or in the file it comes from.

    Attributes
    ----------
    level : {"error", "warning", "note"}
    code : str
        Stable name of the kind of finding, such as "duplicate-time": what programs and tests ask for.
    message : str
        What was found, with numbers and units.
    where : str
        Time or row, such as "t = 1.25 s" or "row 17"; rows count the samples from 1. Empty: the whole record.
    remedy : str
        What the user can do about it.
    """

    level: Level
    code: str
    message: str
    where: str = ""
    remedy: str = ""

    def rendered(self, arrays: bool = False) -> Finding:
        """Return the finding written for its reader; `arrays`: of signals that were given as arrays."""
        return replace(
            self, message=render(self.message, arrays=arrays), remedy=render(self.remedy, arrays=arrays)
        )

    def line(self) -> str:
        """The finding in one line, without its level."""
        text = f"{self.message} ({self.where})" if self.where else self.message
        return f"{text}; {self.remedy}" if self.remedy else text

    def as_data(self) -> dict[str, Any]:
        """Plain data, as JSON holds it."""
        return asdict(self)

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Finding:
        """The finding that `as_data` wrote."""
        return cls(**{str(key): value for key, value in data.items()})


def times(count: int) -> str:
    """Return how often something occurs, in words: "once", "3 times"."""
    return "once" if count == 1 else f"{count} times"


def sorted_findings(findings: Iterable[Finding]) -> list[Finding]:
    """Errors first, then warnings, then notes; in the order found otherwise."""
    return sorted(findings, key=lambda finding: LEVELS.index(finding.level))
