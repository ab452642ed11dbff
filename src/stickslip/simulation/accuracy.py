"""How far the position of a run can be trusted.

Friction makes some motions sensitive: a break-away a little later, a limit cycle a little ahead. An error that a step
may have is then not the error of the run. So the run is repeated with every step wrong on purpose, by twice what the
integrator lets a step be wrong by, once along the motion and once against it: how far those two end up from the run is
the estimate of its error. It holds where the steps keep what they promise, which `benchmarks/accuracy.py` counts on
random cases.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.simulation.adaptive import engine as adaptive
from stickslip.simulation.case_arrays import DONE, PERTURBATION, POSITION_0, TOLERANCE, Case, Outcome
from stickslip.simulation.exact import engine as exact
from stickslip.simulation.sampled import engine as sampled

PERTURBATIONS = (2.0, -2.0)
"""Over what a step may be wrong by."""
WELL = 10.0
"""Largest error of a well-conditioned run, over the tolerance."""
LOOSER = {"adaptive": 10.0, "sampled": 100.0}
"""Of the tolerance. Of order 8, ten times the tolerance may be the same steps."""
LEAST = 0.01
"""Of the tolerance: what two runs that agree may still have in common."""
BESIDE = 1e-9
"""Distance of the starts that are tried beside a run's own, rad."""
BRANCHES = 1e4
"""Growth of that distance from which another branch was taken; motions that are but sensitive stay below 2e3."""
POSITION, EVENT = 3, 8
RUNS: dict[str, Callable[[Case], Outcome]] = {"adaptive": adaptive.run, "sampled": sampled.run}
"""Integrators that take a tolerance and are held to it by a looser one."""


class Accuracy(NamedTuple):
    """How far a run can be trusted.

    Attributes
    ----------
    error : float
        Estimate of the largest error in position on the grid, rad; infinite where a repeated run ends early.
    well_conditioned : bool
        Whether that is at most ten times the tolerance, and the run does not depend on its start.
    start : float
        Largest distance on the grid from a run that starts `BESIDE` on either side, rad.
    depends_on_start : bool
        Whether such a run takes another branch: compensation that pushes away from rest, whose first direction any
        deviation decides.
    """

    error: float
    well_conditioned: bool
    start: float
    depends_on_start: bool


def estimate(case: Case, integrator: str = "exact") -> Accuracy:
    """Repeat a run with wrong steps (exact) or at a looser tolerance (adaptive, sampled), and from starts beside its
    own; about four times its price.

    Parameters
    ----------
    case : Case
        What `stickslip.simulation.closed_loop.prepare` returns; positions are compared on its grid.
    integrator : {"exact", "adaptive", "sampled"}

    Raises
    ------
    ValueError
        If the integrator cannot run the case, or is another one.
    """
    if integrator == "exact":
        error = _perturbed(case)
    elif integrator in RUNS:
        error = max(_looser(case, integrator), LEAST * float(case.numbers[TOLERANCE]))
    else:
        raise ValueError(f"the {integrator} integrator has no tolerance to be held to")
    start = start_apart(case, integrator)
    well = error <= WELL * float(case.numbers[TOLERANCE]) and not branches(start)
    return Accuracy(error, well, start, branches(start))


def branches(start: float) -> bool:
    """Whether a run that starts `BESIDE` takes another branch, by its largest distance, rad."""
    return start > BRANCHES * BESIDE


def start_apart(case: Case, integrator: str = "exact") -> float:
    """Largest distance on the grid of runs that start `BESIDE` on either side, rad; infinite where one ends early."""
    if integrator == "exact":
        prepared = exact.prepare(case)
        begin = float(prepared.parameters[POSITION_0])
        runs = [_started(prepared, begin + side) for side in (0.0, BESIDE, -BESIDE)]
        codes = [code for _, code, _ in runs]
        positions = [motion[:, 0] for motion, _, _ in runs]
    else:
        outcomes = [RUNS[integrator](_beside(case, side)) for side in (0.0, BESIDE, -BESIDE)]
        codes, positions = [o.code for o in outcomes], [_positions(o) for o in outcomes]
    if any(code != DONE for code in codes):
        return math.inf
    return max(_apart(positions[0], other, True) for other in positions[1:])


def _started(prepared: exact.Prepared, position: float) -> Any:
    parameters = prepared.parameters.copy()
    parameters[POSITION_0] = position
    return replace(prepared, parameters=parameters).run()


def _beside(case: Case, side: float) -> Case:
    numbers = case.numbers.copy()
    numbers[POSITION_0] += side
    return replace(case, numbers=numbers)


def _perturbed(case: Case) -> float:
    prepared, worst = exact.prepare(case), 0.0
    motion, code, _ = prepared.run()
    for perturbation in PERTURBATIONS:
        parameters = prepared.parameters.copy()
        parameters[PERTURBATION] = perturbation
        other, ended, _ = replace(prepared, parameters=parameters).run()
        worst = max(worst, _apart(motion[:, 0], other[:, 0], code == ended == DONE))
    return worst


def _looser(case: Case, integrator: str) -> float:
    run = RUNS[integrator]
    numbers = case.numbers.copy()
    numbers[TOLERANCE] *= LOOSER[integrator]
    one, other = run(case), run(replace(case, numbers=numbers))
    return _apart(_positions(one), _positions(other), one.code == other.code == DONE)


def _positions(outcome: Outcome) -> Any:
    return outcome.rows[outcome.rows[:, EVENT] == 0.0, POSITION]


def _apart(one: Any, other: Any, whole: bool) -> float:
    """Largest difference, rad."""
    return float(np.max(np.abs(one - other), initial=0.0)) if whole else math.inf
