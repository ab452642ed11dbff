"""Which metrics of a block are sure: every case is run again, so that what hangs on details nobody knows is flagged.

What may be wrong depends on what ran the case. The exact integrator's steps are made wrong on purpose, the steps of the
adaptive and the fixed one are made longer. A sampled loop is run at a hundredth of the tolerance, and that run is kept:
one edge of an encoder, missed by an error of a step, turns the whole run into another one, and two loose runs that
missed the same edge agree. A machine is run at a thousandth of the tolerance of its sub-steps, as
``stickslip.simulate(..., check=True)`` does; its numbers stay those that `stickslip.simulate` gives.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.simulation.accuracy import LOOSER, PERTURBATIONS
from stickslip.simulation.integrators import INTEGRATORS
from stickslip.studies.planned_run import PlannedRun
from stickslip.sweeps.measured import Array, Measured, measured

Flags = np.ndarray[Any, np.dtype[np.bool_]]
Cases = np.ndarray[Any, np.dtype[np.intp]]
TIGHTER, FINEST = (0.1, 0.01, 0.001), 1e-10
"""Times the tolerance, at which those that are not sure are run again; least tolerance, rad."""
SETTLED, SURE = 0.001, 0.01
"""Parts of a metric: by which wrong steps may change it, and by which it may differ from that at the tolerance before.
The first is a tenth of the 1 % that is wanted: motions without a truth scatter by about that, and would often agree."""
FLOORS = {"rad": 1e-8, "s": 1e-6, "Nm": 1e-6, "J": 1e-9}
"""Differences this small count for nothing, by the unit that a metric's name ends with (rad/s: 1e-6)."""


def checked(
    planned: PlannedRun, values: Mapping[str, Array], metrics: Sequence[str], found: Measured
) -> tuple[Measured, Flags]:
    """Run every case again and say whose metrics are not sure.

    Parameters
    ----------
    planned, values, metrics
        As of `stickslip.sweeps.measured.measured`.
    found : Measured
        What it gave.

    Returns
    -------
    found, flagged
        Of every case at the tightest tolerance that it was run at (of a machine at the first); whether it differs.
    """
    best = Measured(found.metrics.copy(), list(found.failures), list(found.integrators))
    held = _Held(planned, values, metrics, best, np.zeros(len(best.metrics), dtype=np.bool_))
    ways = {"machine": held.by_finer_sub_steps, "sampled": held.by_tighter_runs}
    ran = np.array(best.integrators)
    own = [name for name in dict.fromkeys(best.integrators) if name in ways]
    for name in own:
        ways[name](np.flatnonzero(ran == name))
    # Those that could not be run have no integrator, and nothing to be held against.
    others = np.flatnonzero(~np.isin(ran, [*own, ""]))
    if others.size:
        held.by_wrong_steps(others)
    return best, held.flagged


@dataclass(frozen=True)
class _Held:
    """The cases of a block, held against other runs of themselves; `best` and `flagged` are what is found so far."""

    planned: PlannedRun
    values: Mapping[str, Array]
    metrics: Sequence[str]
    best: Measured
    flagged: Flags

    def by_finer_sub_steps(self, cases: Cases) -> None:
        """Machines, whose noise is the same: one that runs away from itself does so at any tolerance."""
        self.flagged[cases] = self._differs(cases, self._again(cases, 1.0, PERTURBATIONS[0]), SETTLED)

    def by_tighter_runs(self, cases: Cases) -> None:
        """Sampled loops: at a hundredth of the tolerance, and those that differ at `FINEST`."""
        first = self.planned.numerics.tolerance
        levels = [t for t in (max(first / LOOSER["sampled"], FINEST), FINEST) if t < first * (1.0 - 1e-9)]
        if not levels:
            self.flagged[cases] = self._differs(cases, self._again(cases, 1.0, PERTURBATIONS[0]), SETTLED)
        for tolerance in dict.fromkeys(levels):
            if not cases.size:
                break
            fine = self._again(cases, tolerance / first)
            self.flagged[cases] = self._differs(cases, fine, SETTLED)
            self._keep(cases, fine)
            cases = cases[self.flagged[cases]]

    def by_wrong_steps(self, cases: Cases) -> None:
        """The others: with wrong steps, and what differs then at ever tighter tolerances."""
        self._perturb(cases, 1.0)
        unmoved = cases[~self.flagged[cases]]
        if unmoved.size and self.planned.control.feeds_back:
            # It acts on the motion itself, which may turn where the tolerance does not see it, wrong steps or not.
            self.flagged[unmoved] = self._differs(unmoved, self._again(unmoved, TIGHTER[0]), SURE)
        for times in TIGHTER:
            cases = cases[self.flagged[cases]]
            if not cases.size or times * self.planned.numerics.tolerance < FINEST * (1.0 - 1e-9):
                break
            fine = self._again(cases, times)
            self.flagged[cases] = self._differs(cases, fine, SURE)
            self._keep(cases, fine)
            self._perturb(cases, times)

    def _perturb(self, cases: Cases, times: float) -> None:
        """Flag what wrong steps change."""
        for perturbation in PERTURBATIONS:
            # Only the exact integrator can be wrong in two ways.
            some = (
                cases
                if perturbation == PERTURBATIONS[0]
                else cases[[self.best.integrators[i] == "exact" for i in cases]]
            )
            # What is held against a run is one of the integrator that ran it.
            ran: list[str] = [self.best.integrators[i] for i in some]
            for name in dict.fromkeys(ran):
                same = some[[self.best.integrators[i] == name for i in some]]
                self.flagged[same] |= self._differs(
                    same, self._again(same, times, perturbation, name), SETTLED
                )

    def _again(self, cases: Cases, times: float, perturbation: float = 0.0, integrator: str = "") -> Measured:
        """The cases at that multiple of the tolerance."""
        n = self.planned.numerics
        # The fixed integrator is of second order in its step.
        finer = replace(
            n, tolerance=times * n.tolerance, time_step=math.sqrt(times) * n.time_step,
            integrator=integrator if integrator in INTEGRATORS else n.integrator,
        )  # fmt: skip
        some = {k: v[cases] for k, v in self.values.items()}
        return measured(replace(self.planned, numerics=finer), some, self.metrics, len(cases), perturbation)

    def _differs(self, cases: Cases, other: Measured, part: float) -> Flags:
        """Whose metrics differ by more than that part, or which end at another time."""
        ends = [_when(self.best.failures[int(i)]) != _when(why) for i, why in zip(cases, other.failures)]
        apart = differ(self.best.metrics[cases], other.metrics, self.metrics, self.planned.duration, part)
        return apart | np.array(ends, dtype=np.bool_)

    def _keep(self, cases: Cases, fine: Measured) -> None:
        self.best.metrics[cases] = fine.metrics
        for i, why, name in zip(cases, fine.failures, fine.integrators):
            self.best.failures[i], self.best.integrators[i] = why, name


def _when(failure: str) -> str:
    """What is said of a failure before its reason, whose numbers follow the tolerance."""
    return failure.split(": ")[0]


def differ(
    one: Array, other: Array, names: Sequence[str], duration: float = math.inf, part: float = SURE
) -> Flags:
    """Where a metric of one differs from the other's, shape (n,) of two (n, metrics).

    By more than a part, or, for reversals, by more than one in `duration` seconds (in the second half, half of that).
    """
    floors = np.array([_floor(name, duration) for name in names])
    none = np.isnan(one) & np.isnan(other)
    close = np.abs(one - other) <= part * np.abs(one) + floors
    return ~np.all(close | none, axis=1)


def _floor(name: str, duration: float) -> float:
    """Difference of a metric that counts for nothing."""
    if "reversals" in name:
        return 1.001 * (2.0 if name.startswith("second_half") else 1.0) / duration
    if name.endswith("rad_s"):
        return 1e-6
    return FLOORS.get(name.rsplit("_", 1)[1], 0.0)
