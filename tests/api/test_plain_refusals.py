"""What cannot be is refused in one sentence that names the thing to be changed."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import ConfigError, InputError, ParameterError
from support.sweeps import SMALL

COULOMB = ss.Model("coulomb", fc=0.3, sigma2=0.02)


def refusal(**more: object) -> str:
    """Of an axis that swings, what `identify` says."""
    t = np.arange(0.0, 4.0, 1e-3)
    torque = -4e-3 * np.sin(2.0 * t) + 0.3 * np.sign(np.cos(2.0 * t)) + 0.02 * np.cos(2.0 * t)
    with pytest.raises(InputError) as told:
        ss.identify(t=t, position=np.sin(2.0 * t), torque=torque, **more)
    return str(told.value)


def test_what_is_wrong_whatever_the_law_is_said_once() -> None:
    assert refusal(inertia=-1.0) == "inertia = -1 kg·m² must be greater than 0"
    said = refusal(frozen=["foo"])
    assert said.count("unknown parameter 'foo'") == 1
    assert "sigma0" in said
    assert "fc_negative" not in said


def test_no_temperature_is_below_absolute_zero() -> None:
    with pytest.raises(ParameterError, match=r"temperature = -400 °C .* absolute zero"):
        ss.RigidAxis(1e-3, COULOMB, temperature=-400.0)


def test_a_duration_that_is_a_typing_error_is_named() -> None:
    control = ss.Controller(ss.place("PD", 1e-3, 6.0))
    with pytest.raises(ParameterError, match=r"duration = 1e\+09 s .* shorter duration"):
        ss.simulate(ss.RigidAxis(1e-3, COULOMB), control, ss.Reference("step", amplitude=0.1, tau=0.01), 1e9)


def test_an_unknown_study_is_told_all_that_ship() -> None:
    with pytest.raises(ConfigError, match="one of thesis, imperfections, thesis-rig, compensators"):
        ss.study("nofile")


def test_a_sweeps_jobs_may_be_none() -> None:
    with pytest.raises(InputError, match="jobs = -1 must be at least 0; 0, or none, is one block a core"):
        ss.sweep(SMALL, jobs=-1)
