"""What is wrong with a log, before anything is identified from it: the verb `doctor`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Unpack

from stickslip.core.arguments import arguments_checked
from stickslip.core.errors import InputError
from stickslip.core.finding import Finding, sorted_findings
from stickslip.core.messages import name_option
from stickslip.identification.doctor import Diagnosis, examine
from stickslip.readers.cut import file_rows, pieces, range_words
from stickslip.verbs.reading import Log, Reading, open_log


@arguments_checked
def doctor(
    log: Log | None = None,
    *,
    stribeck_velocity: float | None = None,
    accept: Sequence[str] = (),
    **reading: Unpack[Reading],
) -> Diagnosis:
    """Check a log for everything that would spoil an identification.

    Parameters
    ----------
    log : path, data frame, mapping of arrays or Record, optional
        Left out where arrays are given by name (`t`, `position`, `torque`, ...).
    stribeck_velocity : float, optional
        rad/s (m/s): whether the log has speeds near it.
    accept : sequence of str
        Codes of errors that count as warnings, since you know better.
    **reading
        Arrays, and how a log is read: see `stickslip.verbs.reading.Reading`.

    Returns
    -------
    Diagnosis
        ``findings``, errors first; ``errors`` and ``warnings`` among them; ``record``, the rows that can be used.

    Raises
    ------
    InputError
        If the log cannot be read at all; what makes it unusable is among the findings.
    """
    if stribeck_velocity is not None and not 0.0 < stribeck_velocity < float("inf"):
        raise InputError(
            f"{name_option('stribeck_velocity', f'{stribeck_velocity:g}')} must be greater than 0"
        )
    record = open_log(log, reading).record
    parts, short = pieces(record)
    every = [examine(part, stribeck_velocity=stribeck_velocity, accept=accept) for part in parts]
    return Diagnosis(tuple(merged(every, short)), every[0].record if len(every) == 1 else record)


def merged(every: Sequence[Diagnosis], more: Sequence[Finding]) -> list[Finding]:
    """What was found in the pieces of a record; with the rows of the piece where it is not true of all."""
    said: dict[Finding, None] = {}
    for diagnosis in every:
        rows = f"rows {range_words(file_rows(diagnosis.record), 3)}"
        for finding in diagnosis.findings:
            everywhere = all(finding in other.findings for other in every)
            said[finding if finding.where or everywhere else replace(finding, where=rows)] = None
    return sorted_findings([*said, *more])
