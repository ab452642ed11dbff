"""An hour at rest: what a control law remembers may not grow."""

from __future__ import annotations

import ast
import math

import numpy as np

from stickslip.contract.specimens import COUNT, motion, replayed, specimen
from stickslip.contract.verdict import Verdict, failed, held
from stickslip.control.composition import MEMORY
from stickslip.control.controller import Controller
from stickslip.core.control_spec import ControlLaw
from stickslip.simulation.compiled_controller import Sampled, compiled
from stickslip.subset import named

HOUR, MINUTE = 60, 60_000
"""Minutes, and samples of one."""
REST = [f.name for f in MEMORY].index("rest")
"""Place of the samples since the reference came to rest: nothing else in the memory only counts."""


def at_rest(law: ControlLaw) -> Verdict:
    """Nothing grows in an hour at rest, with an encoder that flickers by a count, or in one at the torque limit."""
    count = 2.0 * math.pi / 65536
    flicker = np.zeros((MINUTE, 4))
    flicker[:, 0] = count * np.tile((0.0, 1.0, 0.0, -1.0), MINUTE // 4)
    blocked = np.zeros((MINUTE, 4))
    blocked[:, 1] = 1.0
    told = told_of_rest(specimen(law))
    for name, inputs in (("with a flickering encoder", flicker), ("blocked at the limit", blocked)):
        sampled = compiled(specimen(law))
        replayed(sampled, motion()[: COUNT // 4])
        replayed(sampled, inputs)
        first = np.concatenate([np.abs(sampled.state), [np.abs(replayed(sampled, inputs)).max()]])
        torque = np.zeros(0)
        for _ in range(HOUR - 2):
            before = remembered(sampled, told)
            torque = replayed(sampled, inputs)
            if remembered(sampled, told) == before:
                break  # all that remain are this minute, bit for bit
        last = np.concatenate([np.abs(sampled.state), [np.abs(torque).max()]])
        if not np.all(last <= 1.01 * first + 1e-9) or sampled.memory[sampled.fault] != 0.0:
            i = int(np.argmax(last - first))
            what = [*(f"state {n}" for n in specimen(law).state_names()), "the torque"][i]
            return failed(
                "rest", f"{name}: {what} is {first[i]:.6g} after two minutes, {last[i]:.6g} after an hour"
            )
    return held("rest", "an hour at rest and an hour at the limit: state and torque as after two minutes")


def told_of_rest(controller: Controller) -> bool:
    """Whether a law of the controller reads for how long the reference has been at rest."""
    trees = named({"_sample": controller.functions["sample"]}, controller.layouts)
    return any(
        isinstance(node, ast.Attribute) and node.attr == "rest" and isinstance(node.ctx, ast.Load)
        for tree in trees.values()
        for node in ast.walk(tree)
    )


def remembered(sampled: Sampled, told: bool) -> list[bytes]:
    """The bits of all that a compiled controller's next torque depends on besides its inputs."""
    memory = sampled.memory if told else np.delete(sampled.memory, REST)
    return [x.tobytes() for x in (memory, sampled.state, sampled.parameters)]
