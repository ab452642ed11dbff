"""Exported joints in MuJoCo: a run with sticking and slipping against this package, and a load that is held."""

from __future__ import annotations

import importlib
import math
import re
from typing import Any, NamedTuple

import numpy as np

from stickslip.exports.nearest import Curve
from stickslip.models.model import Model, Reference

Array = np.ndarray[Any, np.dtype[np.float64]]

DURATION, FREQUENCY = 1.0, 0.5  # s, Hz
SPRING = 20.0  # Hz, of the axis on the spring
PULL = 3.0  # torques of friction to which the spring is stretched
FINER = (1, 4, 16)  # parts of the timestep


class Run(NamedTuple):
    """One timestep, s; and the largest difference in position, rad, and as a share of the axis's travel."""

    timestep: float
    error: float
    share: float


def pulled(text: str, model: Model, inertia: float, timestep: float) -> list[Run]:
    """An axis on a spring whose end goes slowly to and fro: it sticks and slips; MuJoCo's error at three timesteps.

    Parameters
    ----------
    text : str
        MJCF of one joint; its timestep is replaced.
    model : Model
        The user's own law, as this package runs it (fixed integrator, 0.02 ms).
    inertia : float
        kg·m²
    timestep : float
        The longest, s.
    """
    stiffness = inertia * (2.0 * math.pi * spring(timestep)) ** 2
    amplitude = PULL * Curve.of(model).size / stiffness
    count = max(4, round(DURATION / timestep))
    times = np.linspace(0.0, count * timestep, count + 1)
    end = Reference("sine", amplitude=amplitude, frequency=FREQUENCY)
    own = own_run(model, inertia, stiffness, end, times)
    travel = max(float(np.ptp(own)), 1e-300)
    out: list[Run] = []
    for parts in FINER:
        h = timestep / parts
        other = mujoco_run(text, h, stiffness, end, count, parts)
        error = float(np.abs(other - own).max())
        out.append(Run(h, error, error / travel))
    return out


def spring(timestep: float) -> float:
    """Natural frequency of the axis on its spring, Hz, which the timestep resolves."""
    return min(SPRING, 0.04 / timestep)


def own_run(model: Model, inertia: float, stiffness: float, end: Reference, times: Array) -> Array:
    """Position at the times, rad."""
    from stickslip.control.controller import Controller
    from stickslip.control.linear import Gains
    from stickslip.machines.rigid import RigidAxis
    from stickslip.simulation.closed_loop import simulate

    run = simulate(
        RigidAxis(inertia, model),
        Controller(Gains(kp=stiffness)),
        end,
        float(times[-1]),
        integrator="fixed",
        time_step=2e-5,
        output=times,
        metered=False,
    )
    return run["position"][np.searchsorted(run.time, times)]


def mujoco_run(text: str, h: float, stiffness: float, end: Reference, count: int, parts: int) -> Array:
    """Position after every `parts` steps, rad."""
    engine: Any = importlib.import_module("mujoco")
    loaded = engine.MjModel.from_xml_string(re.sub(r'timestep="[^"]*"', f'timestep="{h!r}"', text))
    data = engine.MjData(loaded)
    position = np.zeros(count + 1)
    goal = end.sample(h * np.arange(count * parts))[:, 0]
    for k in range(count * parts):
        data.qfrc_applied[0] = stiffness * (goal[k] - data.qpos[0])
        engine.mj_step(loaded, data)
        if (k + 1) % parts == 0:
            position[(k + 1) // parts] = data.qpos[0]
    return position


def drift(loaded: Any, torque: float) -> float:
    """How far a load moves the joint in a second, rad."""
    engine: Any = importlib.import_module("mujoco")
    data = engine.MjData(loaded)
    data.qfrc_applied[0] = torque
    for _ in range(math.ceil(1.0 / loaded.opt.timestep)):
        engine.mj_step(loaded, data)
    return abs(float(data.qpos[0]))
