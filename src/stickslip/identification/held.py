"""What the user knew of an axis: numbers that were held, in the words of those that were fitted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from stickslip.core.rebinding import NEGATIVE
from stickslip.identification.estimate import Held, Identification
from stickslip.identification.output_error.problem import mechanics_parameters
from stickslip.machines.servo import ServoAxis


def held_in(found: Identification, frozen: Iterable[str], values: Mapping[str, float]) -> tuple[Held, ...]:
    """Every number that was held, each once; none of a law that was not taken.

    Parameters
    ----------
    found : Identification
    frozen : iterable of str
        Names that the user gave; one of a list means every element, one of a friction both directions.
    values : mapping of str to float
        Their values, as far as the user gave them.
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
    """A parameter of the law, its elements and directions."""
    described = {f.name: f.par for f in found.model.law.fields} if found.model else {}
    for own, value in found.assumed.items():
        base = own.partition("[")[0]
        if name in (own, base, base.removesuffix(NEGATIVE)):
            yield Held(own, axis.unit(described[base].unit), described[base].symbol, value)


def of_axis(axis: ServoAxis, name: str, values: Mapping[str, float]) -> Iterator[Held]:
    """A number of the axis beside its friction."""
    for p in mechanics_parameters(axis, "torque", values, 0, 0):
        if p.name == name:
            # What a drive's signal is counted in, the record says.
            unit = "" if name in ("drive_gain", "back_emf") else p.par.unit
            yield Held(name, unit, p.par.symbol, p.value)
