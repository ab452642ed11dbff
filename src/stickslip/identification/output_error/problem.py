"""Output error of an axis: simulate every record and compare it to the measurement.

Closed loops are simulated with their controller, which keeps an unstable or drifting motion at the record (Gautier,
Janot and Vandanjon 2013); a record without a known controller is simulated with its recorded drive and a slow observer
that pulls the axis to the measured position, and the misfit is the observer's correction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.spec import Law, Par
from stickslip.identification.experiment import Experiment
from stickslip.identification.fit.axis_start import feasible
from stickslip.identification.fit.parameter_vector import Parameter, Vector
from stickslip.machines.servo import ServoAxis
from stickslip.models.model import Model
from stickslip.simulation.recorded_input.simulation import Course, Drive, Harmonics, Mechanics

Array = np.ndarray[Any, np.dtype[np.float64]]

OBSERVER_HZ = 1.0
"""Natural frequency of the observer on a record without a known controller."""
MAX_STEP = 1e-3  # s, at the start of the search
STEP_ERROR, HALVINGS = (
    0.1,
    2,
)  # change of the misfits by half the step, in their weights; and how often it is halved
SIGNALS = ("drive", "position")


def mechanics_parameters(
    axis: ServoAxis, quantity: str, values: Mapping[str, float], harmonics: int, friction_harmonics: int
) -> list[Parameter]:
    """Return all parameters except the law's, at given or neutral values."""
    gain, loss = axis.drive_gains(quantity)
    torque = axis.unit("N·m")
    described = [
        ("inertia", Par(axis.unit("kg·m²"), "J", "inertia", positive=True), 1.0),
        ("offset", Par(torque, "T_0", "constant torque against positive motion"), 0.0),
        ("gravity", Par(torque, "m g l", "gravity of a pendulum", lower=0.0), 0.0),
        ("gravity_angle", Par(axis.unit("rad"), "q_0", "position at which a pendulum hangs"), 0.0),
        ("drive_gain", Par(f"{torque}/{UNITS[quantity]}", "G", "torque per unit of the drive", positive=True), gain),
        ("back_emf", Par(axis.unit("N·m·s/rad"), "k_e", "torque lost per velocity in the drive", lower=0.0), loss),
        ("load_motor", Par(f"1/({torque})", "l_m", "load per drive torque", lower=0.0), 0.0),
        ("load_external", Par(f"1/({torque})", "l_e", "load per outer torque", lower=0.0), 0.0),
        ("backlash", Par(axis.unit("rad"), "b", "backlash", lower=0.0), axis.backlash),
        ("controller_gain", Par("-", "g", "factor on the controller's output", positive=True), 1.0),
    ]  # fmt: skip
    for i in range(harmonics):
        described += [
            (f"cos[{i}]", Par(torque, f"a_{i + 1}", "cosine of the position-dependent torque"), 0.0),
            (f"sin[{i}]", Par(torque, f"b_{i + 1}", "sine of the position-dependent torque"), 0.0),
        ]
    for i in range(friction_harmonics):
        described += [
            (
                f"friction_cos[{i}]",
                Par("-", f"c_{i + 1}", "cosine of friction's share over the position"),
                0.0,
            ),
            (f"friction_sin[{i}]", Par("-", f"d_{i + 1}", "sine of friction's share over the position"), 0.0),
        ]
    return [Parameter(name, par, float(values.get(name, neutral))) for name, par, neutral in described]


def mechanics_of(named: Mapping[str, float], harmonic_period: float) -> Mechanics:
    """Return the mechanics at named values."""
    torque = tuple(
        (named[f"cos[{i}]"], named[f"sin[{i}]"]) for i in range(len(named)) if f"cos[{i}]" in named
    )
    share = tuple(
        (named[f"friction_cos[{i}]"], named[f"friction_sin[{i}]"])
        for i in range(len(named)) if f"friction_cos[{i}]" in named
    )  # fmt: skip
    plain = {
        k: named[k]
        for k in (
            "inertia", "offset", "gravity", "gravity_angle", "drive_gain", "back_emf", "load_motor",
            "load_external", "backlash",
        )
    }  # fmt: skip
    return Mechanics(**plain, harmonics=Harmonics(harmonic_period, torque, share))


UNITS = {"torque": "N·m", "current": "A", "rated_torque": "%", "voltage": "V"}


@dataclass(frozen=True, eq=False)
class Problem:
    """Records, an axis and a law, ready for simulation with any parameters.

    Attributes
    ----------
    experiments : tuple of Experiment
    axis : ServoAxis
    law : Law
    vector : Vector
        Vector of mechanics and law.
    courses : tuple of Course
    signals : tuple of str
        Signals that are compared: "drive", "position".
    weights : mapping of str to float
        Standard deviation of a misfit of each signal.
    robust : bool
        Whether misfits beyond `ROBUST` standard deviations count linearly (soft L1).
    harmonic_period : float
    """

    experiments: tuple[Experiment, ...]
    axis: ServoAxis
    law: Law
    vector: Vector
    courses: tuple[Course, ...]
    signals: tuple[str, ...]
    weights: Mapping[str, float]
    robust: bool = False
    harmonic_period: float = 2.0 * math.pi

    @staticmethod
    def of(
        experiments: Sequence[Experiment], axis: ServoAxis, law: Law, vector: Vector, *, inertia: float,
        robust: bool = False, harmonic_period: float = 2.0 * math.pi, max_step: float = MAX_STEP,
    ) -> Problem:  # fmt: skip
        """Prepare the records for simulation; `inertia` sets the observer's stiffness where one is needed."""
        courses = tuple(Course(law, drive_of(t, inertia, max_step)) for t in experiments)
        signals = tuple(s for s in SIGNALS if all(has(t, s) for t in experiments))
        return Problem(
            tuple(experiments),
            axis,
            law,
            vector,
            courses,
            signals,
            dict.fromkeys(signals, 1.0),
            robust,
            harmonic_period,
        )

    @property
    def units(self) -> dict[str, str]:
        """Unit of each signal that is compared."""
        drive = self.axis.unit(UNITS[self.experiments[0].quantity])
        return {s: self.axis.unit("rad") if s == "position" else drive for s in self.signals}

    def weighted(self, u: Array) -> Problem:
        """Return this problem with the weights estimated from the misfits at u (robust standard deviations)."""
        misfits = self.misfits(u)
        if misfits is None:
            raise InputError(
                f"{self.law.name}: the simulation fails at the start; give other starting values"
            )
        weights: dict[str, float] = {}
        for place, name in enumerate(self.signals):
            part = np.concatenate([m[:, place] for m in misfits])
            spread = 1.4826 * float(np.median(np.abs(part - np.median(part))))
            weights[name] = max(spread, 0.3 * float(np.std(part)), 1e-300)
        return replace(self, weights=weights)

    def resolved(self, u: Array) -> Problem:
        """Return this problem with steps so short that halving them hardly changes its misfits."""
        problem = self
        for _ in range(HALVINGS):
            finer = replace(problem, courses=tuple(
                Course(self.law, replace(c.drive, max_step=0.5 * min(c.drive.max_step, t.period)))
                for c, t in zip(problem.courses, problem.experiments, strict=True)
            ))  # fmt: skip
            change = finer.residuals(u) - problem.residuals(u)
            if not np.sqrt(np.mean(change**2)) > STEP_ERROR:
                return problem
            problem = finer
        return problem

    def mechanics(self, named: Mapping[str, float]) -> Mechanics:
        """Return the mechanics at named values."""
        return mechanics_of(named, self.harmonic_period)

    def simulated(self, u: Array) -> list[Array] | None:
        """Simulate every record (`Course.run`); None if the law refuses the parameters."""
        p = feasible(self.law, self.vector.law_parameters(u))
        if p is None:
            return None
        named = self.vector.named(u)
        mechanics = self.mechanics(named)
        gain = named["controller_gain"]
        return [
            c.run(mechanics, p, gain=gain if t.closed_loop else 1.0)
            for c, t in zip(self.courses, self.experiments, strict=True)
        ]

    def misfits(self, u: Array) -> list[Array] | None:
        """Return simulated minus measured signals of every record in the rows in use, shape (rows, signals)."""
        runs = self.simulated(u)
        if runs is None:
            return None
        out: list[Array] = []
        for run, experiment in zip(runs, self.experiments, strict=True):
            parts = [run[:, PLACE[s]] - measured(experiment, s) for s in self.signals]
            out.append(np.column_stack(parts)[experiment.rows])
        return out

    def residuals(self, u: Array) -> Array:
        """Return all misfits over their weights, signals of one time adjacent, shape (n,)."""
        misfits = self.misfits(u)
        if misfits is None:
            return np.full(sum(int(t.rows.sum()) for t in self.experiments) * len(self.signals), np.inf)
        size = np.array([self.weights[s] for s in self.signals])
        r = np.concatenate([(m / size).ravel() for m in misfits])
        return soft(r) if self.robust else r

    def model(self, u: Array) -> Model:
        """Return the law at u, its static torque raised to the Coulomb torque if it would be below."""
        p = feasible(self.law, self.vector.law_parameters(u))
        assert p is not None
        return Model(self.law, **p._asdict())


PLACE = {"position": 0, "drive": 2}


def has(experiment: Experiment, signal: str) -> bool:
    """Return whether a simulation of this record can be compared to that signal."""
    return signal == "position" or (experiment.closed_loop and experiment.drive is not None)


def measured(experiment: Experiment, signal: str) -> Array:
    """Return the measured signal to which a simulation is compared, shape (n,)."""
    return experiment.position if signal == "position" else experiment.signal()


def soft(r: Array) -> Array:
    """Return residuals whose squares grow linearly beyond 1 (soft L1: Charbonnier et al. 1994)."""
    return np.copysign(np.sqrt(2.0 * (np.sqrt(1.0 + r * r) - 1.0)), r)


def drive_of(experiment: Experiment, inertia: float, max_step: float) -> Drive:
    """Return the input of the simulated axis."""
    if experiment.closed_loop:
        assert experiment.reference is not None
        return Drive(
            experiment.time, experiment.reference, "feedback", experiment.loop, experiment.supply, experiment.start(),
            max_step=max_step,
        )  # fmt: skip
    omega = 2.0 * math.pi * min(OBSERVER_HZ, 0.02 / experiment.period)
    even = smooth(experiment)
    return Drive(
        experiment.time, experiment.signal(), "held", None, experiment.supply, experiment.start(),
        position=experiment.position, spring=inertia * omega**2,
        damping=np.full(experiment.time.size, 2.0 * inertia * omega),
        goal=np.append(np.diff(even) / np.diff(experiment.time), 0.0), max_step=max_step,
    )  # fmt: skip


def smooth(experiment: Experiment) -> Array:
    """Return the position after a zero-phase low-pass at a tenth of the sample rate, at the record's times."""
    from stickslip.identification.fit.filters import low_pass
    from stickslip.identification.regression.inverse import uniform

    t, q, _, rate = uniform(experiment)
    return np.interp(experiment.time, t, low_pass(q, 0.1 * rate, rate, order=2))
