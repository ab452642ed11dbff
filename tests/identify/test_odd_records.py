"""Records in which nothing moves or nothing drives, and others that no axis makes: a sentence, or a result."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import InputError
from stickslip.identification.fit.multistart import separable_starts
from stickslip.identification.fit.parameter_vector import Vector

T = np.arange(2000) * 1e-3
MOVES = 0.3 * np.sin(2.0 * np.pi * T)
DRIVES = 0.3 * np.sign(np.cos(2.0 * np.pi * T))
NOTHING = np.zeros(T.size)
WAYS = [{}, {"law": "coulomb"}, {"inverse": True}, {"per_direction": True}, {"pendulum": True}]


def accepted(position, torque, t=T):
    """What the doctor holds for errors, which somebody may take for right."""
    return [f.code for f in ss.doctor(t=t, position=position, torque=torque).errors]


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_an_axis_that_never_moved(way):
    still = np.full(T.size, 0.77)
    with pytest.raises(InputError, match=r"0\.77 throughout, so that the axis never moved"):
        ss.identify(t=T, position=still, torque=DRIVES, accept=accepted(still, DRIVES), **way)


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_a_torque_that_is_nought(way):
    with pytest.raises(InputError, match="signal is 0 wherever the axis moves"):
        ss.identify(t=T, position=MOVES, torque=NOTHING, accept=accepted(MOVES, NOTHING), **way)


def test_motion_in_one_record_and_torque_in_another():
    logs = [ss.Record(T, {"position": q, "motor_torque": u}, {"position": "rad", "motor_torque": "N·m"})
            for q, u in ((MOVES, NOTHING), (NOTHING, DRIVES))]  # fmt: skip
    with pytest.raises(InputError, match="signal is 0 wherever the axis moves"):
        ss.identify(*logs, accept=["never-moved", "no-torque"])


@pytest.mark.parametrize(("position", "torque"), [(NOTHING, DRIVES), (MOVES, NOTHING)])
def test_a_loop_of_one_that_never_changes(position, torque):
    with pytest.raises(InputError, match="throughout: without motion and torque there is no loop"):
        ss.identify(
            t=T, position=position, torque=torque, method="hysteresis", accept=accepted(position, torque)
        )


def test_blocks_on_which_other_parameters_act_are_compared():
    """A square wave: without the rows of one block, an element of a law does not act any more."""
    w = 2.0 * np.pi / T[-1] * 3.0
    position = 3.5e-3 * np.sign(np.sin(w * T))
    velocity = np.gradient(position, T)
    torque = 2e-3 * np.gradient(velocity, T) + 5.0 * np.sign(velocity)
    torque += np.random.default_rng(72).normal(0.0, 0.5, T.size)
    found = ss.identify(
        t=T, position=position, torque=torque, method="hysteresis", accept=accepted(position, torque)
    )
    assert found.parameters


def test_a_response_of_an_axis_that_never_moved():
    t = np.arange(25000) * 1e-3
    torque = np.random.default_rng(0).normal(size=t.size)
    still = np.full(t.size, 0.77)
    with pytest.raises(InputError, match=r"record: the position is .* the axis never moved"):
        ss.identify(t=t, position=still, torque=torque, method="inertia", accept=["never-moved"])


def test_an_inertia_below_nothing_has_no_resonance():
    """A torque of the wrong sign, which somebody has accepted."""
    rng = np.random.default_rng(1)
    t = np.arange(30000) * 1e-3
    torque = rng.normal(size=t.size)
    velocity = np.cumsum(-torque) * 1e-3 / 0.01
    position = np.cumsum(velocity - np.linspace(velocity[0], velocity[-1], t.size)) * 1e-3
    found = ss.identify(
        t=t, position=position, torque=torque, method="inertia", accept=accepted(position, torque, t)
    )
    assert found.parameters["inertia"].value < 0.0
    assert found.parameters["inertia"].verdict != "identified"


def test_a_rotation_shorter_than_the_window_of_its_slopes():
    t = np.arange(40) * 2e-4
    position, torque = 1e-3 * np.sin(300.0 * t), np.cos(300.0 * t)
    with pytest.raises(InputError, match="places are left"):
        ss.identify(
            t=t, position=position, torque=torque, method="cogging", accept=accepted(position, torque, t)
        )


def test_a_level_that_has_gone_to_nothing_is_started_from():
    vector = Vector(ss.Model("coulomb", fc=1e-100), limits={"fc": (1e-101, 1e-99)})
    v = np.linspace(-1.0, 1.0, 40)

    def model(values):
        named = dict(zip(vector.names, values, strict=True))
        return named["fc"] * np.sign(v) + named["sigma2"] * v

    starts = separable_starts(model, 3.0 * np.sign(v) + v, vector, 3)
    assert starts.shape == (4, vector.size)
    assert np.all(np.isfinite(starts))


@pytest.mark.parametrize("moves", [slice(0, 70), slice(-70, None), slice(0, 200)])
def test_a_motion_at_the_ends_alone_is_looked_at(moves):
    """Where filters settle there is nothing to regress on."""
    position, torque = np.zeros(1500), np.random.default_rng(3).normal(0.0, 1.0, 1500)
    position[moves] = np.cumsum(np.random.default_rng(4).normal(0.0, 1.0, position[moves].size))
    found = ss.doctor(t=np.arange(1500) * 1e-3, position=position, torque=torque)
    assert "torque-sign" not in {f.code for f in found.findings}
