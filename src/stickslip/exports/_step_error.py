"""How far a law's step is from the law itself, against the time between two samples: measured at every export.

A step takes the velocity as linear between its ends. Laws whose step is exact for that lose next to nothing; others
lose most where the motion reverses, and the less the shorter the step is, or the parts that it is divided into.
"""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from stickslip.core.spec import Law, Surroundings
from stickslip.models.model import Model

SPEED, FREQUENCY = 2.0, 1.0  # rad/s, Hz: of the sine whose reversal is looked at
PARTS = 4
"""Into which a step is divided for the last column, where nothing else divides it."""
SAMPLE_TIMES = (2e-3, 1e-3, 5e-4, 2.5e-4, 1e-4)  # s
PHASES = 4  # of the samples against the reversal
FINE = SAMPLE_TIMES[-1] / (2 * PHASES)  # s, of the steps that stand for the law
BEFORE, AFTER = 320, 640  # fine steps on either side of the reversal
AHEAD = [-BEFORE * FINE - 0.25 / FREQUENCY * (1.0 - i / 60.0) for i in range(61)]
"""s, of the steps up to there."""


Step = Callable[..., float]


class StepError(NamedTuple):
    """Largest error of the torque, N·m, with samples of ``sample_time`` s: in one step, and in parts of it."""

    sample_time: float
    whole: float
    parts: float


def step_errors(model: Model, *, held: bool = False, parts: int = PARTS) -> tuple[StepError, ...]:
    """The errors about a reversal of a sine of 2 rad/s and 1 Hz, which comes from steady sliding.

    ``parts`` divide a step for the last number. ``held``: of the two stages of an axis's step
    (`stickslip.exports.fmu_axis`), in each of which a velocity is held.
    """
    return _measured(model.law, model.parameters, held, parts)


def about_steps(model: Model, substeps: str, *, held: bool = False, parts: int = PARTS) -> dict[str, Any]:
    """What the section of a README on it needs; ``substeps`` says how a step is divided there."""
    return {
        "step_errors": step_errors(model, held=held, parts=parts), "parts": parts, "substeps": substeps,
        "held": held,
    }  # fmt: skip


@functools.lru_cache(maxsize=256)
def _measured(law: Law, p: Any, held: bool, parts: int) -> tuple[StepError, ...]:
    begun = _sliding(law, p, law.step)
    exact = _torques(begun, p, range(-BEFORE, AFTER + 1), 1, law.step)
    step = functools.partial(_in_stages, law.step) if held else law.step
    begun = _sliding(law, p, step) if held else begun
    found: list[StepError] = []
    for sample_time in SAMPLE_TIMES:
        stride = round(sample_time / FINE)
        worst = [0.0, 0.0]
        for phase in range(PHASES):
            at = range(-BEFORE + phase * stride // PHASES, AFTER + 1, stride)
            for i, count in enumerate((1, parts)):
                errors = [abs(f - exact[k + BEFORE]) for k, f in zip(at, _torques(begun, p, at, count, step))]
                worst[i] = max(worst[i], *errors)
        found.append(StepError(sample_time, *worst))
    return tuple(found)


def _in_stages(step: Step, v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """A step as Alexander's two-stage SDIRK makes it, where the velocity is linear from v0 to v1 rad/s."""
    part = (1.0 - math.sqrt(0.5)) * dt
    middle = v0 + (v1 - v0) * (1.0 - math.sqrt(0.5))
    step(middle, middle, dt - part, z, p, u)
    return step(v1, v1, part, z, p, u)


def _sliding(law: Law, p: Any, step: Step) -> Any:
    """The state shortly before the reversal, after a quarter of the period in one direction: the same for all."""
    z, u, last = law.state(p), Surroundings(), AHEAD[0]
    for time in AHEAD:
        step(_speed(last), _speed(time), time - last, z, p, u)
        last = time
    return z


def _torques(begun: Any, p: Any, at: Sequence[int], parts: int, step: Step) -> list[float]:
    """Torques at these fine steps from the reversal, N·m, from the state where the axis slides."""
    z, u = copy.deepcopy(begun), Surroundings()
    v0, last = _speed(AHEAD[-1]), AHEAD[-1]
    torques: list[float] = []
    for k in at:
        time = k * FINE
        v1, dt = _speed(time), (time - last) / parts
        torque = 0.0
        for j in range(parts):
            torque = step(v0 + (v1 - v0) * j / parts, v0 + (v1 - v0) * (j + 1) / parts, dt, z, p, u)
        torques.append(torque)
        v0, last = v1, time
    return torques


def _speed(time: float) -> float:
    return SPEED * math.sin(2.0 * math.pi * FREQUENCY * time)
