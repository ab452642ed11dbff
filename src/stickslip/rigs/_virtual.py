"""The compiled loop of a virtual rig: controller, safety and machine, sample by sample."""

from __future__ import annotations

from typing import Any

from stickslip.jit import kernel
from stickslip.rigs.loop_sample import Control, decide, finished
from stickslip.simulation.machine.plant import Laid, plant_of
from stickslip.simulation.machine.step import sample

__all__ = ["run_block"]


@kernel()
def run_block(laid: Laid, control: Control, setpoints: Any, rows: Any) -> int:
    """`stickslip.rigs.rig.BlockRig.exchange_block` on a machine; returns how many samples were run."""
    plant = plant_of(laid)
    for k in range(setpoints.shape[0]):
        torque = decide(control, setpoints[k], rows[k])
        sample(plant, torque, control.measured)
        if finished(control):
            return k + 1
    return setpoints.shape[0]
