"""The example of Canudas de Wit et al. 1995: a PID hunts on LuGre friction, and does not with the observer.

A mass of 1 kg with the paper's LuGre law, PID of 3, 4 and 6; the last 20 s of a step of 1 m (60 s) and of
0.1 sin t m (40 s).
The paper's loop is continuous; the package's is sampled, so that what depends on the sample time is extrapolated to 0.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller

SIGMA0, SIGMA1 = 1e5, math.sqrt(1e5)
CURVE = {"fs": 1.5, "fc": 1.0, "vs": 1e-3, "sigma2": 0.4}
AXIS = ss.RigidAxis(1.0, ss.Model("lugre", sigma0=SIGMA0, sigma1=SIGMA1, **CURVE))
FINE = 1e-4  # s


def loop(correction, sample_time):
    pid = ControlBlock("pid", kp=3.0, ki=4.0, kd=6.0)
    if correction is None:
        return Controller(loop=pid, sample_time=sample_time)
    # The paper's bristle has no bound, and sigma1 dz/dt is given too.
    observer = ControlBlock(
        "lugre_observer", sigma0=SIGMA0, sigma1=SIGMA1, correction=correction, most=1e6, **CURVE
    )
    ahead = ControlBlock("inertia_feedforward", inertia=1.0, offset=0.0)
    return Controller(loop=pid, sample_time=sample_time, feedforward=ahead, observer=observer)


def late_error(motion, correction, sample_time=FINE):
    """The error over the last 20 s, m."""
    if motion == "step":
        reference, duration, start = ss.Reference("ramp", velocity=0.0), 60.0, (-1.0, 0.0)
    else:
        reference = ss.Reference("plain_sine", amplitude=0.1, frequency=0.5 / math.pi)
        duration, start = 40.0, (0.0, 0.0)
    record = ss.simulate(
        AXIS, loop(correction, sample_time), reference, duration,
        integrator="sampled", output=5e-3, initial=start, metered=False,
    )  # fmt: skip
    error = record.channels["position_reference"] - record.channels["position"]
    return error[record.time >= duration - 20.0]


def rms(error):
    return math.sqrt(float(np.mean(error**2)))


def continuous(motion, measure):
    """What the loop with k = 0 comes to in continuous time: the error of sampling is of first order."""
    return 2.0 * measure(late_error(motion, 0.0, 0.5 * FINE)) - measure(late_error(motion, 0.0))


def test_the_observer_follows_the_sine():
    assert rms(late_error("sine", 10.0)) == pytest.approx(1.0278e-5, rel=0.01)


@pytest.mark.slow
def test_the_pid_alone_hunts_after_the_step_and_sticks_on_the_sine():
    assert float(np.ptp(late_error("step", None))) == pytest.approx(0.12896, rel=0.01)
    assert rms(late_error("sine", None)) == pytest.approx(7.223e-2, rel=0.01)


@pytest.mark.slow
def test_the_observer_without_correction():
    assert continuous("step", lambda e: float(np.ptp(e))) == pytest.approx(3.24e-4, rel=0.01)
    assert continuous("sine", rms) == pytest.approx(6.871e-5, rel=0.01)


@pytest.mark.slow
def test_the_observer_comes_to_rest_after_the_step():
    assert float(np.ptp(late_error("step", 10.0))) < 1e-9
