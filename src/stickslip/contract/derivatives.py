"""Whether a law can be fitted: its torque follows every parameter smoothly."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.contract.motions import Array, batch, example
from stickslip.contract.verdict import Verdict, failed, held
from stickslip.core.errors import ParameterError
from stickslip.core.spec import Law

WIDTHS = 1e-3, 1e-4
"""Changes of a parameter over its value; both tell the same derivative where the torque is smooth."""
TYPICAL = 0.9
"""Share of the moments that count: break-aways and reversals come a little sooner or later."""
APART = 0.1


def derivatives(law: Law) -> Verdict:
    """Differences of the torque over a wide and a narrow change of each parameter tell the same derivative."""
    name, p = "derivatives", example(law)
    without: list[str] = []
    for f in law.fields:
        value = getattr(p, f.name)
        for i, x in enumerate(value if f.per_element else (value,)):
            label = f"{f.name}[{i}]" if f.per_element else f.name
            try:
                wide, narrow = (_slope(law, p, f.name, i if f.per_element else None, x, w) for w in WIDTHS)
            except ParameterError:
                continue  # at a bound, or one of shares that add up
            size = float(np.sqrt(max(np.mean(narrow**2), np.mean(wide**2))))
            apart = np.sort(np.abs(wide - narrow))[: int(TYPICAL * narrow.size)]
            if not np.all(np.isfinite(narrow)):
                return failed(name, f"the torque is not finite near {label} = {x:g}")
            if size == 0.0:
                without.append(label)
            elif float(np.sqrt(np.mean(apart**2))) > APART * size:
                return failed(name, f"the torque does not follow {label} smoothly; a fit cannot move it")
    return held(name, "the torque follows every parameter smoothly" + (
        f"; along a slow swing it does not depend on {', '.join(without)}" if without else ""
    ))  # fmt: skip


def _slope(law: Law, p: Any, name: str, i: int | None, x: float, width: float) -> Array:
    """Derivative of the torques of a slow swing with a parameter, times its value, N·m."""
    change = width * (abs(x) or 1.0)
    ends: list[Array] = []
    for sign in (1.0, -1.0):
        value: Any = getattr(p, name)
        moved = (
            x + sign * change if i is None else [v + sign * change * (j == i) for j, v in enumerate(value)]
        )
        values = {k: list(v) if isinstance(v, tuple) else v for k, v in p._asdict().items()}  # pyright: ignore
        velocity = 2e-2 * np.sin(np.linspace(0.0, 12.0, 4000))[None, :] * np.linspace(0.05, 1.0, 4000)
        dt = np.full(velocity.shape, 1e-3)
        ends.append(
            batch(law, law.parameters({**values, name: moved}), np.ascontiguousarray(velocity), dt)[0][0]
        )
    return (ends[0] - ends[1]) / (2.0 * width)
