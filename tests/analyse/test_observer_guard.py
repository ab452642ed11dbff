"""When a LuGre observer may be switched on: the reference's exact limits on the stuck axis, counts, and the ratios."""

from __future__ import annotations

import math

import pytest

from stickslip.analyse.observer_guard import largest_stiffness, objection, positive_real_ratios, stuck_radius
from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.core.errors import ParameterError

INERTIA, STIFFNESS = 3.8623e-4, 25_000.0  # the thesis's axis and its contact
W = 40.0 * math.pi
PD = ControlBlock("pd", kp=INERTIA * W**2, kd=2.0 * INERTIA * W)


def observed(sigma0, correction=1.0):
    helper = ControlBlock(
        "lugre_observer", sigma0=sigma0, sigma2=0.018, correction=correction, fs=0.335, fc=0.285, vs=0.01
    )
    return Controller(loop=PD, sample_time=1e-3, observer=helper)


@pytest.mark.parametrize(("delay", "limit"), [(0, 25_000.0), (1, 15_800.0)])
def test_the_largest_stiffness_is_that_of_the_reference(delay, limit):
    found = largest_stiffness(observed(1.0), INERTIA, STIFFNESS, 0.018, delay)
    assert found == pytest.approx(limit, abs=150.0)  # the reference's grid is 100


def test_beyond_the_limit_the_loop_grows():
    assert stuck_radius(observed(24_000.0), INERTIA, STIFFNESS, 0.018) < 1.0
    assert stuck_radius(observed(27_000.0), INERTIA, STIFFNESS, 0.018) > 1.0
    assert stuck_radius(observed(17_000.0), INERTIA, STIFFNESS, 0.018, 1) > 1.0


def test_what_the_guard_says():
    said = objection(observed(3.5e4), INERTIA, STIFFNESS, 65_536.0, 0.018)
    assert said.startswith("its stiffness 1 x 35000 N·m/rad is given back to a contact of 25000 N·m/rad")
    coarse = objection(observed(1e4), INERTIA, STIFFNESS, 65_536.0, 0.018)
    assert coarse.startswith("one count of the encoder, 9.59e-05 rad, bends its bristle by 0.959 N·m")
    assert objection(observed(500.0), INERTIA, STIFFNESS, 65_536.0, 0.018, 1) == ""
    with pytest.raises(ParameterError, match="the controller has no lugre_observer; give it one"):
        largest_stiffness(Controller(loop=PD, sample_time=1e-3), INERTIA, STIFFNESS)


def test_ratios_of_positive_realness():
    met = positive_real_ratios(100.0, 1.0, 1e-3, 3.0, 0.2, 6.0)
    assert (met.velocity, met.integral) == pytest.approx((2.0, 50.0))
    assert met.certified
    missed = positive_real_ratios(3.5e4, 0.1, INERTIA, 6.1, 0.097)
    assert missed.velocity == pytest.approx(0.1 * 0.097 / (3.5e4 * INERTIA))
    assert missed.integral == math.inf
    assert not missed.certified
    assert "not certified: a simulation decides" in str(missed)
    assert positive_real_ratios(100.0, 1.0, 1e-3, 3.0, 0.2, 400.0, position=False).velocity == math.inf
    assert not positive_real_ratios(100.0, 1.0, 1e-3, 3.0, 0.2, 400.0, position=False).certified
