"""The thesis's statements on its experiments (4.3.1.2, 4.3.2.2, 4.5, 5.1), judged on runs of the virtual machines."""

from __future__ import annotations

from stickslip.thesis import rig_dry as _thesis_rig_dry
from stickslip.thesis import rig_grease as _thesis_rig_grease
from stickslip.thesis.checks import Claim
from stickslip.thesis.claims import Verdict, View, judge

__all__ = ["CLAIMS", "MAIN", "WHY", "Claim", "Verdict", "View", "judge"]

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
    "LuGre feedforward is best with grease": ("grease-low-lugre", "grease-high-lugre", "grease-low-PID10-lugre"),
}  # fmt: skip
"""The main statements, by what they say together."""

_LOOSE = (
    "The 36 Hz PD itself rings at 246 Hz on the elastic train (`stickslip analyse stability`: stable up to 0.64 of "
    "that bandwidth) and shakes the contact loose: PD alone tracks, and feedforward of the whole friction goes too far."
)
_STICKS = (
    "It does not ring but sticks and jumps: the springs of the GMS law even damp the 246 Hz of the PD, and the loop is "
    "stable while less than 6 % of the contact is missing."
)
_LAG = (
    "The filter takes the ringing, not the slow cycle that its own lag brings; oscillation counts from 5 Hz."
)
_OWN = "GMS is better: the machine's contact is a GMS law with the same parameters."
_MODE = "On the sticking contact the assumed inertias and the loop ring near 250 Hz; the thesis prints no inertias."
_SLOW = "LuGre feedback, of 120 N·m/rad where the contact has 388, leaves a cycle below 20 Hz."
WHY: dict[str, str] = {
    **dict.fromkeys(
        ("dry-low-deformed", "dry-low-dynamic", "dry-low-closer", "dry-low-alike", "dry-low-PID-more",
         "dry-step-PD", "51-low"),
        _LOOSE,
    ),
    **dict.fromkeys(("dry-low-FB-gms", "dry-low-FB-gms-worst", "dry-step-FB-gms"), _STICKS),
    **dict.fromkeys(("dry-low-FB-gms10", "grease-low-FB-gms10", "grease-high-FB-gms10"), _LAG),
    **dict.fromkeys(
        ("grease-low-lugre", "grease-low-order", "grease-high-lugre", "grease-high-PID10-lugre"), _OWN
    ),
    **dict.fromkeys(("45-PD36", "45-PID25"), _MODE),
    **dict.fromkeys(("dry-high-PID10-FB-lugre", "dry-high-FB-smoother", "dry-step-PID10-FB-lugre"), _SLOW),
    "dry-high-dynamic": "Only GMS is better; LuGre's spring of 120 N·m/rad is a third of the contact's, so it lags.",
    "grease-high-PID": "Position-dependent friction, which no law here has, leaves PD an error that PID removes.",
    "grease-low-dynamic": "LuGre's error over the period is 16 % above Stribeck's; near zero velocity it is better.",
    "grease-high-PID10-FB": "Stribeck oscillates a little less than Coulomb.",
    "grease-step-order": "Steady-state errors are where the axis happens to stick: position and noise order them.",
    "grease-step-PID10-steady": "PID alone overshoots and sticks 1.2 mrad away; feedforward spares most of that.",
}  # fmt: skip
"""Why statements do not hold on the machines as they are."""
