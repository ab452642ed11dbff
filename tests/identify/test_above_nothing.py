"""Inertia and friction's level where they are not identified: a number of use, and never none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import stickslip as ss
from stickslip.binding import NEGATIVE
from stickslip.identify.axis.above_nothing import above_zero
from stickslip.identify.axis.settled import settled
from stickslip.identify.axis.settled_each_way import settled_each_way
from stickslip.identify.estimate import Estimate
from stickslip.identify.experiment import Experiment
from stickslip.identify.regression.inverse import InverseDynamics, inverse_dynamics
from stickslip.machines.servo import ServoAxis
from stickslip.model import Model
from stickslip.record import Record

INERTIA, LEVEL, SLOPE = 2e-3, 0.3, 0.01
PLAIN = {"inertia": "inertia", "fc": "fc", "sigma2": "fv"}


def record(seed: int, noise: float, way: float = 0.05) -> Record:
    """Slow sines, friction that builds up over a way behind every reversal (Dahl): least squares see it as an inertia
    below 0."""
    t = np.arange(0.0, 12.0, 2e-3)
    q = np.sin(1.5 * t) + 0.4 * np.sin(0.55 * t)
    v = np.gradient(q, t)
    friction = np.zeros(t.size)
    for i, step in enumerate(np.diff(q), 1):
        side = np.sign(step)
        friction[i] = side - (side - friction[i - 1]) * math.exp(-abs(step) / way)
    rng = np.random.default_rng(seed)
    torque = INERTIA * np.gradient(v, t) + LEVEL * friction + SLOPE * v + noise * rng.standard_normal(t.size)
    channels = {"position": np.round(q / 1e-5) * 1e-5, "motor_torque": torque}
    return Record(t, channels, {"position": "rad", "motor_torque": "N·m"})


@pytest.mark.parametrize("noise", [0.003, 0.02])
def test_an_inertia_that_reversals_hide_is_that_of_sliding_and_not_identified(noise: float) -> None:
    found = ss.identify(record(1, noise))
    inertia = found["inertia"]
    assert not inertia.identified
    assert inertia.lower < INERTIA < inertia.upper
    assert 0.3 * INERTIA < inertia.value < 3.0 * INERTIA
    assert found["fc"].value == pytest.approx(LEVEL, rel=0.05)


# ---- what the whole record puts at a bound -----------------------------------------------------------------------


def seen(inertia: float, level: float, slope: float) -> InverseDynamics:
    """Plain least squares of a record that asks for these numbers, whatever they are."""
    t = np.arange(0.0, 10.0, 2e-3)
    q = np.sin(1.3 * t) + 0.5 * np.sin(3.1 * t)
    v = np.gradient(q, t)
    torque = inertia * np.gradient(v, t) + level * np.sign(v) + slope * v
    noise = 0.003 * np.random.default_rng(1).standard_normal(t.size)
    return inverse_dynamics([Experiment("made", t, q, torque + noise)], ServoAxis(drive_side="load"))


def told(name: str, value: float, identified: bool = False, half: float = 0.5) -> Estimate:
    low, high = value - half * abs(value), value + half * abs(value)
    verdict = "" if identified else "why"
    return Estimate(name, "N·m", "x", value, (high - low) / 3.92, low, high, identified, verdict)


@pytest.mark.parametrize(
    ("inverse", "hidden"), [(seen(-1e-3, 0.3, 0.02), "inertia"), (seen(4e-3, -0.05, 0.2), "fc")]
)
def test_a_number_stays_where_the_whole_record_would_have_none_of_it(
    inverse: InverseDynamics, hidden: str
) -> None:
    values = {"inertia": 4e-3, "offset": 0.0, "fc": 0.1, "sigma2": 0.02}
    given = [told(n, x) for n, x in values.items()]
    found, _ = settled(given, Model("coulomb", fc=0.1, sigma2=0.02), inverse)
    after = {e.name: e for e in found}
    (before,) = (e for e in given if e.name == hidden)
    assert inverse[PLAIN[hidden]] < 0.0
    assert after[hidden] == before
    # What stays free goes with it: the torque is explained as well as can be beside this number.
    again, _ = settled(found, Model("coulomb", fc=after["fc"].value, sigma2=after["sigma2"].value), inverse)
    assert [e.value for e in again] == pytest.approx([e.value for e in found], rel=1e-6, abs=1e-9)


def test_each_direction_keeps_its_level_and_the_inertia() -> None:
    values = {"inertia": 4e-3, "fc": 0.1, f"fc{NEGATIVE}": 0.12, "sigma2": 0.02, f"sigma2{NEGATIVE}": 0.02}
    given = [told(n, x) for n, x in values.items()]
    law = {n: x for n, x in values.items() if n != "inertia"}
    found = settled_each_way(
        given, Model("coulomb", {"symmetry": "asymmetric"}, **law), seen(4e-3, -0.05, 0.2), falls=False
    )
    after = {e.name: e.value for e in found}
    assert (after["fc"], after[f"fc{NEGATIVE}"]) == (0.1, 0.12)
    assert after["sigma2"] != 0.02


def test_identified_numbers_do_not_change_with_it() -> None:
    inverse = seen(-1e-3, 0.3, 0.02)
    values = {"inertia": 4e-3, "offset": 0.01, "fc": 0.28, "sigma2": 0.025}
    given = [told(n, x, n != "inertia") for n, x in values.items()]
    model = Model("coulomb", fc=0.28, sigma2=0.025)
    # One that is below its bound from the beginning has nothing to be put back to.
    none = [replace(e, value=0.0, lower=0.0, std=0.0) if e.name == "inertia" else e for e in given]
    found, without = settled(given, model, inverse)[0], settled(none, model, inverse)[0]
    assert [e for e in found if e.name != "inertia"] == [e for e in without if e.name != "inertia"]
    assert found[0].value == 4e-3
    assert 0.0 < without[0].value < 1e-6


def test_a_number_that_would_leave_more_than_the_torque_is_not_kept() -> None:
    given = [told(n, x) for n, x in {"inertia": 4e-3, "offset": 0.0, "fc": 30.0, "sigma2": 0.02}.items()]
    found, _ = settled(given, Model("coulomb", fc=30.0, sigma2=0.02), seen(4e-3, -0.05, 0.2))
    assert next(e.value for e in found if e.name == "fc") == 0.0


@pytest.mark.parametrize("middle", [-0.1, -1.0, -1.9])
def test_of_an_interval_that_was_cut_off_at_0_the_mean_of_the_rest_is_taken(middle: float) -> None:
    cut = Estimate("inertia", "kg·m²", "J", 0.0, 1.0, 0.0, middle + 1.96, False, "why")
    draws = middle + np.random.default_rng(3).standard_normal(400_000)
    assert above_zero(cut) == pytest.approx(float(np.mean(draws[draws > 0.0])), rel=0.02)
    whole = replace(cut, value=0.5)
    assert above_zero(whole) == 0.5
