"""Captions of cases, generated from their metrics."""

from __future__ import annotations

import math
from collections.abc import Sequence

from stickslip.analyse.wording import quantity
from stickslip.studies.result import Run

OSCILLATES = 20e-3  # rad/s RMS above 50 Hz, as in the statements
MILLI = (1e3, "mrad")
HUNTS = 2.0  # reversals/s while the reference is at rest


def _get(run: Run, name: str) -> float:
    return run.metrics.get(name, math.nan)


def oscillates(run: Run, at_rest: bool) -> bool:
    """Whether a run oscillates: at steady state if the reference comes to rest, else by its fast velocity."""
    if at_rest:
        return _get(run, "second_half_reversals_per_s") > HUNTS
    return _get(run, "velocity_above_50Hz_rms_rad_s") > OSCILLATES


def figure_of_merit(at_rest: bool) -> tuple[str, str]:
    """Return the metric for ranking runs, and its name.

    For a reference that comes to rest it is the RMS of the second half, because the mean would favour a limit cycle
    around the target.
    """
    if at_rest:
        return "second_half_position_rms_rad", "RMS error in the second half"
    return "position_rms_rad", "RMS error"


def ranking(runs: Sequence[Run], name: str) -> list[Run]:
    """Return finished runs, ordered by a metric, smallest first."""
    done = (r for r in runs if not r.failure and math.isfinite(_get(r, name)))
    return sorted(done, key=lambda r: _get(r, name))


def error_of(value: float, factor: float) -> str:
    """Return an error (rad) times a factor as in tables: three digits, none below a thousandth of the unit."""
    scaled = abs(factor * value)
    if scaled < 1e-3:
        return "0" if scaled < 1e-7 else "<0.001"
    return f"{scaled:.3g}" if scaled < 1000.0 else f"{scaled:.0f}"


def case_message(
    runs: Sequence[Run],
    at_rest: bool,
    linear: Sequence[str],
    unit: tuple[float, str] = MILLI,
    shown: Sequence[str] | None = None,
) -> str:
    """Return a sentence on the run that tracks best, the best compensator if it is another, and the other linear
    controllers.

    Parameters
    ----------
    runs : sequence of Run
        All runs in the comparison, including those in other figures.
    at_rest : bool
        Whether the reference comes to rest.
    linear : sequence of str
        The controllers without compensator.
    unit : tuple of (float, str)
        Factor from rad, and unit, of all errors.
    shown : sequence of str, optional
        The controllers in the figure, if not all.
    """
    name, words = figure_of_merit(at_rest)
    ranked = ranking(runs, name)
    if not ranked:
        return "no run was finished"
    numbers = {r.controller: f"{r.controller}\u00a0{error_of(_get(r, name), unit[0])}" for r in ranked}
    best = ranked[0].controller
    helped = next((c for c in numbers if c not in linear), best)
    parts = [f"Least {words}: {numbers[best]} {unit[1]}" + aside(best, shown)]
    if helped != best:
        parts.append(f"best compensator {numbers[helped]}" + aside(helped, shown))
    rest = [numbers[r.controller] for r in runs if r.controller in linear and r.controller in numbers]
    rest = [words for words in rest if words != numbers[best]]
    return "; ".join([*parts, *([", ".join(rest)] if rest else [])])


def aside(name: str, shown: Sequence[str] | None) -> str:
    """Return a note if a controller is in another part of a figure."""
    return " (another part)" if shown is not None and name not in shown else ""


def case_caption(runs: Sequence[Run], at_rest: bool) -> str:
    """Return two or three sentences: the order by error, oscillating runs, runs with standstills."""
    name, words = figure_of_merit(at_rest)
    ranked = ranking(runs, name)
    sentences = [
        f"By {words} in mrad, best first: "
        + ", ".join(f"{r.controller} {error_of(_get(r, name), MILLI[0])}" for r in ranked)
        + "."
    ]
    moving = [r for r in ranked if oscillates(r, at_rest)]
    if at_rest:
        listed = ", ".join(
            f"{r.controller} ({quantity(_get(r, 'second_half_reversals_per_s'), '/s')})" for r in moving
        )
        sentences.append(
            f"At steady state {listed} keep moving (reversals)." if moving else "All come to rest."
        )
    else:
        fast = "velocity_above_50Hz_rms_rad_s"
        listed = ", ".join(f"{r.controller} {quantity(_get(r, fast), 'rad/s')}" for r in moving)
        sentences.append(
            f"Oscillating (RMS velocity above 50 Hz): {listed}." if moving else "None oscillates."
        )
        still = [r for r in ranked if _get(r, "standstills") > 0]
        listed = ", ".join(f"{r.controller} {_get(r, 'standstills'):.0f}" for r in still)
        sentences.append(
            f"Standstills while the reference moves: {listed}." if still else "None stands still."
        )
    cycles = [r for r in ranked if math.isfinite(_get(r, "limit_cycle_period_s"))]
    if cycles:
        listed = ", ".join(
            f"{r.controller} (amplitude {quantity(_get(r, 'limit_cycle_amplitude_rad'), 'rad')}, "
            f"period {quantity(_get(r, 'limit_cycle_period_s'), 's')})"
            for r in cycles
        )
        sentences.append(f"Limit cycle: {listed}.")
    sentences += [f"{r.controller} failed: {r.failure}." for r in runs if r.failure]
    return " ".join(sentences)
