"""A level axis that moves one way: without a constant torque its friction is determined, and the refusal names it."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import InputError


def staircase(seed: int = 0) -> dict[str, np.ndarray]:
    """Eight speeds one way with ramps between them; inertia 0.02 kg·m², fc 0.3 N·m, sigma2 0.05 N·m·s/rad."""
    period = 5e-3
    v = np.concatenate([
        np.concatenate([np.linspace(a, b, 40), np.full(160, b)])
        for a, b in ((0.5, 0.5), (0.5, 2.0), (2.0, 4.0), (4.0, 6.0), (6.0, 8.0), (8.0, 5.0), (5.0, 3.0), (3.0, 1.0))
    ])  # fmt: skip
    torque = 0.02 * np.gradient(v, period) + 0.3 + 0.05 * v
    noise = 5e-3 * np.random.default_rng(seed).standard_normal(v.size)
    return {"t": period * np.arange(v.size), "position": np.cumsum(v) * period, "torque": torque + noise}


def test_without_a_constant_torque_friction_is_identified() -> None:
    found = ss.identify(**staircase(), law="coulomb", frozen=["offset"], values={"offset": 0.0})
    for name, true in (("inertia", 0.02), ("fc", 0.3), ("sigma2", 0.05)):
        assert found[name].identified
        assert found[name].lower <= true <= found[name].upper
    assert dict(found.given) == {"offset": 0.0}


def test_the_refusal_names_the_way_out() -> None:
    with pytest.raises(
        InputError, match=r'fc and offset cannot be.*frozen=\["offset"\], values=\{"offset": 0\}'
    ):
        ss.identify(**staircase(), law="coulomb")


def push(period: float = 2e-3) -> dict[str, np.ndarray]:
    """A push of a second, then coasting to rest; inertia 0.01 kg·m², fc 0.05 N·m, sigma2 0.003 N·m·s/rad."""
    drive = np.where(np.arange(8000) < 700, 0.6, 0.0)
    drive[:200] = 0.0
    position, velocity = np.zeros(8000), 0.0
    for k in range(1, 8000):
        friction = 0.05 + 0.003 * velocity if velocity > 0.0 or drive[k] > 0.05 else drive[k]
        velocity = max(velocity + (drive[k] - friction) / 0.01 * period, 0.0)
        position[k] = position[k - 1] + velocity * period
    return {"t": period * np.arange(8000), "position": np.round(position, 4), "torque": drive}


def test_coasting_behind_a_push_determines_friction_of_a_level_axis() -> None:
    found = ss.identify(**push(), law="coulomb", inertia=0.01, frozen=["offset"], values={"offset": 0.0})
    for name, true in (("fc", 0.05), ("sigma2", 0.003)):
        assert found[name].identified
        assert found[name].lower <= true <= found[name].upper
