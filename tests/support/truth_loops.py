"""Five hundred random closed loops whose motion is frozen in ``tests/data/truth_loops.npz``.

``python tests/support/truth_loops.py`` (with ``PYTHONPATH=tests``) solves all of them at 1e-11 rad and writes the file.
A loop is determined by its number: law, plant, controller, sampled or continuous control, and reference.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np

import stickslip as ss
from stickslip.core.errors import SimulationError
from support.places import ROOT

FILE = ROOT / "tests" / "data" / "truth_loops.npz"
COUNT = 500
SEED = 20261128
DURATION = 0.5
TIMES = np.linspace(0.05, DURATION, 10)
TIGHT, LOOSER = 1e-11, 1e-10
"""Tolerances, rad, of the frozen run and of the run that estimates its error."""
KNOWN = 1e-8
"""rad: largest error of a frozen loop. Loops that amplify rounding beyond it are not frozen; one in ten drawn does."""


@dataclass(frozen=True)
class TruthLoop:
    """A random closed loop, what it is made of, and how it is run."""

    number: int
    parts: tuple[str, ...]
    axis: Any
    controller: ss.Controller
    reference: ss.Reference

    def run(self, tolerance: float, check: bool = False) -> ss.Record:
        """Simulate the loop, and estimate the error of the run if `check` is set."""
        return ss.simulate(
            self.axis, self.controller, self.reference, DURATION,
            tolerance=tolerance, output=TIMES, metered=False, check=check,
        )  # fmt: skip

    def positions(self, tolerance: float) -> Any:
        """Return the positions at `TIMES`, rad; NaN for a run that ends early."""
        try:
            record = self.run(tolerance)
        except SimulationError:
            return np.full(TIMES.size, np.nan)
        rows = record["event"] == 0.0
        return np.interp(TIMES, record.time[rows], record["position"][rows])


def draw(number: int) -> TruthLoop:
    """Draw the loop with this number."""
    rng = np.random.default_rng([SEED, number])
    inertia = 4e-4 * 10.0 ** rng.uniform(-0.5, 0.5)
    law, friction = draw_friction(rng)
    period = float(rng.choice([0.0, 2.5e-4, 5e-4, 1e-3], p=[0.25, 0.25, 0.25, 0.25]))
    plant = str(rng.choice(["rigid", "servo", "two masses"], p=[0.6, 0.2, 0.2])) if period else "rigid"
    axis = (
        draw_machine(rng, plant, inertia, friction, period)
        if plant != "rigid"
        else ss.RigidAxis(inertia, friction)
    )
    structure, controller = draw_controller(rng, inertia, friction, period)
    motion, reference = draw_reference(rng)
    parts = (law, plant, structure, "sampled" if period else "continuous", motion)
    return TruthLoop(number, parts, axis, controller, reference)


def draw_friction(rng: np.random.Generator) -> tuple[str, ss.Model]:
    """Draw a law that the located engines run, with levels and stiffness of a small servo axis."""
    fc = 0.285 * 10.0 ** rng.uniform(-0.5, 0.3)
    curve = {"fc": fc, "fs": fc * rng.uniform(1.0, 1.5), "vs": 10.0 ** rng.uniform(-2.3, -0.7)}
    viscous = {"sigma2": rng.uniform(0.0, 0.03)}
    stiffness = fc * 10.0 ** rng.uniform(4.0, 5.0)
    share = np.array([0.4, 0.3, 0.2, 0.1])
    laws = {
        "gms": lambda: ss.Model(
            "gms", k=list(stiffness * share), alpha=[0.25] * 4, c=rng.uniform(10.0, 50.0), **curve, **viscous
        ),
        "maxwell_slip": lambda: ss.Model(
            "maxwell_slip", k=list(stiffness * share), w=list(fc * share[::-1]), **viscous
        ),
        "lugre": lambda: ss.Model(
            "lugre", sigma0=stiffness, sigma1=rng.uniform(0.0, 0.3), **curve, **viscous
        ),
        "elasto_plastic": lambda: ss.Model(
            "elasto_plastic", sigma0=stiffness, sigma1=0.1, z_ba=0.5 * fc / stiffness, **curve, **viscous
        ),
        "dahl": lambda: ss.Model("dahl", sigma0=0.1 * stiffness, fc=fc, **viscous),
        "coulomb": lambda: ss.Model("coulomb", fc=fc, **viscous),
    }
    name = list(laws)[rng.choice(len(laws), p=[0.3, 0.15, 0.25, 0.1, 0.05, 0.15])]
    return name, laws[name]()


def draw_machine(
    rng: np.random.Generator, plant: str, inertia: float, friction: ss.Model, period: float
) -> ss.Machine:
    """Draw a servo with a current loop and a delay, or one with motor and load on a spring as well."""
    flexible = None
    if plant == "two masses":
        motor = inertia * rng.uniform(0.3, 0.7)
        stiffness = (inertia - motor) * (2.0 * np.pi * rng.uniform(40.0, 200.0)) ** 2
        where = "motor" if rng.random() < 0.5 else "load"
        flexible = ss.TwoMassAxis(motor, inertia - motor, stiffness, rng.uniform(0.01, 0.05), where)
    counts = float(rng.choice([0.0, 65536.0, 1e6]))
    return ss.Machine(
        plant, inertia, ss.Contact(friction), flexible=flexible,
        amplifier=ss.Amplifier(torque_constant=0.2, current_limit=15.0, bandwidth=rng.uniform(500.0, 2000.0)),
        encoder=ss.Encoder(counts=counts) if counts else ss.Encoder(),
        sample_time=period, delay=float(rng.choice([0.0, 0.5, 1.0, 2.3])),
    )  # fmt: skip


def draw_controller(
    rng: np.random.Generator, inertia: float, friction: ss.Model, period: float
) -> tuple[str, ss.Controller]:
    """Draw a linear controller, and a compensator in half of the loops."""
    kind = str(rng.choice(["PD", "PID", "PR"]))
    gains = ss.place(kind, inertia, rng.uniform(5.0, 25.0), rng.uniform(0.7, 1.2))
    believed = friction if rng.random() < 0.5 else ss.Model("coulomb", fc=0.2, sigma2=0.01)
    role = str(rng.choice(["none", "feedforward", "feedback"], p=[0.5, 0.3, 0.2]))
    gain, limit = rng.uniform(0.5, 0.95), float(rng.choice([0.0, 1.0]))
    made = {
        "none": None,
        "feedforward": ss.Feedforward(believed, gain),
        "feedback": ss.Feedback(believed, gain),
    }
    sampling = {"sample_time": period, **({"torque_limit": limit} if limit else {})} if period else {}
    return f"{kind}, {role}", ss.Controller(gains, made[role], **sampling)


def draw_reference(rng: np.random.Generator) -> tuple[str, ss.Reference]:
    """Draw a motion from pre-sliding to several revolutions a second."""
    size = 10.0 ** rng.uniform(-4.0, 0.3)
    motions = {
        "sine": lambda: ss.Reference("sine", amplitude=size, frequency=rng.uniform(1.0, 8.0)),
        "ramp": lambda: ss.Reference("ramp", velocity=size, end=rng.uniform(0.2, 0.5)),
        "step": lambda: ss.Reference("step", amplitude=0.1 * size),
        "scurve": lambda: ss.Reference(
            "scurve", distance=size, velocity=8.0 * size, acceleration=100.0 * size, jerk=4000.0 * size
        ),
    }
    name = str(rng.choice(list(motions)))
    return name, motions[name]()


def freeze(count: int = COUNT) -> None:
    """Solve loops at `TIGHT` until so many are known to `KNOWN`, and write their numbers, positions and errors."""
    numbers, positions, errors, number = list[int](), list[Any](), list[float](), 0
    while len(numbers) < count:
        loop = draw(number)
        position = loop.positions(TIGHT)
        error = float(np.max(np.abs(position - loop.positions(LOOSER))))
        print(number, *loop.parts, f"{error:.1e}", file=sys.stderr, flush=True)
        if error < KNOWN:
            numbers.append(number)
            positions.append(position)
            errors.append(error)
        number += 1
    np.savez_compressed(FILE, number=numbers, position=positions, error=errors)


if __name__ == "__main__":
    freeze(*map(int, sys.argv[1:]))
