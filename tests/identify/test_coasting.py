"""Friction from a coast-down: the torque is off, and the known inertia tells the friction by its deceleration."""

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import InputError

INERTIA, FC, SIGMA2 = 2e-3, 0.05, 4e-4


def coast_down(start, seed=0, seconds=5.0, offset=0.0):
    """Times and noisy positions of an axis that slows down from a speed, rad/s, by the closed form while it slides."""
    time = np.arange(0.0, seconds, 1e-3)
    side = np.sign(start)
    level, rate = FC + side * offset, SIGMA2 / INERTIA
    end = level / SIGMA2
    stop = np.log(1.0 + abs(start) / end) / rate
    t = np.minimum(time, stop)
    position = side * ((abs(start) + end) / rate * (1.0 - np.exp(-rate * t)) - end * t)
    return time, position + np.random.default_rng(seed).normal(0.0, 1e-5, time.size)


def log(start, torque=0.0, **more):
    time, position = coast_down(start, **more)
    return {"t": time, "position": position, "torque": np.full(time.size, torque)}


@pytest.mark.parametrize("seed", range(4))
def test_both_directions_determine_friction_and_the_constant_torque(seed):
    logs = [log(start, seed=seed + 10 * k, offset=0.01) for k, start in enumerate((80.0, -80.0))]
    found = ss.identify(*logs, method="sliding", law="coulomb", inertia=INERTIA)
    for name, truth in (("fc", FC), ("sigma2", SIGMA2), ("offset", 0.01)):
        estimate = found.parameters[name]
        assert estimate.identified
        assert estimate.value == pytest.approx(truth, rel=0.05)
        assert estimate.interval[0] - 0.01 * truth < truth < estimate.interval[1] + 0.01 * truth


def test_one_direction_determines_friction_of_a_level_axis_only():
    options = {"method": "sliding", "law": "coulomb", "inertia": INERTIA}
    assert not ss.identify(log(80.0), **options).parameters["fc"].identified
    level = ss.identify(log(80.0), **options, values={"offset": 0.0}, frozen=["offset"])
    assert level.parameters["fc"].identified
    assert level.parameters["fc"].value == pytest.approx(FC, rel=0.03)


def test_a_log_without_a_torque_will_do():
    time, position = coast_down(80.0)
    found = ss.identify(
        t=time, position=position, method="sliding", law="coulomb", inertia=INERTIA, values={"offset": 0.0},
        frozen=["offset"],
    )  # fmt: skip
    assert found.parameters["fc"].value == pytest.approx(FC, rel=0.03)


def test_a_log_in_which_a_torque_acts_is_refused():
    with pytest.raises(InputError, match="motor_torque is not 0 throughout; select the coasting"):
        ss.identify(log(80.0, torque=0.1) | {"torque": np.linspace(0.1, 0.2, 5000)},
                    method="sliding", law="coulomb", inertia=INERTIA)  # fmt: skip


def test_without_the_inertia_the_error_names_it():
    with pytest.raises(InputError, match='method="sliding" with inertia='):
        ss.identify(log(80.0), method="axis", law="coulomb")


def test_an_inertia_that_is_not_positive_is_refused():
    for inertia in (0.0, -1e-3):
        with pytest.raises(InputError, match="must be greater than 0"):
            ss.identify(log(80.0), method="sliding", law="coulomb", inertia=inertia)


def test_the_torque_that_is_off_is_no_warning_of_a_coast_down():
    logs = [log(80.0), log(-80.0)]
    found = ss.identify(*logs, method="sliding", law="coulomb", inertia=INERTIA)
    assert "no-torque" not in str(found.verdict)
