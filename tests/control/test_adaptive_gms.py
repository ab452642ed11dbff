"""Adaptive GMS: what slips teaches and what sticks does not, bounds, rest, and friction that was believed wrongly."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

import stickslip as ss
from stickslip.control.belief import Belief
from stickslip.control.catalogue import compensated
from stickslip.control.registry import control_law
from stickslip.core.errors import ParameterError
from stickslip.core.spec import Surroundings
from stickslip.models.model import Model
from support.golden_rows import CURVE, GMS, INERTIA, LUGRE, PID, pd

TIME, LEAK, SLOPE = 1e-3, 0.05, 62.83
K, ALPHA = np.array([12896.0, 8141.0, 4273.0]), np.array([1.0, 2.0, 1.0]) / 4.0
LEVEL, RATE, TOP = np.array([0.3368, -0.032, -0.115, 0.0981]), np.array([12.0, 6.0, 4.0, 3.0]), 0.02
LAW = control_law("adaptive_gms")


def block(**more):
    values = {**LAW.example, "alpha": ALPHA.tolist(), "rate": RATE.tolist(), "leak": LEAK, **more}
    return ss.ControlBlock(LAW, **values)


def signals(v, velocity=None, error=0.0):
    velocity = v if velocity is None else velocity
    return SimpleNamespace(reference_velocity=v, velocity=velocity, error=error, elapsed=TIME)


# ---- sample by sample ----------------------------------------------------------------------------------------------


def test_torque_and_coefficients_are_those_of_the_equations():
    adaptive = block(sigma2=0.02)
    z, p = adaptive.state(), adaptive.parameters
    force, side, theta = np.zeros(3), np.zeros(3), LEVEL.copy()
    rng = np.random.default_rng(4)
    slipped = set()
    for k in range(3000):
        v = 0.03 * math.sin(0.004 * k) * math.sin(0.05 * k)
        behind, error = rng.normal(size=2) * np.array([0.02, 1e-3])
        torque = LAW.sample(signals(v, v - behind, error), z, p, None)
        if v != 0.0:
            way = math.copysign(1.0, v)
            powers = min(abs(v) / TOP, 1.0) ** np.arange(4)
            s = float(theta @ powers)
            side[side * way < 0.0] = 0.0
            force = np.where(side == 0.0, force + K * v * TIME, force)
            side[(side == 0.0) & (force * way >= ALPHA * s)] = way
            force = np.where(side != 0.0, ALPHA * s * way, force)
            phi = float(ALPHA[side != 0.0].sum()) * way * powers
            if phi.any():
                theta = theta + TIME * RATE * (phi * (behind + SLOPE * error) - LEAK * (theta - LEVEL))
        slipped.add(int(np.count_nonzero(side)))
        assert torque == pytest.approx(float(force.sum()) + 0.02 * v, abs=1e-12)
    assert z.curve == pytest.approx(theta.tolist(), abs=1e-12)
    assert np.abs(theta - LEVEL).max() > 0.01
    assert slipped == {0, 1, 2, 3}


def test_what_sticks_teaches_nothing():
    adaptive = block()
    z, p = adaptive.state(), adaptive.parameters
    largest = 0.0
    for k in range(200):  # to and fro by less than the first element bends before it slips
        largest = max(largest, LAW.sample(signals(1e-3 * math.cos(0.3 * k), 0.0, 0.01), z, p, None))
    assert largest > 0.05
    assert z.side == [0.0, 0.0, 0.0]
    assert z.curve == LEVEL.tolist()
    for _ in range(200):
        LAW.sample(signals(0.01, 0.0, 0.01), z, p, None)
    assert all(z.side)
    assert z.curve[0] > LEVEL[0] + 0.1


def test_coefficients_stay_within_their_bounds_and_the_curve_is_never_negative():
    adaptive = block(largest=0.5)
    z, p = adaptive.state(), adaptive.parameters
    for _ in range(20_000):
        high = LAW.sample(signals(0.1, -0.4, 0.1), z, p, None)
    assert z.curve == [0.5] * 4
    assert high == pytest.approx(0.5 + 0.018 * 0.1)
    for _ in range(20_000):
        low = LAW.sample(signals(0.1, 0.6, -0.1), z, p, None)
    assert z.curve == [-0.5] * 4
    assert low == pytest.approx(0.018 * 0.1)


@pytest.mark.parametrize("velocity", ["reference", "measured"])
def test_nothing_is_learned_while_the_reference_stands(velocity):
    law = LAW.having(velocity=velocity)
    drive = ss.Controller(
        loop=ss.ControlBlock("pid", **PID),
        sample_time=TIME,
        observer=ss.ControlBlock(law, **law.example),
        torque_limit=1.0,
    )
    n, m, z, p = drive.settings, drive.memory(), drive.state(), drive.parameters
    u, out = SimpleNamespace(**Surroundings()._asdict()), []
    for k in range(3000):
        t = TIME * k
        position, speed = (0.25 * t, 0.3) if t < 1.0 else (0.25 + 1e-4 * (k % 2), 0.0)
        drive.functions["sample"](position, 0.3 * min(t, 1.0), speed, 0.0, n, m, z, p, u)
        out.append(list(drive.learned(z)["observer_curve"]))
    assert out[900] != out[0]
    assert out[1001] == out[-1]


def test_what_is_wrong_with_elements_or_curve_is_said():
    with pytest.raises(ParameterError, match=r"alpha adds up to 0\.9; the shares"):
        block(alpha=[0.3, 0.3, 0.3])
    with pytest.raises(ParameterError, match=r"level gives s = -0\.0\d+ N·m at 0\.0\d+ rad/s"):
        block(level=[0.3368, -0.032, -0.415, 0.0981])
    with pytest.raises(ParameterError, match="every power needs a value of each: level has 4, rate has 2"):
        block(rate=[12.0, 12.0])


# ---- in the loop ---------------------------------------------------------------------------------------------------

MOTIONS = {"low": (0.01, 0.4), "high": (0.5, 0.1)}
"""Amplitude, rad, and frequency, Hz."""


def rms(adaptive, loop, scale, motion):
    """mrad on an axis whose GMS law has levels of that scale, over the second period."""
    curve = {**CURVE, "fs": scale * CURVE["fs"], "fc": scale * CURVE["fc"]}
    axis = ss.RigidAxis(INERTIA, Model("gms", k=K.tolist(), alpha=[1 / 3] * 3, c=23.8782, **curve))
    drive = ss.Controller(loop=loop, sample_time=TIME, observer=adaptive, torque_limit=1.0, alone=True)
    amplitude, frequency = MOTIONS[motion]
    reference = ss.Reference("sine", amplitude=amplitude, frequency=frequency)
    record = ss.simulate(axis, drive, reference, 2.0 / frequency, integrator="sampled", metered=False)
    error = (record["position_reference"] - record["position"])[record["event"] == 0.0]
    return 1e3 * math.sqrt(float(np.mean(error[len(error) // 2 :] ** 2)))


@pytest.mark.slow
@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("scale", [0.7, 1.3])
def test_levels_believed_wrong_by_30_percent_cost_less_than_half_of_what_they_cost_unlearned(scale, motion):
    even = {"alpha": [1 / 3] * 3}
    fixed, learned = block(**even, rate=[0.0] * 4), block(**even, rate=[12.0] * 4)
    for loop in (pd(), ss.ControlBlock("pid", **PID)):
        assert rms(learned, loop, scale, motion) < 0.5 * rms(fixed, loop, scale, motion)


def test_the_catalogue_takes_elements_and_curve_from_the_gms_law():
    belief = Belief(INERTIA, LUGRE, GMS, bandwidth=20.0)
    found = compensated("adaptive-gms", "PID", belief).values()
    assert found["observer_k"] == pytest.approx(K)
    assert found["observer_rate"] == pytest.approx([12.0] * 4, rel=0.02)
    share = np.linspace(0.0, 1.0, 11)
    curve = np.polynomial.polynomial.polyval(share, found["observer_level"])
    assert found["observer_top"] == pytest.approx(0.02)
    assert curve == pytest.approx(0.285 + 0.05 * np.exp(-((2.0 * share) ** 2)), abs=3e-3)
