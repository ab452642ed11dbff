"""Two methods that contradict each other: the interval holds both, and beyond a fifth nothing is identified."""

from __future__ import annotations

import math

import pytest

from stickslip.identify.axis.agreed import held_together
from stickslip.identify.estimate import Estimate
from stickslip.identify.fit.parameter_vector import Parameter
from stickslip.spec import Par

INERTIA = Parameter("inertia", Par("kg·m²", "J", "inertia", lower=0.0), 0.4)


def estimate(value: float, half: float) -> Estimate:
    return Estimate("inertia", "kg·m²", "inertia", value, 0.5 * half, value - half, value + half, True)


@pytest.mark.parametrize(
    ("plain", "identified"), [(0.41, True), (0.36, True), (0.32, False), (0.2846, False), (0.6, False)]
)
def test_beyond_a_fifth_nothing_decides(plain: float, identified: bool) -> None:
    """A record with cogging of 0.8 of its friction called an inertia 84 % too large identified."""
    own = estimate(0.4129, 0.02)
    found, said = held_together(own, (plain, 0.005), INERTIA, math.nan)
    assert found.identified is identified
    assert found.lower <= plain <= found.upper
    apart = abs(plain - own.value) > 0.021
    assert bool(said) is apart
    if not identified:
        assert f"says {plain:.4g} kg·m² instead" in found.verdict
