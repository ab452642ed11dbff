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


@pytest.mark.parametrize("kind", ["PD", "PID"])
@pytest.mark.parametrize("bandwidth", [10.0, 20.0])
def test_gain_and_phase_margin_are_where_the_loop_goes_unstable(kind: str, bandwidth: float) -> None:
    """A phase margin over the crossover is the delay that the loop still bears, and a gain margin is in dB."""
    controller = ss.Controller(ss.place(kind, INERTIA, bandwidth, 1.0), sample_time=T)
    sliding = ss.stability(AXIS, controller).loops[1]
    assert sliding.phase / 360.0 / sliding.crossover == pytest.approx(sliding.delay * T, rel=0.02)
    assert 10.0 ** (sliding.gain_dB[1] / 20.0) == pytest.approx(sliding.torque[1])
    later = ss.stability(AXIS, controller, delay=0.5).loops[1]
    assert later.phase == pytest.approx(sliding.phase - 180.0 * sliding.crossover * T, abs=0.05)
    assert later.crossover == pytest.approx(sliding.crossover, rel=1e-3)


def test_the_margins_of_an_unstable_loop_and_of_one_that_nowhere_crosses_over_are_none() -> None:
    fast = ss.stability(AXIS, ss.Controller(ss.place("PD", INERTIA, 250.0, 1.0), sample_time=T))
    assert not fast.loops[1].poles.stable
    assert all(math.isnan(x) for x in (*fast.loops[1].gain_dB, fast.loops[1].phase, fast.loops[1].crossover))
    stiff = ss.RigidAxis(INERTIA, ss.Model("dahl", sigma0=1e4, fc=0.2, sigma2=VISCOUS))
    held = ss.stability(stiff, ss.Controller(ss.pd(1.0, 0.01), sample_time=T))
    assert held.loops[0].phase == math.inf
    assert any(
        line.startswith("sticking, gain margin") and line.endswith("no crossover") for line in held.lines()
    )


def test_the_bandwidth_of_a_placement_is_no_crossover() -> None:
    """As the help of `place` says of a PID with damping 1."""
    loop = ss.Controller(ss.place("PID", INERTIA, 10.0, 1.0), sample_time=1e-4)
    free = ss.RigidAxis(INERTIA, ss.Model("viscous", sigma2=1e-6))
    assert ss.stability(free, loop).loops[1].crossover == pytest.approx(30.0, rel=0.15)


# ---- what poles do not tell ------------------------------------------------------------------------------------------

STRIBECK = {"fc": 0.3, "fs": 0.5, "vs": 0.02, "sigma2": 0.02}
LUGRE = ss.Model("lugre", sigma0=2e3, sigma1=1.0, **STRIBECK)


@pytest.mark.parametrize(
    "friction", [LUGRE, ss.Model("stribeck_plain", **STRIBECK)], ids=lambda m: m.law.name
)
@pytest.mark.parametrize(
    "made",
    [
        {"gains": ss.pid(10.0, 40.0, 0.3)},
        {"gains": ss.pd(10.0, 0.3), "observer": ss.ControlBlock("disturbance_observer", inertia=4e-3, corner=20.0)},
    ],
    ids=["pid", "observer"],
)  # fmt: skip
def test_that_an_integral_action_may_hunt_is_said_with_what_decides_it(friction, made) -> None:
    """Stable poles and "100 % of the contact may be missing" were said of a loop that hunts with 10 mrad."""
    found = ss.stability(ss.RigidAxis(4e-3, friction), ss.Controller(**made, sample_time=T))
    assert all(loop.poles.stable for loop in found.loops)
    assert found.held == pytest.approx(STRIBECK["fs"], rel=1e-3)
    said = [line for line in found.lines() if "hunts" in line]
    assert len(said) == 1
    assert all(x in said[0] for x in ("ss.simulate(", "stickslip simulate", "limit_cycle_amplitude_rad"))


@pytest.mark.parametrize(
    ("friction", "gains"),
    [
        (LUGRE, ss.pd(10.0, 0.3)),
        (LUGRE, ss.Gains(10.0, 0.0, 0.3, 0.3)),
        (ss.Model("viscous", sigma2=0.02), ss.pid(10.0, 40.0, 0.3)),
    ],
    ids=["pd", "no integral gain", "viscous"],
)
def test_nothing_of_hunting_is_said_without_an_integral_or_a_level_of_friction(friction, gains) -> None:
    found = ss.stability(ss.RigidAxis(4e-3, friction), ss.Controller(gains, sample_time=T))
    assert found.held == 0.0
    assert not any("hunts" in line for line in found.lines())


def test_a_cycle_is_the_least_where_sliding_is_unstable_too() -> None:
    """It was said to end at 380 µrad, and swings by 1160."""
    flexible = ss.FlexibleAxis(
        rotor=1.5e-4, shaft=0.5e-4, disk=2e-4, coupling=8e3, elasticity=300.0, damping=0.02
    )
    lugre = {"sigma0": 3.5e4, "sigma1": 0.1, "fs": 0.335, "fc": 0.285, "vs": 0.01}
    amplifier = ss.Amplifier(torque_constant=0.2, current_limit=15.0, bandwidth=1500.0)
    said = {}
    for viscous in (0.018, 0.1):
        contact = ss.Contact(ss.Model("lugre", **lugre, sigma2=viscous))
        machine = ss.Machine(
            "m", flexible.inertia, contact, flexible=flexible, amplifier=amplifier, delay=0.5
        )
        found = ss.stability(machine, ss.Controller(ss.place("PID", 4e-4, 10.0), sample_time=T))
        ends = [line for line in found.lines() if "ends in a cycle" in line]
        assert len(ends) == 1
        said[found.loops[1].poles.stable] = ends[0]
    assert said[False].endswith("Hz, or a larger one, since sliding is unstable too")
    assert said[True].endswith("Hz")
