"""A spike of one sample among a million is drawn at its height, whatever part of the record is seen, however wide."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stickslip.core.record import Record
from stickslip.web.views import lay_out, plane, samples

ROWS = 1_000_000
PLACES = (0, 1, 63, 64, 511, 4095, 4096, 123_457, 499_999, 500_000, 999_935, 999_998, 999_999)


@pytest.fixture(scope="module")
def noisy() -> tuple[Record, np.ndarray[Any, Any]]:
    """A million samples of noise, and their times."""
    t = np.arange(ROWS) * 1e-3
    noise = np.random.default_rng(7).uniform(-1.0, 1.0, ROWS)
    return Record(t, {"motor_torque": noise}, {"motor_torque": "N*m"}, {}), t


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("height", [50.0, -50.0])
def test_a_spike_is_seen_at_every_zoom(
    noisy: tuple[Record, np.ndarray[Any, Any]], tmp_path: Path, place: int, height: float
) -> None:
    """From the whole record down to some samples, for windows from a telephone's width to the widest."""
    record, t = noisy
    values = record["motor_torque"].copy()
    values[place] = height
    about = lay_out(Record(t, {"motor_torque": values}, dict(record.units), {}), tmp_path / "view")
    for bins in (160, 1210, 4000):
        for share in (1.0, 0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5):
            for left in (0.0, 0.3, 1.0):  # where in the window the spike lies
                width = share * t[-1]
                start = t[place] - left * width
                data = np.frombuffer(
                    samples(tmp_path / "view", about, [0], start, start + width, bins), "<f8"
                )
                points = int(data[0])
                x, low, high = data[4 : 4 + 3 * points].reshape(3, points)
                assert points <= 2 * bins + 2
                seen = (high if height > 0 else low) == height
                assert seen.sum() == 1, (bins, share, left)
                step = np.diff(x).max() if points > 1 else 0.0
                assert x[seen][0] <= t[place] + 1e-9  # the block begins at or before it,
                assert t[place] < x[seen][0] + step + 1e-3  # and it lies in the block


def test_a_spike_is_seen_in_the_plane() -> None:
    """Torque against velocity, too: no cell with a sample is left out."""
    rng = np.random.default_rng(3)
    velocity, torque = rng.normal(size=ROWS), rng.normal(size=ROWS)
    torque[765_432] = 40.0
    cells = plane(velocity, torque)
    assert max(cells["y"]) == 40.0
    assert len(cells["x"]) < 43_201
