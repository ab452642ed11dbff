"""The result of an identification: estimates with intervals and verdicts, a model, and pictures as plain numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from stickslip.core.errors import UnknownName
from stickslip.core.messages import render, rendered
from stickslip.machines.servo import ServoAxis
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]


def silent(_what: str) -> None:
    """Do nothing: the progress callback of a silent identification."""


LINEAR = ServoAxis(motion="linear")
DECADES = 4.0
"""Decades that an interval of a positive number may span for its bounds to be worth printing."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """One identified number.

    Attributes
    ----------
    name, unit, symbol : str
        ``k[1]`` is element 1 (counted from 0) of parameter ``k``.
    value, std : float
        Point estimate and standard deviation; std is NaN if the noise level is unknown.
    lower, upper : float
        95 % interval; infinite where the data set no limit.
    identified : bool
    verdict : str
        Reason why it is not identified; empty if it is.
    cause : str
        Alternative model that widens it most ("play", "cogging 4", ...); empty if none causes a third of the variance.
    share : float
        Part of the variance that this alternative causes.
    """

    name: str
    unit: str
    symbol: str
    value: float
    std: float
    lower: float
    upper: float
    identified: bool
    verdict: str = ""
    cause: str = ""
    share: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "verdict", render(self.verdict))

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval, `lower` and `upper`."""
        return self.lower, self.upper

    @property
    def undetermined(self) -> bool:
        """Whether the interval of a positive number spans more than `DECADES`: its bounds then carry no information."""
        return self.lower > 0.0 and self.upper > 10.0**DECADES * self.lower

    def as_dict(self) -> dict[str, Any]:
        """Return plain data; values that are not finite become None, since JSON has no such numbers."""
        numbers = {k: getattr(self, k) for k in ("value", "std", "lower", "upper")}
        return {
            "name": self.name, "unit": self.unit, "symbol": self.symbol,
            **{k: v if math.isfinite(v) else None for k, v in numbers.items()},
            "identified": self.identified, "verdict": self.verdict,
            **({"cause": self.cause, "share": self.share} if self.cause else {}),
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class Held:
    """A number that was given and not fitted.

    Attributes
    ----------
    name, unit, symbol : str
    value : float
    """

    name: str
    unit: str
    symbol: str
    value: float

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {"name": self.name, "unit": self.unit, "symbol": self.symbol, "value": self.value}


@dataclass(frozen=True, eq=False)
class Trace:
    """One set of points of a picture.

    Attributes
    ----------
    label : str
        Empty for no entry in the legend.
    x, y : array, shape (n,)
    kind : str
        "line", "points", "open points", "cloud" (many small points), "faint" (one of many), "wide" (drawn under another
        line), "band" (between `y` and `y2`), "own band" (the same in the colour of the line that follows), "vertical"
        (a line at every x), or "rug" (a mark on the axis at every x; `y` is ignored).
    y2 : array, shape (n,), optional
    """

    label: str
    x: Array
    y: Array
    kind: str = "line"
    y2: Array | None = None


@dataclass(frozen=True, eq=False)
class Picture:
    """One pair of axes as plain numbers; `stickslip.report.identification.draw_picture_to` draws it.

    Attributes
    ----------
    name : str
        Used in file names.
    title, message : str
        Title; the finding that it shows.
    x_label, y_label : str
        With the unit.
    traces : tuple of Trace
    x_scale : str
        "linear" or "log".
    """

    name: str
    title: str
    message: str
    x_label: str
    y_label: str
    traces: tuple[Trace, ...]
    x_scale: str = "linear"


@dataclass(frozen=True, eq=False)
class Identification:
    """The result of one method.

    Attributes
    ----------
    method : str
    model : Model or None
        None if the method does not yield a complete law.
    estimates : tuple of Estimate
    correlation : array, shape (n, n)
        Correlation of the estimates, in their order; NaN where it is undefined.
    misfit : mapping of str to float
        Goodness of fit; `misfit_unit` gives the units.
    notes : tuple of str
        Caveats for the user, one sentence each.
    measure_next : tuple of str
        Measurements that would determine what is not identified.
    pictures : tuple of Picture
    details : mapping
        Further results of the method, plain data or arrays.
    findings : tuple
        Findings of the log's check, in its order.
    held : tuple of Held
        Values given by the user and not fitted.
    """

    method: str
    model: Model | None
    estimates: tuple[Estimate, ...]
    correlation: Array
    misfit: Mapping[str, float]
    notes: tuple[str, ...] = ()
    measure_next: tuple[str, ...] = ()
    pictures: tuple[Picture, ...] = ()
    details: Mapping[str, Any] = field(default_factory=dict[str, Any])
    findings: tuple[Any, ...] = ()
    held: tuple[Held, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "notes", rendered(self.notes))
        object.__setattr__(self, "measure_next", rendered(self.measure_next))

    def __getitem__(self, name: str) -> Estimate:
        for estimate in self.estimates:
            if estimate.name == name:
                return estimate
        raise UnknownName("estimate", name, [e.name for e in self.estimates])

    def of_linear_axis(self) -> Identification:
        """Return the same numbers with the units of a linear axis; ``rms_Nm`` is then ``rms_N``."""
        details: dict[str, Any] = {"axis": LINEAR, **self.details}
        if "comparison" in details:
            details["comparison"] = {
                name: _in_newtons(cells) for name, cells in details["comparison"].items()
            }
        estimates = tuple(replace(e, unit=LINEAR.unit(e.unit)) for e in self.estimates)
        return replace(self, estimates=estimates, misfit=_in_newtons(self.misfit), details=details)

    def misfit_unit(self, name: str) -> str:
        """Return the unit of an entry of `misfit`; empty for a ratio or a count."""
        for ending, unit in (("_Nm", "N·m"), ("_N", "N"), ("_rad", "rad")):
            if name.endswith(ending):
                return unit
        if not name.endswith(("_rms", "_mean_absolute")):
            return ""
        units: Mapping[str, str] = self.details.get("units", {})
        return units.get(name.removeprefix("held_out_").partition("_")[0], "")

    @property
    def not_identified(self) -> tuple[str, ...]:
        """Names of the estimates that the data do not determine."""
        return tuple(e.name for e in self.estimates if not e.identified)

    @property
    def assumed(self) -> Mapping[str, float]:
        """Values of the law's parameters that were not fitted, by name (``k[1]``): its defaults, or what was given.

        Empty for the inverse dynamics, whose numbers have names of their own.
        """
        if self.model is None or self.method == "inverse dynamics":
            return {}
        fitted, out = {e.name for e in self.estimates}, dict[str, float]()
        for f in self.model.law.fields:
            if f.per_element and f.par.per != "element":
                continue  # where the points of a table lie is no assumption
            value: Any = getattr(self.model.parameters, f.name)
            each = (
                {f"{f.name}[{i}]": float(x) for i, x in enumerate(value)}
                if f.per_element
                else {f.name: float(value)}
            )
            out |= {name: x for name, x in each.items() if name not in fitted}
        return out

    def as_dict(self) -> dict[str, Any]:
        """Return law, estimates, correlation, misfit and notes as plain data for JSON, without pictures."""
        correlation = [[c if math.isfinite(c) else None for c in row] for row in self.correlation.tolist()]
        return {
            "method": self.method,
            "model": self.model.as_dict() if self.model else None,
            "estimates": [e.as_dict() for e in self.estimates],
            "assumed": dict(self.assumed),
            "held": [h.as_dict() for h in self.held],
            "correlation": correlation,
            "misfit": {k: float(v) for k, v in self.misfit.items()},
            "notes": list(self.notes),
            "measure_next": list(self.measure_next),
        }


def missing_fall(misfit: Mapping[str, float]) -> float:
    """Return the fall of friction with velocity that the law lacks, N·m (N); 0 if it lacks none."""
    return next((misfit[k] for k in ("fall_missing_Nm", "fall_missing_N") if k in misfit), 0.0)


def _in_newtons(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Return numbers under names that end with their unit: ``_N`` in place of ``_Nm``."""
    return {f"{k.removesuffix('_Nm')}_N" if k.endswith("_Nm") else k: v for k, v in numbers.items()}
