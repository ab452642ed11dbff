"""The range of a number that a sweep's file gives none: from the bounds of its law, and the number that the run has."""

from __future__ import annotations

import math
from collections.abc import Sequence

from stickslip.core.errors import InputError
from stickslip.core.spec import Par
from stickslip.studies.planned_run import PlannedRun
from stickslip.sweeps.numbers import belongs, parts, value_of
from stickslip.sweeps.sample import Spread

WIDTH = 5.0
"""Factor up and down from the run's own number, where its bounds are open."""


def described(run: PlannedRun, name: str) -> Par | None:
    """What a number means where a law describes it: of a controller made of control laws, or of the axis's friction."""
    family, rest, _ = parts(name)
    fields = ()
    if family == "controller" and not run.control.is_short:
        fields = run.control.fields
    elif family == "friction":
        fields = run.axis.friction.law.fields
    return next((f.par for f in fields if f.name == rest), None)


def usual(runs: Sequence[PlannedRun], name: str) -> Spread:
    """The range of a number: between the bounds of its law, or factors of up to 5 on what the runs have.

    Raises
    ------
    InputError
        If its bounds are open and a run has 0 or a list.
    """
    kept = [run for run in runs if belongs(run, name)]
    pars = [described(run, name) for run in kept]
    bounds = {(par.lower, par.upper) if par else (-math.inf, math.inf) for par in pars}
    low, high = next(iter(bounds))
    if len(bounds) == 1 and math.isfinite(low) and math.isfinite(high):
        return Spread(name, low, high)
    bases = [value_of(run, name) for run in kept]
    if any(isinstance(base, tuple) for base in bases):
        raise InputError(f"{name} is a list; name an element, {name}[0]")
    if not all(0.0 < base < math.inf for base in bases):
        raise InputError(f"{name} = {min(bases):g} has no usual range; give range = [low, high]")
    low = max([1.0 / WIDTH, *(par.lower / base for par, base in zip(pars, bases) if par)])
    high = min([WIDTH, *(par.upper / base for par, base in zip(pars, bases) if par)])
    return Spread(name, low, high, factor=True, logarithmic=True)


def admitted(run: PlannedRun, name: str, number: float) -> float:
    """The number itself; the nearest whole one where only these mean anything."""
    par = described(run, name)
    return float(round(number)) if par is not None and par.whole else number
