"""Defects of the time column: backward, duplicate, gaps, uneven steps, wrong unit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stickslip.core.finding import Finding, times
from stickslip.core.messages import name_option
from stickslip.identification.doctor.view import View, row

GAP = 5.0
"""Ratio of a step to the median step from which on it is a gap."""
FEWEST = 20
"""Fewest usable rows for any result."""
SHORTEST = 1e-9
"""Shortest plausible sample period, s: no drive is faster, so the unit must be another."""
FEW_MS = 100.0
"""Greatest period of a plausible unit if none is stated: up to this number of ms; above it, microseconds."""
UNEVEN, ROUNDED = 0.2, 1e-6
"""Relative deviation from the median step from which on a step is uneven; tolerance for rounding."""
JITTER = 0.02
"""Width of the middle 90 % of the steps over their median, above which there is jitter."""


def ascending(view: View) -> Iterator[Finding]:
    """Yield errors on times that decrease or repeat."""
    time = view.record.time
    if view.has("event"):
        return  # A simulation writes an event before and after its jump.
    known = np.flatnonzero(np.isfinite(time))
    steps = np.diff(time[known])
    back = known[1:][steps < 0.0]
    if back.size:
        piece = (
            "the file may hold several records one after another"
            if back.size < 10
            else "rows are out of order"
        )
        parts = np.split(known, np.flatnonzero(steps < 0.0) + 1)
        longest = max(parts, key=len)
        remedy = "sort the file by time"
        if longest.size >= FEWEST:
            first, last = view.file_rows[longest[[0, -1]]]
            remedy = f"take a part, such as {name_option('rows', f'{first}:{last}')}, or {remedy}"
        else:
            name = view.name("time")
            remedy += (
                f", say which column is the time if {name!r} is not, or give "
                f"{name_option('sample_time', 'SECONDS')} if the rows follow"
                " one another and only their times are wrong"
            )
        message = f"time goes back {times(back.size)}; {piece}"
        yield Finding("error", "backward-time", message, row(int(back[0]), view), remedy)
    same = known[1:][steps == 0.0]
    if same.size:
        share = same.size / max(steps.size, 1)
        message = f"{same.size} rows ({100 * share:.3g} %) have the time of the row before"
        if share > 0.2:
            remedy = f"write the time with more digits, or give {name_option('sample_time', 'SECONDS')}"
            yield Finding(
                "error",
                "duplicate-time",
                f"{message}: the clock is too coarse",
                row(int(same[0]), view),
                remedy,
            )
        else:
            yield Finding(
                "warning", "duplicate-time", message, row(int(same[0]), view), "the first of each is used"
            )


def sampling(view: View) -> Iterator[Finding]:
    """Yield findings on gaps and uneven steps."""
    time = view.time
    if time.size < FEWEST:
        message = f"the record has {time.size} usable rows"
        yield Finding("error", "too-short", message, remedy=f"give at least {FEWEST}")
        return
    rows = np.flatnonzero(view.usable)
    # Rows that the user left out are not a defect of the record.
    as_logged = np.diff(np.cumsum(np.diff(view.file_rows, prepend=view.file_rows[0] - 1) > 1)[rows]) == 0
    steps, rows = np.diff(time)[as_logged], rows[:-1][as_logged]
    usual = view.period
    gaps = np.flatnonzero(steps > GAP * usual)
    if gaps.size and gaps.size < 0.05 * steps.size:
        longest = int(gaps[np.argmax(steps[gaps])])
        lost = float(np.sum(steps[gaps] - usual))
        end, begin = view.record.time[rows[longest]], view.record.time[rows[longest] + 1]
        message = (
            f"{gaps.size} gaps of more than {GAP:g} samples, {lost:.3g} s in all, "
            f"the longest {steps[longest]:.3g} s"
        )
        yield Finding(
            "warning",
            "gap",
            message,
            row(int(rows[longest]), view),
            f"filters smear what lies on both sides of a gap: identify with {name_option('end', f'{end:.6g}')}, "
            f"or {name_option('start', f'{begin:.6g}')}",
        )
    # A run may end between two samples.
    whole = steps[:-1] if steps[-1] < usual else steps
    off = np.flatnonzero((np.abs(whole / usual - 1.0) > UNEVEN + ROUNDED) & (whole <= GAP * usual))
    low, high = np.percentile(whole[whole <= GAP * usual], [5, 95])
    width = float(high - low) / usual
    if off.size:
        message = (
            f"irregular sampling: {off.size} of {whole.size} distances differ from the usual"
            f" {usual * 1e3:.4g} ms by more than {100 * UNEVEN:g} %; they lie between"
            f" {np.min(whole) * 1e3:.3g} and {np.max(whole[whole <= GAP * usual]) * 1e3:.3g} ms"
        )
        yield Finding(
            "warning",
            "irregular-sampling",
            message,
            row(int(rows[off[0]]) + 1, view),
            "it is resampled evenly where a method filters; log with a fixed cycle if you can",
        )
    elif width > JITTER:
        yield Finding(
            "note",
            "jitter",
            f"jitter: samples are {low * 1e3:.4g} to {high * 1e3:.4g} ms apart (middle 90 %)",
        )


def finer(period: float) -> str:
    """Return the unit in which sample steps of this size are plausible for a drive."""
    return "ms" if period < FEW_MS else "us" if period < 1e3 * FEW_MS else "ns"


def scale(view: View) -> Iterator[Finding]:
    """Yield a finding if the sample period suggests milliseconds instead of seconds, or the reverse."""
    if view.time.size < 2:
        return
    period = view.period
    if period >= 0.1 and not view.stated("time"):
        yield Finding(
            "error",
            "time-unit",
            f"samples are {period:g} apart and nobody states the unit: that is {finer(period)} rather than s",
            remedy=f"say {view.mapped('time', finer(period))}, or {view.mapped('time', 's')} if it is right",
        )
    elif period >= 0.1:
        yield Finding(
            "warning",
            "slow-sampling",
            f"samples are {period:g} s apart; friction changes faster",
            remedy=f"log faster, or say {view.mapped('time', finer(period))} if the unit is wrong",
        )
    elif period < SHORTEST:
        yield Finding(
            "error",
            "no-clock",
            f"samples are {period:.3g} s apart: no drive is that fast",
            remedy=f"say in which unit times are, such as {view.mapped('time', 's')}",
        )
    elif period < 5e-6:
        yield Finding(
            "warning",
            "time-unit",
            f"samples are {period:.3g} s apart, {1e-6 / period:.3g} MHz: the unit may be wrong",
            remedy=f"say {view.mapped('time', 's')} if times are in seconds",
        )
