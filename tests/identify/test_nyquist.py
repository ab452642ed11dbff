"""Nyquist's count against the poles of the closed loop, computed without a frequency response."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from stickslip.control.linear import place
from stickslip.core.errors import InputError
from stickslip.identification.response.drivetrain import LoopResponse
from stickslip.identification.response.nyquist import encirclements, fastest_pd

DT = 1e-3


def plant(load, mode, damping, delay, held):
    """Two inertias of 1e-3 kg·m² in all with a spring, the load's side free or held: discrete, with a delay."""
    motor = 1e-3 / (1.0 + load)
    load = 1e-3 - motor
    spring = motor * (2.0 * math.pi * mode) ** 2
    rub = 2.0 * damping * math.sqrt(spring * motor)
    if held:
        top, bottom = [1.0], [motor, rub, spring]
    else:
        top, bottom = (
            [load, rub, spring],
            np.convolve([1.0, 0.0, 0.0], [motor * load / 1e-3, rub, spring]) * 1e-3,
        )
    b, a, _ = signal.cont2discrete((top, bottom), DT, "zoh")
    return np.concatenate([np.zeros(delay), b.ravel()]), np.concatenate([a, np.zeros(delay)])


def unstable_poles(b, a, bandwidth):
    """Poles outside the unit circle of the loop under the PD of `stickslip.control.linear`, differences as velocity."""
    gains = place("PD", 1e-3, bandwidth, 1.0)
    pd = np.array([gains.kp + gains.kd / DT, -gains.kd / DT])
    closed = np.polyadd(np.convolve(a, [1.0, 0.0]), np.convolve(b, pd))
    return np.roots(closed)


def response(b, a, f):
    _, h = signal.freqz(b, a, worN=2.0 * math.pi * f * DT)
    return LoopResponse("it", f, h, np.ones(f.size), DT)


@given(
    load=st.floats(0.1, 3.0), mode=st.floats(30.0, 350.0), damping=st.floats(0.005, 0.2), delay=st.integers(0, 4),
    held=st.booleans(), bandwidth=st.floats(1.0, 100.0),
)  # fmt: skip
@settings(max_examples=150)
def test_the_count_is_half_the_unstable_poles(load, mode, damping, delay, held, bandwidth):
    b, a = plant(load, mode, damping, delay, held)
    poles = unstable_poles(b, a, bandwidth)
    sizes = np.abs(poles)
    if np.any((poles.real < -1.0) & (poles.imag == 0.0)):
        return  # one alone: it oscillates at half the sample rate, where a response has ended
    if np.any(np.abs(sizes - 1.0) < 2e-4) or np.any(np.abs(sizes[sizes > 1.0] - 1.0) < 2e-4):
        return  # on the edge the grid of frequencies decides
    count = encirclements(response(b, a, np.arange(0.25, 499.9, 0.25)), 1e-3, bandwidth)
    assert count.calm == (not np.any(sizes > 1.0))
    assert 2 * count.turns == np.sum(sizes > 1.0)


def locus(points, bandwidth=10.0):
    """A response whose locus under that PD is a polygon through the points, 1 Hz apart from 5 Hz on."""
    from stickslip.identification.response.nyquist import pd_response

    f = 5.0 + np.arange(len(points))
    return LoopResponse(
        "it", f, np.array(points) / pd_response(1e-3, bandwidth, 1.0, f, DT), np.ones(f.size), DT
    )


BACK = [
    -9.0 - 2.0j,
    -6.0 - 1.0j,
    -4.0 + 1.0j,
    -3.0 + 0.5j,
    -2.5 - 0.5j,
    -1.5 - 1.0j,
    -0.5 - 0.8j,
    -0.1 - 0.2j,
]
"""Crosses left of -1 upwards and, still left of it, downwards: conditionally stable."""
ROUND = [-9.0 - 2.0j, -6.0 - 1.0j, -4.0 + 1.0j, -2.0 + 1.5j, -0.5 + 1.0j, 0.3 + 0.1j, 0.2 - 0.2j, -0.1 - 0.2j]


def test_a_locus_that_comes_back_left_of_the_point_is_calm_and_one_that_goes_round_is_not():
    assert encirclements(locus(BACK), 1e-3, 10.0).calm
    round_it = encirclements(locus(ROUND), 1e-3, 10.0)
    assert (round_it.turns, round_it.frequency) == (1, pytest.approx(6.5))
    # A locus that is first seen above the axis has come from below it.
    assert encirclements(locus(ROUND[2:]), 1e-3, 10.0).turns == 1


def test_a_gap_is_neither_crossed_nor_passed_over():
    whole = locus(ROUND)
    kept = [i for i in range(len(ROUND)) if i not in (2, 3)]
    gap = replace(
        whole, frequency=whole.frequency[kept], response=whole.response[kept], coherence=whole.coherence[kept]
    )
    assert gap.gaps == ((6.0, 9.0),)
    count = encirclements(gap, 1e-3, 10.0)
    assert count.turns == 0
    assert count.unseen == (6.0, 9.0)
    assert not count.calm
    # A single line is seen from both sides: the locus goes on across it.
    kept = [0, 1, 3, 4, 5, 6, 7]
    line = replace(
        whole, frequency=whole.frequency[kept], response=whole.response[kept], coherence=np.ones(7)
    )
    assert line.gaps
    assert (encirclements(line, 1e-3, 10.0).turns, encirclements(line, 1e-3, 10.0).unseen) == (1, ())
    # One that lies where the loop is weak hides nothing.
    kept = [0, 1, 2, 3, 4, 7]
    weak = replace(
        whole, frequency=whole.frequency[kept], response=0.05 * whole.response[kept], coherence=np.ones(6)
    )
    assert weak.gaps
    assert not encirclements(weak, 1e-3, 10.0).unseen


def test_the_fastest_pd_says_what_it_does_not_see():
    b, a = plant(1.0, 80.0, 0.02, 1, True)
    f = np.arange(1.0, 450.0, 1.0)
    seen = fastest_pd([response(b, a, f)], 1e-3)
    assert "oscillates from" in seen.sentence
    poles = unstable_poles(b, a, seen.bandwidth)
    ringing = abs(np.angle(poles[np.argmax(np.abs(poles))])) / (2.0 * math.pi * DT)
    assert seen.frequency == pytest.approx(ringing, rel=0.02)
    with pytest.raises(InputError, match="no PD can be recommended"):
        fastest_pd([LoopResponse("it", f, -1e3 / f**2 + 10j, np.ones(f.size), DT)], 1e-3)


@pytest.mark.parametrize(
    ("held", "wide"),
    [(True, 2.5), (True, 12.0), (True, 20.0), (False, 2.5), (False, 12.0), (False, 30.0), (False, 60.0)],
)
def test_no_pd_that_rings_is_called_calm_where_its_ringing_is_hidden(held, wide):
    b, a = plant(1.0, 80.0, 0.02, 1, held)
    f = np.arange(1.0, 450.0, 1.0)
    seen = fastest_pd([response(b, a, f)], 1e-3)
    hidden = fastest_pd([response(b, a, f[np.abs(f - seen.frequency) > wide])], 1e-3)
    assert hidden.unseen
    assert "not seen between" in hidden.sentence
    assert hidden.bandwidth <= seen.bandwidth
    assert not np.any(np.abs(unstable_poles(b, a, 0.99 * hidden.bandwidth)) > 1.0)


def test_a_gap_that_may_hide_ringing_at_any_bandwidth_leaves_no_pd():
    b, a = plant(1.0, 80.0, 0.02, 1, True)
    f = np.arange(1.0, 450.0, 1.0)
    seen = fastest_pd([response(b, a, f)], 1e-3)
    # It rings from 18.3 Hz on, and was once said not to up to 100 Hz.
    with pytest.raises(InputError, match=r"not seen between .*: no PD can be recommended.*excite"):
        fastest_pd([response(b, a, f[np.abs(f - seen.frequency) > 60.0])], 1e-3)


def test_a_resonance_wholly_inside_a_gap_is_not_passed_over():
    inside = [0.3 - 0.1j, 0.3 - 0.1j, -2.0 - 0.2j, -2.0 + 0.2j, 0.3 - 0.1j, 0.2 - 0.05j]
    whole = locus(inside)
    assert encirclements(whole, 1e-3, 10.0).turns
    kept = [0, 1, 4, 5]
    gap = replace(whole, frequency=whole.frequency[kept], response=whole.response[kept], coherence=np.ones(4))
    assert encirclements(gap, 1e-3, 10.0).unseen == (6.0, 9.0)
