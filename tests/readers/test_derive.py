"""Derived signals: exact where they must be, without phase, named."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip import Record
from stickslip.core.errors import InputError
from stickslip.core.messages import render
from stickslip.readers import Drive, read
from stickslip.readers.derive import METHODS, with_position, with_resampled_time, with_velocity

T = np.arange(0.0, 2.0, 1e-3)


def record(position: np.ndarray, time: np.ndarray = T) -> Record:
    return Record(time, {"position": position}, {"position": "rad"})


@pytest.mark.parametrize("method", METHODS)
def test_slow_motion_passes_without_phase(method):
    found = with_velocity(record(np.sin(6.0 * T)), method, cutoff=60.0)
    np.testing.assert_allclose(found["velocity"][100:-100], 6.0 * np.cos(6.0 * T)[100:-100], atol=2e-4)
    assert found.units["velocity"] == "rad/s"
    assert "60 Hz" in found.meta["derived"]["velocity"]


@pytest.mark.parametrize("method", METHODS)
def test_the_cutoff_is_where_it_is_said_to_be(method):
    w = 2 * np.pi * 50.0
    found = with_velocity(record(np.sin(w * T)), method, cutoff=50.0)["velocity"][500:1500]
    gain = np.sqrt(2.0 * np.mean(found**2)) / w
    # Butterworth is exact but for the central difference; a window is the shortest that damps at least so much.
    low = 0.97 if method == "butterworth" else 0.85
    assert low * np.sqrt(0.5) < gain < 1.005 * np.sqrt(0.5)


def test_resampling_keeps_straight_lines():
    time = np.cumsum(np.random.default_rng(1).uniform(0.5e-3, 1.5e-3, 500))
    even = with_resampled_time(record(3.0 * time, time))
    np.testing.assert_allclose(even["position"], 3.0 * even.time, rtol=1e-12)
    assert np.ptp(np.diff(even.time)) < 1e-12
    with pytest.raises(InputError, match="with_resampled_time"):
        with_velocity(record(3.0 * time, time))


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: with_velocity(record(T), "kalman"), "unknown method"),
        (lambda: with_velocity(record(T), cutoff=600.0), "half the sampling frequency"),
        (lambda: with_velocity(record(T), cutoff=-1.0), "cutoff = -1"),
        (lambda: with_velocity(record(T[:5], T[:5])), "at least 16"),
        (lambda: with_velocity(record(np.full(T.size, np.nan))), "missing values"),
        (lambda: with_resampled_time(record(T, -T)), "do not ascend"),
    ],
)
def test_bad_arguments(call, said):
    with pytest.raises(InputError, match=said):
        call()


# ---- conversions at the border ------------------------------------------------------------------------------


def log(tmp_path, text):
    (tmp_path / "log.csv").write_text(text)
    return tmp_path / "log.csv"


def test_drive_numbers(tmp_path):
    path = log(
        tmp_path,
        "time [ms],pos [counts],speed [rpm],torque [permille],I [mA]\n0,0,60,500,100\n1,1024,-60,-1000,200\n",
    )
    found = read(path, drive=Drive(counts_per_rev=4096, rated_torque=1.5))
    np.testing.assert_allclose(found.time, [0.0, 1e-3])
    np.testing.assert_allclose(found["position"], [0.0, np.pi / 2])
    np.testing.assert_allclose(found["velocity"], [2 * np.pi, -2 * np.pi])
    np.testing.assert_allclose(found["motor_torque"], [0.75, -1.5])
    np.testing.assert_allclose(found["current"], [0.1, 0.2])
    from_current = read(path, ["torque=none"], drive=Drive(counts_per_rev=4096, torque_constant=0.05))
    assert "motor_torque" not in from_current.meta["reading"]["columns"]
    np.testing.assert_allclose(from_current["motor_torque"], [0.005, 0.01])
    assert "torque constant 0.05" in from_current.meta["derived"]["motor_torque"]


def test_both_sides_of_a_gear(tmp_path):
    path = log(tmp_path, "time [s],q_arm [rad],torque [Nm]\n0,0,1\n1,0.5,2\n")
    motor = read(path, ["position=q_arm [rad]:rad@load"], drive=Drive(gear_ratio=50.0))
    np.testing.assert_allclose(motor["position"], [0.0, 25.0])
    np.testing.assert_allclose(motor["motor_torque"], [1.0, 2.0])
    load = read(path, ["position=q_arm [rad]:rad@load"], drive=Drive(gear_ratio=50.0, side="load"))
    np.testing.assert_allclose(load["position"], [0.0, 0.5])
    np.testing.assert_allclose(load["motor_torque"], [50.0, 100.0])
    with pytest.raises(InputError, match="gear_ratio"):
        read(path, ["position=q_arm [rad]:rad@load"])
    idle = read(log(tmp_path, "time [s],q [rad],torque [Nm]\n0,0,1\n1,0.5,2\n"), drive=Drive(gear_ratio=50.0))
    (said,) = [f for f in idle.meta["reading"]["findings"] if f["code"] == "gear-ratio"]
    assert said["level"] == "note"
    assert "converts nothing" in said["message"]
    assert 'side="load"' in render(said["remedy"])
    for moved in (motor, load):
        assert "gear-ratio" not in {f["code"] for f in moved.meta["reading"]["findings"]}


def test_a_position_is_the_integral_of_the_velocity():
    time = np.cumsum(np.random.default_rng(1).uniform(0.5e-3, 1.5e-3, 2000))
    moving = Record(time, {"velocity": 3.0 * np.cos(2.0 * time)}, {"velocity": "rad/s"})
    found = with_position(moving)
    exact = 1.5 * (np.sin(2.0 * time) - np.sin(2.0 * time[0]))
    np.testing.assert_allclose(found["position"], exact, atol=1e-5)
    assert found.units["position"] == "rad"
    assert "integral" in found.meta["derived"]["position"]
    moving.channels["velocity"][3] = np.nan
    with pytest.raises(InputError, match="missing values"):
        with_position(moving)
    with pytest.raises(InputError, match="neither a position nor a velocity"):
        with_position(Record(time, {"torque": time}, {"torque": "N·m"}))
