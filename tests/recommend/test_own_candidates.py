"""Controllers of the user's own among what `recommend` tries."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest
from test_recommend_beside import THESIS, known

from stickslip.control.block import ControlBlock
from stickslip.control.catalogue import compensated
from stickslip.control.controller import Controller
from stickslip.control.files import read_controller
from stickslip.control.linear import Gains
from stickslip.control.written import tables_of
from stickslip.core.code_approval import allow_code
from stickslip.core.errors import InputError, UnknownName
from stickslip.recommendation import recommend as recommending
from stickslip.recommendation.beside import Beside, Own, belief_of, fed
from stickslip.recommendation.file import write_setting
from stickslip.recommendation.recommend import Drive, recommend
from stickslip.report.recommendation_text import beside_lines
from stickslip.verbs.candidates_given import compensators_of, made_for

DRIVE = Drive(20.0, amplitude=0.2, torque_limit=1.0)
FOUND = known(**THESIS)

LAW = """
from typing import Annotated, NamedTuple
from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par

class Params(NamedTuple):
    stiffness: Annotated[float, Par("N·m/rad", "k", "of the loop", positive=True)]
    damping: Annotated[float, Par("N·m·s/rad", "d", "of the loop", positive=True)]

def sample(y, z, p, u):
    return p.stiffness * y.error + p.damping * (y.reference_velocity - y.velocity)

CONTROL_LAW = ControlLaw("stranger", Params, sample, "loop", title="A stranger's", source=("own",), equation="T = k e",
                         example={"stiffness": 6.0, "damping": 0.1})
"""

FILE = """
plugins = ["stranger.py"]
[controller]
loop = {law = "stranger", stiffness = 20.0, damping = 0.15}
feedforward = {law = "friction_feedforward", friction = "identified", gain = 0.9}
"""


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(recommending, "GAINS", (0.5,))
    monkeypatch.setattr(recommending, "LEADS", (0.0,))
    monkeypatch.setattr(recommending, "BEYOND", ())


@pytest.fixture
def file(tmp_path):
    (tmp_path / "stranger.py").write_text(LAW)
    path = tmp_path / "mine.toml"
    path.write_text(FILE)
    with allow_code():
        yield path


@pytest.mark.usefixtures("few")
def test_a_controller_of_ones_own_is_tried_as_one_of_the_catalogue_is():
    belief = belief_of(FOUND.model, DRIVE, THESIS["inertia"])
    same = fed(compensated("ff-dob", "PD", belief), THESIS["inertia"], 0.0)
    advice = recommend(FOUND, DRIVE, axes=1, confirm=2, compensators=("ff-dob", Own("mine", same)))
    errors = {b.label: b.errors for b in advice.beside}
    assert errors["mine"] == errors["PD + ff-dob"]
    assert all(0.0 < error < 1.0 for error in errors["mine"])


@pytest.mark.usefixtures("few")
def test_a_law_of_ones_own_is_switched_on_and_written(file, tmp_path):
    (own,) = made_for(compensators_of([file]), DRIVE, THESIS["inertia"], FOUND.model)
    assert isinstance(own, Own)
    assert own.controller.blocks["feedforward"].friction == FOUND.model
    advice = recommend(FOUND, DRIVE, axes=1, confirm=2, compensators=(own,))
    assert advice.instead is not None
    assert advice.instead.label == "mine"
    assert advice.instead.at_most < min(c.worst for c in advice.candidates)
    assert any("mine" in line and "<- yes" in line for line in beside_lines(advice))
    written = write_setting(tmp_path / "recommended.toml", FOUND, advice)
    assert tables_of(read_controller(written)) == tables_of(own.controller)


def test_what_leaves_as_little_as_the_setting_is_not_said_to_leave_more():
    one = Beside("mine", "", (0.02,), "", None)
    chosen = SimpleNamespace(worst=0.021)
    (_, _, row, _) = beside_lines(SimpleNamespace(beside=(one,), instead=None, chosen=chosen, hunts=""))
    assert row.endswith("no: it leaves hardly less")
    chosen.worst = 0.01
    (_, _, row, _) = beside_lines(SimpleNamespace(beside=(one,), instead=None, chosen=chosen, hunts=""))
    assert row.endswith("no: another one leaves less")


def test_a_controller_runs_as_the_drive_does():
    loop = ControlBlock("pd", None, None, kp=6.0, kd=0.1)
    (own,) = made_for([Controller(loop=loop, sample_time=1e-3, torque_limit=0.5)], DRIVE, None, FOUND.model)
    assert isinstance(own, Own)
    assert (own.name, own.controller.torque_limit) == ("pd", 0.5)
    (short,) = made_for([Controller(Gains(6.0, 0.0, 0.1, 0.0))], DRIVE, None, FOUND.model)
    assert isinstance(short, Own)
    assert (short.controller.sample_time, short.controller.torque_limit) == (1e-3, 1.0)
    assert math.isclose(short.controller.gains.kp, 6.0)


def test_what_is_made_for_another_drive_is_refused(file):
    loop = ControlBlock("pd", None, None, kp=6.0, kd=0.1)
    with pytest.raises(
        InputError, match=r"pd.: sample_time = 0.002 s is not the drive's, 0.001 s; leave it out"
    ):
        made_for([Controller(loop=loop, sample_time=2e-3)], DRIVE, None, FOUND.model)
    with pytest.raises(
        InputError, match=r"encoder_counts = 4096 is not the drive's, 0; .* counts_per_rev=4096"
    ):
        made_for([Controller(loop=loop, sample_time=1e-3, encoder_counts=4096.0)], DRIVE, None, FOUND.model)
    with pytest.raises(InputError, match=r"nothing.toml.: there is no such file; give a TOML file"):
        compensators_of(["nothing.toml"])
    with pytest.raises(UnknownName, match="dobs"):
        compensators_of([file, "dobs"])
    assert compensators_of([file, "dob"]) == (file, "dob")
    assert file in compensators_of(["all", file])
