"""Play between motor and load is found where it is, and nowhere else."""

from __future__ import annotations

import importlib.util
import math
import sys
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.record import Record
from stickslip.identification.doctor import examine
from stickslip.identification.doctor.play import backlash, dead_travel
from stickslip.identification.doctor.view import View
from stickslip.models.model import Model
from stickslip.simulation.recorded_input.simulation import Drive, Mechanics, drive_axis
from support.places import DATA, ROOT, needs_data

UNITS = {"position": "rad", "motor_torque": "N·m"}


@pytest.fixture(scope="module")
def logs() -> Any:
    """The fleet of ordinary logs: two inertias with a gap between, driven by a drive's loop."""
    spec = importlib.util.spec_from_file_location("ordinary_logs", ROOT / "benchmarks" / "ordinary_logs.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["ordinary_logs"] = module
    spec.loader.exec_module(module)
    return module


def said(time, position, torque, units=UNITS):
    record = Record(np.asarray(time, dtype=float), {"position": position, "motor_torque": torque}, units)
    return list(backlash(View(record)))


def of(log):
    return said(log.time, log.position, log.torque)


def test_a_gap_is_found_on_a_sine_and_measured(logs):
    found = {}
    for seed in range(100, 108):
        log = logs.draw(seed, "commanded", 1000, "p-pi", "sine", "backlash")
        for finding in of(log):
            assert finding.code == "backlash"
            width = float(finding.message.split("about ")[1].split()[0])
            found[seed] = width / log.machine.axis[4]
    assert len(found) >= 6
    # A gap as small as what the drivetrain winds up by is found a quarter too wide.
    assert all(0.9 < ratio < 1.3 for ratio in found.values()), found


@pytest.mark.parametrize("rate", [2500, 5000])
def test_a_gap_is_found_in_a_fast_log_as_in_one_of_1_khz(logs, rate):
    """Teeth meet in a millisecond, which is no two rows there: 1 and 0 of 8 were found."""
    held = 0
    for seed in range(100, 108):
        log = logs.draw(seed, "held", rate, "p-pi", "sine", "backlash")
        channels = {"position": log.position, "motor_torque": log.torque}
        if (found := dead_travel(View(Record(log.time, channels, UNITS)))) is not None:
            assert found.lower <= log.machine.axis[4] <= found.upper
            held += 1
        for imperfection in ("clean", "flexible"):
            assert of(logs.draw(seed, "held", rate, "p-pi", "sine", imperfection)) == []
    assert held >= 5


@pytest.mark.parametrize("imperfection", ["clean", "flexible", "cogging", "asymmetry"])
def test_without_a_gap_none_is_found(logs, imperfection):
    for seed in range(100, 108):
        for moves in ("sine", "production"):
            assert of(logs.draw(seed, "commanded", 1000, "p-pi", moves, imperfection)) == []


def test_the_doctor_says_so(logs):
    log = next(
        one
        for one in (
            logs.draw(seed, "commanded", 1000, "p-pi", "sine", "backlash") for seed in range(100, 108)
        )
        if of(one)
    )
    record = Record(log.time, {"position": log.position, "motor_torque": log.torque}, UNITS)
    (finding,) = (f for f in examine(record).findings if f.code == "backlash")
    assert finding.level == "warning"
    assert "play" in finding.remedy


# ---- two inertias with a gap, in plain steps -------------------------------------------------------------------------


def two_inertias(gap, coast=0.0, share=0.5, seconds=9.0):
    """A motor and a load with a gap between, Coulomb friction at both, held on a sine by a P-PI loop at 1 kHz.

    The teeth are a stiff, damped spring. `coast`: of the load's friction, taken off. Rows of time, angle, torque.
    """
    motor, load, friction, h = 4e-4, 3e-4, 0.08, 2.5e-5
    at_motor, at_load = (1.0 - share) * friction, share * friction * (1.0 - coast)
    stiffness, damping = 900.0, 0.25
    q = v = ql = vl = summed = 0.0
    rows = []
    for k in range(round(seconds / 1e-3)):
        t = 1e-3 * k
        reference, rate = 2.0 * math.sin(1.9 * t), 3.8 * math.cos(1.9 * t)
        seen = math.floor(q / 2e-5) * 2e-5
        slip = rate + 20.0 * (reference - seen) - v
        summed = min(max(summed + 2.0 * slip * 1e-3, -0.5), 0.5)
        torque = min(max(0.06 * slip + summed, -0.5), 0.5)
        rows.append((t, seen, torque))
        for _ in range(40):
            twist = q - ql
            depth = twist - math.copysign(min(abs(twist), 0.5 * gap), twist)
            teeth = stiffness * depth + (damping * (v - vl) if depth else 0.0)
            if teeth * depth < 0.0:
                teeth = 0.0
            v = slid(v, (torque - teeth) / motor, at_motor / motor, h)
            vl = slid(vl, teeth / load, at_load / load, h)
            q += h * v
            ql += h * vl
    return np.array(rows).T


def slid(v, push, drag, h):
    """Velocity after a step with Coulomb friction: it stops, and stays, where friction is the larger."""
    free = v + h * push
    return free - math.copysign(min(abs(free), h * drag), free)


@pytest.mark.parametrize("gap", [0.006, 0.02])
def test_the_gap_of_two_inertias_lies_in_the_interval(gap):
    found = travel_of(*two_inertias(gap))
    assert found is not None
    assert found.lower < gap < found.upper
    assert found.value == pytest.approx(gap, rel=0.1)
    assert found.reversals >= 3


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_two_inertias_without_a_gap_show_none(share):
    assert travel_of(*two_inertias(0.0, share=share)) is None


def travel_of(time, position, torque):
    return dead_travel(View(Record(time, {"position": position, "motor_torque": torque}, UNITS)))


def test_identify_says_the_doctors_number():
    time, position, torque = two_inertias(0.02)
    found = ss.identify(t=time, position=position, torque=torque, method="axis", law="coulomb")
    (own,) = (e for e in found.identification.estimates if e.name == "dead_travel")
    doctor = travel_of(time, position, torque)
    assert (own.value, own.lower, own.upper) == (doctor.value, doctor.lower, doctor.upper)
    assert own.identified
    assert own.unit == "rad"
    assert any(note.startswith("Backlash: at ") for note in found.identification.notes)
    count = len(found.identification.estimates)
    assert found.identification.correlation.shape == (count, count)


def test_identify_with_a_map_says_it_too(logs):
    log = logs.draw(7013, "commanded", 1000, "p-pi", "production", "backlash", duration=20.0)
    for more in ({}, {"position_map": True}):
        found = ss.identify(
            t=log.time, position=log.position, torque=log.torque, method="axis", law="coulomb", **more
        )
        (own,) = (e for e in found.identification.estimates if e.name == "dead_travel")
        assert own.lower < log.machine.axis[4] < own.upper


def test_play_behind_which_the_encoder_sits_shows_no_travel_of_the_motor():
    """The virtual axis measures behind its play: nothing of it is seen, and nothing is said."""
    time = 1e-3 * np.arange(9000)
    torque = 0.3 * np.sin(1.9 * time)
    seen = drive_axis(
        Mechanics(4e-4, backlash=0.02),
        Model("coulomb", fc=0.08, sigma2=0.02),
        Drive(time, torque, "held"),
    )
    assert travel_of(time, seen[:, 0], torque) is None
    found = ss.identify(t=time, position=seen[:, 0], torque=torque, method="axis", law="coulomb")
    assert all(e.name != "dead_travel" for e in found.identification.estimates)


# ---- real machines, none of which has play at the motor's side -------------------------------------------------------


@needs_data("emps")
def test_the_emps_axis_has_none():
    from scipy.io import loadmat

    data: Any = loadmat(DATA / "emps" / "DATA_EMPS.mat")
    t, q, u = (np.ascontiguousarray(data[k].ravel(), dtype=float) for k in ("t", "qm", "vir"))
    torque = float(data["gtau"].item()) * u
    assert said(t, q, torque, {"position": "m", "motor_torque": "N"}) == []


@needs_data("screw_drives")
def test_the_screw_drives_have_none_that_shows():
    table = np.genfromtxt(
        DATA / "screw_drives" / "screw_drives.csv.gz", delimiter=",", names=True, dtype=None, encoding="utf-8"
    )
    tried = 0
    for drive in (1, 2, 3):
        for name in sorted(set(table["record"][table["drive"] == drive])):
            rows = (table["drive"] == drive) & (table["record"] == name)
            if not name.startswith("start_stop"):
                continue
            t, speed = table["t_s"][rows], table["speed_rpm"][rows] * 2.0 * np.pi / 60.0
            way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])
            assert said(t, way, 9.84e-5 * table["torque_pct"][rows]) == []
            tried += 1
    assert tried >= 3


@needs_data("kuka_kr300")
def test_a_robots_axes_have_none():
    for letter in "AB":
        table = np.genfromtxt(DATA / "kuka_kr300" / f"record_{letter}.csv.gz", delimiter=",", names=True)
        for j in range(1, 7):
            assert said(table["t_s"], table[f"q{j}_rad"], table[f"tau{j}_motor_Nm"]) == []
