"""Spectrum, repeatability, both sides, dependence on position: signals whose answers are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.analyse.dependence import dependence
from stickslip.analyse.motor_vs_sensor import sides
from stickslip.analyse.repeatability import repeatability
from stickslip.analyse.spectrum import spectrum
from stickslip.core.errors import InputError
from stickslip.core.record import Record

RATE = 1000.0


def record(seconds: float, **channels) -> Record:
    time = np.arange(round(seconds * RATE)) / RATE
    data = {k: np.asarray(f(time), dtype=float) for k, f in channels.items()}
    return Record(time, data, dict.fromkeys(data, "rad"))


def noise(size, scale=1.0, seed=1):
    return scale * np.random.default_rng(seed).standard_normal(size)


def test_a_sinusoid_in_noise_is_found_with_its_amplitude_and_named():
    run = record(
        8.0, position=lambda t: 3e-4 * np.sin(2 * math.pi * 331.3 * t) + noise(t.size, 1e-5) + 0.01 * t
    )
    found = spectrum(run, "position", modes={"elastic mode": 335.0, "encoder": 85.0})
    assert len(found.peaks) == 1
    (peak,) = found.peaks
    assert peak.frequency == pytest.approx(331.3, abs=0.3)
    assert peak.amplitude == pytest.approx(3e-4, rel=0.05)
    assert peak.mode == "elastic mode"
    assert "elastic mode" in "\n".join(found.lines())


def test_white_noise_has_its_level_and_no_peak():
    found = spectrum(record(60.0, torque=lambda t: noise(t.size, 0.1)), "torque", resolution=5.0)
    assert not found.peaks
    assert np.median(found.density[2:-2]) == pytest.approx(0.01 / (RATE / 2.0), rel=0.1)
    total = float(np.sum(found.density) * found.frequency[1])
    assert total == pytest.approx(found.rms**2, rel=0.02)


def test_a_mode_above_half_the_sample_rate_is_looked_for_where_it_folds_to():
    run = record(8.0, position=lambda t: np.sin(2 * math.pi * 870.0 * t) + noise(t.size, 0.01))
    (peak,) = spectrum(run, "position", modes={"coupling": 870.0}).peaks
    assert peak.frequency == pytest.approx(130.0, abs=0.5)
    assert peak.mode == "coupling"


def test_rows_at_events_do_not_disturb_the_spectrum():
    time = np.sort(np.concatenate([np.arange(4000) / RATE, [0.5, 0.5, 1.2345, 2.71828]]))
    run = Record(time, {"position": np.sin(2 * math.pi * 50.0 * time)}, {"position": "rad"})
    (peak,) = spectrum(run, "position").peaks
    assert peak.frequency == pytest.approx(50.0, abs=0.2)


def test_position_error_is_made_from_the_reference():
    run = record(4.0, position=lambda t: 0 * t, position_reference=lambda t: np.sin(2 * math.pi * 20.0 * t))
    assert spectrum(run).rms == pytest.approx(math.sqrt(0.5), rel=0.01)


def test_too_few_samples_and_unknown_channels_are_refused():
    with pytest.raises(InputError, match="too few"):
        spectrum(record(0.02, position=lambda t: t), "position")
    with pytest.raises(InputError, match="no channel"):
        spectrum(record(1.0, position=lambda t: t), "torque")


def test_spread_of_repeated_runs_is_what_was_put_in():
    def run(seed):
        return record(20.0, position=lambda t: np.sin(t) + noise(t.size, 0.02, seed))

    calm, rough = [run(s) for s in range(30)], [run(s) for s in range(5)]
    same = record(20.0, position=np.sin)
    found = {f.name: f for f in repeatability({"calm": calm, "rough": rough, "same": [same, same]})}
    assert found["calm"].rms_spread == pytest.approx(0.02, rel=0.02)
    assert found["rough"].rms_spread == pytest.approx(0.02, rel=0.05)
    assert found["calm"].relative == pytest.approx(0.02, rel=0.1)
    assert found["same"].rms_spread == 0.0
    assert found["same"].alikeness == pytest.approx(1.0)
    with pytest.raises(InputError, match="two"):
        repeatability({"one": [same]})


def test_runs_of_different_start_and_length_are_laid_over_each_other():
    first = record(10.0, position=np.sin)
    later = Record(first.time[:8000] + 600.0, {"position": first["position"][:8000]}, {"position": "rad"})
    (found,) = repeatability({"PID": [first, later]})
    assert found.time[-1] == pytest.approx(7.999)
    assert found.rms_spread < 1e-12


def test_runs_of_the_same_motion_count_from_their_own_start():
    runs = [
        record(
            10.0,
            position=lambda t, s=start: s + np.sin(t),
            position_reference=lambda t, s=start: s + np.sin(t),
        )
        for start in (0.0, 0.3, -0.2)
    ]
    (found,) = repeatability({"PID": runs})
    assert found.rms_spread < 1e-12
    assert found.as_dict()["range_of_starts"] == pytest.approx(0.5)


def test_bearings_between_motor_and_sensor_are_found():
    def sliding(speed, seed):
        t = np.arange(5000) / RATE
        sensor = math.copysign(0.3, speed) + 0.01 * np.sin(t * speed) + noise(t.size, 0.02, seed)
        motor = sensor + math.copysign(0.05, speed) + 0.004 * speed + noise(t.size, 0.01, seed + 99)
        channels = {"position": speed * t, "motor_torque": motor, "sensor_torque": sensor}
        return Record(t, channels, dict.fromkeys(channels, "-"))

    speeds = (-20.0, -5.0, -1.0, 1.0, 5.0, 20.0)
    found = sides({str(v): sliding(v, i) for i, v in enumerate(speeds)})
    assert found.coulomb == pytest.approx(0.05, abs=2e-3)
    assert found.viscous == pytest.approx(0.004, abs=3e-4)
    assert abs(found.offset) < 1e-3
    assert [round(p.velocity) for p in found.points] == [round(v) for v in speeds]
    one = sides({"one": sliding(5.0, 3)})
    assert (one.viscous, one.offset) == (0.0, 0.0)
    assert one.coulomb == pytest.approx(0.07, abs=2e-3)


def test_inertia_is_taken_from_the_motors_torque():
    t = np.arange(5000) / RATE
    v = 10.0 + 5.0 * np.sin(2.0 * t)
    motor = 0.3 + 0.1 * 10.0 * np.cos(2.0 * t)
    channels = {"velocity": v, "motor_torque": motor, "sensor_torque": 0.3 + 1e-3 * np.sin(t)}
    run = Record(t, channels, dict.fromkeys(channels, "-"))
    # A central difference over 0.2 s of this motion is 0.7 % short; the inertia takes 1 N·m.
    assert sides({"run": run}, inertia=0.1).residual < 7e-3
    assert sides({"run": run}).residual > 0.5


def test_a_record_without_a_sensor_is_refused():
    run = record(1.0, velocity=lambda t: 1 + 0 * t, motor_torque=np.sin, sensor_torque=lambda t: t * np.nan)
    with pytest.raises(InputError, match="sensor"):
        sides({"run": run})


def test_position_dependence_and_drift_are_told_apart():
    time = np.arange(0.0, 60.0, 1e-3)
    position = 0.5 * time  # 4.8 revolutions
    torque = (0.3 + 0.02 * np.cos(position) + 0.005 * np.sin(3.0 * position)) * (1.0 + time / 6000.0)
    run = Record(
        time, {"position": position, "motor_torque": torque}, {"position": "rad", "motor_torque": "N·m"}
    )
    found = dependence({"run": run})
    assert len(found.passes) == 4
    assert found.passes[0].harmonics()[:3] == pytest.approx([0.02, 0.0, 0.005], abs=5e-4)
    assert found.alike > 0.99
    rise = (found.passes[-1].time - found.passes[0].time) / 6000.0
    assert found.drift == pytest.approx(rise / (1.0 + 30.0 / 6000.0), rel=0.05)
    back = Record(time, {"position": -position, "motor_torque": -torque}, run.units)
    assert dependence({"back": back}).passes[0].mean == pytest.approx(found.passes[0].mean, rel=1e-3)
    assert dependence({"forth": run, "back": back}).drift == pytest.approx(found.drift, rel=1e-3)
    with pytest.raises(InputError, match="revolution"):
        dependence({"short": Record(time[:9000], {k: v[:9000] for k, v in run.channels.items()}, run.units)})
