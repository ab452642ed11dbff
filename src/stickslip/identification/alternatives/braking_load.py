"""A transmission that brakes differently from how it drives, such as a worm gear: inertia and friction when braking."""

from __future__ import annotations

from stickslip.identification.alternatives.alternative import Alternative, braking

REMEDY = "record coasting to rest beside driven moves"
ALTERNATIVES = (
    Alternative(
        "inertia when braking", lambda rows: rows.see(lambda r: r.acceleration * braking(r)), "inertia",
        absent=0.001, present=(0.02, 0.2), odds=0.2, splits="inertia",
        cause="a load that brakes otherwise than it drives", remedy=REMEDY,
    ),
    Alternative(
        "friction when braking", lambda rows: rows.see(lambda r: r.sign * braking(r)),
        present=(0.02, 0.2), odds=0.2, splits="fc",
        cause="friction that differs when braking", remedy=REMEDY,
    ),
)  # fmt: skip
