"""The EMPS record: the published inverse dynamics, and the simulated closed loop (Janot, Gautier, Brunot 2019)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stickslip.identification.experiment import Experiment
from stickslip.identification.output_error.loop_check import doubted_loops
from stickslip.identification.output_error.output import output_error
from stickslip.identification.regression.inverse import inverse_dynamics
from stickslip.machines.servo import ServoAxis
from stickslip.models.plugins import law
from stickslip.simulation.recorded_input.simulation import Loop, control_signal
from support.places import DATA, needs_data

FILE = DATA / "emps" / "DATA_EMPS.mat"
pytestmark = needs_data("emps/DATA_EMPS.mat")

PUBLISHED = {
    "inertia": (95.1089, 0.1085),
    "fv": (203.5034, 1.146),
    "fc": (20.3935, 0.1012),
    "offset": (-3.1648, 0.0444),
}


@pytest.fixture(scope="module")
def emps() -> tuple[Experiment, ServoAxis]:
    from scipy.io import loadmat

    data: Any = loadmat(FILE)
    t, q, r, u = (np.ascontiguousarray(data[k].ravel(), dtype=float) for k in ("t", "qm", "qg", "vir"))
    kp, kv, gain = (float(data[k].item()) for k in ("kp", "kv", "gtau"))
    loop = Loop(kp=kv * kp, kd=kv, limit=10.0, velocity_span=2)
    axis = ServoAxis(motion="linear", drive_gain=gain, drive_side="load")
    return Experiment("emps", t, q, u, "voltage", r, loop), axis


def test_the_loop_makes_the_recorded_voltage(emps: tuple[Experiment, ServoAxis]) -> None:
    experiment, _ = emps
    assert experiment.loop is not None
    assert experiment.reference is not None
    assert experiment.drive is not None
    made = control_signal(experiment.loop, experiment.time, experiment.reference, experiment.position)
    assert np.sqrt(np.mean((made - experiment.drive)[3:] ** 2)) < 4.7e-3


def test_its_gains_are_not_doubted_and_wrong_ones_are(emps: tuple[Experiment, ServoAxis]) -> None:
    experiment, _ = emps
    assert experiment.loop is not None
    assert doubted_loops([experiment]) == []
    (said,) = doubted_loops([replace(experiment, loop=replace(experiment.loop, kd=2.0 * experiment.loop.kd))])
    assert "kd 486.9 given, 243.4" in said


def test_inverse_dynamics_gives_the_published_parameters(emps: tuple[Experiment, ServoAxis]) -> None:
    experiment, axis = emps
    found = inverse_dynamics([experiment], axis)
    for name, (value, spread) in PUBLISHED.items():
        place = found.names.index(name)
        assert abs(found.values[place] - value) < spread
        assert found.std[place] == pytest.approx(spread, rel=0.02)
        # Residuals are correlated, which the published deviations leave out.
        assert found.robust_std[place] > 2.0 * spread
    assert found.relative_error <= 0.0415
    assert found.units == ("kg", "N·s/m", "N", "N")


def test_friction_per_direction(emps: tuple[Experiment, ServoAxis]) -> None:
    experiment, axis = emps
    found = inverse_dynamics([experiment], axis, per_direction=True)
    assert found.relative_error <= 0.0320
    published = {
        "inertia": 95.154,
        "fv_plus": 166.706,
        "fc_plus": 20.144,
        "fv_minus": 240.424,
        "fc_minus": 20.628,
    }
    for name, value in published.items():
        assert found[name] == pytest.approx(value, rel=2e-3)


def test_closed_loop_output_error(emps: tuple[Experiment, ServoAxis]) -> None:
    experiment, axis = emps
    found = output_error([experiment], axis, law("coulomb"), inverse_dynamics([experiment], axis))
    assert found.errors["position_relative"] < 3e-5
    assert found.errors["drive_relative"] <= 0.048
    assert found.mechanics.inertia == pytest.approx(95.1, rel=0.01)
