"""Starting values of a law's parameters, for any law: its example, scaled to the axis.

A law's parameters are powers of torque, length and time; the example of every law is scaled by the torque, velocity and
pre-sliding length of the axis (dimensional analysis), and its steady torque is then fitted to the friction curve of the
inverse dynamics. No parameter is known by name here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from stickslip.core.errors import InputError, ParameterError
from stickslip.core.spec import Field, Law
from stickslip.identification.fit.levenberg_marquardt import Squares, descend
from stickslip.identification.fit.parameter_vector import Vector
from stickslip.identification.fit.sample_rate_limit import stiffness_at_rest
from stickslip.models.model import Model
from stickslip.simulation.prescribed.steady import Steady

Array = np.ndarray[Any, np.dtype[np.float64]]

LENGTHS = (1e-5, 1e-4, 1e-3)  # pre-sliding lengths that are tried, part of the travel
VELOCITIES = (0.03, 0.15)  # Stribeck velocities that are tried, part of the usual speed
ELEMENTS = 2  # elements of a law; a record rarely determines more, and starting values may give more
TIE = 0.3  # weight of the scaled example in the steady fit, in coordinates per relative torque
NEARLY = 1e-4  # relative decrease of the sum of squares at which it stops: a search continues from there


def dimensions(unit: str) -> tuple[int, int, int]:
    """Return the powers of torque, length and time in a unit: ``N·m·s/rad`` is (1, -1, 1).

    Raises
    ------
    InputError
        If the unit contains anything but N·m (N), rad (m) and s.
    """
    text = unit.replace("N·m", "N").replace("(", "").replace(")", "").strip()
    powers = [0, 0, 0]
    if text in ("", "-", "1"):
        return 0, 0, 0
    above, _, below = text.partition("/")
    for part, sign in ((above, 1), (below, -1)):
        for token in filter(None, re.split(r"[·*]", part)):
            base, power = (token[:-1], 2) if token.endswith("²") else (token, 1)
            if base == "1":
                continue
            place = {"N": 0, "rad": 1, "m": 1, "s": 2}.get(base)
            if place is None:
                raise InputError(f"unit {unit!r}: {base!r} is none of N·m, rad, s")
            powers[place] += sign * power
    return powers[0], powers[1], powers[2]


def scaled(law: Law, torque: float, length: float, velocity: float) -> dict[str, Any]:
    """Return the law's example with its units of torque, length and velocity multiplied by these factors."""
    time = length / velocity
    values: dict[str, Any] = {}
    for f in law.fields:
        if f.name not in law.example and f.par.default is None:
            continue
        value: Any = law.example.get(f.name, f.par.default)
        if f.per_element:
            value = fewer(f, list(value))
        try:
            t, x, s = dimensions(f.par.unit)
        except InputError:
            t, x, s = 0, 0, 0
        factor = torque**t * length**x * time**s
        values[f.name] = [factor * float(v) for v in value] if f.per_element else factor * float(value)
        low, high = f.par.lower, f.par.upper
        if not f.per_element:
            values[f.name] = min(max(values[f.name], low), high)
    return values


def fewer(f: Field, values: list[float]) -> list[float]:
    """Return the first elements, scaled so that shares add up to 1, or torques to the same total."""
    kept = values[:ELEMENTS]
    if not (f.par.shares or (f.par.per == "element" and f.par.unit == "N·m")):
        return kept
    share = (1.0 if f.par.shares else math.fsum(values)) / math.fsum(kept)
    return [share * v for v in kept]


def frozen_by_default(law: Law) -> list[str]:
    """Return the parameters that are frozen unless freed by name: shape factors with a default, and equal shares."""
    return [
        f.name for f in law.fields
        if f.par.shares or (f.par.default is not None and f.par.unit == "-" and not f.per_element)
    ]  # fmt: skip


def feasible(law: Law, p: Any) -> Any | None:
    """Return these parameters, or the nearest that the law accepts; None if none is known.

    A static torque below the Coulomb torque is raised to it: the curve without a Stribeck effect. Limits of elements
    whose sum is below the static torque (Leuven) are raised to it in proportion.
    """
    if law.check is None or not law.check(p):
        return p
    if not (hasattr(p, "fs") and hasattr(p, "fc")):
        return None
    raised = p._replace(fs=max(p.fs, p.fc))
    if hasattr(p, "w") and math.fsum(p.w) < raised.fs:
        share = raised.fs / math.fsum(p.w)
        raised = raised._replace(w=tuple(share * w for w in p.w))
    return None if law.check(raised) else raised


def starts(
    law: Law, coulomb: float, viscous: float, speed: float, travel: float, known: dict[str, Any]
) -> list[Model]:
    """Return starting models: the example on the axis's scales, fitted to its friction curve.

    Parameters
    ----------
    law : Law
    coulomb, viscous : float
        Friction curve of the inverse dynamics, N·m and N·m·s/rad.
    speed, travel : float
        Usual (RMS) speed and range of the position, rad/s and rad.
    known : mapping
        Values given by the user, which are kept.
    """
    example = law.parameters(dict(law.example))
    own_velocity = law.velocity_scale(example) if law.velocity_scale else 0.01
    own_torque = level_of(law, example, own_velocity)
    own_length = length_of(law, example, own_torque)
    # Faster than the Stribeck velocities that are tried, to keep the example's shape below them.
    v = speed * np.array([-3.0, -2.0, -1.4, -1.0, -0.7, -0.5, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0])
    curve = np.sign(v) * coulomb + viscous * v
    out, fits = list[Model](), dict[Any, dict[str, float]]()
    lengths = LENGTHS if law.state_fields else LENGTHS[1:2]
    velocities = VELOCITIES if law.velocity_scale else VELOCITIES[:1]
    for part in lengths:
        for share in velocities:
            values = scaled(
                law,
                coulomb / own_torque,
                part * travel / own_length,
                share * speed / max(own_velocity, 1e-12),
            )
            try:
                values |= viscous_ones(Model(law, **values), viscous, 3.0 * speed) | known
                model = Model(law, **values)
                out.append(steady_fit(model, v, curve, list(known), fits) if law.steady else model)
            except ParameterError:
                continue
    if not out:
        raise InputError(f"{law.name}: its example cannot be carried over to this axis; give starting values")
    return out


def viscous_ones(model: Model, viscous: float, v: float) -> dict[str, float]:
    """Return the parameters that are slopes of the steady torque over velocity, set to `viscous`; none for 0.

    In the fit of the curve, a rising Stribeck effect could otherwise replace the slope.
    """
    law, p, out = model.law, model.parameters, dict[str, float]()
    for f in law.fields:
        if law.steady is None or viscous <= 0.0 or f.per_element or dimensions_of(f.par.unit) != (1, -1, 1):
            continue
        value = float(getattr(p, f.name))
        more = max(abs(value), viscous)
        rise = law.steady(v, p._replace(**{f.name: value + more})) - law.steady(v, p)
        if abs(rise - more * v) <= 1e-6 * more * v:
            out[f.name] = viscous
    return out


def level_of(law: Law, p: Any, velocity: float) -> float:
    """Return the torque in slow steady motion, N·m."""
    if law.steady is not None:
        torque = abs(law.steady(3.0 * velocity, p))
    else:
        from stickslip.core.spec import Surroundings

        z = law.state(p)
        torque = 0.0
        for _ in range(2000):
            torque = abs(law.step(velocity, velocity, 1e-3, z, p, Surroundings()))
    return torque if torque > 0.0 and math.isfinite(torque) else 1.0


def length_of(law: Law, p: Any, torque: float) -> float:
    """Return the displacement over which torque builds up from rest, rad: torque over the stiffness at rest."""
    stiffness = stiffness_at_rest(law, p)
    return torque / stiffness if stiffness > 0.0 else 1e-5


def steady_fits(models: Sequence[Model], v: Array, curve: Array, held: Sequence[str]) -> list[Model]:
    """Return `steady_fit` of several models of one law."""
    fits: dict[Any, dict[str, float]] = {}
    return [steady_fit(model, v, curve, held, fits) for model in models]


def steady_fit(
    model: Model, v: Array, curve: Array, held: Sequence[str], fits: dict[Any, dict[str, float]]
) -> Model:
    """Return the model with its steady torque fitted to a curve; parameters without influence on it are kept.

    ``fits`` are those of the same law to the same curve: models that differ only in parameters without influence share
    one.
    """
    names = told_by(model, v, held)
    start = tuple(getattr(model.parameters, name) for name in names)
    if (names, start) not in fits:
        fits[names, start] = steady_values(model, v, curve, names) if names else {}
    p = feasible(model.law, model.parameters._replace(**fits[names, start]))
    return model if p is None else Model(model.law, **p._asdict())


def told_by(model: Model, v: Array, held: Sequence[str]) -> tuple[str, ...]:
    """Return the parameters that influence the steady torque at these velocities, except those held."""
    law, p = model.law, model.parameters
    if law.steady is None:
        return ()
    steady, told = Steady(law, v, np.sign(v)), list[str]()
    torque = steady.torque(np.array(law.pack(p)))
    for f in law.fields:
        if f.per_element or f.name in (*held, *frozen_by_default(law)) or dimensions_of(f.par.unit) is None:
            continue
        value = float(getattr(p, f.name))
        more = p._replace(**{f.name: value + 1e-3 * max(abs(value), 1e-3)})
        if np.any(steady.torque(np.array(law.pack(more))) != torque):
            told.append(f.name)
    return tuple(told)


def steady_values(model: Model, v: Array, curve: Array, names: Sequence[str]) -> dict[str, float]:
    """Return these parameters fitted to make the steady torque follow the curve."""
    law = model.law
    vector = Vector(model, frozen=[f.name for f in law.fields if f.name not in names])
    first, size, steady = vector.start, float(np.max(np.abs(curve))), Steady(law, v, np.sign(v))

    def residuals(u: Array) -> Array:
        p = feasible(law, vector.law_parameters(u))
        if p is None:
            return np.full(v.size + u.size, np.inf)
        return np.concatenate(
            [(steady.torque(np.array(law.pack(p))) - curve) / size, TIE / v.size * (u - first)]
        )

    squares = Squares(residuals, vector.lower, vector.upper)
    best = descend(squares, first, iterations=30, tolerance=NEARLY, jacobian_there=False)
    p = feasible(law, vector.law_parameters(best.u))
    return {} if p is None else {name: getattr(p, name) for name in names}


def dimensions_of(unit: str) -> tuple[int, int, int] | None:
    """Return `dimensions` of a unit; None if the unit cannot be read."""
    try:
        return dimensions(unit)
    except InputError:
        return None


def each_way(law: Law) -> Law:
    """Return the law with separate parameters for v < 0, if it allows them."""
    known = {choice.name for choice in law.choices}
    return law.having(symmetry="asymmetric") if "symmetry" in known else law
