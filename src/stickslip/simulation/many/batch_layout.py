"""Cases that differ in numbers, laid out for the exact integrator all at once.

`stickslip.simulation.exact.engine.prepare` lays one case out; this fills the same arrays for many, from columns of
numbers.
A law's `modes` runs once on whole columns where its text allows, else case by case; its sliding curve is asked in
compiled code. Both layouts are the same, bit for bit; the tests of batches hold them to it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from stickslip.core.errors import ParameterError, UnknownName
from stickslip.core.rebinding import bound
from stickslip.core.spec import Bristle, Elements, Field, Law
from stickslip.simulation.case_arrays import Array, Side
from stickslip.simulation.exact import state as col
from stickslip.simulation.exact.engine import CURVE_SPEEDS, curve_of
from stickslip.simulation.many.batch_kernel import curve_at, layers, least_of


@dataclass(frozen=True)
class Member:
    """A law of the loop for n cases.

    Attributes
    ----------
    side : Side
        Of the case that the others vary.
    packed : array, shape (n, parameters)
    columns : array of SIDE, shape (n,)
        Its side (`exact.state.SIDE`); its weight and what one loop's says are left to the caller.
    elements : array, shape (n, elements, 2)
        Stiffness and share of those of finite stiffness.
    """

    side: Side
    packed: Array
    columns: Any
    elements: Array

    @property
    def curve(self) -> int:
        """Address of the sliding curve, 0 for a constant one."""
        e = self.side.elements
        return 0 if e is None or e.constant_curve else self.side.pointers.sliding


def member(side: Side, varied: Mapping[str, Array], n: int) -> Member:
    """Lay out a law whose parameters `varied` names, shape (n,) or (n, elements); the others are those of `side`.

    Raises
    ------
    UnknownName, ParameterError
        If the law has no such parameter, or a value is out of bounds.
    """
    assert side.model is not None
    law, base = side.model.law, side.model.parameters
    for name in varied:
        if name not in base._fields:
            raise UnknownName(f"parameter of law {law.name!r}", name, base._fields)
    values = {f.name: checked(law, f, varied[f.name]) for f in law.fields if f.name in varied}
    packed = np.tile(side.parameters, (n, 1))
    for name, place in places(law, base).items():
        if name in values:
            packed[:, place] = values[name].reshape(n, -1)
    check_together(law, base, values, n)
    return Member(side, packed, *forms(side, values, packed, n))


def checked(law: Law, f: Field, values: Array) -> Array:
    """The values, if all of them are within the parameter's bounds."""
    for value in (float(np.min(values)), float(np.max(values))):
        if complaint := f.par.complaint(value):
            raise ParameterError(f"{law.name}: {f.name} = {value:g} {f.par.unit} {complaint}")
    return values


def places(law: Law, p: Any) -> dict[str, slice]:
    """Where `law.pack` puts every parameter."""
    blocks = [f for f in law.fields if f.per_element]
    names = [f.name for f in law.fields if not f.per_element]
    found = {name: slice(i, i + 1) for i, name in enumerate(names)}
    at = len(names) + len({f.par.per for f in blocks})
    for f in blocks:
        size = len(getattr(p, f.name))
        found[f.name] = slice(at, at + size)
        at += size
    return found


# ---- parameters as Python sees them ------------------------------------------------------------------------


class Watched:
    """Parameters that note which of them a function reads."""

    def __init__(self, p: Any) -> None:
        self.p, self.read = p, set[str]()

    def __getattr__(self, name: str) -> Any:
        self.read.add(name)
        return getattr(self.p, name)


def check_together(law: Law, base: Any, values: Mapping[str, Array], n: int) -> None:
    """Let the law judge every case, where its judgement depends on what varies."""
    if law.check is None or not values:
        return
    watched = Watched(base)
    law.check(watched)
    if watched.read & {*values, "_replace", "_fields"}:
        for p in each(law, base, values, n):
            if complaint := law.check(p):
                raise ParameterError(f"{law.name}: {complaint}")


def each(law: Law, base: Any, values: Mapping[str, Array], n: int) -> list[Any]:
    """The parameters of every case."""
    lists: dict[str, Any] = {
        name: [tuple(row) for row in v.tolist()] if v.ndim == 2 else v.tolist() for name, v in values.items()
    }
    return [base._replace(**{name: v[i] for name, v in lists.items()}) for i in range(n)]


def as_columns(base: Any, values: Mapping[str, Array]) -> Any:
    """The parameters of all cases as one: arrays where they vary, tuples of arrays where each element has one."""
    return base._replace(**{name: tuple(v.T) if v.ndim == 2 else v for name, v in values.items()})


# ---- modes -------------------------------------------------------------------------------------------------


def forms(side: Side, values: Mapping[str, Array], packed: Array, n: int) -> tuple[Any, Array]:
    """Sides and elements, as `exact.fill_side` has them for one case."""
    e = side.elements
    assert side.model is not None
    assert e is not None
    address = 0 if e.constant_curve else side.pointers.sliding
    breakaway = np.empty(n)
    if address:
        curve_at(address, packed, 0.0, breakaway)
    f = columns_of(side, e, values, breakaway if address else None, n)
    into = np.zeros(n, col.SIDE)
    into["viscous"], into["breakaway"] = f["viscous"], f["breakaway"]
    into["scale"] = 0.0 if e.constant_curve else f["velocity_scale"]
    into["lowest"] = 0.999 * f["breakaway"]
    if address:
        least = np.empty(n)
        least_of(address, packed, f["velocity_scale"], CURVE_SPEEDS, least)
        into["lowest"] = 0.99 * least
    into["velocity"] = into["velocity_before"] = math.nan
    if isinstance(e, Bristle):
        into["kind"], into["varies"] = col.BENDS, 1
        into["bristle"], into["lag"] = f["stiffness"], f["damping"] / f["stiffness"]
        return into, np.zeros((n, 0, 2))
    into["kind"] = col.FOLLOWS if math.isinf(e.attraction) else col.RELAXES
    into["attraction"] = f["attraction"]
    into["varies"] = 0 if e.constant_curve and math.isinf(e.attraction) else 1
    holds = np.isinf(e.stiffness)
    rigid = np.zeros(n)
    for i in np.flatnonzero(holds):
        rigid += f["share"][:, i]
    if math.isinf(e.slope):
        into["rigid"] = rigid
    else:
        layer = np.empty(n)
        layers(address, packed, f["velocity_scale"], f["slope"], f["viscous"], rigid, layer)
        into["steep"], into["steepness"], into["layer"] = rigid, f["slope"], layer
    return into, np.stack([f["stiffness"][:, ~holds], f["share"][:, ~holds]], axis=2)


def columns_of(
    side: Side, e: Elements | Bristle, values: Mapping[str, Array], breakaway: Array | None, n: int
) -> dict[str, Array]:
    """The fields of `Elements` or `Bristle` for every case, shape (n,) or (n, elements)."""
    assert side.model is not None
    law, base = side.model.law, side.model.parameters
    found: Any = e if not values else modes_on_columns(law, base, values, breakaway)
    names = [f for f in e.__dataclass_fields__ if f != "constant_curve"]
    if found is None:
        assert law.modes is not None
        rows: Any = [law.modes(p) for p in each(law, base, values, n)]
        return {name: np.array([getattr(row, name) for row in rows], dtype=np.float64) for name in names}
    return {name: broad(getattr(found, name), n) for name in names}


def broad(value: Any, n: int) -> Array:
    """A field for every case: shape (n,), or (n, elements) of a tuple."""
    if isinstance(value, tuple):
        parts = cast("tuple[Any, ...]", value)
        return np.stack([np.broadcast_to(np.asarray(part, dtype=np.float64), n) for part in parts], axis=1)
    return np.broadcast_to(np.asarray(value, dtype=np.float64), n)


def modes_on_columns(law: Law, base: Any, values: Mapping[str, Array], breakaway: Array | None) -> Any:
    """What the law's `modes` makes of whole columns, or None where its text works on numbers alone."""

    def at_rest(v: float, _: Any) -> Array:
        if v != 0.0 or breakaway is None:
            raise TypeError("the curve is known at rest alone")
        return breakaway

    try:
        return bound(law.modes, {"sliding": at_rest})(as_columns(base, values))
    except (TypeError, ValueError):
        return None


def share_curves(one: Member, other: Member) -> Array:
    """1 for every case whose two laws slide along the same curve with the same parameters, else 0."""
    n = one.packed.shape[0]
    if not (one.side.pointers.sliding and other.side.pointers.sliding):
        return np.zeros(n)
    curve = curve_of(one.side)
    if curve is not curve_of(other.side):
        return np.zeros(n)
    assert one.side.model is not None
    assert other.side.model is not None
    here = places(one.side.model.law, one.side.model.parameters)
    there = places(other.side.model.law, other.side.model.parameters)
    same = np.ones(n, dtype=np.bool_)
    for name in getattr(curve.params, "_fields", ()):
        p, q = one.packed[:, here[name]], other.packed[:, there[name]]
        same &= p.shape == q.shape and np.all(p == q, axis=1)
    return same.astype(np.float64)
