"""What a target with a law of its own can hold of a model, what it loses, and the nearest it can carry.

Such a target names the laws of this package that say the same as its own (`Form`). `carried` returns the model in
the first form that loses nothing; where all lose something it refuses with what is lost and offers the nearest form,
with its residual on the model's sliding curve, which `Job.nearest` takes.
"""

from __future__ import annotations

import functools
import importlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from stickslip.core.errors import ParameterError
from stickslip.core.messages import axis_unit, name_option
from stickslip.core.rebinding import NEGATIVE
from stickslip.core.spec import Bristle, Law, Mode
from stickslip.exports._analysis import fields_read
from stickslip.exports._sliding import Curve
from stickslip.exports._text import folded
from stickslip.exports.job import CannotCarry, Job
from stickslip.models import plugins
from stickslip.models.model import Model
from stickslip.subset import law_layouts, named

Array = np.ndarray[Any, np.dtype[np.float64]]

DIFFERENCE = "the difference between the directions"
CHANGE = "the change of the difference between the directions with the velocity"
EXACT = 1e-9
"""Of the largest torque: what differs by less is the same."""
DEPENDENCES = {
    "position": "its dependence on position",
    "load": "its dependence on the normal load",
    "temperature": "its dependence on temperature",
    "time": "its slow change over time",
}


# ---- forms -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Form:
    """A law that a target has room for.

    Attributes
    ----------
    words : str
        What it is, for people.
    law : str or Law
        The law that says the same.
    fit : callable
        ``fit(curve)``: values of that law's parameters, nearest to a sliding curve.
    keeps : frozenset of str
        What it holds besides a symmetric sliding curve and the torque at rest: "memory", "bristle" (the memory of a
        law that is one bristle, and of no other), "slope" (through rest), "direction", "constant" (a difference between
        the directions that is the same at all velocities), "position", "load", "temperature", "time".
    density : int
        How close the velocities must lie at which it is compared (`Curve`).
    tolerance : float
        Of the largest torque: a curve that differs by less counts as carried.
    fixed : mapping
        Parameters of that law which the target does not let one choose.
    """

    words: str
    law: str | Law
    fit: Callable[[Curve], Mapping[str, Any]]
    keeps: frozenset[str] = frozenset()
    density: int = 1
    tolerance: float = EXACT
    fixed: Mapping[str, float] = field(default_factory=dict[str, float])


def fit_coulomb(curve: Curve) -> dict[str, float]:
    """Coulomb and viscous friction: least squares with velocities weighted evenly, neither below 0.

    The slope of a smooth sign is left out: the jump of Coulomb friction is in its place.
    """
    weight = curve.width * curve.sliding
    (fc, sigma2), _ = _not_negative([np.ones_like(curve.velocity), curve.velocity], curve.mean, weight)
    return {"fc": fc, "sigma2": sigma2}


def fit_static(curve: Curve) -> dict[str, float]:
    """The torque at rest, and Coulomb and viscous friction as `fit_coulomb`."""
    sliding = fit_coulomb(curve)
    return {"fs": max(sum(curve.rest) / 2.0, sliding["fc"], 1e-12 * curve.size), **sliding}


def fit_stribeck(curve: Curve, shape: float | None = None) -> dict[str, float]:
    """Stribeck friction with any shape factor, or with this one; slow velocities weigh as much as fast ones."""
    optimize: Any = importlib.import_module("scipy.optimize")  # it carries no types
    v, target = np.append(curve.velocity, 0.0), np.append(curve.mean, sum(curve.rest) / 2.0)
    weight = np.ones_like(v)

    def parts(x: Array) -> tuple[list[float], Array]:
        bend = np.exp(-np.power(v / math.exp(x[0]), x[-1] if shape is None else shape))
        return _not_negative([np.ones_like(v), bend, v], target, weight)

    shapes: list[list[float]] = [[1.0], [2.0]] if shape is None else [[]]
    starts = [[math.log(curve.top * share), *s] for share in (1e-3, 1e-2, 1e-1) for s in shapes]
    bounds = ([math.log(1e-6 * curve.top), 0.2], [math.log(10.0 * curve.top), 20.0])
    bounds = tuple(b[: len(starts[0])] for b in bounds)

    def residuals(x: Array) -> Array:
        return parts(x)[1]

    found: list[Any] = [
        optimize.least_squares(residuals, s, bounds=bounds, xtol=1e-14, ftol=1e-14) for s in starts
    ]
    best: Array = min(found, key=_cost).x
    (fc, rise, sigma2), _ = parts(best)
    return {
        "fs": fc + rise, "fc": fc, "vs": math.exp(best[0]),
        "delta_s": float(best[-1]) if shape is None else shape, "sigma2": sigma2,
    }  # fmt: skip


def _cost(found: Any) -> float:
    return found.cost


def _not_negative(columns: Sequence[Array], target: Array, weight: Array) -> tuple[list[float], Array]:
    """Least squares with coefficients that are not negative, and the weighted residuals."""
    optimize: Any = importlib.import_module("scipy.optimize")
    root = np.sqrt(weight)
    matrix = np.stack(columns, axis=1) * root[:, None]
    size = np.abs(matrix).max(axis=0)
    x: Array = optimize.nnls(matrix / size, target * root)[0] / size
    return [float(c) for c in x], matrix @ x - target * root


COULOMB = Form("Coulomb and viscous friction", "coulomb", fit_coulomb)
STATIC = Form("static, Coulomb and viscous friction", "static", fit_static)
STRIBECK = Form("Stribeck and viscous friction", "stribeck_plain", fit_stribeck)


def with_constant(form: Form) -> Form:
    """The form of a target that holds a constant torque too: half the difference between the directions."""
    law = plugins.law(form.law) if isinstance(form.law, str) else form.law
    law = law.having(symmetry="asymmetric")
    twins = {f.name: f.name.removesuffix(NEGATIVE) for f in law.fields if f.name.endswith(NEGATIVE)}

    def fit(curve: Curve) -> dict[str, Any]:
        values, constant = dict(form.fit(curve)), constant_of(curve)
        values |= {name: values[own] for name, own in twins.items() if own in values}
        for level in ("fc", "fs"):
            if level in values:
                values |= {level: values[level] + constant, level + NEGATIVE: values[level] - constant}
        return values

    fixed = {**form.fixed, **{name: form.fixed[own] for name, own in twins.items() if own in form.fixed}}
    return replace(
        form, words=f"{form.words} and a constant torque", law=law, fit=fit, keeps=form.keeps | {"constant"},
        fixed=fixed,
    )  # fmt: skip


def constant_of(curve: Curve) -> float:
    """Half the mean difference between the directions, N·m: positive where positive motion meets more friction."""
    return 0.5 * float(np.sum(curve.width * (curve.forward - curve.backward)))


def parted(model: Model) -> tuple[Model, float]:
    """A law with other parameters for v < 0 as the mean of both directions and a constant torque, N·m."""
    law, p = model.law, model.parameters
    if law.chosen.get("symmetry") != "asymmetric":
        return model, 0.0
    constant = 0.5 * (p.fc - getattr(p, "fc" + NEGATIVE))
    return Model(law.having(symmetry="symmetric"), **mean_of(model)._asdict()), constant


def mean_of(model: Model) -> Any:
    """Parameters of a law with others for v < 0: the mean of both directions."""
    law, both = model.law.having(symmetry="symmetric"), model.parameters._asdict()
    return law.parameters({f.name: between(both[f.name], both.get(f.name + NEGATIVE)) for f in law.fields})


# ---- what is lost ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Nearest:
    """A model in a form of the target.

    Attributes
    ----------
    form : Form
    model : Model
        Of the form's law.
    lost : tuple of str
        What it does not hold; empty where it is the user's model as it is.
    residual, at : float
        Largest difference on the sliding curve, N·m, and its velocity, rad/s (0: at rest).
    at_rest : float
        Difference of the torque at rest, N·m.
    rms : float
        Over evenly spaced velocities of both directions, N·m.
    size, top : float
        The largest torque of the curve, N·m, and its greatest velocity, rad/s.
    """

    form: Form
    model: Model
    lost: tuple[str, ...]
    residual: float
    at: float
    at_rest: float
    rms: float
    size: float
    top: float

    @property
    def values(self) -> str:
        """The parameters, for people."""
        law, p = self.model.law, self.model.parameters
        per = next((f for f in law.fields if f.per_element), None)
        if per is not None:
            return f"one of {len(getattr(p, per.name))} {per.par.per}s"
        return ", ".join(f"{f.name} = {getattr(p, f.name):.5g} {axis_unit(f.par.unit)}" for f in law.fields)

    @property
    def error(self) -> str:
        """The residual, for people."""
        if self.residual <= EXACT * self.size:
            return f"0 {axis_unit('N·m')} off the sliding curve from 0 to {self.top:.3g} {axis_unit('rad/s')}"
        place = "at rest" if self.at == 0.0 else f"at {self.at:.3g} {axis_unit('rad/s')}"
        return (
            f"at most {self.residual:.3g} {axis_unit('N·m')} ({100.0 * self.residual / self.size:.3g} %, "
            f"{place}) off the sliding "
            f"curve, {self.rms:.3g} {axis_unit('N·m')} rms from 0 to {self.top:.3g} {axis_unit('rad/s')}"
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user must know of it; nothing where nothing is lost."""
        lost = (f"not carried: {'; '.join(self.lost)}",) if self.lost else ()
        differs = self.lost or self.residual > EXACT * self.size
        return (*lost, f"nearest {self.form.words}: {self.error}") if differs else ()


def carried(job: Job, target: str, forms: Sequence[Form], also_lost: Sequence[str] = ()) -> Nearest:
    """The job's model in the first of the forms, the simplest first, that loses nothing.

    ``also_lost`` is what the target does not hold for reasons of its own.

    Raises
    ------
    CannotCarry
        If all lose something and the job does not ask for the nearest.
    """
    one, density = _given(job), max(form.density for form in forms)
    near = [found for form in forms if (found := _found(one, job.top_speed, density, form)) is not None]
    tried = [replace(found, lost=(*found.lost, *also_lost)) for found in near]
    for found in tried:
        if not found.lost:
            return found
    if not tried:
        raise CannotCarry(
            f"{target} carries {forms[-1].words}, and nothing of {job.model.law.name} is of that kind"
        )
    best = min(tried, key=lambda n: (len(n.lost), n.rms, n.at_rest))
    if job.nearest:
        return best
    raise CannotCarry(
        f"{target} carries {best.form.words}; {job.model.law.name} would lose {'; '.join(best.lost)}. The nearest is "
        f"{best.values}: {best.error}; {name_option('top_speed')} gives another highest velocity. Take it with "
        f"{name_option('nearest', True)}"
    )


@dataclass(frozen=True)
class _Given:
    """A model, the same as one of the same law and parameters."""

    law: Law
    parameters: Any
    model: Model = field(compare=False)


def _given(job: Job) -> _Given:
    return _Given(job.model.law, job.model.parameters, job.model)


@functools.lru_cache(maxsize=32)
def _found(one: _Given, top_speed: float | None, density: int, form: Form) -> Nearest | None:
    """As `nearest`: what is written is looked for again where it is checked, and where a refusal is overruled."""
    return nearest(_curve(one, top_speed, density), form)


@functools.lru_cache(maxsize=8)
def _curve(one: _Given, top_speed: float | None, density: int) -> Curve:
    return Curve.of(one.model, top_speed, density)


def curve_of(job: Job) -> Curve:
    """The sliding curve of the job's model, computed once."""
    return _curve(_given(job), job.top_speed, 1)


def nearest(curve: Curve, form: Form) -> Nearest | None:
    """The nearest model of a form, or None where the form has no such parameters."""
    uneven = "constant" in form.keeps and difference_beyond(curve, form) > EXACT * curve.size
    same = None if uneven else _made(form, _same_names(curve, form))
    as_it_is = _compared(curve, same, form) if same else None
    if as_it_is is not None and as_it_is.residual <= EXACT * curve.size:
        return as_it_is
    fitted = _made(form, form.fit(curve))
    found = _compared(curve, fitted, form) if fitted else None
    return min((n for n in (as_it_is, found) if n is not None), key=lambda n: n.rms, default=None)


def _made(form: Form, values: Mapping[str, Any]) -> Model | None:
    try:
        return Model(form.law, **values)
    except ParameterError:
        return None


def _same_names(curve: Curve, form: Form) -> dict[str, Any]:
    """The model's own values of the parameters that the form calls by the same names."""
    values: dict[str, Any] = curve.model.parameters._asdict()
    fields = (plugins.law(form.law) if isinstance(form.law, str) else form.law).fields
    same = {f.name: values.get(f.name, 0.0 if f.par.default is None else f.par.default) for f in fields}
    return {**same, **form.fixed}


def _compared(curve: Curve, model: Model, form: Form) -> Nearest:
    other = Curve(model, curve.top)
    other.__dict__["velocity"] = curve.velocity  # where the model slides
    error = np.maximum(abs(other.forward - curve.forward), abs(other.backward - curve.backward))
    worst = int(np.argmax(error))
    residual, at = float(error[worst]), float(curve.velocity[worst])
    at_rest = max(abs(a - b) for a, b in zip(other.rest, curve.rest))
    if at_rest >= 0.99 * residual:
        residual, at = max(at_rest, residual), 0.0
    both = (other.forward - curve.forward) ** 2 + (other.backward - curve.backward) ** 2
    rms = math.sqrt(float(np.sum(curve.width * both)) / 2.0)
    lost = losses(curve, form)
    shape = float(np.max(np.abs(other.mean - curve.mean)))
    if shape > form.tolerance * curve.size:
        lost.append("the shape of its sliding curve")
    elif at_rest > form.tolerance * curve.size and not set(lost) & {DIFFERENCE, CHANGE}:
        lost.append("its torque at rest")
    return Nearest(form, model, tuple(lost), residual, at, at_rest, rms, curve.size, curve.top)


def losses(curve: Curve, form: Form) -> list[str]:
    """What a form does not hold of a model, besides the shape of its sliding curve."""
    law = curve.given.law
    out: list[str] = []
    if "bristle" in form.keeps and not law.state_fields:
        out.append("its rest without elasticity (a bristle bends)")
    if (
        "memory" not in form.keeps
        and law.state_fields
        and not ("bristle" in form.keeps and bristle_of(curve))
    ):
        bends = [folded(f.par.meaning) for f in law.state_fields if not isinstance(f.par, Mode)]
        memory = "; non-local memory" if law.non_local_memory else ""
        out.append(f"pre-sliding and hysteresis ({', '.join(bends[:3]) or 'its states'}{memory})")
    if "slope" not in form.keeps and curve.slowest > 0.0:
        out.append(f"its slope or band of rest up to {curve.slowest:.2g} {axis_unit('rad/s')}")
    if "direction" not in form.keeps and difference_beyond(curve, form) > EXACT * curve.size:
        out.append(CHANGE if "constant" in form.keeps else DIFFERENCE)
    read = surroundings_of(curve.given)
    return out + [words for name, words in DEPENDENCES.items() if name in read and name not in form.keeps]


def difference_beyond(curve: Curve, form: Form) -> float:
    """The largest difference between the directions, without the constant part where the form holds it, N·m."""
    constant = 2.0 * constant_of(curve) if "constant" in form.keeps else 0.0
    unequal = np.abs(curve.forward - curve.backward - constant)
    return max(float(np.max(unequal)), abs(curve.rest[0] - curve.rest[1] - constant))


def bristle_of(curve: Curve) -> Bristle | None:
    """The law's bristle where it is one like LuGre's, the dependences on direction and surroundings aside."""
    model = curve.model
    law, p = model.law, model.parameters
    if law.chosen.get("symmetry") == "asymmetric":
        law, p = law.having(symmetry="symmetric"), mean_of(model)
    contact = law.modes(p) if law.modes else None
    return contact if isinstance(contact, Bristle) and not contact.own_growth else None


def between(forth: Any, back: Any) -> Any:
    """The mean of both directions' values, where they are numbers of their own."""
    return 0.5 * (forth + back) if isinstance(forth, float) and isinstance(back, float) else forth


def surroundings_of(model: Model) -> frozenset[str]:
    """The surroundings on which a law's torque depends, other than the applied torque: they are seen in its code."""
    return _surroundings_in(model.law)


@functools.lru_cache(maxsize=256)
def _surroundings_in(law: Law) -> frozenset[str]:
    """Of a law: an export asks several times, and translates the law for it."""
    trees = named({"_step": law.step}, law_layouts(law))
    return frozenset(fields_read(trees.values()) - {"applied"})


def read_by(model: Model) -> str:
    """What a law's torque depends on besides its motion, for people; empty where on nothing."""
    read = surroundings_of(model)
    known = ("position", "normal load", "temperature", "time")
    names = [words for words, name in zip(known, DEPENDENCES, strict=True) if name in read]
    return f"{', '.join(names[:-1])} and {names[-1]}" if names[1:] else "".join(names)
