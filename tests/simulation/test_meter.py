"""Metrics of signals whose metrics are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.models.model import Reference
from stickslip.simulation._meter import HIGH_PASS, close_standstill, meter, new_meter, turning_points
from stickslip.simulation.metrics import limit_cycle, metrics, settle_band_of


def measured(duration, x, v, xd=None, vd=None, tm=None, band=0.0, h=1e-3):
    """Meter a motion given by functions of time, in segments of h."""
    acc, turns = new_meter(duration, band), np.empty((4096, 2))
    zero = lambda t: np.zeros_like(t)  # noqa: E731
    xd, vd, tm = xd or zero, vd or zero, tm or zero
    for i in range(round(duration / h)):
        t = i * h + 0.25 * h * np.arange(5)
        nodes = np.array([xd(t) - x(t), vd(t) - v(t), x(t), v(t), vd(t), tm(t), tm(t), zero(t)])
        meter(acc, turns, i * h, h, nodes)
    close_standstill(acc, duration)
    count = int(metrics(acc, turns[:0])["reversals_per_s"] * duration + 0.5)
    return metrics(acc, turns[:count]), turns[:count]


def test_sine():
    """RMS, peaks, steady state and reversals of A sin(w t), against a reference at rest."""
    amplitude, w = 0.01, 2 * math.pi * 10.0
    found, turns = measured(
        2.0,
        lambda t: amplitude * np.sin(w * t),
        lambda t: amplitude * w * np.cos(w * t),
        tm=lambda t: 3.0 * np.cos(w * t),
    )
    assert found["position_rms_rad"] == pytest.approx(amplitude / math.sqrt(2), rel=1e-7)
    assert found["position_peak_rad"] == pytest.approx(amplitude, rel=1e-7)
    assert found["velocity_rms_rad_s"] == pytest.approx(amplitude * w / math.sqrt(2), rel=1e-7)
    assert found["velocity_peak_rad_s"] == pytest.approx(amplitude * w, rel=1e-6)
    assert found["torque_rms_Nm"] == pytest.approx(3.0 / math.sqrt(2), rel=1e-7)
    assert found["steady_state_error_rad"] == pytest.approx(0.0, abs=1e-12)
    assert found["reversals_per_s"] == pytest.approx(20.0)
    assert found["limit_cycle_amplitude_rad"] == pytest.approx(amplitude, rel=1e-3)
    assert found["limit_cycle_period_s"] == pytest.approx(0.1, rel=1e-3)
    assert np.abs(turns[:, 1]) == pytest.approx(amplitude, rel=1e-3)


@pytest.mark.parametrize("frequency", [5.0, 50.0, 400.0])
def test_high_pass_of_a_sine(frequency):
    """Steady amplitude of s/(s + w0); the filter's start from rest is the analytic transient."""
    w, duration = 2 * math.pi * frequency, 2.0
    found, _ = measured(
        duration, lambda t: np.sin(w * t) / w, lambda t: np.cos(w * t), h=min(1e-3, 0.05 / frequency)
    )
    ratio = w / math.hypot(w, HIGH_PASS)
    phase = math.atan2(HIGH_PASS, w)
    t = np.linspace(0.0, duration, 4_000_001)
    # v - y for y(0) = 0: the steady response and a decay that makes it start at v(0).
    passed = ratio * np.cos(w * t + phase) + (1.0 - ratio * math.cos(phase)) * np.exp(-HIGH_PASS * t)
    assert found["velocity_above_50Hz_rms_rad_s"] == pytest.approx(
        math.sqrt(np.trapezoid(passed**2, t) / duration), rel=1e-5
    )


def test_noise_below_the_trigger_is_no_reversal():
    found, _ = measured(1.0, lambda t: t * 0.0, lambda t: 0.9e-3 * np.sin(200 * t))
    assert found["reversals_per_s"] == 0.0


def test_standstills_count_from_ten_milliseconds():
    """Stops of 9 ms do not count, of 30 ms do, and only while the reference moves."""
    stops = ((0.1, 0.109), (0.3, 0.33), (0.5, 0.62))

    def v(t):
        still = np.zeros(t.shape, bool)
        for start, end in stops:
            still |= (t >= start) & (t < end)
        return np.where(still, 0.0, 0.1)

    moving, _ = measured(1.0, lambda t: t, v, vd=lambda t: np.full_like(t, 0.1))
    assert moving["standstills"] == 2
    assert moving["longest_standstill_s"] == pytest.approx(0.12, abs=1e-3)
    resting, _ = measured(1.0, lambda t: t, v)
    assert resting["standstills"] == 0


def test_settling_is_the_entry_for_good():
    """e = exp(-5 t): enters 2 % at ln(50)/5; never if it leaves again."""
    band = 0.02
    found, _ = measured(
        2.0, lambda t: 1 - np.exp(-5 * t), lambda t: 5 * np.exp(-5 * t), xd=np.ones_like, band=band
    )
    assert found["settling_s"] == pytest.approx(math.log(50) / 5, abs=1e-4)
    never, _ = measured(2.0, lambda t: 1 - np.exp(-t), lambda t: np.exp(-t), xd=np.ones_like, band=band)
    assert math.isnan(never["settling_s"])


def test_settle_band_only_where_the_reference_comes_to_rest():
    assert settle_band_of(Reference("step", amplitude=0.01, tau=0.02), 3.0) == pytest.approx(2e-4)
    assert settle_band_of(Reference("step", amplitude=0.01), 3.0) == pytest.approx(2e-4)
    assert settle_band_of(Reference("sine", amplitude=0.01, frequency=0.4), 5.0) == 0.0


def cycle(periods, period=0.1, swing=1e-3, wobble=0.0, end=2.0):
    rng = np.random.default_rng(1)
    t = end - period * 0.5 * np.arange(2 * periods + 1)[::-1]
    size = swing * (1 + wobble * rng.standard_normal(t.size))
    return np.column_stack([t, 0.5 * size * (-1.0) ** np.arange(t.size)])


def test_limit_cycle_needs_five_even_periods():
    amplitude, period = limit_cycle(cycle(6), 2.0)
    assert amplitude == pytest.approx(5e-4)
    assert period == pytest.approx(0.1)
    assert math.isnan(limit_cycle(cycle(4), 2.0)[0])
    assert math.isnan(limit_cycle(cycle(6, wobble=0.2), 2.0)[0])


@pytest.mark.parametrize("rings", [1, 2, 7])
@pytest.mark.parametrize("wobble", [0.01, 0.2])
def test_small_turns_at_the_ends_of_swings_neither_hide_a_limit_cycle_nor_make_one(rings, wobble):
    """As of a contact that springs back where the axis stops."""
    plain = cycle(6, wobble=wobble)
    ringing = []
    for t, x in plain.tolist():
        for i in range(2 * rings + 1):
            ringing.append((t + 1e-3 * i, x * (1.0 - 0.05 * (i % 2) - 0.002 * i)))
    assert limit_cycle(np.array(ringing), 2.0) == pytest.approx(limit_cycle(plain, 2.0), nan_ok=True)


def test_turns_without_a_swing_of_their_own_are_no_limit_cycle():
    still = np.column_stack([np.linspace(1.3, 2.0, 40), np.full(40, 0.1)])
    assert math.isnan(limit_cycle(still, 2.0)[0])


def test_a_limit_cycle_that_turns_oftener_than_is_remembered_is_found():
    """Its turns filled the room before the last 40 % of the run, where a limit cycle is looked for."""
    w, duration = 2.0 * math.pi * 200.0, 3.0
    acc, turns = new_meter(duration, 0.0), np.empty((600, 2))
    for i in range(round(duration / 1e-3)):
        t = 1e-3 * i + 0.25e-3 * np.arange(5)
        nodes = np.zeros((8, 5))
        nodes[2], nodes[3] = 1e-3 * np.sin(w * t), 1e-3 * w * np.cos(w * t)
        meter(acc, turns, 1e-3 * i, 1e-3, nodes)
    found = metrics(acc, turning_points(acc, turns))
    assert found["limit_cycle_period_s"] == pytest.approx(0.005, rel=1e-3)
    assert found["limit_cycle_amplitude_rad"] == pytest.approx(1e-3, rel=0.02)
