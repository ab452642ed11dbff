"""A rigid axis with friction as a rig: the plant under the tests of the loop."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.jit import compiled_law, flat, kernel, pointer
from stickslip.model import Model
from stickslip.rigs._control import Control, decide, finished
from stickslip.rigs.rig import Capabilities, Limits, Measurement, Watchdog
from stickslip.simulation._driven_step import Plant, advance
from stickslip.simulation.driven import Mechanics
from stickslip.spec import Surroundings

LIMITS = Limits(
    torque=1.0, speed=60.0, position=(-20.0, 20.0), temperature=80.0, following_error=1.0, stop_time=0.02
)
FRICTION = Model("lugre", sigma0=2.5e4, sigma1=1.0, sigma2=1e-3, fs=0.35, fc=0.28, vs=0.1)


@kernel()
def sample(numbers: Any, step: int, holding: int, parameters: Any, surroundings: Any, z: Any, base: Any,
           trial: Any, state: Any, torque: float, dt: float, measured: Any) -> None:  # fmt: skip
    """The plant over one sample time, and what is then measured."""
    plant = Plant(
        pointer(numbers, 0), step, holding, pointer(parameters, 0), pointer(surroundings, 0), pointer(base, 0),
        pointer(trial, 0), z.size,
    )  # fmt: skip
    for _ in range(4):
        advance(plant, state, pointer(z, 0), torque, 0.0, 0.25 * dt)
    measured[0] += dt
    measured[1], measured[2], measured[3], measured[4], measured[5] = state[0], torque, torque, 25.0, 0.0


@kernel()
def block(control: Control, setpoints: Any, rows: Any, plant: Any, torque_in: Any, dt: float) -> int:
    """Many samples."""
    numbers, step, holding, parameters, surroundings, z, base, trial, state = plant
    for k in range(setpoints.shape[0]):
        torque = decide(control, setpoints[k], rows[k])
        torque_in[0] = torque
        sample(numbers, step, holding, parameters, surroundings, z, base, trial, state, torque, dt,
               control.measured)  # fmt: skip
        if finished(control):
            return k + 1
    return setpoints.shape[0]


class AxisRig:
    """A rigid axis; its clock is the number of samples."""

    name = "axis"
    sample_time = 1e-3

    def __init__(self, *, blocks: bool = True, watchdog: bool = True, friction: Model = FRICTION,
                 inertia: float = 4.2757e-4, limits: Limits = LIMITS) -> None:  # fmt: skip
        self.limits = limits
        declared = Watchdog(0.0, "the plant stops with the process") if watchdog else None
        self.capabilities = Capabilities(declared, False, blocks, True, True)
        pointers = compiled_law(friction.law)
        parameters = flat(friction.law.pack(friction.parameters))
        z = flat(friction.law.pack_state(friction.law.state(friction.parameters)))
        self._plant = (
            Mechanics(inertia).numbers(False), pointers.step, pointers.holding, parameters,
            np.array(Surroundings()), z, z.copy(), z.copy(), np.zeros(2),
        )  # fmt: skip
        self._measured = np.array([0.0, 0.0, 0.0, 0.0, 25.0, 0.0])
        self.torques: list[float] = []
        self.open_now = False

    def open(self) -> Measurement:
        self.open_now = True
        return Measurement(*self._measured)

    def exchange(self, torque: float) -> Measurement:
        self.torques.append(torque)
        sample(*self._plant, torque, self.sample_time, self._measured)
        return Measurement(*self._measured.tolist())

    def exchange_block(self, control: Control, setpoints: Any, rows: Any) -> int:
        last = np.zeros(1)
        count = block(control, setpoints, rows, self._plant, last, self.sample_time)
        self._measured[:] = control.measured
        self.torques.extend(rows[:count, 4].tolist())
        return count

    def pause(self, seconds: float) -> Measurement:
        self._measured[0] += seconds
        return Measurement(*self._measured)

    def close(self) -> None:
        self.open_now = False
