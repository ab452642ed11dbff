"""The search of output error: the parameters of a law whose simulation is closest to an axis's records.

Levels of friction and inertia come from the inverse dynamics, the rest from the law's example on the axis's scales; the
best starts are descended from, with weights and integration steps adapted to the present point.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError, UnknownName
from stickslip.core.messages import name_parameter
from stickslip.core.spec import Law
from stickslip.identification.experiment import Experiment
from stickslip.identification.fit.axis_start import frozen_by_default, starts
from stickslip.identification.fit.broyden import descend_by_secants
from stickslip.identification.fit.levenberg_marquardt import Squares
from stickslip.identification.fit.parameter_vector import Parameter, Vector
from stickslip.identification.output_error.gravity import hanging
from stickslip.identification.output_error.load_check import tells_external
from stickslip.identification.output_error.problem import Problem, measured, mechanics_parameters
from stickslip.identification.regression.inverse import InverseDynamics, inverse_dynamics
from stickslip.machines.servo import ServoAxis
from stickslip.models.model import Model
from stickslip.simulation.recorded_input.simulation import Mechanics

Array = np.ndarray[Any, np.dtype[np.float64]]

ROUGH, ENOUGH = 0.1, 3e-3
"""Relative decrease of the sum of squares at which a first and a later descent stop."""
DIFFERENCE = 1e-3
"""Step of the coordinates for the first Jacobians."""
BEGIN = 0.34
"""Part of the travel used by the first descents."""
SETTLED = 0.1
"""Relative change of the weights below which no other descent follows."""
DESCENTS = 3
"""Number of starts for rough descents."""
LEVELS = {"fc", "sigma2"}
"""Level and slope of friction, which may be given for any law."""
REACH = 7.0
"""Greatest distance of a logarithmic coordinate from its start: a factor of 1100."""


@dataclass(frozen=True)
class Extras:
    """Terms in addition to inertia, offset and the law.

    Attributes
    ----------
    harmonics, friction_harmonics : int
        Harmonics of a torque, and of friction's share, over the position.
    harmonic_period : float
        Period of the harmonics, rad (m).
    load : bool
        Whether friction grows with the torque that the gearing carries; with the outer torque's own share
        (``load_external``) only if that torque changes, as for a pendulum, or if it is freed by name.
    """

    harmonics: int = 0
    friction_harmonics: int = 0
    harmonic_period: float = 2.0 * math.pi
    load: bool = False


@dataclass(frozen=True, eq=False)
class Asked:
    """Options of a fit.

    Attributes
    ----------
    free, frozen, values, extras, robust
        As in `stickslip.identification.output_error.output.output_error`.
    """

    free: Sequence[str] = ()
    frozen: Sequence[str] = ()
    values: Mapping[str, Any] = field(default_factory=dict[str, Any])
    extras: Extras = Extras()
    robust: bool = False


@dataclass(frozen=True, eq=False)
class FittedAxis:
    """An axis with its fitted parameters.

    Attributes
    ----------
    problem : Problem
    u : array
        Coordinates of the problem's vector.
    """

    problem: Problem
    u: Array

    @property
    def model(self) -> Model:
        """The law with its parameters."""
        return self.problem.model(self.u)

    @property
    def mechanics(self) -> Mechanics:
        """The mechanics: all parameters except friction."""
        return self.problem.mechanics(self.problem.vector.named(self.u))

    def on(self, experiments: Sequence[Experiment]) -> Problem:
        """Return the same problem with other records (or rows)."""
        problem = self.problem
        if len(experiments) == len(problem.experiments) and all(
            map(operator.is_, experiments, problem.experiments)
        ):
            return problem
        return replace(
            Problem.of(
                experiments, problem.axis, problem.law, problem.vector, inertia=self.mechanics.inertia,
                harmonic_period=problem.harmonic_period, max_step=problem.courses[0].drive.max_step,
            ),
            weights=problem.weights, robust=problem.robust,
        )  # fmt: skip

    def simulated(self, experiments: Sequence[Experiment]) -> list[Array]:
        """Simulate any records with the fitted axis (`stickslip.simulation.recorded_input.simulation.COLUMNS`)."""
        runs = self.on(experiments).simulated(self.u)
        assert runs is not None
        return runs

    def misfits(self, experiments: Sequence[Experiment]) -> list[Array]:
        """Return simulated minus measured signals on records (or rows), each of shape (rows, signals)."""
        misfits = self.on(experiments).misfits(self.u)
        assert misfits is not None
        return misfits

    def held_out(self, experiments: Sequence[Experiment]) -> dict[str, float]:
        """Return the errors (`errors_of`) on records (or rows) that were not fitted."""
        return errors_of(experiments, self.problem.signals, self.misfits(experiments))


def errors_of(
    experiments: Sequence[Experiment], signals: Sequence[str], misfits: Sequence[Array]
) -> dict[str, float]:
    """Return relative norms, root mean squares and mean absolute values of the misfit of each signal."""
    out: dict[str, float] = {}
    for place, name in enumerate(signals):
        wrong = np.concatenate([m[:, place] for m in misfits])
        right = np.concatenate([measured(t, name)[t.rows] for t in experiments])
        out[f"{name}_relative"] = float(np.linalg.norm(wrong) / np.linalg.norm(right))
        out[f"{name}_rms"] = float(np.sqrt(np.mean(wrong**2)))
        out[f"{name}_mean_absolute"] = float(np.mean(np.abs(wrong)))
    return out


def fitted_axis(
    experiments: Sequence[Experiment],
    axis: ServoAxis,
    law: Law,
    first: InverseDynamics | None,
    asked: Asked,
    *,
    tolerance: float = ENOUGH,
) -> FittedAxis:
    """Estimate the parameters of an axis, without verdicts.

    Parameters and errors as in `stickslip.identification.output_error.output.output_error`; ``tolerance`` is the
    relative decrease of the sum of squares at which the last descent stops.
    """
    if first is None:
        require_start(experiments, axis, [law], asked)
    candidates = [
        laid_out(experiments, axis, law, first, model, asked)
        for model in starting_models(experiments, law, first, asked.values)
    ]
    beginnings = [t.until(rows_until(t, BEGIN)) for t in experiments]
    ranked = ranked_starts(beginnings, axis, law, candidates, asked)
    rough = ranked[0][1].resolved(ranked[0][2])
    tried = [descended(rough, u, ROUGH) for _, _, u in ranked[:DESCENTS]]
    found = FittedAxis(rough, min(tried, key=lambda found: found[1])[0])
    problem, u = found.on(experiments), found.u
    for descents in range(3):
        weights = problem.weights
        problem = problem.weighted(u)
        # The first descents used the starts of the records only.
        if descents and all(abs(problem.weights[s] / weights[s] - 1.0) < SETTLED for s in weights):
            break
        problem = problem.resolved(u)
        u, _ = descended(problem, u, tolerance)
    return FittedAxis(problem, u)


def rows_until(experiment: Experiment, part: float) -> int:
    """Return the number of rows in which a part of the whole distance is travelled."""
    way: Array = np.cumsum(np.abs(np.diff(experiment.position)))
    return int(np.sum(way < part * float(way[-1]))) + 2


def descended(
    problem: Problem, u: Array, tolerance: float = ENOUGH, difference: float = DIFFERENCE
) -> tuple[Array, float]:
    """Descend from u; return coordinates and sum of squares."""
    vector = problem.vector
    squares = Squares(problem.residuals, vector.lower, vector.upper, difference)
    return descend_by_secants(squares, u, tolerance=tolerance)


def ranked_starts(
    experiments: Sequence[Experiment], axis: ServoAxis, law: Law, candidates: Sequence[tuple[Vector, float]],
    asked: Asked,
) -> list[tuple[float, Problem, Array]]:  # fmt: skip
    """Return sum of squares, problem and coordinates of every start that can be simulated, the best first."""
    out: list[tuple[float, Problem, Array]] = []
    weights: Mapping[str, float] | None = None
    for vector, inertia in candidates:
        problem = Problem.of(
            experiments,
            axis,
            law,
            vector,
            inertia=inertia,
            robust=asked.robust,
            harmonic_period=asked.extras.harmonic_period,
        )
        problem = problem.weighted(vector.start) if weights is None else replace(problem, weights=weights)
        weights = problem.weights
        r = problem.residuals(vector.start)
        cost = float(r @ r)
        if math.isfinite(cost):
            out.append((cost, problem, vector.start))
    if not out:
        raise InputError(
            f"{law.name}: no simulation from the starting values succeeds; give others with "
            f"{name_parameter('NAME', 'VALUE')}"
        )
    return sorted(out, key=lambda found: found[0])


# ---- starts of the search --------------------------------------------------------------------------------------


class NearVector(Vector):
    """A vector whose logarithmic coordinates stay within `REACH` of their start.

    Simulations become slower the farther an undetermined parameter drifts.
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


def starting_models(
    experiments: Sequence[Experiment], law: Law, first: InverseDynamics | None, given: Mapping[str, Any]
) -> list[Model]:
    """Return starting models: scaled examples, or the values given by the user."""
    known = {f.name: given[f.name] for f in law.fields if f.name in given}
    needed = [f.name for f in law.fields if f.par.default is None]
    if all(name in known for name in needed):
        return [Model(law, **known)]
    travel = max(float(np.ptp(t.position)) for t in experiments)
    level = float(given.get("fc", 0.0))
    if first is None:
        speeds = np.concatenate([np.diff(t.position) / np.diff(t.time) for t in experiments])
        speed = math.sqrt(float(np.mean(speeds**2)))
        return starts(law, level, float(given.get("sigma2", 0.0)), speed, travel, known)
    coulomb = level or max(first.coulomb, 1e-3 * float(np.sqrt(np.mean(first.torque**2))))
    return starts(law, coulomb, max(first.viscous, 0.0), first.usual_speed, travel, known)


def laid_out(
    experiments: Sequence[Experiment], axis: ServoAxis, law: Law, first: InverseDynamics | None, model: Model,
    asked: Asked,
) -> tuple[Vector, float]:  # fmt: skip
    """Return the vector of all fitted parameters, and its starting inertia."""
    given, extras = asked.values, asked.extras
    values: dict[str, float] = {}
    if first is not None:
        values = {"inertia": first_inertia(first), "offset": first.offset}
        if first.has("gravity_sin"):
            sine, cosine = first["gravity_sin"], first["gravity_cos"]
            size, angle = hanging(sine, cosine, first.position)
            values |= {"gravity": size, "gravity_angle": angle}
        for i in range(extras.harmonics):
            if first.has(f"cos[{i}]"):
                values |= {f"cos[{i}]": first[f"cos[{i}]"], f"sin[{i}]": first[f"sin[{i}]"]}
    law_names = {f.name for f in law.fields}
    values |= {k: float(v) for k, v in given.items() if k not in law_names}
    extra = mechanics_parameters(
        axis, experiments[0].quantity, values, extras.harmonics, extras.friction_harmonics
    )
    require_known([*asked.free, *given], law_names | {p.name for p in extra} | LEVELS)
    if not values["inertia"] > 0.0:
        raise InputError(f"inertia = {values['inertia']:g} {axis.unit('kg·m²')} must be greater than 0")
    held = {"drive_gain", "back_emf", "backlash", "controller_gain", *frozen_by_default(law)}
    if axis.gravity != "pendulum":
        held |= {"gravity", "gravity_angle"}
        if first is None or not tells_external(first):
            held.add("load_external")
    if not extras.load:
        held |= {"load_motor", "load_external"}
    held = (held - set(asked.free)) | set(asked.frozen)
    size = abs(first.coulomb) if first is not None else 1.0
    extra = [scaled_parameter(p, size) for p in extra]
    return NearVector(model, frozen=sorted(held), extra=extra), values["inertia"]


def require_start(
    experiments: Sequence[Experiment], axis: ServoAxis, laws: Sequence[Law], asked: Asked
) -> None:
    """Refuse a search without inverse dynamics and without starting values of any of the laws, with the reason.

    Raises
    ------
    InputError
    """
    given, extras = asked.values, asked.extras
    whole = any(all(f.name in given for f in x.fields if f.par.default is None) for x in laws)
    needed = [] if whole or given.get("fc", 0.0) > 0.0 else ["fc"]  # The others follow from it.
    if "inertia" not in given:
        needed.append("inertia")
    if not needed:
        return
    why = "the search has no start"
    try:
        inverse_dynamics(
            experiments, axis, harmonics=extras.harmonics, harmonic_period=extras.harmonic_period
        )
    except InputError as error:
        why = error.message
    settings = " and ".join(name_parameter(name) for name in needed)
    raise InputError(f"{why}; or say where the search starts with {settings}")


def require_known(names: Iterable[str], known: set[str]) -> None:
    """Refuse parameters that neither law nor axis has.

    Raises
    ------
    UnknownName
    """
    for name in names:
        if name not in known and name.partition("[")[0] not in known:
            raise UnknownName("parameter", name, known)


def first_inertia(first: InverseDynamics) -> float:
    """Return the inertia of the inverse dynamics; if it is not distinct from 0, friction over usual acceleration."""
    place = first.names.index("inertia")
    if first.values[place] > 2.0 * first.robust_std[place]:
        return float(first.values[place])
    fast = float(np.quantile(np.abs(first.matrix[:, place]), 0.98))
    return max(abs(first.coulomb) / fast if fast > 0.0 else 0.0, float(first.values[place]), 1e-12)


def scaled_parameter(p: Parameter, torque: float) -> Parameter:
    """Return a parameter with a typical size: friction for signed torques, a radian for angles."""
    if p.par.unit in ("N·m", "N"):
        return replace(p, scale=max(torque, abs(p.value)) or 1.0)
    if p.par.unit.startswith("1/"):
        return replace(p, scale=1.0 / torque if torque > 0.0 else 1.0)
    return replace(p, scale=abs(p.value) or 1.0)
