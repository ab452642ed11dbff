"""The ringing in a window of the meter: closed forms against quadrature, long windows against short steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.signal import lfilter

from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation._meter import HIGH_PASS
from stickslip.simulation.case_arrays import DONE, MAX_STEP
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.exact import engine as exact
from stickslip.simulation.exact import ringing as closed
from stickslip.simulation.exact.flow import flow, linear
from stickslip.simulation.exact.state import PLAN
from stickslip.simulation.metrics import metrics

CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018}
GMS = Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **CURVE)
LUGRE = Model("lugre", sigma0=3.5e4, sigma1=0.1, **CURVE)
COULOMB = Model("coulomb", fc=0.285, sigma2=0.018)
INERTIA = 3.8623e-4
PD = Controller(place("PD", INERTIA, 36.0, 1.0))
SINE = Reference("sine", amplitude=0.01, frequency=2.0)
AXES = [  # stiffness N·m/rad, damping N·m·s/rad, and a window in s; the inertia is 0.15 kg·m²
    (6e4, 60.0, 0.016), (6e4, 60.0, 0.064), (500.0, 20.0, 0.02), (3e5, 8.0, 0.03), (3e3, 0.1, 0.03), (2e3, 90.0, 0.01),
]  # fmt: skip


def motion(stiffness: float, damping: float, width: float):
    """Free motion from 10 µrad and 3 mrad/s over a window: the ringing, and fine samples of s, p and v."""
    lin = linear(0.15, damping, stiffness)
    s = np.linspace(0.0, 1.0, 20_001)
    m = np.array([flow(lin, x) for x in width * s])
    p, v = m[:, 0] * 1e-5 + m[:, 1] * 3e-3, m[:, 2] * 1e-5 + m[:, 3] * 3e-3
    assert closed.has_closed_form(lin, width)
    return closed.ringing(lin, width, p[0], v[0], p[-1], v[-1]), s, p, v


@pytest.mark.parametrize(("stiffness", "damping", "width"), AXES)
def test_moments_and_mean_squares(stiffness, damping, width):
    ring, s, p, v = motion(stiffness, damping, width)
    q = v * width
    for k in range(5):
        assert ring.p_moments[k] == pytest.approx(simpson(s**k * p, x=s), abs=1e-9 * np.max(np.abs(p)))
        assert ring.q_moments[k] == pytest.approx(simpson(s**k * q, x=s), abs=1e-9 * np.max(np.abs(q)))
    assert ring.pp == pytest.approx(simpson(p * p, x=s), rel=1e-8)
    assert ring.qq == pytest.approx(simpson(q * q, x=s), rel=1e-8)
    assert ring.pq == pytest.approx(simpson(p * q, x=s), abs=1e-8 * math.sqrt(ring.pp * ring.qq))


@pytest.mark.parametrize(("stiffness", "damping", "width"), AXES)
def test_high_pass(stiffness, damping, width):
    """Against the low-pass of straight lines between 20,000 samples, from y(0) = 2 mrad/s."""
    ring, s, _, v = motion(stiffness, damping, width)
    curve = (4e-3, -2e-3, 9e-3, -5e-3, 3e-3)
    speed = v + np.polynomial.polynomial.polyval(s, curve)
    k = HIGH_PASS * width * s[1]
    rest = (1.0 - math.exp(-k)) / k
    low, _ = lfilter(
        [1.0 - rest, rest - math.exp(-k)], [1.0, -math.exp(-k)], speed, zi=[2e-3 - (1.0 - rest) * speed[0]]
    )
    total, end = closed.high_passed(curve, ring, width, True, 2e-3)
    assert end == pytest.approx(low[-1], rel=1e-6)
    assert total == pytest.approx(simpson((speed - low) ** 2, x=width * s), rel=1e-6)


def test_no_closed_form_where_digits_would_go():
    """Motion too slow for its window, undamped, or with the pole of the high-pass."""
    assert not closed.has_closed_form(linear(0.15, 20.0, 1.0), 0.02)
    assert not closed.has_closed_form(linear(0.15, 0.0, 6e4), 0.02)
    pole, other = HIGH_PASS, 900.0
    assert not closed.has_closed_form(linear(1.0, pole + other, pole * other), 0.02)


REST = Reference("step", amplitude=0.01, tau=0.02)


@pytest.mark.parametrize("reference", [SINE, REST], ids=["sine", "step"])
@pytest.mark.parametrize("plant", [GMS, LUGRE, COULOMB], ids=["gms", "lugre", "coulomb"])
@pytest.mark.parametrize(
    "compensator", [None, Feedback(GMS, 0.8), Feedforward(LUGRE, 0.8)], ids=["", "FB", "FF"]
)
def test_metrics_are_those_of_short_steps(reference, plant, compensator):
    """Steps of 20 µs are windows of their own, whose nodes resolve any ringing."""
    controller = Controller(PD.linear, compensator)
    case = prepare(RigidAxis(INERTIA, plant), controller, reference, 0.6, tolerance=1e-9, output=0.6)
    long, short = exact.prepare(case), exact.prepare(case)
    short.parameters[MAX_STEP], short.plan.view(PLAN)["first_steps"] = 2e-5, math.inf
    ours, truth = long.record(), short.record()
    assert ours.code == truth.code == DONE
    assert ours.counts["steps"] <= 0.9 * truth.counts["steps"]
    found, expected = metrics(ours.meter, ours.turns), metrics(truth.meter, truth.turns)
    for name, value in expected.items():
        loose = name in ("longest_standstill_s", "settling_s")
        assert found[name] == pytest.approx(value, rel=2e-5, abs=6e-4 if loose else 1e-9, nan_ok=True), name
