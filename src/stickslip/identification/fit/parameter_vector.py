"""Free and frozen parameters of a law and its mechanics as one flat vector for optimisers.

The coordinate of a positive parameter is its logarithm, of another parameter its value over its typical size, and of
shares that add up to 1 their log ratios. Steps of equal size are therefore comparable, and every point inside the
bounds is valid for the law.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.description import packed
from stickslip.core.errors import InputError, UnknownName
from stickslip.core.spec import Par
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]

LARGEST = 230.0
"""Greatest magnitude of a parameter's logarithm: values between 1e-100 and 1e100 prevent overflow."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of a vector.

    Attributes
    ----------
    name : str
        ``fc``; ``k[1]`` for element 1 (counted from 0).
    par : Par
    value : float
        Starting value of the search, or the frozen value.
    free : bool
    shares : str
        Name of the group whose values add up to 1; empty for none.
    scale : float
        Typical size of a parameter that may be zero or negative.
    """

    name: str
    par: Par
    value: float
    free: bool = True
    shares: str = ""
    scale: float = 1.0

    @property
    def logarithmic(self) -> bool:
        """Whether its coordinate is a logarithm: its bounds make it positive."""
        return self.par.positive or self.par.lower > 0.0

    @property
    def nonnegative(self) -> bool:
        """Whether its bounds exclude negative values."""
        return self.par.positive or self.par.lower >= 0.0

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a value."""
        if self.logarithmic:
            return math.log(value) if value > 0.0 else -LARGEST
        return value / self.scale

    @property
    def limits(self) -> tuple[float, float]:
        """Lower and upper bound of the coordinate."""
        low = self.coordinate(max(self.par.lower, 0.0)) if self.logarithmic else self.par.lower / self.scale
        if self.par.upper < math.inf:
            return low, self.coordinate(self.par.upper)
        return low, LARGEST if self.logarithmic else math.inf


class Vector:
    """Free and frozen parameters, and the map between their values and the optimiser's coordinates.

    Parameters
    ----------
    model : Model or None
        The law, and the starting or frozen values of its parameters.
    free, frozen : sequence of str, optional
        Names of the free or the frozen parameters; ``k`` means every element, ``k[1]`` one. Without `free` all except
        those in `frozen` are free.
    extra : sequence of Parameter
        Other numbers (inertia, offset); they come first.
    limits : mapping of str to (float, float)
        Tighter bounds of the search, by full name; the law's own bounds remain.
    """

    def __init__(
        self,
        model: Model | None,
        free: Iterable[str] | None = None,
        frozen: Iterable[str] = (),
        extra: Sequence[Parameter] = (),
        limits: Mapping[str, tuple[float, float]] | None = None,
    ) -> None:
        self.base = model
        everything = [_limited(p, limits or {}) for p in [*extra, *_parameters_of(model)]]
        chosen = None if free is None else _matched(list(free), everything)
        held = _matched(list(frozen), everything)
        self.parameters: tuple[Parameter, ...] = tuple(
            replace(p, free=p.free and p.name not in held and (chosen is None or p.name in chosen))
            for p in everything
        )
        self.free: tuple[Parameter, ...] = tuple(p for p in self.parameters if p.free)
        self._plain = [p for p in self.free if not p.shares]
        groups = dict.fromkeys(p.shares for p in self.free if p.shares)
        self._groups = [[p for p in self.free if p.shares == g] for g in groups]
        wholes = [1.0 - sum(p.value for p in self.parameters if p.shares == g and not p.free) for g in groups]
        self._sums = [(len(group), whole) for group, whole in zip(self._groups, wholes, strict=True)]
        self._fixed = {p.name: p.value for p in self.parameters if not p.free}
        self._scales = [(p.logarithmic, p.scale) for p in self._plain]
        self._order = [p.name for p in (*self._plain, *itertools.chain(*self._groups))]
        self._flat = _flat_names(model) if model else []
        self._packed = [self._fixed.get(x, math.nan) if isinstance(x, str) else x for x in self._flat]
        self._places = [self._flat.index(name) if name in self._flat else None for name in self._order]

    # ---- sizes and bounds ------------------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters, in the order of `values`."""
        return tuple(p.name for p in self.free)

    def signed_scale(self, friction: float) -> dict[str, float]:
        """Return the scale for the half-width of each parameter that may have either sign.

        It is one radian for angles and `friction`, N·m (N), for torques.
        """
        return {p.name: 1.0 if p.par.unit == "rad" else friction for p in self.free}

    @property
    def size(self) -> int:
        """The number of coordinates: one less than the free parameters for every group of shares."""
        return len(self._plain) + sum(len(g) - 1 for g in self._groups)

    @property
    def start(self) -> Array:
        """Coordinates of the values at which the search starts, shape (size,)."""
        return self.coordinates({p.name: p.value for p in self.free})

    @property
    def lower(self) -> Array:
        """Lower bounds of the coordinates, shape (size,)."""
        return np.array([p.limits[0] for p in self._plain] + [-30.0] * (self.size - len(self._plain)))

    @property
    def upper(self) -> Array:
        """Upper bounds of the coordinates, shape (size,)."""
        return np.array([p.limits[1] for p in self._plain] + [30.0] * (self.size - len(self._plain)))

    def coordinate_of(self, name: str) -> int | None:
        """Return the index of a free parameter's own coordinate; None for a share."""
        return next((i for i, p in enumerate(self._plain) if p.name == name), None)

    # ---- the map ---------------------------------------------------------------------------------------------

    def coordinates(self, values: Mapping[str, float]) -> Array:
        """Return the coordinates of named values of the free parameters, shape (size,)."""
        out = [p.coordinate(values[p.name]) for p in self._plain]
        for group in self._groups:
            last = values[group[-1].name]
            out += [math.log(values[p.name] / last) for p in group[:-1]]
        return np.clip(np.array(out, dtype=np.float64), self.lower, self.upper)

    def named(self, u: Array) -> dict[str, float]:
        """Return every parameter by name, including frozen ones."""
        values = dict(self._fixed)
        values.update(zip(self._order, self._free_values(u), strict=True))
        return values

    def _free_values(self, u: Array) -> list[float]:
        """Return the values of the free parameters, with shares last."""
        flat = u.tolist()
        out = [
            math.exp(x) if logarithmic else x * scale
            for x, (logarithmic, scale) in zip(flat, self._scales, strict=False)
        ]
        place = len(out)
        for size, whole in self._sums:
            ratios = [*flat[place : place + size - 1], 0.0]
            place += size - 1
            top = max(ratios)
            parts = [math.exp(x - top) for x in ratios]
            factor = whole / math.fsum(parts)
            out += [factor * x for x in parts]
        return out

    def values(self, u: Array) -> Array:
        """Return the values of the free parameters, shape (number of free parameters,)."""
        named = self.named(u)
        return np.array([named[p.name] for p in self.free], dtype=np.float64)

    def jacobian(self, u: Array) -> Array:
        """Return the derivatives of the free values by the coordinates, shape (free parameters, size)."""
        values = self.values(u)
        place = {p.name: i for i, p in enumerate(self.free)}
        out = np.zeros((len(self.free), self.size))
        for j, p in enumerate(self._plain):
            out[place[p.name], j] = values[place[p.name]] if p.logarithmic else p.scale
        column = len(self._plain)
        for group in self._groups:
            rows = [place[p.name] for p in group]
            part = values[rows]
            for j in range(len(group) - 1):
                out[rows, column + j] = -part * part[j] / part.sum()
                out[rows[j], column + j] += part[j]
            column += len(group) - 1
        return out

    def law_parameters(self, u: Array) -> Any:
        """Return the law's parameters, unchecked: for the inner loop of a fit."""
        return self._parameters(self.named(u))

    def packed(self, u: Array) -> Array:
        """Return the law's parameters as the flat array of compiled functions."""
        out = self._packed.copy()
        for place, value in zip(self._places, self._free_values(u), strict=True):
            if place is not None:
                out[place] = value
        return np.array(out, dtype=np.float64)

    def packed_values(self, values: Array) -> Array:
        """Return that array for values of the free parameters."""
        return self.packed_named({**self._fixed, **dict(zip(self.names, values.tolist(), strict=True))})

    def packed_named(self, named: Mapping[str, float]) -> Array:
        """Return that array for every parameter by name, as returned by `named`."""
        return np.array([named[x] if isinstance(x, str) else x for x in self._flat], dtype=np.float64)

    def model(self, u: Array) -> Model:
        """Return the law with these parameters.

        Raises
        ------
        ParameterError
            If the law refuses them together (`Law.check`).
        """
        assert self.base is not None
        return Model(self.base.law, **self._law_values(self.named(u)))

    def complaint(self, u: Array) -> str:
        """Return the law's error message for these parameters; empty if it accepts them."""
        assert self.base is not None
        check = self.base.law.check
        return check(self.law_parameters(u)) if check else ""

    def _parameters(self, named: Mapping[str, float]) -> Any:
        assert self.base is not None
        return self.base.law.Parameters(**self._law_values(named))

    def _law_values(self, named: Mapping[str, float]) -> dict[str, Any]:
        assert self.base is not None
        values: dict[str, Any] = {}
        for f in self.base.law.fields:
            if f.per_element:
                count = len(getattr(self.base.parameters, f.name))
                values[f.name] = tuple(named[f"{f.name}[{i}]"] for i in range(count))
            else:
                values[f.name] = named[f.name]
        return values


def _parameters_of(model: Model | None) -> list[Parameter]:
    """Return every number of a model's law, all free."""
    if model is None:
        return []
    out: list[Parameter] = []
    for f in model.law.fields:
        value: Any = getattr(model.parameters, f.name)
        shares = f.name if f.per_element and f.par.shares else ""
        numbers = list(value) if f.per_element else [value]
        for i, number in enumerate(numbers):
            name = f"{f.name}[{i}]" if f.per_element else f.name
            out.append(Parameter(name, f.par, float(number), True, shares, abs(float(number)) or 1.0))
    return out


def _flat_names(model: Model) -> list[Any]:
    """Return the entry of every place in the flat array of compiled functions: a parameter's name, or a count.

    The counts of elements are the model's, whatever the parameters.
    """
    fields, p = model.law.fields, model.parameters
    counts = {f.name: len(getattr(p, f.name)) for f in fields if f.per_element}
    places = {
        f.name: tuple(f"{f.name}[{i}]" for i in range(counts[f.name])) if f.per_element else f.name
        for f in fields
    }
    return packed(fields, model.law.Parameters(**places))


def _limited(parameter: Parameter, limits: Mapping[str, tuple[float, float]]) -> Parameter:
    """Return the parameter with the requested tighter bounds."""
    if parameter.name not in limits:
        return parameter
    low, high = limits[parameter.name]
    bounds = replace(parameter.par, lower=max(low, parameter.par.lower), upper=min(high, parameter.par.upper))
    return replace(parameter, par=bounds)


def _matched(wanted: list[str], parameters: Sequence[Parameter]) -> set[str]:
    """Return the full names of the parameters in `wanted`."""
    names = [p.name for p in parameters]
    out: set[str] = set()
    for name in wanted:
        hits = [n for n in names if n == name or n.partition("[")[0] == name]
        if not hits:
            raise UnknownName("parameter", name, names)
        out.update(hits)
    if not names:
        raise InputError("there is no parameter to identify; give a law or parameters")
    return out
