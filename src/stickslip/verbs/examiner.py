"""The doctor of `identify`: an error ends it, what is odd about a log is told before anything is computed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding
from stickslip.core.messages import render
from stickslip.core.record import Record
from stickslip.identification.doctor import Diagnosis, examine, of_arrays
from stickslip.identification.doctor.steady_table import is_steady_table
from stickslip.identification.memo import EstimateSliding
from stickslip.readers.cut import pieces
from stickslip.readers.remembered import CODES
from stickslip.report.identified import Source
from stickslip.verbs.reading import Log, doctor_of, named


@dataclass(frozen=True)
class Examiner:
    """The doctor of `identify`: an error ends it."""

    accept: Sequence[str]
    estimate: EstimateSliding
    tell: Callable[[str], None]
    said: set[str] = field(default_factory=set[str])
    """Lines that were told."""

    def say(self, name: str, finding: Finding, record: Record) -> None:
        """Tell a finding of a log, once."""
        line = f"{name}: {render(finding.line(), arrays=of_arrays(record))}"
        if line not in self.said:
            self.said.add(line)
            self.tell(line)

    def warn(self, sources: Sequence[Source]) -> None:
        """Tell what it warns of."""
        for source in sources:
            for finding in source.findings:
                if finding.level == "warning":
                    self.say(source.about["file"] or source.name, finding, source.record)

    def pieces(self, record: Record, log: Log | None) -> list[Diagnosis]:
        """What it says of a record; several pieces where many rows in a row are left out. What a saved profile did is
        told first: an error may come of it."""
        for data in cast("list[dict[str, Any]]", record.meta.get("reading", {}).get("findings", [])):
            if data["code"] in CODES:
                self.say(named(log), Finding.from_data(data), record)
        parts, short = ([record], []) if is_steady_table(record) else pieces(record)
        every = [examine(part, accept=self.accept, estimate=self.estimate) for part in parts]
        for found in every:
            if found.errors:
                raise InputError(f"{named(log)}: {found.errors[0].line()}; see {doctor_of(log)}")
        return [replace(every[0], findings=(*every[0].findings, *short)), *every[1:]]
