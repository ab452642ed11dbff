"""A compensator leaves whole: offset, inertia, gain, lead and deadband, or the export says what it leaves out."""

import dataclasses

import numpy as np
import pytest
from test_c99 import COMPILERS, CONTROL, answers, built_controller

import stickslip as ss
from stickslip.cli import main
from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import Gains, place
from stickslip.control.recommended import read_recommended
from stickslip.core.errors import ParameterError
from stickslip.core.spec import Surroundings
from stickslip.exports.job import Check
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.rigs.loop import Loop
from stickslip.rigs.procedures.track import Track
from stickslip.rigs.rig import setpoints
from stickslip.rigs.virtual import virtual_rig
from stickslip.simulation.closed_loop import simulate
from stickslip.simulation.compiled_controller import compiled, replay

MODEL = """law = "coulomb"
[parameters]
fc = 0.25
sigma2 = 0.02
[axis]
inertia = 4e-4
offset = -0.07
{more}
"""
RECOMMENDED = """[recommended]
compensator = "feedforward"
gain = 0.8
bandwidth = 20.0
damping = 1.0
inertia = 4e-4
lead = 5e-4
{more}
"""
FED = "offset = -0.07\ninertia_feedforward = 4e-4"
COULOMB = Model("coulomb", fc=0.25, sigma2=0.02)
INERTIA = 4e-4


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(more="", name="m.toml"):
        (tmp_path / name).write_text(MODEL.format(more=more))
        return name

    return write


def exported(capsys, *call):
    """What the export says."""
    assert main(["export", *call]) == 0
    return capsys.readouterr().out


@pytest.mark.skipif(not COMPILERS, reason="needs a C compiler")
@pytest.mark.parametrize("kind", [Feedforward, Feedback])
def test_the_simulation_runs_the_compensator_that_is_exported(kind, tmp_path):
    """Along a move on an axis with friction: the torque held is that of the C at the same positions."""
    helper = kind(COULOMB, 0.9, offset=-0.07, inertia_feedforward=INERTIA)
    controller = Controller(place("PD", INERTIA, 20.0, 1.0), helper, 3.0, 1e-3)
    reference = Reference("scurve", distance=0.5, velocity=2.0, acceleration=40.0, jerk=2000.0)
    record = simulate(RigidAxis(INERTIA, COULOMB), controller, reference, 0.6, output=1e-3)
    rows = [
        np.flatnonzero(record.time == 1e-3 * k)[-1] for k in range(600)
    ]  # as the controller has just acted
    motion = reference.sample(1e-3 * np.arange(600))
    told = answers(
        built_controller(controller, CONTROL, tmp_path, COMPILERS[0]),
        record["position"][rows], *motion.T,
    )  # fmt: skip
    np.testing.assert_allclose(told, record["motor_torque"][rows], atol=2e-9)
    assert np.ptp(motion[:, 2]) * INERTIA > 0.03  # the inertia's part is seen


def test_with_its_inertia_fed_forward_a_frictionless_axis_follows_without_error():
    free = Model("coulomb", fc=0.0, sigma2=0.0)
    reference = Reference("sine", amplitude=0.1, frequency=2.0)

    def error(inertia):
        helper = Feedforward(free, inertia_feedforward=inertia)
        loop = Controller(place("PD", INERTIA, 5.0, 1.0), helper, sample_time=1e-4)
        return simulate(RigidAxis(INERTIA, free), loop, reference, 1.0).meta["metrics"]["position_rms_rad"]

    assert error(INERTIA) < 0.03 * error(0.0)


def test_a_recommendation_leaves_with_its_offset_and_inertia(file, tmp_path, capsys):
    name = file(RECOMMENDED.format(more=FED))
    found = read_recommended(name).on(COULOMB)
    assert (found.offset, found.inertia_feedforward) == (-0.07, INERTIA)
    said = exported(capsys, name, "--to", "c99", "--compensator", "recommended", "--out", "out", "--check")
    source = (tmp_path / "out" / "m.c").read_text()
    for line in ("0.8, /* feedforward_gain:", "0.0005, /* feedforward_lead:", "-0.07, /* feedforward_2_offset:",
                 "0.0004, /* feedforward_2_inertia:"):  # fmt: skip
        assert line in source
    for words in ("0.8 times the friction law's torque", "`feedforward_2_offset` = -0.07",
                  "`feedforward_2_inertia` = 0.0004 kg·m²"):  # fmt: skip
        assert words in said
        assert words in (tmp_path / "out" / "README.md").read_text()
    assert "beside friction is not" not in said


def test_a_recommendation_without_the_offset_of_its_axis_says_so(file, capsys):
    said = exported(capsys, file(RECOMMENDED.format(more="offset = -0.01")), "--to", "c99",
                    "--compensator", "recommended")  # fmt: skip
    assert "the constant torque of -0.07 N·m that acts in addition to friction is not in the export" in said


@pytest.mark.parametrize("target", ["c99", "st", "python", "linuxcnc"])
def test_the_law_alone_of_a_recommendation_says_what_is_left_out(target, file, capsys):
    said = exported(capsys, file(RECOMMENDED.format(more=FED)), "--to", target)
    left = "feedforward with gain 0.8, lead 0.0005 s, offset -0.07 N·m, inertia feedforward 0.0004 kg·m²"
    assert left in said
    assert "the constant torque of -0.07 N·m that acts in addition to friction is not in the export" in said


def test_a_models_compensator_has_the_offset_and_inertia_of_its_axis(file, tmp_path, capsys):
    call = [file("gravity = 0.4"), "--to", "c99", "--compensator", "ff", "--out", "out"]
    said = exported(capsys, *call)
    source = (tmp_path / "out" / "m.c").read_text()
    assert "-0.07, /* feedforward_2_offset:" in source
    assert "0.0004, /* feedforward_2_inertia:" in source
    assert "gravity, up to 0.4 N·m over the angle" in said
    said = exported(capsys, *call, "--offset", "0", "--inertia-feedforward", "0")
    assert "no constant torque" in said
    assert "the constant torque of -0.07 N·m that acts in addition to friction is not in the export" in said


def test_the_mean_torque_of_a_map_of_the_angle_leaves(file, tmp_path, capsys):
    angle = "ripple_order = []\nripple = []\nripple_phase = []\ntorque_offset = 0.03\n"
    angle = f"[angle]\n{angle}torque_order = [1]\ntorque = [0.01]\ntorque_phase = [0]\n"
    said = exported(capsys, file(RECOMMENDED.format(more=angle)), "--to", "c99", "--compensator", "recommended",
                    "--out", "out")  # fmt: skip
    assert "0.03, /* feedforward_2_offset:" in (tmp_path / "out" / "m.c").read_text()
    assert "is not in the export but for the mean of the torque" in said


def test_a_rig_runs_what_is_recommended_with_offset_and_inertia(file):
    """Behind an open position loop the compensator's torque is all there is."""
    rig = virtual_rig("ideal")
    loop = Track(compensator="recommended", model=file(RECOMMENDED.format(more=FED))).made(rig)
    alone = Controller(Gains(kp=0.0), loop.compensator, sample_time=rig.sample_time)
    with Loop(rig) as run:
        run.run(setpoints(5, velocity=1.0, acceleration=100.0, closed=1.0), alone)
        given = run.record()["compensation_torque"][-5:]
    assert given == pytest.approx(0.8 * (0.25 + 0.02) - 0.07 + 4e-4 * 100.0)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [({"offset": np.nan}, "offset"), ({"inertia_feedforward": -1.0}, "inertia_feedforward = -1 kg·m²")],
)
def test_what_cannot_be_fed_forward_is_refused(wrong, said):
    with pytest.raises(ParameterError, match=said):
        Feedforward(COULOMB, **wrong)
    with pytest.raises(ParameterError, match="offset needs a sampled controller"):
        Controller(Gains(1.0), Feedback(COULOMB, offset=0.1))


def test_a_printed_export_says_what_its_check_found():
    made = ss.export(
        Controller(Gains(kp=0.0), Feedforward(COULOMB), sample_time=1e-3), to="python", check=True
    )
    assert str(made).splitlines()[-1] == f"check: {made.check.text}"
    failed = dataclasses.replace(made, check=Check(False, "gcc: 0.5 N·m off the definition"))
    assert str(failed).endswith("check failed: gcc: 0.5 N·m off the definition")
    assert "check" not in str(dataclasses.replace(made, check=None)).splitlines()[-1]


@pytest.mark.parametrize(("gain", "what"), [(0.0, "compensator"), (5.0, "controller")])
def test_a_simulation_unit_is_titled_by_what_it_holds(gain, what):
    made = ss.export(Controller(Gains(kp=gain), Feedforward(COULOMB), sample_time=1e-3), to="fmu")
    assert made.target.title == f"FMI 2.0 and 3.0 co-simulation unit of a sampled {what}"
    assert ss.export(COULOMB, to="fmu").target.title.endswith("a contact that is moved")


@pytest.mark.parametrize("to", ["c99", "st", "matlab", "python", "arduino", "fmu"])
def test_a_friction_that_is_fed_forward_says_that_the_reference_must_rest_at_zero(to):
    """A reference velocity of -1e-9 rad/s at rest gave the whole friction, and no README said so."""
    said = "At rest the reference velocity must be exactly 0"
    forward = ss.export(COULOMB, to, compensator="ff", deadband=0.01).files["README.md"]
    assert said in forward
    assert "`feedforward_deadband` (`stickslip export --compensator ff --deadband RAD_PER_S`" in forward
    assert said not in ss.export(COULOMB, to, compensator="fb").files["README.md"]


@pytest.mark.parametrize(("deadband", "given"), [(0.0, -0.25), (1e-6, 0.0)])
def test_a_deadband_above_the_noise_of_the_reference_velocity_keeps_it_at_rest(deadband, given):
    law = Model("coulomb", fc=0.25, sigma2=0.02)
    made = Controller(Gains(kp=0.0), Feedforward(law, deadband=deadband), sample_time=1e-3)
    sampled = compiled(made)
    inputs, torque = np.tile([0.0, 0.0, -1e-9, 0.0], (3, 1)), np.zeros(3)
    replay(sampled, inputs, np.array(Surroundings()), sampled.fault, torque, np.zeros(3))
    assert torque[-1] == pytest.approx(given, abs=1e-3)
