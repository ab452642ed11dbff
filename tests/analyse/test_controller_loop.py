"""Controllers made of control laws about rest: their matrices against the samples, known loops, and the virtual rig."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from stickslip.analyse.controller_loop import linear_to, linearised
from stickslip.analyse.controller_margins import controller_stability
from stickslip.analyse.machine_axis import axis_of
from stickslip.analyse.presliding_loop import Drive, Loop, describing
from stickslip.cli import main
from stickslip.contract.control_laws import Plain, block_of, specimen
from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.control.registry import control_law, control_law_names
from stickslip.core.errors import InputError
from stickslip.machines.files import machine
from stickslip.studies.controller_confirmed import confirmed_controller, scaled
from stickslip.studies.stability_map import moved

T = 1e-3
DRY = machine("thesis-dry")
AXIS = axis_of(DRY)
RIGID = axis_of(DRY.without("flexibility", "encoder-mode", "bearings", "direction", "bandwidth"))
OWN = Path(__file__).parents[1] / "support" / "sliding_mode.py"
LINEAR = [n for n in control_law_names() if control_law(n).is_linear]


def placed(kind, bandwidth, **more):
    gains = place(kind, 3.8623e-4, bandwidth, 1.0)
    values = {"kp": gains.kp, "kd": gains.kd, **({"ki": gains.ki} if gains.ki else {})}
    return Controller(loop=ControlBlock(kind.lower(), **values), sample_time=T, **more), gains


@pytest.mark.parametrize("name", LINEAR)
def test_the_matrices_give_the_torque_of_the_samples(name):
    """Of every linear law, along random angles about rest."""
    controller = specimen(control_law(name), math.inf, T)
    a, b, c, d = linearised(controller, 1e-6, 100.0).state_space()
    plain = Plain(controller)
    for _ in range(3):
        plain((0.0, 0.0, 0.0, 0.0))
    angles = 1e-6 * np.random.default_rng(3).standard_normal(300).cumsum()
    told = [plain((x, 0.0, 0.0, 0.0)) for x in angles.tolist()]
    state, found = np.zeros((a.shape[0], 1)), []
    for x in angles.tolist():
        found.append((c @ state).item() + d * x)
        state = a @ state + b * x
    assert found == pytest.approx(told, rel=1e-6, abs=1e-9 * max(map(abs, told)))


@pytest.mark.parametrize("kind", ["PD", "PID"])
def test_the_loop_is_that_of_the_gains(kind):
    controller, gains = placed(kind, 20.0)
    drivetrain = AXIS.at(AXIS.amplitude, AXIS.ringing)
    found = Loop(drivetrain, linearised(controller, 1e-6, 100.0, DRY.delay)).poles()
    assert found.growth == pytest.approx(
        Loop(drivetrain, Drive(gains, sample_time=T, delay=DRY.delay)).poles().growth, rel=1e-6
    )


@pytest.mark.parametrize("observer", [None, "disturbance_observer"])
def test_a_constant_torque_changes_no_loop(observer):
    """It stands at rest: the loop about it is the same (and was refused, as not smooth)."""
    own = {} if observer is None else {"observer": block_of(control_law(observer))}
    found = []
    for held in (0.0, 0.08):
        ahead = ControlBlock("inertia_feedforward", inertia=3.8623e-4, offset=held)
        controller, _ = placed("PID", 20.0, feedforward=ahead, **own)
        found.append(linearised(controller, 1e-6, 100.0).response(np.array([1.0, 30.0, 200.0])))
    assert found[1] == pytest.approx(found[0], rel=1e-6)


def test_a_held_friction_law_is_its_spring_and_damper():
    law = DRY.models["gms"]
    controller, gains = placed("PD", 36.0, observer=ControlBlock("friction_feedback", law, gain=0.8))
    drivetrain = AXIS.at(AXIS.amplitude, AXIS.ringing)
    drive = Drive(gains, describing(law, 1e-6, 100.0), 0.8, 0.0, T, DRY.delay)
    found = Loop(drivetrain, linearised(controller, 1e-6, 100.0, DRY.delay)).poles()
    assert found.growth == pytest.approx(Loop(drivetrain, drive).poles().growth, rel=1e-6)
    assert found.growth < 0.0
    # While everything slides its torque is constant.
    alone = linearised(placed("PD", 36.0)[0], math.inf, 100.0)
    assert linearised(controller, math.inf, 100.0).response(np.array([5.0])) == pytest.approx(
        alone.response(np.array([5.0]))
    )


def test_the_transfer_function_is_that_of_the_continuous_law_at_low_frequency():
    f = np.array([0.5, 2.0, 8.0])
    s = 2j * math.pi * f
    controller, gains = placed("PID", 20.0)
    late = np.exp(-0.5 * T * s)  # of the velocity
    wanted = gains.kp + gains.ki / s + gains.kd * s * late
    assert -linearised(controller, 1e-6, 100.0).response(f) == pytest.approx(wanted, rel=3e-3)


def test_margins_are_where_the_loop_goes_unstable():
    controller, gains = placed("PD", 20.0)
    found = controller_stability(RIGID, controller)
    sliding = found.loops[1]
    assert [loop.name for loop in found.loops] == ["sticking", "sliding"]
    assert sliding.poles.stable
    _, high = sliding.torque
    for factor, good in ((0.98 * high, True), (1.02 * high, False)):
        scaled = Controller(
            loop=ControlBlock("pd", kp=factor * gains.kp, kd=factor * gains.kd), sample_time=T
        )
        assert controller_stability(RIGID, scaled).loops[1].poles.stable == good
    assert found.softer == 1.0  # a PD holds the axis alone
    late = controller_stability(RIGID, controller, sliding.delay + 0.15).loops[1]
    assert not late.poles.stable


def test_the_virtual_rig_does_what_the_poles_say():
    calm, _ = placed("PD", 20.0)
    perturbed, _ = placed(
        "PD", 20.0, observer=ControlBlock("disturbance_observer", inertia=4.2757e-4, corner=150.0)
    )
    quiet, restless = (controller_stability(AXIS, c, DRY.delay) for c in (calm, perturbed))
    assert quiet.loops[0].poles.stable
    assert quiet.cycle is None
    assert not restless.loops[0].poles.stable
    limit = 1.0
    moves = [
        moved(
            DRY,
            Controller(loop=c.loop, sample_time=T, feedforward=None, observer=c.observer, torque_limit=limit),
        )
        for c in (calm, perturbed)
    ]
    assert moves[1] > 5.0 * moves[0]
    said = restless.cycle.amplitude / math.sqrt(2.0)  # by the first harmonic of a contact that slips
    assert said / 3.0 < moves[1] < 3.0 * said


def test_what_is_not_smooth_about_rest_is_refused():
    smooth = block_of(control_law(str(OWN)))
    assert (
        linearised(Controller(loop=smooth, sample_time=T), 1e-6, 100.0).state_space()[3] < 0.0
    )  # inside its boundary layer
    sharp = ControlBlock(smooth.law, **{**smooth.parameters._asdict(), "layer": 1e-9})
    with pytest.raises(InputError, match="sliding_mode is not smooth about rest"):
        linearised(Controller(loop=sharp, sample_time=T), 1e-6, 100.0)


# ---- up to which motion it is linear --------------------------------------------------------------------------------

BENT = """from typing import Annotated, NamedTuple
import math
from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    width: Annotated[float, Par("rad", "w", "width", positive=True)]


def sample(y, z, p, u):
    return {}


CONTROL_LAW = ControlLaw("bent", Params, sample, "loop", title="t", equation="T", source=(), example={{"width": 1e-4}})
"""
DEAD = "5.0 * (max(y.error - p.width, 0.0) + min(y.error + p.width, 0.0))"


@pytest.fixture
def bent(tmp_path):
    """A controller whose torque has this text."""

    def made(text: str, width: float) -> Controller:
        file = tmp_path / "bent.py"
        file.write_text(BENT.format(text))
        return Controller(loop=ControlBlock(str(file), width=width), sample_time=T)

    return made


def test_a_smooth_law_is_linear_up_to_where_it_bends(bent):
    controller = bent("5.0 * p.width * math.tanh(y.error / p.width)", 1e-7)
    assert linear_to(controller, 5e-8, 20.0) == 5e-8
    assert 3e-8 < linear_to(controller, 1e-4, 20.0) < 1e-7


def test_stability_says_up_to_which_motion_it_holds(bent):
    """It spoke about any amplitude with the slope of a motion a thousand times smaller."""
    controller = bent("5.0 * y.error - 0.05 * p.width * math.tanh(y.velocity / p.width)", 0.01)
    said = {}
    for amplitude in (1e-7, 1e-3):
        found = controller_stability(axis_of(DRY, amplitude), controller, DRY.delay)
        said[amplitude] = [line for line in found.lines() if "is linear about rest only up to" in line]
        assert found.as_dict()["linear_to"] == found.linear_to
    assert said[1e-7] == []
    assert len(said[1e-3]) == 1
    assert "which these lines (of motion up to 1 mrad) do not describe" in said[1e-3][0]
    assert 1e-6 < found.linear_to < 1e-4


@pytest.mark.parametrize("width", [5e-6, 5e-7])
def test_a_dead_band_is_refused(width, bent):
    """Its slope at rest is 0: no controller, whatever moves."""
    with pytest.raises(InputError, match=r"bent has a dead band about rest \(it answers changes of 1e-0"):
        linearised(bent(DEAD, width), 1e-6, 100.0)


def test_a_dead_band_wider_than_what_is_tried_is_said(bent):
    assert linear_to(bent(DEAD, 1e-4), 5e-5, 20.0) == 5e-5
    assert linear_to(bent(DEAD, 1e-4), 1e-2, 20.0) < 1e-4


def test_what_an_observer_of_friction_is_about_rest_ends_where_its_bristle_slides():
    """Its stiffness was said of a motion ten times as large as the way to break-away."""
    values = {"sigma0": 3.5e4, "sigma1": 0.1, "fc": 0.285, "fs": 0.335, "vs": 0.01, "correction": 1.0}
    controller, _ = placed("PD", 20.0, observer=ControlBlock("lugre_observer", **values))
    assert linearised(controller, 1e-4, 100.0).state_space()[3] > 1e4
    assert linear_to(controller, 1e-6, 100.0) == 1e-6
    assert linear_to(controller, 1e-4, 100.0) < values["fs"] / values["sigma0"]
    found = controller_stability(axis_of(DRY, 1e-4), controller, DRY.delay)
    assert "linear about rest only up to" in "\n".join(found.lines())


FILE = """
[controller]
sample_time = 1e-3
placement = {bandwidth_hz = 20.0, damping = 1.0}
loop = {law = "pd"}
observer = {law = "friction_feedback", friction = "gms", gain = 0.8}
"""


def test_the_rig_does_what_the_poles_say_of_softer_and_stiffer_loops():
    """A PD that rings by itself is held by the friction of its compensator, but not with gains three times as high."""
    alone, _ = placed("PD", 36.0)
    helped, _ = placed("PD", 36.0, observer=ControlBlock("friction_feedback", DRY.models["gms"], gain=0.8))
    factors = (0.5, 1.0, 3.0)
    calm = [[p.calm for p in confirmed_controller(DRY, c, factors).points] for c in (alone, helped)]
    assert calm == [[True, False, False], [True, True, False]]
    assert all(p.agrees for c in (alone, helped) for p in confirmed_controller(DRY, c, factors).points)


def test_a_loop_that_is_not_gains_alone_is_tried_as_it_is():
    sliding = ControlBlock(str(OWN), inertia=DRY.inertia, slope=62.8, torque=0.45, layer=0.5)
    found = confirmed_controller(DRY, Controller(loop=sliding, sample_time=T))
    assert [p.factor for p in found.points] == [1.0]
    assert scaled(Controller(loop=sliding, sample_time=T), 2.0) is None


def test_where_a_law_bends_no_poles_are_told_and_the_rig_alone_says_what_it_does(bent):
    """A loop whose poles were "stable" for motion that its law is not linear over swung by itself."""
    controller = bent("5.0 * y.error - 0.05 * p.width * math.tanh(y.velocity / p.width)", 0.01)
    found = confirmed_controller(DRY, controller)
    point = found.points[0]
    assert not point.is_linear
    assert point.linear_to < found.amplitude
    said = "\n".join(found.lines())
    assert "do what the poles say" not in said
    assert (
        "1 of 1 loops have no poles for such motion: the controller is linear about rest only up to" in said
    )
    margins = controller_stability(axis_of(DRY, found.amplitude), controller, DRY.delay)
    assert not any("stable pole" in line for line in margins.lines())
    assert margins.as_dict()["loops"][0] == {"name": "sticking", "stable": None}


def test_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("c.toml").write_text(FILE)
    line = ["analyse", "stability", "--rig", "thesis-dry", "--controller", "c.toml"]
    assert main([*line, "--plot", "c.png"]) == 0
    said = capsys.readouterr().out
    assert "observer: friction_feedback" in said
    assert "sticking  stable" in said
    assert Path("c.png").stat().st_size > 10_000
    assert main([*line, "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["loops"][0]["stable"] is True
    assert len(data["gain"]) == len(data["frequency"])
    assert main([*line, "--confirm"]) == 0
    said = capsys.readouterr().out
    assert "8 of 8 loops do what the poles say" in said
    one, other = (
        re.search(r"motion of (\S+ \S+) at the encoder", said),
        re.search(r"poles of motion of (\S+ \S+):", said),
    )
    assert one[1] == other[1]  # both halves speak of the same motion
    for wrong, words in (
        (["--bandwidth", "20"], "--bandwidth cannot be combined with --controller c.toml, which defines it"),
        (["--confirm", "--delay", "0.5"], "--confirm runs the machine with its own delay"),
        (["--delay", "-1"], "--delay -1 samples must be from 0 to 100"),
    ):
        assert main([*line, *wrong]) == 2
        assert words in capsys.readouterr().err
