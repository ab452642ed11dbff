"""What a sweep varies held against its runs: refused before anything runs, and in which runs a number varies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.core.config import Table
from stickslip.core.errors import ConfigError, InputError, suggestion
from stickslip.studies.planned_run import PlannedRun
from stickslip.sweeps.numbers import belongs, known, value_of, varied
from stickslip.sweeps.ranges import admitted
from stickslip.sweeps.sample import LEVEL, Drawn, Spread

if TYPE_CHECKING:
    from stickslip.sweeps.plan import Sweep

Array = np.ndarray[Any, np.dtype[np.float64]]
NAMED = 3
"""Runs that a line names, at most."""


def check_numbers(sweep: Sweep, table: Table) -> None:
    """Refuse numbers that no run has, factors on nothing, and ends of ranges at which a run cannot be run.

    Raises
    ------
    ConfigError
        One line that names the number, the run and what to give instead.
    """
    for name in (*sweep.drawn.names, *(s.name for s in sweep.tuned)):
        if name != LEVEL and not any(belongs(run, name) for run in sweep.runs):
            allowed = list(dict.fromkeys(k for run in sweep.runs for k in known(run)))
            raise ConfigError(
                f"{table.label('vary')}: no run has a number {name!r}; {suggestion(name, allowed)}"
            )
    for run in sweep.runs:
        _refuse_factors_on_nothing(run, sweep.drawn.spreads, table, "vary")
        for numbers in _ends(sweep.drawn):
            values = sweep.values(run, numbers[None, :])
            _try(run, {k: _plain(v[0]) for k, v in values.items()}, table, "vary")
        # Where a law's numbers exclude each other within their usual ranges, the search finds out.
        given = [s for s in sweep.tuned if sweep.config["tune"][s.name]]
        _refuse_factors_on_nothing(run, given, table, "tune")
        for s in (s for s in given if belongs(run, s.name)):
            base = value_of(run, s.name)
            if isinstance(base, tuple):
                raise ConfigError(f"{table.label('tune')}: {s.name} is a list; name an element, {s.name}[0]")
            for end in (s.low, s.high):
                number = end * (base if s.factor else 1.0)
                _try(run, {s.name: admitted(run, s.name, number)}, table, "tune")


def _refuse_factors_on_nothing(run: PlannedRun, spreads: Iterable[Spread], table: Table, key: str) -> None:
    """Refuse factors on a number that no factor changes: every case would be the same."""
    for s in (s for s in spreads if s.factor and belongs(run, s.name)):
        elements: Array = np.atleast_1d(np.asarray(value_of(run, s.name), dtype=np.float64))
        if not np.any(np.isfinite(elements) & (elements != 0.0)):
            way = 'values = [...] with of = "value"' if s.values else "range = [low, high]"
            raise ConfigError(
                f"{table.label(key)}: {s.name} is {elements[0]:g} in run {run.key}, which no factor changes; "
                f"give {way} in its own unit, or leave such runs out with `only`"
            )


def _try(run: PlannedRun, values: Mapping[str, Any], table: Table, key: str) -> None:
    """Refuse numbers at the end of a range with which the run cannot be run."""
    try:
        varied(run, values)
    except InputError as error:
        raise ConfigError(f"{table.label(key)}: run {run.key} at the end of a range: {error}") from None


def _ends(drawn: Drawn) -> list[Array]:
    """Every number at its lowest and at its highest while the others are in the middle."""
    middle = [0.5 * (s.low + s.high) for s in drawn.spreads] + [e.value for e in drawn.estimates]
    middle += [1.0] if drawn.nested else []
    out: list[Array] = []
    for i, s in enumerate(drawn.spreads):
        for end in (s.low, s.high):
            numbers = np.array(middle)
            numbers[i] = end
            out.append(numbers)
    return out or [np.array(middle)]


def _plain(value: Any) -> Any:
    """A number or a list of them, as Python has them."""
    return value.tolist() if isinstance(value, np.ndarray) else float(value)


# ---- which runs a number varies in -----------------------------------------------------------------------------


def not_varied(sweep: Sweep, run: PlannedRun) -> list[str]:
    """The numbers that the sweep varies and the run does not have."""
    own = sweep.varied(run)
    return [name for name in sweep.drawn.names if name != LEVEL and name not in own]


def unvaried_lines(sweep: Sweep) -> list[str]:
    """The same of a sweep that is to run."""
    return not_varied_lines((run.key, sweep.varied(run), not_varied(sweep, run)) for run in sweep.runs)


def not_varied_lines(runs: Iterable[tuple[str, Sequence[str], Sequence[str]]]) -> list[str]:
    """A line for every set of numbers that some runs do not have, lest a run that stays the same look robust.

    Parameters
    ----------
    runs : iterable of (str, sequence of str, sequence of str)
        Name of each, the numbers that vary in it, and those that do not.
    """
    groups: dict[tuple[tuple[str, ...], bool], list[str]] = {}
    for key, own, others in runs:
        if others:
            groups.setdefault((tuple(others), not own), []).append(key)
    return [
        f"not varied, as the run has no such number: {', '.join(others)} in {', '.join(keys[:NAMED])}"
        + (f" and {len(keys) - NAMED} more" if len(keys) > NAMED else "")
        + ("; nothing varies there, and all cases are the same" if alike else "")
        for (others, alike), keys in groups.items()
    ]
