"""Whether a law gives energy back although it is declared passive."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.contract.motions import Array, batch, example, name_of, nearby, seeded, swings, tried
from stickslip.contract.verdict import Verdict, failed, held, not_tried
from stickslip.core.spec import Law

CASES = 8
TRAPEZOID = 0.02
"""Share of the work that its trapezoids leave open."""


def claims_passivity(law: Law) -> bool:
    """Whether the law with its options is declared passive, perhaps under a condition on its parameters."""
    return law.passive not in ("", "never") and all(law.option(c).passive for c in law.choices)


def within_condition(law: Law, p: Any) -> Any:
    """`p` where the law's condition holds, else `p` with the largest sigma1 (by halves) or with the constant s(v) that
    meets it; None where neither does."""
    values = p._asdict()
    for _ in range(50):
        if law.dissipates(p):
            return p
        if "sigma1" not in values:
            break
        for name in ("sigma1", "sigma1_negative"):
            if name in values:
                values[name] *= 0.5
        p = law.parameters(values)
    constant: dict[str, Any] = {
        **{f"fs{end}": values[f"fc{end}"] for end in ("", "_negative") if f"fs{end}" in values},
        **{name: 0.0 for name in ("alpha1", "alpha2", "beta1", "beta2") if name in values},
    }
    if "curve_torque" in values:
        constant["curve_torque"] = [values["curve_torque"][0]] * len(values["curve_torque"])
    p = law.parameters({**values, **constant})
    return p if law.dissipates(p) else None


def gives_back(law: Law, p: Any, velocity: Array, dt: Array) -> bool:
    """Whether the work from rest along one of the motions, shapes (cases, steps), is ever negative, within what its
    trapezoids leave open."""
    torque, _ = batch(law, p, velocity, dt)
    zero = np.zeros((len(velocity), 1))
    before = np.concatenate([zero, velocity[:, :-1]], axis=1)
    earlier = np.concatenate([zero, torque[:, :-1]], axis=1)
    power = 0.25 * (torque + earlier) * (velocity + before) * dt
    room = TRAPEZOID * np.abs(power).sum(axis=1) + 1e-15
    return bool(np.any(np.cumsum(power, axis=1).min(axis=1) < -room))


def dissipation(law: Law) -> Verdict:
    """No motion gives energy back where the law is declared passive."""
    name, count = "dissipation", 0
    if not claims_passivity(law):
        return not_tried(name, f"passive = {law.passive!r} claims nothing that a motion could disprove")
    for variant in filter(claims_passivity, tried(law)):
        rng = seeded(variant, 5)
        for case in range(CASES):
            p = within_condition(variant, nearby(variant, rng) if case else example(variant))
            if p is None:
                continue
            if gives_back(variant, p, *swings(rng, 10)):
                return failed(
                    name,
                    f"{name_of(variant)}: declared passive ({law.passive}), a motion from rest gives energy back",
                )
            count += 1
    if not count:
        return not_tried(name, f"no parameters near the example meet the condition ({law.passive})")
    return held(name, f"{count} sets of parameters, 10 motions each: no energy comes back")
