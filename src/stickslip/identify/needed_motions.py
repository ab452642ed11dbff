"""The procedure of a rig that determines a number, and the motion that it makes."""

from __future__ import annotations

EXPERIMENTS = {
    "inertia": "inertia", "fs": "breakaway", "sigma0": "presliding", "k": "presliding", "alpha": "presliding",
    "fc": "sliding", "vs": "sliding", "sigma2": "sliding", "delta_s": "sliding",
    "sigma1": "stickslip", "c": "stickslip",
}  # fmt: skip
"""The procedure that a rig runs for a number."""
MOTIONS = {
    "inertia": "accelerations to and fro", "sliding": "constant speeds in both directions, three of them at least",
    "breakaway": "slow ramps of the torque from rest, until it moves",
    "presliding": "slow ramps of the torque to and fro, below break-away", "stickslip": "slow constant speeds",
}  # fmt: skip
"""What it moves, for a drive that does it in a program of its own."""


def experiment_for(name: str) -> str:
    """Return the procedure that determines a number of this name, ``axis.k[1]`` or ``fc_negative`` among them."""
    return EXPERIMENTS.get(name.partition("[")[0].rpartition(".")[2].removesuffix("_negative"), "sliding")


def motion_for(name: str) -> str:
    """Return the motion that determines a number of this name."""
    return MOTIONS[experiment_for(name)]
