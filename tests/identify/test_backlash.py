"""Play between motor and load is found where it is, and nowhere else."""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stickslip.identify.doctor import examine
from stickslip.identify.doctor._view import View
from stickslip.identify.doctor.play import backlash
from stickslip.record import Record

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("STICKSLIP_DATA", ROOT / "../shared/data"))
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
    assert len(found) >= 4
    # The load coasts on when the motor turns round: the travel is the gap or less.
    assert all(0.4 < ratio < 1.3 for ratio in found.values()), found


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


# ---- real machines, none of which has play at the motor's side -------------------------------------------------------


@pytest.mark.skipif(not (DATA / "emps").is_dir(), reason="no EMPS record")
def test_the_emps_axis_has_none():
    from scipy.io import loadmat

    data: Any = loadmat(DATA / "emps" / "DATA_EMPS.mat")
    t, q, u = (np.ascontiguousarray(data[k].ravel(), dtype=float) for k in ("t", "qm", "vir"))
    torque = float(data["gtau"].item()) * u
    assert said(t, q, torque, {"position": "m", "motor_torque": "N"}) == []


@pytest.mark.skipif(not (DATA / "screw_drives").is_dir(), reason="no screw drives")
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


@pytest.mark.skipif(not (DATA / "kuka_kr300").is_dir(), reason="no KR300 records")
def test_a_robots_axes_have_none():
    for letter in "AB":
        table = np.genfromtxt(DATA / "kuka_kr300" / f"record_{letter}.csv.gz", delimiter=",", names=True)
        for j in range(1, 7):
            assert said(table["t_s"], table[f"q{j}_rad"], table[f"tau{j}_motor_Nm"]) == []
