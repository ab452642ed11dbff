"""The thesis's statements on its experiments (4.3.1.2, 4.3.2.2, 4.5, 5.1), judged on runs of the virtual machines."""

from __future__ import annotations

from stickslip.thesis import rig_dry as _thesis_rig_dry
from stickslip.thesis import rig_grease as _thesis_rig_grease
from stickslip.thesis.checks import Claim
from stickslip.thesis.claims import Verdict, View, judge

__all__ = ["CLAIMS", "MAIN", "Claim", "Verdict", "View", "judge"]

CLAIMS: tuple[Claim, ...] = (*_thesis_rig_dry.CLAIMS, *_thesis_rig_grease.CLAIMS)
MAIN: dict[str, tuple[str, ...]] = {
    "feedforward: dynamic laws beat static ones near zero velocity": (
        "dry-low-dynamic", "dry-high-dynamic", "grease-low-near", "grease-high-dynamic",
    ),
    "PID of 36 Hz oscillates": ("dry-low-PID", "dry-step-PID"),
    "feedback compensation oscillates": (
        "dry-low-FB-oscillates", "grease-low-FB-oscillates", "51-feedback", "51-rather",
    ),
    "GMS feedback is unstable": ("dry-low-FB-gms", "grease-low-FB-gms"),
    "and calmed by the 10 Hz filter": ("dry-low-FB-gms10", "grease-low-FB-gms10"),
    "stick-slip at non-zero velocity as well": (
        "dry-high-FF-nonzero", "dry-high-FB-nonzero", "dry-high-PID-nonzero", "grease-high-FF-nonzero",
    ),
    "LuGre feedforward is best with grease": ("grease-low-lugre", "grease-high-lugre", "grease-low-PID10-lugre"),
}  # fmt: skip
"""The main statements, by what they say together."""
