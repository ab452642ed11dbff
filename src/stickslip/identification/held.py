"""Values that were given and held fixed, described like the fitted ones."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from stickslip.core.rebinding import NEGATIVE
from stickslip.identification.estimate import Held, Identification
from stickslip.identification.output_error.problem import mechanics_parameters
from stickslip.machines.servo import ServoAxis


def held_in(found: Identification, frozen: Iterable[str], values: Mapping[str, float]) -> tuple[Held, ...]:
    """Return every value that was held fixed, once; none of a law that was not chosen.

    Parameters
    ----------
    found : Identification
    frozen : iterable of str
        Names given by the user; the name of a list means every element, the name of a friction both directions.
    values : mapping of str to float
        Their values, where the user gave them.
    """
    known: object = found.details.get("axis")
    axis = known if isinstance(known, ServoAxis) else ServoAxis()
    each = (
        h
        for name in dict.fromkeys(frozen)
        for h in (*of_law(found, axis, name), *of_axis(axis, name, values))
    )
    fitted = {e.name for e in found.estimates}
    return tuple({h.name: h for h in each if h.name not in fitted}.values())


def of_law(found: Identification, axis: ServoAxis, name: str) -> Iterator[Held]:
    """Yield a held parameter of the law, with its elements and directions."""
    described = {f.name: f.par for f in found.model.law.fields} if found.model else {}
    for own, value in found.assumed.items():
        base = own.partition("[")[0]
        if name in (own, base, base.removesuffix(NEGATIVE)):
            yield Held(own, axis.unit(described[base].unit), described[base].symbol, value)


def of_axis(axis: ServoAxis, name: str, values: Mapping[str, float]) -> Iterator[Held]:
    """Yield a held number of the axis other than friction."""
    for p in mechanics_parameters(axis, "torque", values, 0, 0):
        if p.name == name:
            # The record's drive quantity determines their unit.
            unit = "" if name in ("drive_gain", "back_emf") else p.par.unit
            yield Held(name, unit, p.par.symbol, p.value)
