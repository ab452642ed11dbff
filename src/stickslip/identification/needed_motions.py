"""Procedures of a rig that determine the parameters of a model, and their motions."""

from __future__ import annotations

EXPERIMENTS = {
    "inertia": "inertia", "fs": "breakaway", "sigma0": "presliding", "k": "presliding", "alpha": "presliding",
    "fc": "sliding", "vs": "sliding", "sigma2": "sliding", "delta_s": "sliding",
    "sigma1": "stickslip", "c": "stickslip",
}  # fmt: skip
"""Procedure of a rig for each parameter."""
MOTIONS = {
    "inertia": "accelerations back and forth", "sliding": "constant speeds in both directions, three of them at least",
    "breakaway": "slow ramps of the torque from rest, until it moves",
    "presliding": "slow ramps of the torque back and forth, below break-away", "stickslip": "slow constant speeds",
}  # fmt: skip
"""Motion of each procedure, for a drive that runs its own program."""


def experiment_for(name: str) -> str:
    """Return the procedure that determines a parameter, such as ``axis.k[1]`` or ``fc_negative``."""
    return EXPERIMENTS.get(name.partition("[")[0].rpartition(".")[2].removesuffix("_negative"), "sliding")


def motion_for(name: str) -> str:
    """Return the motion that determines a parameter."""
    return MOTIONS[experiment_for(name)]
