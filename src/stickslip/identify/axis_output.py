"""Output error: inertia, gravity and the parameters of any law, fitted to simulated motion of the whole axis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.identify.axis_inverse import InverseDynamics, correlation_lags
from stickslip.identify.axis_problem import Problem, mechanics_parameters
from stickslip.identify.axis_start import frozen_by_default, starts
from stickslip.identify.axis_trial import Trial
from stickslip.identify.estimate import Estimate
from stickslip.identify.optimum import descend
from stickslip.identify.uncertainty import Fit, fit
from stickslip.identify.vector import Parameter, Vector
from stickslip.machines.servo import ServoAxis
from stickslip.model import Model
from stickslip.spec import Law

__all__ = ["Extras", "OutputError", "output_error"]

Array = np.ndarray[Any, np.dtype[np.float64]]

ROUGH, TOLERANCE = 1e-3, 1e-6
"""Relative decrease of the sum of squares at which a first and the last descent end."""
DESCENTS = 2
"""Of how many starts a rough descent is made."""
REACH = 7.0
"""How far a logarithmic coordinate may go from its start: a factor of 1100."""


@dataclass(frozen=True)
class Extras:
    """Terms beside inertia, offset and the law.

    Attributes
    ----------
    harmonics, friction_harmonics : int
        Harmonics of a torque, and of friction's share, over the position.
    harmonic_period : float
        rad (m) after which they repeat.
    load : bool
        Friction grows with the torque that the gearing carries.
    """

    harmonics: int = 0
    friction_harmonics: int = 0
    harmonic_period: float = 2.0 * math.pi
    load: bool = False


@dataclass(frozen=True, eq=False)
class OutputError:
    """A fitted axis.

    Attributes
    ----------
    problem : Problem
    fit : Fit
    model : Model
    mechanics : Any
        `stickslip.simulation.driven.Mechanics`.
    errors : mapping of str to float
        Of the records fitted: ``position_relative``, ``drive_relative`` (norms of misfit over norms of signal),
        ``position_mean_absolute``, ``position_rms``.
    """

    problem: Problem
    fit: Fit
    model: Model
    mechanics: Any
    errors: Mapping[str, float]

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Estimates with intervals and verdicts, units of the axis's own system."""
        return tuple(self._shown(e) for e in self.fit.estimates)

    def _shown(self, e: Estimate) -> Estimate:
        e = replace(e, unit=self.problem.axis.unit(e.unit))
        value = getattr(self.model.parameters, e.name, e.value)
        if isinstance(value, float) and value > e.value * (1.0 + 1e-9) > 0.0:
            why = f"the law allows no value below {value:.4g} {e.unit}, and the data ask for none above"
            return replace(e, value=value, identified=False, verdict=why)
        return e

    def _other(self, trials: Sequence[Trial]) -> Problem:
        problem = self.problem
        return Problem.of(
            trials, problem.axis, problem.law, problem.vector, inertia=self.mechanics.inertia,
            harmonic_period=problem.harmonic_period, max_step=problem.courses[0].drive.max_step,
        )  # fmt: skip

    def simulated(self, trials: Sequence[Trial]) -> list[Array]:
        """Any records simulated with the fitted axis (`stickslip.simulation.driven.COLUMNS`)."""
        runs = self._other(trials).simulated(self.fit.u)
        assert runs is not None
        return runs

    def held_out(self, trials: Sequence[Trial]) -> dict[str, float]:
        """The same errors on records (or rows) that were not fitted."""
        return errors_of(self._other(trials), self.fit.u)


def output_error(
    trials: Sequence[Trial],
    axis: ServoAxis,
    law: Law,
    first: InverseDynamics | None,
    *,
    free: Sequence[str] = (),
    frozen: Sequence[str] = (),
    values: Mapping[str, Any] | None = None,
    extras: Extras = Extras(),
    robust: bool = False,
    profiles: bool = False,
) -> OutputError:
    """Fit the simulated axis to its records.

    Parameters
    ----------
    trials : sequence of Trial
    axis : ServoAxis
    law : Law
        Any; a user's own from its file.
    first : InverseDynamics or None
        Where the search starts; None where `values` give inertia and the law's parameters.
    free, frozen : sequence of str
        Names beyond the usual: inertia, offset, what `extras` adds and the law are free, except for shape factors
        with a default value (``delta_s``); ``drive_gain``, ``back_emf``, ``backlash``, ``controller_gain`` are frozen.
    values : mapping
        Starting values, or those that frozen parameters have.
    extras : Extras
    robust : bool
        Outliers count linearly.
    profiles : bool
        Follow the profile likelihood for the intervals (slow); otherwise they come from the covariance.

    Returns
    -------
    OutputError

    Raises
    ------
    InputError
        If nothing is free, or no simulation from the starting values succeeds.
    """
    given = dict(values or {})
    candidates = [
        laid_out(trials, axis, law, first, model, given, free, frozen, extras)
        for model in starting_models(trials, law, first, given)
    ]
    ranked = ranked_starts(trials, axis, law, candidates, extras, robust)
    problem = ranked[0][1].resolved(ranked[0][2])
    optima = [
        descend(
            problem.residuals, u, problem.vector.lower, problem.vector.upper, iterations=8, tolerance=ROUGH
        )
        for _, _, u in ranked[:DESCENTS]
    ]
    u = min(optima, key=lambda o: o.cost).u
    for _ in range(2):
        problem = problem.weighted(u).resolved(u)
        u = descend(
            problem.residuals, u, problem.vector.lower, problem.vector.upper, iterations=15, tolerance=ROUGH
        ).u
    return finished(problem.weighted(u), u, profiles)


def ranked_starts(
    trials: Sequence[Trial], axis: ServoAxis, law: Law, candidates: Sequence[tuple[Vector, float]], extras: Extras,
    robust: bool,
) -> list[tuple[float, Problem, Array]]:  # fmt: skip
    """Sum of squares, problem and coordinates of every start that can be simulated, the best first."""
    out: list[tuple[float, Problem, Array]] = []
    weights: Mapping[str, float] | None = None
    for vector, inertia in candidates:
        problem = Problem.of(
            trials, axis, law, vector, inertia=inertia, robust=robust, harmonic_period=extras.harmonic_period
        )
        problem = problem.weighted(vector.start) if weights is None else replace(problem, weights=weights)
        weights = problem.weights
        r = problem.residuals(vector.start)
        cost = float(r @ r)
        if math.isfinite(cost):
            out.append((cost, problem, vector.start))
    if not out:
        raise InputError(
            f"{law.name}: no simulation from the starting values succeeds; give others by `values`"
        )
    return sorted(out, key=lambda found: found[0])


def finished(problem: Problem, u: Array, profiles: bool) -> OutputError:
    """The last descent, and what it says about every parameter."""
    # Residuals of one time lie side by side, so that a lag counts as many of them as there are signals.
    width = len(problem.signals)
    residual = problem.residuals(u).reshape(-1, width)
    lags = width * max(correlation_lags(residual[:, i]) for i in range(width)) + width - 1
    result = fit(
        problem.residuals, problem.vector, starts=u[None, :], profiles=profiles, lags=lags, tolerance=TOLERANCE,
        signed_scale=scale_of(problem, u),
    )  # fmt: skip
    named = result.values
    return OutputError(
        problem, result, problem.model(result.u), problem.mechanics(named), errors_of(problem, result.u)
    )


def scale_of(problem: Problem, u: Array) -> float:
    """Torque that signed parameters are compared with: the law's own at slow motion, N·m."""
    from stickslip.identify.axis_start import level_of

    speeds = np.concatenate([np.abs(np.diff(t.position) / np.diff(t.time)) for t in problem.trials])
    return level_of(problem.law, problem.model(u).parameters, 0.1 * float(np.sqrt(np.mean(speeds**2))))


def errors_of(problem: Problem, u: Array) -> dict[str, float]:
    """Norms of misfit over norms of signal, and of the position its mean absolute and RMS error."""
    from stickslip.identify.axis_problem import measured

    misfits = problem.misfits(u)
    assert misfits is not None
    out: dict[str, float] = {}
    for place, name in enumerate(problem.signals):
        wrong = np.concatenate([m[:, place] for m in misfits])
        right = np.concatenate([measured(t, name)[t.rows] for t in problem.trials])
        out[f"{name}_relative"] = float(np.linalg.norm(wrong) / np.linalg.norm(right))
        out[f"{name}_rms"] = float(np.sqrt(np.mean(wrong**2)))
        out[f"{name}_mean_absolute"] = float(np.mean(np.abs(wrong)))
    return out


class NearVector(Vector):
    """A vector whose logarithmic coordinates stay within `REACH` of their start.

    Simulations take longer the farther a parameter runs off that the data do not determine.
    """

    @property
    def lower(self) -> Array:
        """Lower bounds of the coordinates, shape (size,)."""
        return np.where(self._logs(), np.maximum(super().lower, self._first() - REACH), super().lower)

    @property
    def upper(self) -> Array:
        """Upper bounds of the coordinates, shape (size,)."""
        return np.where(self._logs(), np.minimum(super().upper, self._first() + REACH), super().upper)

    def _logs(self) -> Any:
        plain = [p.logarithmic for p in self.free if not p.shares]
        return np.array(plain + [True] * (self.size - len(plain)))

    def _first(self) -> Array:
        plain = [p.coordinate(p.value) for p in self.free if not p.shares]
        return np.array(plain + [0.0] * (self.size - len(plain)))


# ---- where the search starts ----------------------------------------------------------------------------------


def starting_models(
    trials: Sequence[Trial], law: Law, first: InverseDynamics | None, given: Mapping[str, Any]
) -> list[Model]:
    """Models to start from: scaled examples, or what the user gave."""
    known = {f.name: given[f.name] for f in law.fields if f.name in given}
    needed = [f.name for f in law.fields if f.par.default is None]
    if all(name in known for name in needed):
        return [Model(law, **known)]
    if first is None:
        raise InputError(
            f"{law.name}: without the drive's torque the search needs starting values; give {', '.join(needed)}"
        )
    speed = math.sqrt(float(np.mean(first.velocity**2)))
    travel = max(float(np.ptp(t.position)) for t in trials)
    coulomb = max(first.coulomb, 1e-3 * float(np.sqrt(np.mean(first.torque**2))))
    return starts(law, coulomb, max(first.viscous, 0.0), speed, travel, known)


def laid_out(
    trials: Sequence[Trial], axis: ServoAxis, law: Law, first: InverseDynamics | None, model: Model,
    given: Mapping[str, Any], free: Sequence[str], frozen: Sequence[str], extras: Extras,
) -> tuple[Vector, float]:  # fmt: skip
    """The vector of everything that is fitted, and the inertia it starts from."""
    values: dict[str, float] = {}
    if first is not None:
        values = {"inertia": max(first["inertia"], 1e-12), "offset": first.offset}
        if first.has("gravity_sin"):
            sine, cosine = first["gravity_sin"], first["gravity_cos"]
            values |= {"gravity": math.hypot(sine, cosine), "gravity_angle": math.atan2(-cosine, sine)}
        for i in range(extras.harmonics):
            if first.has(f"cos[{i}]"):
                values |= {f"cos[{i}]": first[f"cos[{i}]"], f"sin[{i}]": first[f"sin[{i}]"]}
    law_names = {f.name for f in law.fields}
    values |= {k: float(v) for k, v in given.items() if k not in law_names}
    if "inertia" not in values:
        raise InputError(
            "without the drive's torque the search needs a starting value of the inertia; give it"
        )
    extra = mechanics_parameters(
        axis, trials[0].quantity, values, extras.harmonics, extras.friction_harmonics
    )
    held = {"drive_gain", "back_emf", "backlash", "controller_gain", *frozen_by_default(law)}
    if axis.gravity != "pendulum":
        held |= {"gravity", "gravity_angle"}
    if not extras.load:
        held |= {"load_motor", "load_external"}
    held = (held - set(free)) | set(frozen)
    size = abs(first.coulomb) if first is not None else 1.0
    extra = [scaled_parameter(p, size) for p in extra]
    return NearVector(model, frozen=sorted(held), extra=extra), values["inertia"]


def scaled_parameter(p: Parameter, torque: float) -> Parameter:
    """A parameter with a typical size: signed torques that of friction, angles a radian."""
    if p.par.unit in ("N·m", "N"):
        return replace(p, scale=max(torque, abs(p.value)) or 1.0)
    if p.par.unit.startswith("1/"):
        return replace(p, scale=1.0 / torque if torque > 0.0 else 1.0)
    return replace(p, scale=abs(p.value) or 1.0)
