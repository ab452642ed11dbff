"""A law with parameters, and a reference with parameters: what an axis, a compensator and a file hold."""

from __future__ import annotations

import inspect
import os
import warnings
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, cast, overload

import numpy as np

from stickslip.core.arguments import arguments_checked
from stickslip.core.config import Table, read_toml
from stickslip.core.errors import InputError, ModelRemark, ParameterError, suggestion
from stickslip.core.reprs import Vector, call_of, unmasked
from stickslip.core.spec import Law, ReferenceKind
from stickslip.models import plugins
from stickslip.references.through_points import velocities_through

Array = np.ndarray[Any, np.dtype[np.float64]]

MODEL_FORMAT = "stickslip-model-1"
"""What a file that `stickslip identify` wrote says it is."""
TOP_KEYS = (
    "format", "law", "parameters", "choices", "axis", "motion", "method", "notes", "measure_next", "position_map",
    "drivetrain", "angle", "misfit", "estimates", "assumed", "correlation", "data", "versions", "trust", "doubts",
    "evidence", "speeds", "trajectory", "recommended", "controller", "laws",
)  # fmt: skip
"""Keys of a model's file; the last three are what `stickslip recommend` and `stickslip rig commission` add."""
AXIS_NUMBERS = (
    "inertia", "offset", "gravity", "gravity_angle", "drive_gain", "back_emf", "load_motor", "load_external",
    "backlash", "gear_ratio",
)  # fmt: skip
TABLE_KEYS = {
    "axis": (*AXIS_NUMBERS, "seen_from"),
    "speeds": ("positive", "negative"),
    "trajectory": ("source", "time", "position", "velocity"),
    "correlation": ("names", "matrix"),
}
"""Keys of the tables in it that a person may write too."""

SHOWN = 6
"""Numbers of a parameter that are printed one by one, at most."""
MOST_BREAKS = 200_000
"""Turning points of a reference within a run"""


class Model:
    """A friction law with its parameters.

    Parameters
    ----------
    law : str or Law
        A registered name, the path of a law's file, or a law.
    choices : mapping, optional
        Options of the law by name, ``{"slip_rule": "literal"}``.
    **parameters
        The law's parameters in SI units; a list for those with one value per element.

    Raises
    ------
    UnknownName, ParameterError
        One line that names the thing, its value and the remedy.

    Notes
    -----
    Two are equal where law, choices and parameters are. A pickle names the law, or holds the path and the text of its
    file, so that other processes run the same one.

    Warns
    -----
    ModelRemark
        Where the parameters are allowed but seldom meant (`Law.remark`): F_S below F_C, say.
    """

    __slots__ = ("law", "parameters")

    @arguments_checked
    def __init__(self, law: str | Law, choices: Mapping[str, str] | None = None, **parameters: Any) -> None:
        found = plugins.law(law) if isinstance(law, str) else plugins.completed(law)
        self.law: Law = found.having(**choices) if choices else found
        self.parameters: Any = self.law.parameters(parameters)
        if (words := self.law.remark(self.parameters)) and (level := level_of_caller()):
            warnings.warn(words, ModelRemark, stacklevel=level)

    @arguments_checked
    def warn(self, origin: str = "") -> Model:
        """This model, with a `ModelRemark` where its parameters are allowed but seldom meant; `origin` says where it
        stands."""
        if words := self.law.remark(self.parameters):
            warnings.warn(f"{origin}: {words}" if origin else words, ModelRemark, stacklevel=4)
        return self

    @classmethod
    @arguments_checked
    def from_file(cls, path: str | os.PathLike[str]) -> Model:
        """Read the law that `stickslip identify` wrote to ``model.toml``, or a person: ``law`` and ``[parameters]``.

        Raises
        ------
        InputError
            If there is no such file, it is no such model, or its law is code that nobody has approved.
        """
        return cls.from_table(read_toml(Path(path)))

    @classmethod
    @arguments_checked
    def from_table(cls, table: Table) -> Model:
        """As `from_file`, of the content of a file: a `table` in which the path of a law's file is relative to its
        document's folder."""
        file = table.document.name
        if table.values.get("format", MODEL_FORMAT) != MODEL_FORMAT:
            raise table.error(
                "format", f"is of another version; this one reads {MODEL_FORMAT!r}: identify the axis again"
            )
        if not (table.has("law") or table.has("parameters")):
            held = f"but {', '.join(table.values)}" if table.values else "and nothing else"
            raise InputError(
                f"{file} holds no model (`law` and a table [parameters]) {held}; give what `stickslip identify` wrote"
            )
        name = table.text("law")
        if name.endswith(".py"):
            name = str(table.document.locate(name))
        law = plugins.law(name, table.label("law"))
        choices = dict(table.table("choices").values) if table.has("choices") else dict[str, Any]()
        with table.blamed():
            variant = law.having(**choices)
            refuse_unknown_keys(table, variant)
            refuse_odd_axis(table)
            parameters = table.table("parameters")
            values = parameters.rest()
            known = {f.name for f in variant.fields}
            for key in values:
                if key not in known:
                    raise parameters.error(key, f"is no parameter of this law; {variant.remedy_for(key)}")
            made = cls(law, choices, **values)
            # What an identification found was remarked upon there; nobody mistook one number for another.
            return made if "format" in table.values else made.warn(file)

    @arguments_checked
    def having(self, **choices: str) -> Model:
        """This model under other options of its law; options that the law does not have are left out."""
        known = {c.name for c in self.law.choices}
        wanted = {name: option for name, option in choices.items() if name in known}
        same = all(self.law.option_of(n) == o for n, o in wanted.items())
        return self if same else Model(self.law, wanted, **self.parameters._asdict())

    @arguments_checked
    def scaled(self, **factors: float) -> Model:
        """This model with some parameters multiplied, ``model.scaled(fs=1.1, fc=1.1)``.

        Parameters
        ----------
        **factors : float
            By the names of the parameters; one factor multiplies every element of a list.

        Raises
        ------
        ParameterError
            If the law has no such parameter, or the result is out of bounds.
        """
        values: dict[str, Any] = self.parameters._asdict()
        for name, factor in factors.items():
            if name not in values:
                raise ParameterError(f"{self.law.name}: no parameter {name!r}; {suggestion(name, values)}")
            values[name] = _times(factor, values[name])
        return Model(self.law, **values)

    @overload
    def sliding_torque(self, velocity: float) -> float: ...
    @overload
    def sliding_torque(self, velocity: Iterable[float]) -> Array: ...
    @arguments_checked
    def sliding_torque(self, velocity: float | Vector) -> float | Array:
        """Friction torque at constant velocity, when everything that moves in the contact has settled.

        Parameters
        ----------
        velocity : float or array_like
            rad/s (m/s); of either sign.

        Returns
        -------
        float or array
            N·m (N) against the motion, of the velocity's shape; at rest 0, where the contact withstands any torque up
            to break-away.

        Raises
        ------
        ParameterError
            If the law says no torque at constant velocity, or a velocity is not finite.
        """
        steady = self.law.steady
        if steady is None:
            raise ParameterError(
                f"{self.law.name}: says no torque at constant velocity; simulate a motion with "
                "`stickslip.respond(model, reference, times)`"
            )
        given = np.asarray(unmasked(velocity), dtype=np.float64)
        odd = given[~np.isfinite(given)]
        if odd.size:
            raise ParameterError(f"sliding_torque: velocity = {odd[0]:g} rad/s must be finite")
        out = np.array([steady(v, self.parameters) if v else 0.0 for v in given.reshape(-1).tolist()])
        return out.reshape(given.shape) if given.ndim else float(out[0])

    def as_dict(self) -> dict[str, Any]:
        """Law, choices and parameters as plain data."""
        return {"law": self.law.name, **dict(self.law.chosen), **_plain(self.parameters)}

    def __repr__(self) -> str:
        chosen = [("choices", dict(self.law.chosen))] if self.law.chosen else []
        return call_of("Model", [self.law.called], [*chosen, *self.parameters._asdict().items()])

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Model):
            return NotImplemented
        return self.law is other.law and self.parameters == other.parameters

    def __hash__(self) -> int:
        return hash((self.law, self.parameters))

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return _model, (self.law, self.parameters._asdict())


def refuse_unknown_keys(table: Table, law: Law | None = None) -> None:
    """Refuse keys that a model's file does not have, with the nearest that it has, whatever table that is in.

    Parameters
    ----------
    table : Table
        The whole file.
    law : Law, optional
        Under the file's choices; None for a file without a law.

    Raises
    ------
    ConfigError
    """
    tables = {"axis": TABLE_KEYS["axis"]}
    if law is not None:
        tables |= {
            "choices": tuple(c.name for c in law.choices),
            "parameters": tuple(f.name for f in law.fields),
        }
    elsewhere = {key: name for name, keys in tables.items() for key in keys}
    table.refuse_unknown(TOP_KEYS, elsewhere)
    for name, keys in TABLE_KEYS.items():
        if isinstance(table.values.get(name), dict):
            own = {k: v for k, v in elsewhere.items() if v != name}
            table.table(name).refuse_unknown(keys, own)


def refuse_odd_axis(table: Table) -> None:
    """Refuse a model's file whose kind of motion or numbers of the axis cannot be used.

    Raises
    ------
    ConfigError
    """
    table.choice("motion", ("rotary", "linear"), "rotary")
    if table.has("axis"):
        axis = table.table("axis")
        for key in AXIS_NUMBERS:
            axis.number(key, "SI units", 0.0)
        axis.choice("seen_from", ("motor", "load"), "load")


def _model(law: Law, values: Mapping[str, Any]) -> Model:
    """A model as a pickle says it; what is remarkable of it was said where it was made."""
    return Model(law, **values)


def level_of_caller(between: int = 3) -> int:
    """The ``stacklevel`` of whoever called the constructor that asks, behind `dataclasses.replace` too; 0 where it was
    the package itself: a fit tries many models that nobody has written. `between` are the frames from this function to
    the caller's: itself, the constructor, what checks its arguments; of a dataclass also its ``__post_init__``."""
    frame, level = inspect.currentframe(), between
    for _ in range(between):
        frame = frame.f_back if frame else None
    while frame is not None and frame.f_globals.get("__name__") in ("dataclasses", "copy"):  # their `replace`
        frame, level = frame.f_back, level + 1
    within = frame is not None and str(frame.f_globals.get("__name__", "")).startswith("stickslip.")
    return 0 if within else level


def _times(factor: float, value: Any) -> Any:
    """A parameter, or each of its values, multiplied."""
    if isinstance(value, tuple):
        return [factor * v for v in cast("tuple[float, ...]", value)]
    return factor * value


def _plain(parameters: Any) -> dict[str, Any]:
    """Parameters as numbers and lists."""
    values: dict[str, Any] = parameters._asdict()
    return {k: list(cast("tuple[float, ...]", v)) if isinstance(v, tuple) else v for k, v in values.items()}


class Reference:
    """A reference motion: a kind with its parameters.

    Parameters
    ----------
    kind : str
        A registered kind: sine, plain_sine, harmonic, step, ramp, staircase, scurve, table. ``sine`` starts from rest,
        A (1 - cos 2 pi f t), and spans from 0 to 2 A; ``plain_sine`` is A sin 2 pi f t.
    **parameters
        The kind's parameters in SI units.
    """

    __slots__ = ("kind", "parameters")

    @arguments_checked
    def __init__(self, kind: str | ReferenceKind, **parameters: Any) -> None:
        self.kind: ReferenceKind = plugins.reference_kind(kind) if isinstance(kind, str) else kind
        self.parameters: Any = self.kind.parameters(parameters)

    @classmethod
    @arguments_checked
    def table(cls, time: Vector, position: Vector, velocity: Vector | None = None) -> Reference:
        """A reference through points.

        Parameters
        ----------
        time, position : array_like, shape (n,)
            s, ascending; rad.
        velocity : array_like, shape (n,), optional
            rad/s; if left out, the motion starts and ends at rest, and has the derivative through five points where
            they show a smooth motion, else that of a cubic which does not overshoot them
            (`stickslip.references.through_points`).

        Raises
        ------
        ParameterError
            One line that names the first row that cannot be: a number that is none or not finite, or a time that does
            not come after the one before; or shapes that do not fit.
        """
        t, x = points(time, position)
        v = velocities_through(t, x) if velocity is None else column("velocity", velocity, "rad/s", t.size)
        return cls("table", time=t, position=x, velocity=v)

    @arguments_checked
    def breaks(self, duration: float) -> list[float]:
        """Times inside (0, duration) that integrators step onto, s."""
        per_second = 2.0 * float(getattr(self.parameters, "frequency", 0.0))
        if not per_second * duration <= MOST_BREAKS:
            raise InputError(
                f"{self!r} turns {per_second * duration:.3g} times within {duration:g} s, {MOST_BREAKS:,} at most; "
                "give a lower frequency or a shorter duration"
            )
        return sorted(t for t in self.kind.breaks(self.parameters, duration) if 0.0 < t < duration)

    @arguments_checked
    def sample(self, time: Vector) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Position (rad), velocity (rad/s) and acceleration (rad/s²), shape (n, 3), at each `time` (s), shape (n,).

        Raises
        ------
        ParameterError
            If the times are a table.
        """
        from types import SimpleNamespace

        out = SimpleNamespace(position=0.0, velocity=0.0, acceleration=0.0)
        rows: list[tuple[float, float, float]] = []
        times = np.asarray(time, dtype=np.float64)
        if times.ndim > 1:
            raise ParameterError(
                f"reference: time has the shape {times.shape}; give the times one after another, shape (n,)"
            )
        for t in times.reshape(-1).tolist():
            self.kind.profile(t, self.parameters, out)
            rows.append((out.position, out.velocity, out.acceleration))
        return np.array(rows, dtype=np.float64).reshape(-1, 3)

    def as_dict(self) -> dict[str, Any]:
        """Kind and parameters as plain data."""
        return {"kind": self.kind.name, **_plain(self.parameters)}

    def __repr__(self) -> str:
        inside = ", ".join(f"{k}={_short(v)}" for k, v in self.parameters._asdict().items())
        return f"Reference({self.kind.name!r}, {inside})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Reference):
            return NotImplemented
        return self.kind is other.kind and self.parameters == other.parameters

    def __hash__(self) -> int:
        return hash((self.kind, self.parameters))

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return _reference, (self.kind, self.parameters._asdict())


def _reference(kind: ReferenceKind, values: Mapping[str, Any]) -> Reference:
    """A reference as a pickle says it."""
    return Reference(kind, **values)


def _short(value: Any) -> str:
    """A parameter as code; of many numbers how many, and their range."""
    numbers = cast("tuple[float, ...]", value if isinstance(value, tuple) else ())
    if len(numbers) <= SHOWN:
        return f"{value!r}"
    return f"<{len(numbers)} numbers, {min(numbers):g} to {max(numbers):g}>"


def column(name: str, values: Vector, unit: str, rows: int = 0) -> Array:
    """A column of a table of points, of so many rows (0: of any number).

    Raises
    ------
    ParameterError
    """
    try:
        found: Array = np.asarray(unmasked(values), dtype=np.float64)
    except (TypeError, ValueError):
        raise ParameterError(
            f"table: {name} holds what is no number; give one number a point, in {unit}"
        ) from None
    if found.ndim != 1:
        raise ParameterError(
            f"table: {name} has the shape {found.shape}; give one number a point, shape (n,)"
        )
    if rows and found.size != rows:
        raise ParameterError(f"table: time has {rows} values and {name} {found.size}; give as many of each")
    odd = np.flatnonzero(~np.isfinite(found))
    if odd.size:
        raise ParameterError(
            f"table: {name}[{odd[0]}] = {found[odd[0]]:g} {unit} must be a finite number; leave the row out"
        )
    return found


def points(time: Vector, position: Vector) -> tuple[Array, Array]:
    """Times (s) and positions (rad) of a table of points.

    Raises
    ------
    ParameterError
    """
    t = column("time", time, "s")
    x = column("position", position, "rad", t.size)
    if t.size < 2:
        raise ParameterError(f"table: time has {t.size} values; give at least two points")
    late = np.flatnonzero(np.diff(t) <= 0.0)
    if late.size:
        i = int(late[0]) + 1
        remedy = "leave one of both rows out" if t[i] == t[i - 1] else "sort the rows by time"
        raise ParameterError(
            f"table: time[{i}] = {t[i]:.9g} s must come after time[{i - 1}] = {t[i - 1]:.9g} s; {remedy}"
        )
    return t, x
