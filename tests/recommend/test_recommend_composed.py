"""A recommendation beside a loop made of control laws, written as the whole controller and read again."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from test_recommend_axes import INERTIA, PD, identified

import stickslip as ss
from stickslip.cli import main
from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.control.files import read_controller
from stickslip.control.linear import Cascade
from stickslip.control.recommended import read_recommended
from stickslip.control.written import tables_of
from stickslip.core.code_approval import allow_code
from stickslip.core.errors import ParameterError
from stickslip.models.model import Model
from stickslip.recommendation import recommend as recommending
from stickslip.recommendation.candidates import Setting
from stickslip.recommendation.recommend import Drive, recommend
from stickslip.recommendation.sample_time import hardly_damped
from stickslip.rigs.procedures.track import Track
from stickslip.rigs.virtual import virtual_rig
from stickslip.verbs.recommend import drive_with, refuse_beside

T = 1e-3
LAW = Model("coulomb", fc=0.285, sigma2=0.018)
LOOP = ControlBlock("pd", kp=PD.kp, kd=PD.kd)
OBSERVER = ControlBlock("disturbance_observer", inertia=INERTIA, corner=40.0)


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(recommending, "GAINS", (0.8,))
    monkeypatch.setattr(recommending, "LEADS", (0.0,))
    monkeypatch.setattr(recommending, "BEYOND", ())


def test_a_pd_made_of_control_laws_gets_what_a_pd_gets(few):
    given = {"sample_time": T, "torque_limit": 2.0, "amplitude": 0.2, "frequency": 0.5}
    old = recommend(identified(), Drive(gains=PD, **given), axes=1, confirm=2)
    new = recommend(
        identified(), Drive(controller=Controller(loop=LOOP, sample_time=T), **given), axes=1, confirm=2
    )
    assert new.linear_error == pytest.approx(old.linear_error, rel=1e-6)
    assert new.gains == {"loop_kp": PD.kp, "loop_kd": PD.kd}
    assert new.chosen.setting == old.chosen.setting
    assert np.allclose(new.chosen.errors, old.chosen.errors, rtol=1e-3)


def test_what_an_observer_leaves_is_what_a_compensator_is_worth(few):
    given = {"sample_time": T, "torque_limit": 2.0, "amplitude": 0.2, "frequency": 0.5}
    alone = recommend(
        identified(), Drive(controller=Controller(loop=LOOP, sample_time=T), **given), axes=1, confirm=2
    )
    observed = Controller(loop=LOOP, sample_time=T, feedforward=None, observer=OBSERVER)
    found = recommend(identified(), Drive(controller=observed, **given), axes=1, confirm=2)
    assert found.linear_error < 0.5 * alone.linear_error
    assert found.chosen is not None
    assert found.chosen.errors[0] < 0.7


def test_settings_stand_beside_the_loops_own_laws():
    loop = Controller(
        loop=LOOP,
        sample_time=T,
        feedforward=ControlBlock("inertia_feedforward", inertia=2e-4),
        observer=OBSERVER,
    )
    ahead = Setting("coulomb", "feedforward", 0.9, 1e-3, 0.0, INERTIA, 0.02).on(loop, LAW)
    assert list(ahead.blocks) == [
        "estimator", "feedforward", "feedforward_2", "feedforward_3", "observer", "loop"
    ]  # fmt: skip
    values = ahead.values()
    assert (values["feedforward_2_offset"], values["feedforward_3_lead"], values["feedforward_3_gain"]) == (
        0.02,
        1e-3,
        0.9,
    )
    back = Setting("coulomb", "feedback", 0.7, deadband=0.01).on(loop, LAW)
    assert [b.law.name for b in back.blocks.values()][-3:] == [
        "disturbance_observer",
        "friction_feedback",
        "pd",
    ]
    assert loop.answers_to_acceleration
    assert not Controller(loop=LOOP, sample_time=T).answers_to_acceleration


def test_the_tables_of_a_controller_are_that_controller(tmp_path):
    own = Path(__file__).parents[1] / "support" / "sliding_mode.py"
    sliding = ControlBlock(str(own), inertia=INERTIA, slope=60.0, torque=0.4, layer=0.5)
    pid = ControlBlock("pid", None, {"at_rest": "reset"}, kp=1.0, ki=2.0, kd=0.01)
    ahead = ControlBlock("friction_feedforward", LAW, {"velocity": "held"}, gain=0.9)
    inertia = ControlBlock("inertia_feedforward", inertia=INERTIA)
    estimator = ControlBlock("luenberger", corner=900.0)
    made = Controller(
        loop=[sliding, pid],
        sample_time=T,
        feedforward=[ahead, inertia],
        observer=OBSERVER,
        estimator=estimator,
        torque_limit=1.5,
        encoder_counts=65536.0,
    )
    file = tmp_path / "c.toml"
    file.write_bytes(tomli_w.dumps(tables_of(made)).encode())
    with allow_code():
        again = read_controller(file, 1.0)
    assert again.as_dict() == made.as_dict()
    assert again.values() == made.values()


@pytest.mark.parametrize(
    ("controller", "words"),
    [
        (Controller(loop=LOOP, sample_time=2e-3), "sample_time = 0.001 s, the controller's is 0.002 s"),
        (
            Controller(loop=LOOP, sample_time=T, feedforward=ControlBlock("friction_feedforward", LAW)),
            "'friction_feedforward' contains a friction law",
        ),
    ],
)
def test_a_loop_that_the_drive_cannot_be_is_refused(controller, words):
    with pytest.raises(ParameterError, match=words):
        Drive(controller=controller, amplitude=0.1)


MODEL = """
law = "coulomb"
[parameters]
fc = 0.285
sigma2 = 0.018
[axis]
inertia = 4e-4
"""
LOOPS = """
[controller]
sample_time = 1e-3
torque_limit = 2.0
placement = {bandwidth_hz = 20.0, damping = 1.0}
loop = {law = "pd"}
observer = {law = "disturbance_observer", corner = 40.0}
"""


COMMAND = ["recommend", "model.toml", "--controller", "loop.toml", "--amplitude", "0.2", "--axes", "1"]


def test_the_command_writes_a_controller_that_runs_and_is_exported(tmp_path, monkeypatch, capsys, few):
    monkeypatch.chdir(tmp_path)
    Path("model.toml").write_text(MODEL)
    Path("loop.toml").write_text(LOOPS)
    line = [*COMMAND, "--confirm", "0"]
    assert main([*line, "--out", "out.toml", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    made = read_controller("out.toml")
    assert made.blocks["observer"].law.name == "disturbance_observer"
    held = [b for b in made.blocks.values() if b.friction]
    assert [b.parameters.gain for b in held] == [data["chosen"]["gain"]]
    assert main(["export", "out.toml", "--to", "python", "--controller", "--check"]) == 0
    assert "at most 0 N·m" in capsys.readouterr().out
    track = ["rig", "run", "track", "--rig", "thesis-dry", "--set", "controller=out.toml", "--dry-run"]
    assert main(track) == 0
    assert main([*line, "--bandwidth", "20"]) == 2
    assert "--bandwidth cannot be combined with --controller loop.toml" in capsys.readouterr().err


def test_what_a_controller_sets_is_refused_beside_it_in_short():
    with pytest.raises(
        ss.InputError,
        match=r"^sample_time cannot be combined with controller, which sets it; leave it out$",
    ):
        refuse_beside(Controller(loop=LOOP, sample_time=T), sample_time=T)


def test_a_recommendation_that_is_a_whole_controller_is_exported_as_one(few):
    """As the object is: no option says so."""
    given = {"sample_time": T, "torque_limit": 2.0, "amplitude": 0.2, "frequency": 0.5}
    found, drive = identified(), Drive(controller=Controller(loop=LOOP, sample_time=T), **given)
    advice = ss.RecommendationResult(recommend(found, drive, axes=1, confirm=2), found)
    made = ss.export(advice, to="c99")
    assert made.files == ss.export(advice.controller, to="c99", name=made.name).files
    assert made.files == ss.export(advice, to="c99", compensator="recommended").files
    assert made.files == ss.export(advice, to="c99", controller=True).files
    law = ss.export(advice, to="c99", compensator="ff").files
    assert law != made.files


CASCADE = {"gains": Cascade(40.0, 0.02, 0.4, 0.9), "velocity_filter": 300.0}


@pytest.mark.parametrize("given", [CASCADE, {"gains": PD}, {"bandwidth": 15.0}, {"linear": "PID"}])
def test_the_file_of_a_recommendation_holds_the_whole_controller(given, tmp_path, few):
    """Limit and encoder among it, which were lost."""
    found = identified()
    drive = Drive(
        sample_time=T, torque_limit=1.5, encoder_counts=262144.0, amplitude=0.2, frequency=0.5, **given
    )
    advice = ss.RecommendationResult(recommend(found, drive, axes=1, confirm=2), found)
    file = advice.save(tmp_path / "recommended.toml")
    again = read_recommended(file).controller(Model.from_file(str(file)))
    assert again.as_dict() == advice.controller.as_dict()
    assert (again.torque_limit, again.encoder_counts) == (1.5, 262144.0)
    axis, slow = ss.RigidAxis(INERTIA, LAW), ss.Reference("sine", amplitude=0.2, frequency=0.5)
    one, two = (ss.simulate(axis, c, slow, duration=0.2)["position"] for c in (again, advice.controller))
    assert np.array_equal(one, two)
    whole = [ss.export(x, to="c99", controller=True, name="a").files for x in (advice, file)]
    assert whole[0] == whole[1]
    assert whole[0] == ss.export(advice.controller, to="c99", name="a").files


def test_the_limit_of_a_recommendation_holds_on_a_rig(tmp_path, few):
    found = identified()
    drive = Drive(
        gains=PD, sample_time=T, torque_limit=0.6, encoder_counts=65536.0, amplitude=0.2, frequency=0.5
    )
    advice = ss.RecommendationResult(recommend(found, drive, axes=1, confirm=2), found)
    file = str(advice.save(tmp_path / "recommended.toml"))
    run = Track(compensator="recommended", model=file)
    assert run.made(virtual_rig("thesis-dry")).torque_limit == 0.6
    assert run.made(virtual_rig("thesis-dry")).encoder_counts == 0.0


def test_a_controllers_file_without_a_sample_time_is_sampled_as_any_loop(tmp_path, monkeypatch, capsys, few):
    """It was refused by "drive: sample_time = 0", or by a law of it that acts on samples only."""
    monkeypatch.chdir(tmp_path)
    Path("model.toml").write_text(MODEL)
    Path("loop.toml").write_text(LOOPS.replace("sample_time = 1e-3", "encoder_counts = 65536"))
    line = [*COMMAND, "--json"]
    for more, period, source in (
        ([], 1e-3, "assumed, as the model"),
        (["--sample-time", "5e-4"], 5e-4, "as given"),
    ):
        assert main([*line, "--confirm", "0", *more]) == 0
        drive = json.loads(capsys.readouterr().out)["drive"]
        assert drive["sample_time"] == drive["controller"]["sample_time"] == period
        assert drive["sample_time_from"].startswith(source)
    Path("loop.toml").write_text(LOOPS)
    assert main([*line, "--sample-time", "5e-4"]) == 2
    assert "--sample-time cannot be combined with --controller loop.toml" in capsys.readouterr().err


def test_a_controller_of_continuous_time_takes_the_records_sample_time(few):
    found = dataclasses.replace(identified(), data=({"file": "log.csv", "sample_time": 5e-4},))
    loop = Controller(loop=LOOP, torque_limit=2.0)
    drive = drive_with(loop, held_by, found, None, None, None)
    assert drive.sample_time == 5e-4
    assert drive.sample_time_from.startswith("the time between the rows of the record log.csv")
    assert (
        drive_with(dataclasses.replace(loop, sample_time=2e-3), held_by, found, None, None, None).sample_time
        == 2e-3
    )


def held_by(made: Controller, told_by: str) -> Drive:
    """A drive whose loop is this controller."""
    return Drive(sample_time=made.sample_time, controller=made, amplitude=0.2, sample_time_from=told_by)


@pytest.mark.parametrize(("period", "hardly"), [(1e-3, False), (0.03, True)])
def test_a_loop_of_control_laws_is_doubted_at_rows_too_rare_for_it(period, hardly, monkeypatch):
    loop = Controller(loop=LOOP, sample_time=T)
    assert hardly_damped(loop, period, INERTIA) is hardly

    def bent(*_):
        raise ss.InputError("controller: loop is not smooth about rest")

    monkeypatch.setattr("stickslip.recommendation.sample_time.linearised", bent)
    assert not hardly_damped(loop, period, INERTIA)
