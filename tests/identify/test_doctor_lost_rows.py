"""Rows that are lost, rows that repeat, and clocks that are written in few digits."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss

T = np.arange(0.0, 8.0, 1e-3)
Q = 0.5 * np.sin(0.5 * np.pi * T)
TORQUE = 0.3 * np.sign(np.cos(0.5 * np.pi * T)) + 0.02 * np.cos(0.5 * np.pi * T)


def test_a_position_that_moves_on_while_rows_are_lost_does_not_jump() -> None:
    kept = np.ones(T.size, dtype=bool)
    kept[3998:4002] = kept[6000:6003] = False  # of which none is a gap yet
    found = ss.doctor(t=T[kept], position=np.round(Q[kept], 5), torque=TORQUE[kept])
    assert "position-jump" not in {f.code for f in found.findings}
    jumped = Q + 0.02 * (T > 3.6)
    found = ss.doctor(t=T, position=np.round(jumped, 5), torque=TORQUE)
    assert "position-jump" in {f.code for f in found.findings}


def test_a_distance_that_differs_by_a_fifth_is_jitter_whatever_its_last_digit() -> None:
    steps = np.where(np.random.default_rng(3).random(900) < 0.3, 12, 10)
    t = np.concatenate([[0], np.cumsum(steps)]) / 1000.0
    for later in (0.0, 12.34, 777.77):
        found = ss.doctor(t=np.round(t + later, 3), position=0.5 * np.sin(t), torque=np.sign(np.cos(t)))
        codes = {f.code for f in found.findings}
        assert "jitter" in codes
        assert "irregular-sampling" not in codes


@pytest.mark.parametrize("every", [1.25, 2.0, 5.0])
@pytest.mark.parametrize("both", [True, False])
def test_rows_that_repeat_the_row_before_are_told(every: float, both: bool) -> None:
    """A position that is new in every so many rows of a log that is written faster."""
    source = np.floor(np.arange(T.size) / every) * every * 1e-3
    position = np.round(np.interp(source, T, Q), 7)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(T.size)
    torque = np.interp(source, T, TORQUE + noise) if both else TORQUE + noise
    (said,) = (
        f for f in ss.doctor(t=T, position=position, torque=torque).findings if f.code == "repeated-rows"
    )
    assert said.level == "warning"
    assert f"new once in {every:.2g} rows" in said.message
    assert said.message.endswith("as is the torque" if both else "the torque is not")


def test_an_axis_that_stops_for_some_rows_repeats_none() -> None:
    """Short steps with dwells of ten rows: it does not catch up behind them."""
    phase = np.arange(T.size) % 40
    way = np.cumsum(np.where(phase < 30, 1e-3 * np.sin(np.pi * phase / 30.0) ** 2, 0.0))
    found = ss.doctor(t=T, position=np.round(way, 6), torque=0.3 + 0.01 * np.cos(T))
    assert "repeated-rows" not in {f.code for f in found.findings}
