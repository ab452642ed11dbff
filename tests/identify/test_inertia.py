"""Inertia from the frequency response, thesis 4.2."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stickslip import Model
from stickslip.core.errors import InputError
from stickslip.identification.estimate import Estimate, Identification
from stickslip.identification.experiment import Experiment
from stickslip.identification.response.inertia import frequency_response, inertia, verdict_on
from stickslip.machines.servo import ServoAxis
from stickslip.report.answers import answers_of
from stickslip.report.identified import shown
from stickslip.report.result_text import result_lines
from stickslip.simulation.recorded_input.simulation import Drive, Mechanics, drive_axis

J = 4.2757e-4  # thesis 4.2
AXIS = ServoAxis(drive_side="load")


def excited(amplitude: float, friction: Model, seed: int = 0, seconds: float = 60.0) -> Experiment:
    """Random torque held over 4 ms, on a light axis with a counted position."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1e-3)
    torque = amplitude * np.repeat(rng.normal(size=time.size // 4 + 1), 4)[: time.size]
    out = drive_axis(Mechanics(J), friction, Drive(time, torque))
    return Experiment(f"{amplitude:g} N·m", time, out[:, 0] + 1e-5 * rng.normal(size=time.size), torque)


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


def two_masses(mode: float, seed: int = 0, noise: float = 1e-6) -> Experiment:
    """Motor and load of equal inertia on a spring with that natural frequency (Hz), 2 % of damping; exact."""
    from scipy.signal import cont2discrete, dlsim

    rng = np.random.default_rng(seed)
    dt, half, omega = 1e-3, 0.5 * J, 2.0 * np.pi * mode
    k, d = 0.5 * half * omega**2, 0.5 * half * 2.0 * 0.02 * omega
    a = np.array([[0, 1, 0, 0], [-k / half, -(d + 0.01) / half, k / half, d / half], [0, 0, 0, 1],
                  [k / half, d / half, -k / half, -d / half]])  # fmt: skip
    system = cont2discrete(
        (a, np.array([[0.0], [1.0 / half], [0.0], [0.0]]), np.eye(1, 4), np.zeros((1, 1))), dt
    )
    torque = 0.5 * rng.normal(size=60_000)
    position = dlsim(system, torque)[1][:, 0]
    time = dt * np.arange(torque.size)
    return Experiment("two masses", time, position + noise * rng.normal(size=time.size), torque)


@pytest.mark.parametrize("mode", [70.0, 230.0])
def test_a_true_mode_is_found_and_nothing_else(mode: float) -> None:
    found = inertia([two_masses(mode), two_masses(mode, 1)], AXIS, band=(0.4, 15.0)).details["resonances"]
    assert len(found) == 1
    assert found[0] == pytest.approx(mode, rel=0.03)


@pytest.mark.parametrize("noise", [1e-6, 1e-4, 1e-3])
def test_noise_on_a_rigid_axis_is_no_resonance(noise: float) -> None:
    experiments = [excited(0.5, Model("coulomb", fc=0.02, sigma2=0.018), seed) for seed in (1, 2)]
    rng = np.random.default_rng(9)
    noisy = [replace(t, position=t.position + noise * rng.normal(size=t.time.size)) for t in experiments]
    assert inertia(noisy, AXIS, band=(0.4, 10.0)).details["resonances"] == ()


def test_coherence_lies_between_the_estimators() -> None:
    r = frequency_response(excited(0.5, Model("coulomb", fc=0.1, sigma2=0.018)), AXIS)
    assert np.all((r.coherence > 0.0) & (r.coherence <= 1.0 + 1e-12))
    assert np.all(np.abs(r.h1) <= np.abs(r.h2) * (1.0 + 1e-12))
    assert np.abs(r.h1) / np.abs(r.h2) == pytest.approx(r.coherence, rel=1e-9)


def test_what_cannot_be_fitted_is_said() -> None:
    experiment = excited(0.5, Model("coulomb", fc=0.0, sigma2=0.018), seconds=5.0)
    with pytest.raises(InputError, match="two windows"):
        inertia([experiment], AXIS)
    with pytest.raises(InputError, match="ascending"):
        inertia([experiment], AXIS, band=(5.0, 1.0))
    with pytest.raises(InputError, match="no record"):
        inertia([], AXIS)


def test_two_windows_to_the_row_are_enough() -> None:
    free = Model("coulomb", fc=0.0, sigma2=0.018)
    assert inertia([excited(0.5, free, seconds=20.0)], AXIS)["inertia"].value == pytest.approx(J, rel=0.2)
    with pytest.raises(InputError, match=r"19\.9 s hold fewer than two windows of 10 s"):
        inertia([excited(0.5, free, seconds=19.9)], AXIS)


def test_a_value_below_zero_and_an_interval_of_many_decades_are_called_what_they_are():
    assert "below 0" in verdict_on(-2.0, -1.0)
    assert verdict_on(-2.0, 1.0) == "cannot be distinguished from 0"
    wide = Estimate("k", "N·m/rad", "k", 1.0, 1.0, 3e-12, 3e16, False, "")
    found = Identification(
        "axis", None, (wide, replace(wide, name="fs", lower=0.5, upper=2.0)), np.eye(2), {}
    )
    line, other = result_lines(found, answers_of(found, []))[2:4]
    assert line.split() == ["k", "not", "determined", "N·m/rad", "not", "identified"]
    assert other.split()[1:4] == ["1", "[0.5,", "2]"]
    assert line.index("N·m/rad") == other.index("N·m/rad")
    row = shown(wide)
    assert (row["value"], row["interval"]) == ("not determined", "-")
    assert "the model's 1 is one choice among many" in row["verdict"]
