"""The doctor: checks for defects of a record before anything is identified from it.

`CHECKS` lists every check; each yields findings and changes nothing. To add one, write a function of a `View` in the
file of its family and add it to the tuple.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import Any, cast

import numpy as np

from stickslip.core.arguments import arguments_checked
from stickslip.core.errors import InputError, UnknownName
from stickslip.core.finding import Finding, sorted_findings
from stickslip.core.record import Record
from stickslip.identification.doctor import (
    by_profile,
    change,
    excitation,
    magnitude,
    physics,
    play,
    signals,
    spikes,
    timing,
    units,
    velocity,
)
from stickslip.identification.doctor.steady_table import examine_table, is_steady_table
from stickslip.identification.doctor.view import View
from stickslip.identification.memo import EstimateSliding
from stickslip.identification.sliding import estimate_sliding
from stickslip.readers.cut import range_words, taken

FINAL = ("too-short", "no-clock", "too-small")
"""Errors after which nothing can be computed."""
ERRORS = (
    *FINAL, "ambiguous-column", "backward-time", "duplicate-time", "missing-column", "mixed-units", "nan",
    "never-moved", "no-torque", "position-reference-unit", "position-unit", "position-wrap", "time-unit", "torque-sign",
    "torque-magnitude", "torque-unit", "unknown-unit", "velocity-mismatch", "velocity-sign", "velocity-unit",
)  # fmt: skip
"""Codes of errors that may make a record unusable, including those of its reading."""
FIRST: tuple[Callable[[View], Iterator[Finding]], ...] = (
    excitation.channels, signals.missing, signals.too_small, timing.ascending, timing.sampling,
)  # fmt: skip
"""Checks that apply to any record; the others require enough usable rows."""
CHECKS: tuple[Callable[[View], Iterator[Finding]], ...] = (
    *FIRST, timing.scale, velocity.velocity_late, units.assumed, units.counted,
    units.degrees, units.turns, units.reference_scale, velocity.velocity_scale, units.too_fast, units.torque_scale,
    spikes.spikes, signals.wrapped, signals.repeated, signals.saturated, signals.supply, signals.quantised,
    magnitude.unsigned,
    physics.sign, physics.skew, physics.gravity, play.backlash, change.changes, change.temperature, excitation.moved,
)  # fmt: skip


CONSEQUENCES = {
    "position-wrap": (
        "torque-sign", "velocity-sign", "velocity-mismatch", "time-skew", "torque-timing", "gravity", "offset",
        "change", "backlash", "less-than-a-revolution", "no-reversal", "spikes",
    ),
    "torque-magnitude": (
        "torque-sign", "time-skew", "torque-timing", "gravity", "offset", "change", "backlash",
    ),
    "duplicate-time": (
        "torque-sign", "velocity-mismatch", "velocity-unit", "time-skew", "torque-timing", "change", "backlash",
        "irregular-sampling", "gap", "spikes", "position-jump",
    ),
}  # fmt: skip
"""Consequences of an error: findings that are meaningless before it is repaired and whose own remedies are wrong."""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The doctor's findings on a record.

    Attributes
    ----------
    findings : tuple of Finding
        Errors first; includes those of the reading.
    record : Record
        The usable rows: times increase and values are finite. The findings list the rows left out.
    """

    findings: tuple[Finding, ...]
    record: Record

    def __post_init__(self) -> None:
        arrays = of_arrays(self.record)
        object.__setattr__(self, "findings", tuple(f.rendered(arrays) for f in self.findings))

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings that make the record unusable."""
        return tuple(f for f in self.findings if f.level == "error")

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings that make a result doubtful."""
        return tuple(f for f in self.findings if f.level == "warning")

    def __str__(self) -> str:
        lines = [f"{f.level:<8}{f.code:<24}{f.line()}" for f in self.findings]
        return "\n".join([*lines, f"{len(self.errors)} errors, {len(self.warnings)} warnings"])

    def _repr_html_(self) -> str:
        """Return a table for a notebook."""
        rows = "".join(
            f"<tr><td>{f.level}</td><td>{escape(f.code)}</td><td>{escape(f.line())}</td></tr>"
            for f in self.findings
        )
        tally = f"<p>{len(self.errors)} errors, {len(self.warnings)} warnings in {len(self.record)} usable rows</p>"
        return f"<table><tbody>{rows}</tbody></table>{tally}"

    @arguments_checked
    def raise_for_errors(self, name: str = "the record") -> None:
        """Refuse an unusable record.

        Raises
        ------
        InputError
            With the first error and the number of others.
        """
        if self.errors:
            first, *others = self.errors
            more = f" (and {len(others)} more errors: the doctor lists them)" if others else ""
            raise InputError(f"{name}: {first.line()}{more}")


def of_arrays(record: Record) -> bool:
    """Return whether the signals were given as arrays by name: they have units and no columns."""
    reading: dict[str, Any] = record.meta.get("reading", {})
    sources = {c["source"] for c in reading.get("columns", ())}
    return not reading.get("file") and sources == {"map"}


def examine(
    record: Record, *, stribeck_velocity: float | None = None, accept: Sequence[str] = (),
    estimate: EstimateSliding = estimate_sliding,
) -> Diagnosis:  # fmt: skip
    """Check a record for defects that would spoil an identification.

    Parameters
    ----------
    record : Record
        Measured or simulated; findings of its reading (``meta["reading"]``) are included.
    stribeck_velocity : float
        rad/s (or m/s), to check for speeds near it. Without it, near a twentieth of the usual speed.
    accept : sequence of str
        Codes of errors that the caller accepts as warnings; those of `FINAL` stay errors.
    estimate : callable
        `estimate_sliding`, or a memo of it that keeps the result for the identification.

    Raises
    ------
    UnknownName
        If a code of `accept` is not in `ERRORS`.
    """
    for code in accept:
        if code not in ERRORS:
            raise UnknownName("error of the doctor", code, ERRORS)
    if is_steady_table(record):
        kept, found = examine_table(record)
        return Diagnosis(tuple(sorted_findings(accepted(found, accept))), kept)
    view = View(record, estimate)
    reading = cast("Mapping[str, Any]", record.meta.get("reading", {}))
    findings = [Finding.from_data(f) for f in reading.get("findings", [])]
    # Absurd numbers overflow; comparisons with the results are false.
    with np.errstate(all="ignore"):
        for check in FIRST:
            findings += check(view)
        enough = view.time.size >= timing.FEWEST and not any(f.code == "too-small" for f in findings)
        for check in CHECKS[len(FIRST) :] if enough else ():
            findings += check(view)
        if enough and not any(f.code == "never-moved" for f in findings):
            findings += excitation.reversed_and_slow(view, stribeck_velocity)
        else:
            # Noise has no sign, delay or speed.
            vain = (
                "torque-sign",
                "time-skew",
                "velocity-sign",
                "velocity-mismatch",
                "gravity",
                "position-jump",
                "offset",
                "change",
            )
            findings = [f for f in findings if f.code not in vain]
    causes = {f.code for f in findings if f.level == "error" and f.code not in accept}
    follow = {code for cause in causes for code in CONSEQUENCES.get(cause, ())}
    findings = by_profile.told([f for f in findings if f.code not in follow], view)
    kept, trimmed = _usable_rows(view)
    return Diagnosis(tuple(sorted_findings([*accepted(findings, accept), *trimmed])), kept)


def accepted(findings: Sequence[Finding], accept: Sequence[str]) -> list[Finding]:
    """Return the findings with accepted errors as warnings."""
    return [
        replace(f, level="warning") if f.level == "error" and f.code in accept and f.code not in FINAL else f
        for f in findings
    ]


def _usable_rows(view: View) -> tuple[Record, list[Finding]]:
    """Return the record without unusable rows, and the finding that lists them."""
    record, keep = view.record, view.usable
    if view.has("event"):
        keep = keep | (record["event"] > 0.5)
    out = np.flatnonzero(~keep)
    if not out.size:
        return record, []
    listed = range_words(view.file_rows[out])
    finding = Finding("warning", "trimmed", f"{out.size} of {len(record)} rows are left out: rows {listed}")
    kept = taken(record, keep)
    return replace(kept, meta={**kept.meta, "trimmed": listed}), [finding]
