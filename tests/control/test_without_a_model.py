"""Laws that need no model of friction: what each adds along a motion made by hand, and leaves on a sticking axis."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import stickslip as ss
from stickslip.control.belief import Belief
from stickslip.control.block import ControlBlock
from stickslip.control.catalogue import compensated
from stickslip.core.errors import ParameterError
from stickslip.machines.files import machine
from stickslip.studies.bench_metrics import judged

INERTIA = 3.8623e-4
BELIEF = Belief(
    INERTIA, ss.Model("lugre", sigma0=3.5e4, sigma1=0.0, fs=0.335, fc=0.285, vs=0.01, sigma2=0.018),
    torque_limit=1.0, bandwidth=20.0,
)  # fmt: skip


def answered(block, **signals):
    """The law's torques, N·m, along signals of the loop, arrays or numbers."""
    usual = {"started": 1.0, "slow_velocity": 0.0, "error": 0.0, "commanded": 0.0}
    rows = np.broadcast_arrays(*({**usual, **signals}).values())
    z, names = block.state(), [*usual]
    return np.array([
        block.law.sample(SimpleNamespace(**dict(zip(names, map(float, row)))), z, block.parameters, None)
        for row in zip(*rows)
    ])  # fmt: skip


def standing(compensator, loop="PD"):
    """Largest error at which the thesis's axis comes to rest after steps of many sizes, rad."""
    law = ss.Model(
        "gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, fs=0.335, fc=0.285, vs=0.01, sigma2=0.018
    )
    controller = compensated(compensator, loop, BELIEF)
    left = []
    for size in (0.02, 0.05, 0.11):
        reference = ss.Reference("step", amplitude=size, tau=0.02)
        record = ss.simulate(
            ss.RigidAxis(INERTIA, law), controller, reference, 2.0, integrator="sampled", metered=False
        )
        left.append(abs(record.channels["position_reference"][-1] - record.channels["position"][-1]))
    return max(left)


# ---- nonlinear Coulomb --------------------------------------------------------------------------------------------


def test_with_the_pd_the_torque_is_that_above_break_away_from_the_layer_on():
    block = ControlBlock("nonlinear_coulomb", torque=0.4, gain=6.0, layer=5e-3)
    error = np.linspace(-0.1, 0.1, 401)
    whole = 6.0 * error + answered(block, error=error)
    inside, outside = np.abs(error) < 5e-3, np.abs(error) > 0.4 / 6.0
    between = ~inside & ~outside
    assert np.abs(whole[between]) == pytest.approx(0.4)
    assert np.array_equal(np.sign(whole), np.sign(error))
    assert whole[outside] == pytest.approx(6.0 * error[outside])
    assert np.all(np.abs(whole[inside]) <= 0.4)


def test_what_sticks_beside_a_pd_alone_comes_closer():
    alone, filled, sprung = (standing(name) for name in ("none", "nonlinear-coulomb", "nonlinear-maxwell"))
    values = compensated("nonlinear-coulomb", "PD", BELIEF).values()
    torque, gain, layer = (values[f"observer_{name}"] for name in ("torque", "gain", "layer"))
    # It rests where its torque is below break-away: gain e + (torque - gain e) e / layer = fs.
    slope = gain + torque / layer
    bound = (slope - np.sqrt(slope**2 - 4.0 * gain / layer * 0.335)) / (2.0 * gain / layer)
    assert filled <= bound
    assert alone > 2.0 * filled
    assert alone > sprung
    assert sprung < 0.335 / gain


# ---- nonlinear Maxwell-slip ---------------------------------------------------------------------------------------


def test_springs_take_energy_along_every_loop_of_the_error_and_slip_at_their_levels():
    block = ControlBlock("nonlinear_maxwell_slip", k=[12.0, 6.0, 3.0], w=[0.1, 0.1, 0.1])
    error = np.concatenate([[0.0], 0.1 * np.sin(np.linspace(0.0, 6.0 * np.pi, 6001))])
    torque = answered(block, error=error)
    assert np.abs(torque).max() == pytest.approx(0.3)
    taken = np.sum(0.5 * (torque[1:] + torque[:-1]) * np.diff(error))
    # A loop between -A and A takes 4 W (A - W / k) of each element that slips: two loops and the way back to 0.
    last = slice(4001, 6002)
    loop = np.sum(0.5 * (torque[last][1:] + torque[last][:-1]) * np.diff(error[last]))
    expected = sum(4.0 * 0.1 * (0.1 - 0.1 / k) for k in (12.0, 6.0, 3.0))
    assert loop == pytest.approx(expected, rel=1e-3)
    assert taken > 2.0 * loop
    all_at_once = answered(block, error=np.array([0.0, 1e-3]))
    assert all_at_once == pytest.approx([0.0, 0.021])


def test_the_springs_begin_where_the_error_is_at_the_first_sample():
    block = ControlBlock("nonlinear_maxwell_slip", k=[12.0], w=[0.1])
    torque = answered(block, error=np.array([0.5, 0.5]), started=np.array([0.0, 1.0]))
    assert list(torque) == [0.0, 0.0]


# ---- knocker ------------------------------------------------------------------------------------------------------


def test_pulses_follow_the_sign_of_the_torques_change_since_the_last_one():
    block = ControlBlock("knocker", torque=0.2, samples=5.0, width=2.0, least=1e-3)
    up, rest, down = np.linspace(0.0, 0.1, 11), np.full(10, 0.1), np.linspace(0.1, 0.0, 11)
    torque = answered(block, commanded=np.concatenate([up[1:], rest, down[1:]]))
    pulses = torque.reshape(-1, 5)
    assert np.all(pulses[:, 2:] == 0.0)
    assert list(pulses[:, 0]) == pytest.approx([0.2, 0.2, 0.2, 0.0, -0.2, -0.2])
    assert np.array_equal(pulses[:, 0], pulses[:, 1])


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ({"samples": 5.5}, "samples = 5.5 must be a whole number"),
        ({"width": 5.0}, "width = 5 must be less than"),
    ],
)
def test_pulses_that_never_end_are_refused(numbers, said):
    with pytest.raises(ParameterError, match=said):
        ControlBlock("knocker", **{"torque": 0.2, "samples": 5.0, "width": 2.0, **numbers})


def test_an_integral_with_pulses_breaks_away_sooner():
    """Along a slow sine the error of a PID is that of its waits; pulses shorten them."""
    axis = machine("thesis-dry")
    reference = ss.Reference("sine", amplitude=0.01, frequency=0.4)
    law, limit = axis.models["lugre"], axis.limits["torque"]
    belief = Belief(axis.inertia, law, sample_time=axis.sample_time, torque_limit=limit)
    errors = [
        judged(ss.simulate(axis, compensated(name, "PID", belief), reference, 2.5, metered=False))["rms_rad"]
        for name in ("none", "knocker")
    ]
    assert errors[1] < 0.8 * errors[0]


# ---- dither where the axis stands off -----------------------------------------------------------------------------


def test_dither_ends_with_the_error_that_it_is_there_for():
    block = ControlBlock("dither", None, {"given": "stuck"}, torque=0.2, samples=4.0, error=2e-3, speed=0.02)
    wave = np.array([1.0, 1.0, -1.0, -1.0])
    assert answered(block, error=np.full(4, 3e-3)) == pytest.approx(0.2 * wave)
    assert answered(block, error=np.full(4, 1e-3)) == pytest.approx(0.1 * wave)
    assert not answered(block, error=np.zeros(4)).any()
    assert not answered(block, error=np.full(4, 3e-3), slow_velocity=0.03).any()
