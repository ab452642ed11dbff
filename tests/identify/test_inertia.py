"""Inertia from the frequency response, thesis 4.2."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip import Model
from stickslip.errors import InputError
from stickslip.identify.axis_trial import Trial
from stickslip.identify.inertia import frequency_response, inertia
from stickslip.machines.servo import ServoAxis
from stickslip.simulation.driven import Drive, Mechanics, drive_axis

J = 4.2757e-4  # thesis 4.2
AXIS = ServoAxis(drive_side="load")


def excited(amplitude: float, friction: Model, seed: int = 0, seconds: float = 60.0) -> Trial:
    """Random torque held over 4 ms, on a light axis with a counted position."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1e-3)
    torque = amplitude * np.repeat(rng.normal(size=time.size // 4 + 1), 4)[: time.size]
    out = drive_axis(Mechanics(J), friction, Drive(time, torque))
    return Trial(f"{amplitude:g} N·m", time, out[:, 0] + 1e-5 * rng.normal(size=time.size), torque)


def test_inertia_and_viscous_friction_of_a_linear_axis() -> None:
    found = inertia([excited(0.5, Model("coulomb", fc=0.0, sigma2=0.018))], AXIS)
    assert found["inertia"].lower < J < found["inertia"].upper
    assert found["inertia"].value == pytest.approx(J, rel=0.02)
    assert found["viscous[0]"].value == pytest.approx(0.018, rel=0.05)
    assert found["inertia"].identified
    assert found.details["resonances"] == ()


def test_amplitudes_agree_on_the_inertia_and_not_on_the_friction() -> None:
    friction = Model("coulomb", fc=0.2, sigma2=0.005)
    found = inertia([excited(0.8, friction, 1), excited(1.6, friction, 2)], AXIS, band=(2.0, 25.0))
    assert found["inertia"].value == pytest.approx(J, rel=0.05)
    # Coulomb friction acts like viscous friction that falls with the amplitude.
    assert found["viscous[0]"].value > 1.2 * found["viscous[1]"].value


def test_coherence_lies_between_the_estimators() -> None:
    r = frequency_response(excited(0.5, Model("coulomb", fc=0.1, sigma2=0.018)), AXIS)
    assert np.all((r.coherence > 0.0) & (r.coherence <= 1.0 + 1e-12))
    assert np.all(np.abs(r.h1) <= np.abs(r.h2) * (1.0 + 1e-12))
    assert np.abs(r.h1) / np.abs(r.h2) == pytest.approx(r.coherence, rel=1e-9)


def test_what_cannot_be_fitted_is_said() -> None:
    trial = excited(0.5, Model("coulomb", fc=0.0, sigma2=0.018), seconds=5.0)
    with pytest.raises(InputError, match="two windows"):
        inertia([trial], AXIS)
    with pytest.raises(InputError, match="ascending"):
        inertia([trial], AXIS, band=(5.0, 1.0))
    with pytest.raises(InputError, match="no record"):
        inertia([], AXIS)
