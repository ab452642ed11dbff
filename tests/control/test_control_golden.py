"""Controllers made of control laws against the reference's golden traces: they pin every order of operations.

The traces are of 600 samples at 1 kHz, computed independently in C and Python (they agree to 4e-15 N·m).
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from stickslip.core.spec import Surroundings
from stickslip.simulation.compiled_controller import FAULT, compiled, replay
from support.golden_rows import ROWS

DATA = np.load(f"{__file__.rpartition('/control/')[0]}/data/control_golden.npz")
INPUTS = np.column_stack([DATA[name] for name in ("qm", "qd", "vd", "ad")])
AGREED = 1e-12  # N·m


@pytest.mark.parametrize("row", ROWS)
def test_torques_are_those_of_the_reference(row):
    controller = ROWS[row]
    n, m, z, p = controller.settings, controller.memory(), controller.state(), controller.parameters
    u, sample = SimpleNamespace(**Surroundings()._asdict()), controller.functions["sample"]
    torque = np.array([sample(*map(float, x), n, m, z, p, u) for x in INPUTS])
    assert np.abs(torque - DATA[row]).max() <= AGREED
    assert np.abs(torque).max() > 0.3


@pytest.mark.parametrize(
    "row", ["PD", "PID + FF GMS3 .9", "PD + FF LuGre .9 + DOB 400 residual reset at rest"]
)
def test_compiled_torques_are_those_of_the_reference(row):
    torque, fault = np.zeros(len(INPUTS)), np.zeros(len(INPUTS))
    replay(compiled(ROWS[row]), INPUTS, np.array(Surroundings()), FAULT, torque, fault)
    assert np.abs(torque - DATA[row]).max() <= AGREED
    assert not fault.any()
