"""The loop about rest against the drive's own samples, known answers and simulations."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from stickslip.analyse.machine_axis import axis_of
from stickslip.analyse.presliding_loop import Axis, Drive, Loop, describing
from stickslip.analyse.stability import gain_margin, stability
from stickslip.control.compensator import Feedback
from stickslip.control.controller import Controller
from stickslip.control.linear import Gains, place
from stickslip.core.errors import ParameterError
from stickslip.core.spec import Surroundings
from stickslip.machines.drivetrain import Drivetrain, LinearContact
from stickslip.machines.files import machine
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate
from support.sampled_text import Memory, sampled_by, settings

J = 4.2757e-4
DRY = machine("thesis-dry")
RIGID = DRY.without("flexibility", "encoder-mode", "bearings", "direction", "bandwidth")
GMS = DRY.models["gms"]
PD36 = place("PD", 3.8623e-4, 36.0, 1.0)


# ---- describing functions --------------------------------------------------------------------------------------


def test_coulombs_describing_function_is_the_relays():
    found = describing(Model("coulomb", fc=0.3), 1e-3, 50.0)
    w = 2.0 * math.pi * 50.0
    assert found.damping == pytest.approx(4.0 * 0.3 / (math.pi * 1e-3 * w), rel=1e-3)
    assert found.stiffness < 1e-9


def test_a_sticking_contact_is_its_spring_and_slipping_softens_it():
    small = describing(GMS, 1e-6, 100.0)
    assert small.stiffness == pytest.approx(388.157, rel=1e-3)
    assert small.damping == pytest.approx(0.0263, rel=1e-3)
    large = describing(GMS, 2e-3, 100.0)
    assert large.stiffness < 0.6 * small.stiffness
    assert large.damping > 2.0 * small.damping
    lugre = describing(DRY.models["lugre"], 1e-7, 100.0)
    assert lugre.stiffness == pytest.approx(120.0, rel=1e-3)
    assert lugre.damping == pytest.approx(0.01 + 0.0263, rel=1e-2)


# ---- the linear parts are those that run --------------------------------------------------------------------------


@pytest.mark.parametrize("filter_hz", [0.0, 10.0, 120.0])
@pytest.mark.parametrize("gains", [PD36, Gains(60.0, 4500.0, 0.26, 0.26)])
def test_the_drive_is_the_sampled_controller(gains, filter_hz):
    controller = Controller(gains, Feedback(GMS, 0.7, filter_hz or None), sample_time=1e-3)
    n, m = settings(controller), SimpleNamespace(**dict.fromkeys(Memory._fields, 0.0))
    z, u = GMS.law.state(GMS.parameters), SimpleNamespace(**Surroundings()._asdict())
    run = sampled_by(GMS.law)
    angles = 1e-9 * np.concatenate([[0.0], np.random.default_rng(3).standard_normal(200).cumsum()])
    told = [run(float(x), 0.0, 0.0, 0.0, n, m, z, GMS.parameters, u) for x in angles]

    drive = Drive(gains, LinearContact(sum(GMS.parameters.k), 0.0263), 0.7, filter_hz)
    a, b, c, d = drive.state_space()
    state, found = np.zeros((a.shape[0], 1)), []
    for x in angles:
        found.append((c @ state).item() + d * x)
        state = a @ state + b * x
    assert found == pytest.approx(told, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("name", ["thesis-dry", "thesis-grease"])
def test_the_contact_is_as_stiff_as_the_machine_says(name):
    plant = machine(name)
    assert axis_of(plant).at(1e-7, 150.0).visible == pytest.approx(plant.visible_stiffness, rel=2e-3)


# ---- known answers --------------------------------------------------------------------------------------------------


def test_poles_of_a_free_inertia_are_where_they_were_placed():
    """With fast samples the loop without friction has the poles of the design (thesis eq. 3.10)."""
    drive = Drive(place("PD", J, 10.0, 0.5), sample_time=1e-6)
    found = Loop(Drivetrain((J,)), drive).poles()
    w = 2.0 * math.pi * 10.0
    assert found.growth == pytest.approx(-0.5 * w, rel=1e-3)
    assert found.frequency == pytest.approx(10.0 * math.sqrt(0.75), rel=1e-3)


def test_static_margin_is_the_stiffness_that_is_left():
    drivetrain = Drivetrain((J,), contact=LinearContact(388.157, 0.05))
    law = LinearContact(388.157)
    found = gain_margin(drivetrain, Drive(PD36), law)
    assert found == pytest.approx((388.157 + PD36.kp) / 388.157, rel=1e-4)
    # Half of the contact lost: nothing holds the axis with gain 1.
    broken = Loop(drivetrain.softer(0.5), Drive(PD36, law)).poles()
    assert not broken.stable
    assert broken.frequency < 1.0


def test_a_delay_of_a_whole_sample_is_the_limit_of_a_part():
    drivetrain = Drivetrain((J,), contact=LinearContact(388.0, 0.03))
    loops = [Loop(drivetrain, Drive(PD36, delay=d)).poles().radius for d in (0.0, 1e-9, 1.0 - 1e-9, 1.0)]
    assert loops[1] == pytest.approx(loops[0], abs=1e-6)
    assert loops[2] == pytest.approx(loops[3], abs=1e-6)
    assert loops[3] > loops[0]


def test_thesis_answers():
    """Grease: the printed springs exceed what the shaft lets through, so gain 1 leaves negative stiffness."""
    grease = machine("thesis-grease")
    found = stability(
        axis_of(grease), Drive(place("PD", 3.8623e-4, 25.0, 1.0)), {"gms": grease.models["gms"]}, (0.0,)
    )
    assert found.drivetrain.visible < found.margins[1].law.stiffness
    assert found.margins[1].static < 0.9
    assert not found.margins[1].at_one.stable
    dry = stability(axis_of(DRY), Drive(place("PD", 3.8623e-4, 10.0, 0.85)), DRY.models, (0.0,))
    by_name = {m.name: m for m in dry.margins}
    assert by_name["gms"].softer < 0.1  # friction varies by more than that over a revolution
    assert by_name["lugre"].softer > 0.5
    assert by_name["coulomb"].cycle is not None
    assert by_name["coulomb"].gain < 0.01
    advice = dry.recommended["gms"]
    assert advice
    assert advice.gain < by_name["gms"].static


# ---- simulations of the package -------------------------------------------------------------------------------------


def swing(gain, sample_time, filter_hz, gains=PD36, model=GMS, start=1e-7, duration=0.3):
    """Position over time from a small start, by the package's own sampled simulation of the rigid axis."""
    controller = Controller(gains, Feedback(model, gain, filter_hz or None), sample_time=sample_time)
    record = simulate(
        RigidAxis(J, RIGID.clutch), controller, Reference.table([0.0, duration], [0.0, 0.0]), duration,
        output=sample_time, initial=(start, 0.0), metered=False,
    )  # fmt: skip
    return record["position"][record["event"] == 0.0]


@pytest.mark.parametrize("sample_time", [5e-4, 1e-3, 3e-3])
def test_simulations_grow_where_poles_say_so(sample_time):
    law = describing(GMS, 1e-7, 150.0)
    drivetrain = Axis(Drivetrain((J,)), RIGID.clutch).at(1e-7, 150.0)
    judged = 0
    for gain in (0.0, 0.5, 0.9, 1.2, 1.5):
        for filter_hz in (0.0, 10.0, 60.0, 150.0):
            poles = Loop(drivetrain, Drive(PD36, law, gain, filter_hz, sample_time)).poles()
            if abs(poles.growth) < 30.0:
                continue  # too slow to tell in 0.3 s
            path = np.abs(swing(gain, sample_time, filter_hz))
            late, early = path[len(path) // 2 :].max(), path[: len(path) // 8].max()
            assert (late > early) == (not poles.stable), (gain, filter_hz, poles)
            judged += 1
    assert judged >= 10


def test_the_cycle_of_coulomb_feedback_is_the_simulated_one():
    axis = Axis(Drivetrain((J,)), RIGID.clutch)
    found = stability(axis, Drive(PD36), {"coulomb": DRY.models["coulomb"]}, (0.0,)).margins[1].cycle
    assert found
    path = swing(1.0, 1e-3, 0.0, model=DRY.models["coulomb"], start=1e-5, duration=1.0)[500:]
    amplitude = 0.5 * np.ptp(path)
    turns = np.sum(np.diff(np.sign(path - path.mean())) != 0.0) / 2.0
    assert amplitude == pytest.approx(found.amplitude, rel=0.1)
    assert turns / 0.5 == pytest.approx(found.frequency, rel=0.1)


@pytest.mark.parametrize(
    "bad", [{"sample_time": 0.0}, {"delay": -1.0}, {"delay": math.nan}], ids=lambda b: next(iter(b))
)
def test_bad_drives_are_refused(bad):
    with pytest.raises(ParameterError):
        Drive(PD36, **bad)
