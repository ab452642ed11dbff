"""Whether a law's torque is a torque for any step: finite, bounded, mirrored, the same compiled."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.contract.motions import (
    STEPS,
    Array,
    U,
    batch,
    level_of,
    motions,
    name_of,
    nearby,
    seeded,
    tried,
)
from stickslip.contract.verdict import Verdict, failed, held
from stickslip.core.smoke_test import complaint
from stickslip.core.spec import Law

CASES, MOTIONS = 10, 30
"""Parameter sets of a law and option, and motions of each."""
FINER = 64
"""Parts of a step in the motion that tells whether a torque beyond the level is the law's own."""


def bounded(law: Law) -> Verdict:
    """Torques and states are finite for any step; at rest the torque is within the law's levels."""
    count = 0
    for variant in tried(law):
        rng = seeded(variant, 1)
        for _ in range(CASES):
            p = nearby(variant, rng)
            velocity, dt = motions(rng, MOTIONS)
            if wrong := unbounded(variant, p, velocity, dt):
                return failed("bounded", f"{name_of(variant)}: {wrong} with {_named(p)}")
            count += MOTIONS
    levels = (
        ""
        if math.isfinite(level_of(law, law.parameters(dict(law.example))))
        else "; no parameter in N·m gives a level"
    )
    return held("bounded", f"{count} random motions of {STEPS} steps: finite, mirrored as declared{levels}")


def unbounded(law: Law, p: Any, velocity: Array, dt: Array) -> str:
    """Say what is wrong with the torques of motions, shapes (cases, STEPS); "" where nothing is."""
    torque, end = batch(law, p, velocity, dt)
    if not (np.all(np.isfinite(torque)) and np.all(np.isfinite(end))):
        return "a torque or a state is not finite"
    if law.odd:
        mirrored, _ = batch(law, p, -velocity, dt)
        room = 1e-15 + 1e-12 * np.abs(torque)
        if np.any(np.abs(mirrored + torque) > room):
            return "the mirrored motion does not give the mirrored torque (declared odd)"
    # At rest nothing viscous is left.
    rest = velocity[:, -1] == 0.0
    level = 1.0001 * level_of(law, p)
    high = np.flatnonzero(rest & (np.abs(torque[:, -1]) > level))
    if not high.size:
        return ""
    # Levels may be products of parameters in other units: then the torque is as high in fine steps too.
    fine, _ = batch(law, p, *_finer(velocity[high], dt[high]))
    own = np.abs(fine).max(axis=1)
    beyond = np.abs(torque[high, -1]) > 1.0001 * np.maximum(level, own)
    if not np.any(beyond):
        return ""
    found = float(np.abs(torque[high, -1])[beyond].max())
    return f"a torque of {found:.4g} N·m at rest is above the level of {level:.4g} N·m"


def _finer(velocity: Array, dt: Array) -> tuple[Array, Array]:
    """The same motions, every step in parts along which the velocity runs linearly."""
    before = np.concatenate([np.zeros((len(velocity), 1)), velocity[:, :-1]], axis=1)
    share = np.arange(1, FINER + 1) / FINER
    fine = before[:, :, None] + (velocity - before)[:, :, None] * share
    return (
        np.ascontiguousarray(fine.reshape(len(velocity), -1)),
        np.ascontiguousarray(np.repeat(dt / FINER, FINER, axis=1)),
    )


def _named(p: Any) -> str:
    return ", ".join(f"{k} = {v}" for k, v in p._asdict().items())


def no_length(law: Law) -> Verdict:
    """A step of no length gives the torque now; `rate` gives it too and moves the state as `step` does."""
    for variant in tried(law):
        if wrong := complaint(variant):
            return failed("torque now", f"{name_of(variant)}: {wrong}")
    return held("torque now", "a step with dt = 0 gives it, and `rate` where there is one")


def compiled(law: Law) -> Verdict:
    """The compiled law gives the bits of plain Python."""
    rng = seeded(law, 2)
    for _ in range(4):
        p = nearby(law, rng)
        velocity, dt = motions(rng, 4)
        torque, _ = batch(law, p, velocity, dt)
        for case in range(4):
            z, v = law.state(p), 0.0
            for i in range(STEPS):
                end = float(velocity[case, i])
                plain = law.step(v, end, float(dt[case, i]), z, p, U)
                if plain != torque[case, i]:
                    return failed("compiled", f"{plain!r} N·m in Python, {float(torque[case, i])!r} compiled")
                v = end
    return held("compiled", "every bit as plain Python")
