"""How fast a disturbance observer may be, against the reference's exact limits (grid of 5 rad/s)."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from stickslip.analyse.observer_corner import DAMPING, HIGHEST, damped, default_corner, largest_corner, poles
from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.core.errors import ParameterError
from stickslip.core.spec import Surroundings

INERTIA = 3.8623e-4
W = 40.0 * np.pi
PD = ControlBlock("pd", kp=INERTIA * W**2, kd=2.0 * INERTIA * W)


def with_observer(corner, **choices):
    helper = ControlBlock("disturbance_observer", None, choices, inertia=INERTIA, corner=corner)
    return Controller(loop=PD, sample_time=1e-3, observer=helper)


LIMITS = [  # inertia over the nominal one, delay in samples, choices, largest stable corner, with damping 0.3
    (0.5, 0, {}, 1240.0, 260.0),
    (1.0, 0, {}, HIGHEST, 1305.0),
    (2.0, 0, {}, HIGHEST, HIGHEST),
    (0.5, 1, {}, 125.0, 0.0),
    (1.0, 1, {}, 585.0, 195.0),
    (2.0, 1, {}, HIGHEST, 665.0),
    (1.0, 1, {"form": "textbook"}, 710.0, 210.0),
    (1.0, 1, {"order": "second"}, 895.0, 320.0),
    (0.5, 1, {"aligned": "yes", "delay": 1.0}, 580.0, 0.0),
]


@pytest.mark.parametrize(("ratio", "delay", "how", "stable", "calm"), LIMITS)
def test_limits_are_those_of_the_reference(ratio, delay, how, stable, calm):
    choices = {k: v for k, v in how.items() if isinstance(v, str)}

    def made(corner):
        helper = ControlBlock(
            "disturbance_observer", None, choices, inertia=INERTIA, corner=corner, delay=how.get("delay", 0.0)
        )
        return Controller(loop=PD, sample_time=1e-3, observer=helper)

    assert largest_corner(made, ratio * INERTIA, delay) == pytest.approx(stable, abs=5.0)
    assert largest_corner(made, ratio * INERTIA, delay, DAMPING) == pytest.approx(calm, abs=5.0)


def test_a_loop_beyond_its_limit_grows_and_one_below_decays():
    for corner, grows in ((115.0, False), (135.0, True)):
        controller = with_observer(corner)
        sample, z, m = controller.functions["sample"], controller.state(), controller.memory()
        n, p = controller.settings, controller.parameters
        u = SimpleNamespace(**Surroundings()._asdict())
        position, velocity, held, sizes = 1e-3, 0.0, 0.0, []
        for _ in range(4000):
            torque = sample(position, 0.0, 0.0, 0.0, n, m, z, p, u)
            acceleration = held / (0.5 * INERTIA)
            position += 1e-3 * velocity + 0.5e-6 * acceleration
            velocity += 1e-3 * acceleration
            held = torque
            sizes.append(abs(position))
        assert (max(sizes[-200:]) > max(sizes[:200])) == grows
        assert (np.abs(poles(controller, 0.5 * INERTIA, 1)).max() > 1.0) == grows


def test_the_default_corner_keeps_its_damping_with_the_inertia_off_and_no_larger_one_does():
    found = default_corner(with_observer(400.0))
    for ratio in (0.8, 1.0, 1.25):
        assert damped(poles(with_observer(found), ratio * INERTIA), DAMPING)
    assert not all(damped(poles(with_observer(found + 2.0), x * INERTIA), DAMPING) for x in (0.8, 1.0, 1.25))
    assert default_corner(with_observer(400.0), 1) < 0.5 * found


def test_only_a_disturbance_observer_has_a_default_corner():
    with pytest.raises(ParameterError, match="the controller has no disturbance_observer; give it one"):
        default_corner(Controller(loop=PD, sample_time=1e-3))
