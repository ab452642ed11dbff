"""The simulation of an axis that a recorded signal drives, against the other integrators and closed forms."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from stickslip import Controller, Gains, Model, Reference, RigidAxis, simulate
from stickslip.core.errors import InputError
from stickslip.models.plugins import law
from stickslip.simulation.recorded_input.simulation import (
    Course,
    Drive,
    Harmonics,
    Loop,
    Mechanics,
    drive_axis,
)

INERTIA = 4e-4
LAWS = ("coulomb", "stribeck", "lugre", "gms")


def example(name: str) -> Model:
    found = law(name)
    return Model(found, **found.example)


def sine(period: float = 1e-3, end: float = 1.0, amplitude: float = 0.5) -> Drive:
    time = np.arange(0.0, end, period)
    return Drive(time, amplitude * np.sin(2.0 * math.pi * 2.0 * time), "linear", max_step=1e-4)


@pytest.mark.parametrize("name", LAWS)
def test_a_sampled_loop_moves_as_the_sampled_integrator_says(name: str) -> None:
    reference = Reference("sine", amplitude=0.3, frequency=1.0)
    gains = Gains(kp=20.0, kd=0.2)
    record = simulate(RigidAxis(INERTIA, example(name)), Controller(gains, sample_time=1e-3), reference, 1.0)
    time = np.arange(0.0, 1.0, 1e-3)
    wanted = reference.sample(time)[:, 0]
    drive = Drive(time, wanted, "feedback", Loop(kp=20.0, kd=0.2), max_step=2e-5)
    out = drive_axis(Mechanics(INERTIA), example(name), drive)
    errors = np.abs(out[:, 0] - np.interp(time, record.time, record["position"]))
    # Of a motion of 0.3 rad. A contact that sticks at a sample or just after it differs for a while.
    assert np.max(errors) < 3e-4
    assert np.median(errors) < 1e-7


@pytest.mark.parametrize("name", LAWS)
def test_shorter_steps_change_little(name: str) -> None:
    coarse, fine = (
        drive_axis(Mechanics(INERTIA), example(name), Drive(d.time, d.signal, "linear", max_step=h))
        for d, h in ((sine(), 1e-4), (sine(), 1e-5))
    )
    assert np.max(np.abs(coarse[:, 0] - fine[:, 0])) < 2e-3 * np.ptp(fine[:, 0])


def test_linear_motion_is_second_order() -> None:
    friction = Model("coulomb", fc=0.0, sigma2=2e-3)
    time = np.linspace(0.0, 1.0, 101)
    tau = INERTIA / 2e-3
    exact = 0.1 / 2e-3 * (time - tau * (1.0 - np.exp(-time / tau)))
    errors = []
    for h in (1e-2, 5e-3):
        drive = Drive(time, np.full(time.size, 0.1), max_step=h)
        errors.append(np.max(np.abs(drive_axis(Mechanics(INERTIA), friction, drive)[:, 0] - exact)))
    assert 3.4 < errors[0] / errors[1] < 4.6


def test_torque_below_breakaway_does_not_move_a_contact_that_holds() -> None:
    drive = Drive(np.linspace(0.0, 1.0, 201), 0.28 * np.ones(201))
    out = drive_axis(Mechanics(INERTIA), example("coulomb"), drive)  # F_C = 0.285 N·m
    assert np.all(out[:, 0] == 0.0)
    moved = drive_axis(Mechanics(INERTIA, offset=-0.01), example("coulomb"), drive)
    assert moved[-1, 0] > 0.0


def test_a_stiff_contact_comes_to_rest_at_long_steps() -> None:
    # omega dt = 80 for the four elements of Table 1 and steps of 10 ms.
    time = np.arange(0.0, 2.0, 1e-2)
    out = drive_axis(
        Mechanics(INERTIA), example("gms"), Drive(time, np.zeros(time.size), start=(0.0, 3.0), max_step=1e-2)
    )
    assert np.max(np.abs(out[-100:, 1])) < 1e-9


def test_a_pendulum_swings_at_its_frequency() -> None:
    m_l2, mgl = 0.49 * 0.1**2, 0.49 * 9.81 * 0.1
    time = np.arange(0.0, 5.0, 1e-3)
    drive = Drive(time, np.zeros(time.size), start=(0.02, 0.0), max_step=1e-4)
    out = drive_axis(Mechanics(m_l2, gravity=mgl), Model("coulomb", fc=0.0), drive)
    falls = time[1:][(out[1:, 0] <= 0.0) & (out[:-1, 0] > 0.0)]
    assert np.mean(np.diff(falls)) == pytest.approx(2.0 * math.pi * math.sqrt(0.1 / 9.81), rel=1e-3)


def test_irregular_times_sample_the_same_motion() -> None:
    regular = sine()
    keep = np.sort(np.random.default_rng(1).choice(regular.time.size, 400, replace=False))
    keep[0] = 0
    # A signal that is linear between the kept times.
    torque = np.interp(regular.time, regular.time[keep], regular.signal[keep])
    whole = drive_axis(
        Mechanics(INERTIA), example("lugre"), Drive(regular.time, torque, "linear", max_step=1e-4)
    )
    part = drive_axis(
        Mechanics(INERTIA),
        example("lugre"),
        Drive(regular.time[keep], regular.signal[keep], "linear", max_step=1e-4),
    )
    assert np.max(np.abs(whole[keep, 0] - part[:, 0])) < 1e-3 * np.ptp(whole[:, 0])


def test_load_scales_friction_and_position_modulates_it() -> None:
    time = np.linspace(0.0, 0.2, 201)
    drive = Drive(time, np.full(time.size, 0.5), start=(0.0, 10.0))
    friction = Model("coulomb", fc=0.1)
    loaded = drive_axis(Mechanics(INERTIA, load_motor=2.0), friction, drive)  # load 1 + 2 * 0.5
    doubled = drive_axis(Mechanics(INERTIA), Model("coulomb", fc=0.2), drive)
    assert np.allclose(loaded, doubled, rtol=1e-9)
    once = Harmonics(friction=((0.5, 0.0),))
    rough = drive_axis(
        Mechanics(1e6, harmonics=once), friction, Drive(time, np.zeros(201), start=(0.0, 1e-3))
    )
    smooth = drive_axis(
        Mechanics(1e6), Model("coulomb", fc=0.15), Drive(time, np.zeros(201), start=(0.0, 1e-3))
    )
    assert np.allclose(rough[:, 1], smooth[:, 1], rtol=1e-6)


def test_an_observer_pulls_the_axis_to_what_was_measured() -> None:
    drive = sine()
    measured = drive_axis(Mechanics(INERTIA, offset=0.05), example("coulomb"), drive)
    blind = drive_axis(Mechanics(INERTIA), example("coulomb"), drive)
    pulled = drive_axis(
        Mechanics(INERTIA), example("coulomb"),
        Drive(
            drive.time, drive.signal, "linear", position=measured[:, 0], spring=5.0,
            damping=np.full(drive.time.size, 0.1), goal=np.append(measured[1:, 1], 0.0),
        ),
    )  # fmt: skip
    assert np.std(pulled[:, 0] - measured[:, 0]) < 0.05 * np.std(blind[:, 0] - measured[:, 0])
    # What the model lacks, the observer supplies: the offset, while the axis moves.
    moving = np.abs(measured[:, 1]) > 1.0
    assert np.median(pulled[moving, 3]) == pytest.approx(-0.05, abs=0.01)


@pytest.mark.parametrize("play", [0.0, 0.02, 0.1])
def test_under_the_true_parameters_an_observer_adds_nothing(play: float) -> None:
    time = 1e-3 * np.arange(3000)
    axis, law = Mechanics(1e-3, backlash=play), example("lugre")
    torque = 1.5 * np.sin(8.0 * time)
    measured = drive_axis(axis, law, Drive(time, torque, "held"))
    assert np.ptp(measured[:, 0]) > 0.5
    velocity = np.append(np.diff(measured[:, 0]) / 1e-3, 0.0)
    watched = Drive(
        time, torque, "held", position=measured[:, 0], spring=4.0, damping=np.full(time.size, 0.126), goal=velocity,
        forgets=0.6,
    )  # fmt: skip
    found = drive_axis(axis, law, watched)
    assert np.max(np.abs(found[:, 0] - measured[:, 0])) < 1e-4
    assert np.std(found[:, 3]) < 1e-3 * np.std(torque)


def test_a_firm_observer_sticks_and_slips_with_the_axis() -> None:
    """Friction that falls steeply with velocity: the true model is told from a wrong one only where nothing parts."""
    contact = Model("stribeck", k=5000.0, fs=0.5, fc=0.3, vs=0.05, sigma2=0.01)
    time = 1e-3 * np.arange(3000)
    travel = np.where(time < 2.5, 0.4 * time, 1.0)
    true, loop = Mechanics(INERTIA, offset=0.02), Loop(kp=5.0, kd=0.02)
    push = 0.02 * np.sin(40.0 * time) * np.cos(17.0 * time)
    measured = drive_axis(true, contact, Drive(time, travel, "feedback", loop, disturbance=push))
    assert np.mean(np.abs(measured[:, 1]) < 1e-3) > 0.2  # it sticks between its slips
    velocity = np.append(np.diff(measured[:, 0]) / 1e-3, 0.0)
    firm = Drive(
        time, measured[:, 2], "held", position=measured[:, 0], damping=np.full(time.size, INERTIA / 2e-4),
        goal=velocity, firm=np.ones(time.size, dtype=np.bool_), returns=100.0,
    )  # fmt: skip
    found = drive_axis(true, contact, firm)
    assert np.max(np.abs(found[:, 0] - measured[:, 0])) < 1e-3
    # The moment at which it breaks away lies somewhere within a sample.
    sliding = np.array([np.all(np.abs(velocity[max(k - 5, 0) : k + 1]) > 0.2) for k in range(time.size)])
    # What is added is the disturbance, and without the offset that, too.
    assert np.std((found[:, 3] - push)[sliding]) < 0.25 * np.std(push[sliding])
    without = drive_axis(Mechanics(INERTIA), contact, firm)
    assert np.median((without[:, 3] - push)[sliding]) == pytest.approx(-0.02, abs=0.003)


def test_backlash_hides_small_motion() -> None:
    drive = sine()
    free = drive_axis(Mechanics(INERTIA), example("coulomb"), drive)
    played = drive_axis(Mechanics(INERTIA, backlash=0.02), example("coulomb"), drive)
    assert np.max(np.abs(free[:, 0] - played[:, 0])) == pytest.approx(0.01, rel=1e-6)


def test_a_law_of_ones_own_is_driven_too(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "CONTRIBUTING.md").read_text(encoding="utf-8")
    block = next(b for b in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if "LAW = Law(" in b)
    (tmp_path / "dahl.py").write_text(block, encoding="utf-8")
    own = law(str(tmp_path / "dahl.py"))
    out = Course(own, sine()).run(Mechanics(INERTIA), own.parameters(dict(own.example)))
    assert np.all(np.isfinite(out))
    assert np.ptp(out[:, 0]) > 1e-3


def test_a_course_asked_again_is_asked_anew_where_anything_differs() -> None:
    model, axis = example("stribeck"), Mechanics(INERTIA)
    course = Course(model.law, sine())
    first = course.run(axis, model.parameters)
    kept = first.copy()
    first[:] = math.nan  # What a caller does to its copy is its own affair.
    assert np.array_equal(course.run(axis, model.parameters), kept)
    other = model.parameters._replace(fc=1.1 * model.parameters.fc)
    asked = [
        {"gain": 0.5}, {"start": np.array([0.1, 0.0])}, {"start": (0.0, 0.2)}, {"gain": 0.5, "start": (0.0, 0.2)},
    ]  # fmt: skip
    runs = [course.run(axis, model.parameters, **a) for a in asked] + [course.run(axis, other)]  # type: ignore[arg-type]
    fresh = [Course(model.law, sine()).run(axis, model.parameters, **a) for a in asked]  # type: ignore[arg-type]
    fresh.append(Course(model.law, sine()).run(axis, other))
    for one, alone in zip(runs, fresh, strict=True):
        assert np.array_equal(one, alone)
        assert not np.array_equal(one, kept)


def test_bad_drives_are_refused() -> None:
    time = np.array([0.0, 1.0, 1.0])
    with pytest.raises(InputError, match="ascend strictly"):
        Drive(time, time)
    with pytest.raises(InputError, match="'fedback'"):
        Drive(np.arange(3.0), time, "fedback")
    with pytest.raises(InputError, match="both or neither"):
        Drive(np.arange(3.0), time, "feedback")
    with pytest.raises(InputError, match="shape"):
        Drive(np.arange(3.0), np.zeros(4))
