"""A velocity column that is late against its position: told from one that is only differenced."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, lfilter

from stickslip.core.record import Record
from stickslip.identification.doctor.velocity import velocity_late, velocity_scale
from stickslip.identification.doctor.view import View

RATE = 1000.0
T = np.arange(8000) / RATE
STEP = 2.0 * np.pi / 2**17


def position(frequency=0.7, late=0.0):
    """From rest, so that a filter starts without a transient, rad."""
    w, t = 2.0 * np.pi * np.array([frequency, 3.1]), np.maximum(T - late, 0.0)
    return 0.5 * (1.0 - np.cos(w[0] * t)) + 0.1 * (1.0 - np.cos(w[1] * t))


def told(q, v):
    units = {"position": "rad", "velocity": "rad/s", "motor_torque": "N·m"}
    return [
        f.message
        for f in velocity_late(View(Record(T, {"position": q, "velocity": v, "motor_torque": v}, units)))
    ]


@pytest.mark.parametrize("kind", ["exact", "backward", "central", "noisy", "another unit"])
def test_a_velocity_that_is_differenced_draws_no_word(kind):
    q = np.round(position() / STEP) * STEP
    v = {
        "exact": np.gradient(position(), T), "backward": np.diff(q, prepend=q[0]) * RATE, "central": np.gradient(q, T),
        "noisy": np.gradient(q, T) + np.random.default_rng(1).normal(0.0, 0.05, T.size),
        "another unit": 57.3 * np.gradient(q, T),
    }[kind]  # fmt: skip
    assert told(q, v) == []


@given(corner=st.floats(8.0, 80.0), frequency=st.floats(0.3, 1.5), sign=st.sampled_from([1.0, -1.0]))
@settings(max_examples=15, deadline=None)
def test_a_filter_is_told_by_its_delay(corner, frequency, sign):
    q = np.round(position(frequency) / STEP) * STEP
    v = sign * lfilter(*butter(1, corner, fs=RATE), np.gradient(q, T))
    (message,) = told(q, v)
    # At frequencies well below its corner a filter of first order delays by 1/(2 pi corner).
    said = float(message.split(" ms")[0].split()[-1]) * 1e-3
    assert said == pytest.approx(1.0 / (2.0 * np.pi * corner), rel=0.15)
    assert message.startswith("velocity lags the derivative of position")


@pytest.mark.parametrize("rows", [-20, -3, 3, 40])
def test_rows_of_another_cycle_are_counted(rows):
    (message,) = told(position(), np.gradient(position(late=rows / RATE), T))
    assert f"({abs(rows):g} rows)" in message
    assert message.startswith("velocity lags" if rows > 0 else "velocity leads")


UNITS = {"position": "rad", "velocity": "rad/s", "motor_torque": "N·m"}


def findings(q, v, rows=slice(None)):
    """Codes of what both checks say of some rows."""
    view = View(Record(T[rows], {"position": q[rows], "velocity": v[rows], "motor_torque": v[rows]}, UNITS))
    return [f.code for check in (velocity_scale, velocity_late) for f in check(view)]


@pytest.mark.parametrize("last", [40, 50, 100, 200])
def test_the_start_of_a_motion_does_not_tell_a_wrong_unit(last):
    """Another program's log: ten counts at the begin, then a standstill, "velocity is 0.7454 times the change of
    position per second" and "lags by 4.39 ms"."""
    way = -10.0 * (1.0 - np.exp(-((T / 0.006) ** 2))) - 300.0 * np.maximum(T - 0.25, 0.0) ** 2
    q = np.round(way) * 1.9e-4
    assert findings(q, np.diff(q, prepend=q[0]) * RATE, slice(0, last)) == []


@pytest.mark.parametrize("factor", [1.0, 30.0 / np.pi, 3.7, 0.6])
def test_a_filter_and_a_delay_are_no_other_unit_but_do_not_hide_one(factor):
    """Motion at 1.2 and 3.1 Hz, of which a low-pass of 1.5 Hz takes a fifth and a half."""
    q = position(1.2)
    slow = lfilter(*butter(1, 1.5, fs=RATE), np.gradient(q, T))
    late = np.gradient(position(1.2, late=0.05), T)
    for v in (slow, late):
        codes = {c for c in findings(q, factor * v) if c != "velocity-late"}
        assert codes == (
            set() if factor == 1.0 else {"velocity-unit" if factor > 9.0 else "velocity-mismatch"}
        )
