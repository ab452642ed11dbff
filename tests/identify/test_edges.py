"""What an encoder says of the velocity."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip.identification.observer.encoder_edges import REST, seen_velocity

DT = 1e-3


def counted(position: np.ndarray, count: float) -> np.ndarray:
    return count * np.floor(position / count + 0.5)


@given(
    speed=st.floats(0.02, 50.0), count=st.sampled_from([6e-6, 1e-4, 4e-4]), sign=st.sampled_from([-1.0, 1.0])
)
def test_an_even_motion_is_seen_as_even(speed: float, count: float, sign: float) -> None:
    time = DT * np.arange(2000)
    seen = seen_velocity(time, counted(sign * speed * time, count), count)
    inside = slice(200, -200)
    # Two samples or counts apart, an edge is known to half a sample: a quarter of the velocity, or better.
    assert np.max(np.abs(seen.velocity[inside] - sign * speed)) < 0.51 * speed
    assert np.mean(seen.velocity[inside]) == pytest.approx(sign * speed, rel=0.02)
    assert np.all(seen.doubt[inside] <= count / REST)


def test_a_rest_is_known_to_one_count_and_a_start_is_not_known() -> None:
    count = 1e-4
    time = DT * np.arange(1000)
    position = np.where(time < 0.2, time, np.where(time < 0.8, 0.2, 0.2 + 5.0 * (time - 0.8)))
    seen = seen_velocity(time, counted(position, count), count)
    assert np.all(seen.doubt[250:750] == pytest.approx(count / 0.6, rel=0.02))
    assert np.max(np.abs(seen.velocity[250:750])) < 2.0 * count / 0.6
    assert np.all(seen.doubt[50:150] == 0.0)
    assert np.isinf(np.max(seen.doubt[795:806]))


def test_an_exact_position_leaves_no_doubt() -> None:
    time = DT * np.arange(500)
    seen = seen_velocity(time, np.sin(time), 0.0)
    assert np.all(seen.doubt == 0.0)
    assert seen.velocity[:-1] == pytest.approx(np.cos(time[:-1] + 0.5 * DT), abs=1e-6)
