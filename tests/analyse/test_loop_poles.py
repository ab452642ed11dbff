"""Poles and margins of loops that textbooks know: nothing that is not felt, and no rounding, is a pole of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.analyse.controller_loop import linearised
from stickslip.analyse.presliding_loop import Loop
from stickslip.machines.drivetrain import Drivetrain

INERTIA, VISCOUS, T = 4e-4, 0.01, 1e-3
AXIS = ss.RigidAxis(INERTIA, ss.Model("coulomb", fc=0.2, sigma2=VISCOUS))


def closed(kp: float, kd: float) -> complex:
    """The least stable pole of a sampled PD (backward difference, held torque) on inertia and viscous friction, 1/s."""
    decay = math.exp(-VISCOUS / INERTIA * T)
    slow = INERTIA / VISCOUS * (1.0 - decay)
    # Position, velocity, and the position of the sample before.
    free = np.array([[1.0, slow, 0.0], [0.0, decay, 0.0], [1.0, 0.0, 0.0]])
    pushed = np.array([(T - slow) / VISCOUS, (1.0 - decay) / VISCOUS, 0.0])
    torque = np.array([-kp - kd / T, 0.0, kd / T])
    poles = np.linalg.eigvals(free + np.outer(pushed, torque))
    return complex(np.log(poles[np.argmax(np.abs(poles))] + 0j)) / T


@pytest.mark.parametrize("bandwidth", [2.0, 10.0, 36.0, 100.0])
def test_a_pd_on_a_sliding_axis_has_the_poles_of_its_own_matrix(bandwidth: float) -> None:
    """An integral without a gain moves and is not felt: as rounding it was a pole at 0 that was called unstable."""
    gains = ss.place("PD", INERTIA, bandwidth, 1.0)
    sliding = ss.stability(AXIS, ss.Controller(gains, sample_time=T)).loops[1]
    wanted = closed(gains.kp, gains.kd)
    assert sliding.poles.growth == pytest.approx(wanted.real, rel=1e-3)
    assert 2.0 * math.pi * sliding.poles.frequency == pytest.approx(abs(wanted.imag), rel=1e-3, abs=1e-3)
    for factor, good in ((0.97 * sliding.torque[1], True), (1.03 * sliding.torque[1], False)):
        assert (closed(factor * gains.kp, factor * gains.kd).real < 0.0) is good


@pytest.mark.parametrize(
    ("gains", "poles"),
    [
        (ss.Gains(1.6, 0.0, 0.05, 0.05), [0.0]),
        (ss.Gains(1.6, 0.01, 0.05, 0.05), [0.0, 1.0]),
        (ss.Cascade(40.0, 0.05, 0.0, 1.0), [0.0]),
        (ss.Cascade(40.0, 0.05, 0.5, 1.0), [0.0, 1.0]),
        (ss.Gains(1.6, 0.0, 0.0, 0.0), []),
    ],
)
def test_a_controller_has_the_poles_that_its_torque_feels(
    gains: ss.Gains | ss.Cascade, poles: list[float]
) -> None:
    a, _, _, _ = linearised(ss.Controller(gains, sample_time=T), math.inf, 10.0).state_space()
    assert np.sort(np.linalg.eigvals(a).real) == pytest.approx(poles, abs=1e-6)


@pytest.mark.parametrize("damping", [0.2, 0.3, 0.5])
def test_the_sensitivity_of_a_loop_that_is_sampled_often_is_the_textbooks(damping: float) -> None:
    def peak(sample_time: float) -> float:
        loop = ss.Controller(ss.place("PD", INERTIA, 15.0, damping), sample_time=sample_time)
        return Loop(Drivetrain((INERTIA,)), linearised(loop, math.inf, 10.0)).sensitivity()

    # Of s² / (s² + 2 D s + 1).
    assert peak(1e-4) == pytest.approx(1.0 / (2.0 * damping * math.sqrt(1.0 - damping**2)), rel=0.02)
    assert peak(0.05) == math.inf
