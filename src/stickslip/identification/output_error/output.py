"""Output error: inertia, gravity and the parameters of any law, fitted to simulated motion of the whole axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.messages import axis_unit
from stickslip.core.spec import Law
from stickslip.identification.estimate import Estimate
from stickslip.identification.experiment import Experiment
from stickslip.identification.fit.axis_start import level_of
from stickslip.identification.fit.uncertainty import Fit, fit
from stickslip.identification.output_error.problem import Problem
from stickslip.identification.output_error.search import (
    Asked,
    Extras,
    FittedAxis,
    descended,
    errors_of,
    fitted_axis,
)
from stickslip.identification.regression.inverse import InverseDynamics, correlation_lags
from stickslip.machines.servo import ServoAxis

Array = np.ndarray[Any, np.dtype[np.float64]]

TOLERANCE, DIFFERENCE = 1e-5, 1e-4
"""Last descent: relative decrease of the sum of squares at which it stops, and step of the coordinates."""


@dataclass(frozen=True, eq=False)
class OutputError(FittedAxis):
    """A fitted axis with the uncertainty of each of its parameters.

    Attributes
    ----------
    fit : Fit
    errors : mapping of str to float
        Errors on the fitted records: ``position_relative``, ``drive_relative`` (norms of misfit over norms of signal),
        ``position_mean_absolute``, ``position_rms``.
    """

    fit: Fit
    errors: Mapping[str, float]

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Estimates with intervals and verdicts, in the units of the axis's own system."""
        return tuple(self._shown(e) for e in self.fit.estimates)

    def _shown(self, e: Estimate) -> Estimate:
        e = replace(e, unit=self.problem.axis.unit(e.unit))
        value = getattr(self.model.parameters, e.name, e.value)
        if isinstance(value, float) and value > e.value * (1.0 + 1e-9) > 0.0:
            why = f"the law allows no value below {value:.4g} {axis_unit(e.unit)}, and the data ask for none above"
            return replace(e, value=value, identified=False, verdict=why)
        return e


def output_error(
    experiments: Sequence[Experiment],
    axis: ServoAxis,
    law: Law,
    first: InverseDynamics | None,
    *,
    free: Sequence[str] = (),
    frozen: Sequence[str] = (),
    values: Mapping[str, Any] | None = None,
    extras: Extras = Extras(),  # noqa: B008 (frozen)
    robust: bool = False,
    profiles: bool = False,
) -> OutputError:
    """Fit the simulated axis to its records.

    Parameters
    ----------
    experiments : sequence of Experiment
    axis : ServoAxis
    law : Law
        Any law, including a user's own from its file.
    first : InverseDynamics or None
        Start of the search; None if `values` give inertia and the law's parameters.
    free, frozen : sequence of str
        Names besides the default: inertia, offset, the parameters of `extras` and the law are free, except for shape
        factors with a default value (``delta_s``); ``drive_gain``, ``back_emf``, ``backlash``, ``controller_gain`` are
        frozen.
    values : mapping
        Starting values, or the values of frozen parameters.
    extras : Extras
    robust : bool
        Whether outliers count linearly.
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
    asked = Asked(free, frozen, values or {}, extras, robust)
    return judged(fitted_axis(experiments, axis, law, first, asked), profiles)


def judged(found: FittedAxis, profiles: bool = False) -> OutputError:
    """Run the last descent and judge every parameter."""
    problem, (u, _) = found.problem, descended(found.problem, found.u, TOLERANCE, DIFFERENCE)
    # Residuals of one time are adjacent, so a lag counts as many of them as there are signals.
    width = len(problem.signals)
    residual = problem.residuals(u).reshape(-1, width)
    lags = width * max(correlation_lags(residual[:, i]) for i in range(width)) + width - 1
    result = fit(
        problem.residuals, problem.vector, starts=u[None, :], profiles=profiles, lags=lags, tolerance=TOLERANCE,
        signed_scale=scales_of(problem, u),
    )  # fmt: skip
    misfits = problem.misfits(result.u)
    assert misfits is not None
    return OutputError(problem, result.u, result, errors_of(problem.experiments, problem.signals, misfits))


def scales_of(problem: Problem, u: Array) -> dict[str, float]:
    """Return the scale for the half-width of each signed parameter.

    Torques are compared to the law's own in slow motion; an angle has no relative width and is compared to a radian (a
    position on a linear axis to the range travelled), shares to the whole.
    """
    speeds = np.concatenate([np.abs(np.diff(t.position) / np.diff(t.time)) for t in problem.experiments])
    torque = level_of(problem.law, problem.model(u).parameters, 0.1 * float(np.sqrt(np.mean(speeds**2))))
    travel = max(float(np.ptp(t.position)) for t in problem.experiments)
    length = 1.0 if problem.axis.motion == "rotary" else travel
    sizes = {"rad": length, "m": length, "-": 1.0}
    return {p.name: sizes.get(p.par.unit, torque) for p in problem.vector.free}
