"""The exported sampled controller, and the package's own: faults, limits, far angles, taking over."""

import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from test_c99 import COMPILERS, answers, built_controller, example

from stickslip.cli import main
from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import Cascade, Gains, place
from stickslip.core.errors import ParameterError
from stickslip.core.spec import Surroundings
from stickslip.exports import controller_target
from stickslip.exports._step_error import step_errors
from stickslip.machines.rigid import RigidAxis
from stickslip.models import plugins
from stickslip.models.model import Reference
from stickslip.rigs.loop_sample import control_of
from stickslip.rigs.rig import Limits
from stickslip.simulation.closed_loop import simulate

needs_compiler = pytest.mark.skipif(not COMPILERS, reason="needs a C compiler")
T, LIMIT = 1e-3, 2.0
PID = place("PID", 3.86e-4, 25.0, 1.0)


class Sampled:
    """The controller in plain Python."""

    def __init__(self, controller):
        made = controller
        self.p, self.n, self.z, self.m = made.parameters, made.settings, made.state(), made.memory()
        self.u = SimpleNamespace(**Surroundings()._asdict())
        self.functions = made.functions

    def __call__(self, *inputs, name="sample"):
        """Position, reference and its velocity, and the torque to follow; the acceleration is 0."""
        return self.functions[name](*inputs[:3], 0.0, *inputs[3:], self.n, self.m, self.z, self.p, self.u)


def controllers():
    gms = example(plugins.law("gms"))
    return {
        "PID": Controller(PID, None, LIMIT, T),
        "FF": Controller(PID, Feedforward(gms, lead=7e-4), LIMIT, T),
        "FF in 3": Controller(Gains(0.0), Feedforward(gms, 0.9, lead=7e-4, substeps=3), LIMIT, T),
        "FB": Controller(PID, Feedback(gms, 0.8, filter_hz=50.0), LIMIT, T),
        "cascade": Controller(Cascade(60.0, 0.05, 1.0, 0.9), None, LIMIT, T, velocity_filter=300.0),
    }


ALL = controllers()
every_controller = pytest.mark.parametrize("controller", ALL.values(), ids=ALL)


# ---- inputs that are no numbers -------------------------------------------------------------------------------


@every_controller
@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place_of", ["position", "wanted", "velocity", "load", "time"])
def test_an_input_that_is_no_number_is_a_fault_and_leaves_no_trace(controller, wrong, place_of):
    faulty, clean = Sampled(controller), Sampled(controller)
    for k in range(400):
        t = T * k
        given = {"position": 0.1 * t, "wanted": 0.1 * t + 1e-3, "velocity": 0.1, "load": 1.0, "time": t}
        right = clean(given["position"], given["wanted"], given["velocity"])
        bad = 100 <= k < 103
        if bad:
            given[place_of] = wrong
        faulty.u.load, faulty.u.time = given["load"], given["time"]
        torque = faulty(given["position"], given["wanted"], given["velocity"])
        assert abs(torque) <= LIMIT
        assert faulty.m.fault == (k - 99 if bad else 0)
    # The three samples are bridged: what was in the memory goes on, and the hold has faded.
    assert torque == pytest.approx(right, rel=1e-2)


def test_a_lasting_fault_ramps_the_torque_to_zero_within_the_fade():
    drive = Sampled(ALL["PID"])
    for _ in range(50):
        held = drive(0.0, 0.01, 0.0)
    fallen = [drive(math.nan, 0.01, 0.0) for _ in range(120)]
    assert held > 0.1
    assert np.all(np.diff([held, *fallen]) <= 0.0)
    assert fallen[98] > 0.0
    assert fallen[99:] == [0.0] * 21
    assert drive.m.fault == 120
    assert abs(drive(0.0, 0.01, 0.0)) < 0.02 * held  # and comes back from there
    assert drive.m.fault == 0


# ---- the integral ------------------------------------------------------------------------------------------------


def test_the_integral_rests_at_the_limit():
    """An axis that is blocked 1 rad from the reference for 10 s, and then free: it is there within a second."""
    drive, inertia = Sampled(ALL["PID"]), 3.86e-4
    for _ in range(10_000):
        torque = drive(0.0, 1.0, 0.0)
    assert torque == LIMIT
    position = velocity = 0.0
    path = []
    for _ in range(2000):
        torque = drive(position, 1.0, 0.0)
        velocity += T * torque / inertia
        position += T * velocity
        path.append(position)
    assert abs(np.array(path[1000:]) - 1.0).max() < 1e-3
    assert max(path) < 2.5


def test_the_integral_leaves_the_limit_at_once():
    drive = Sampled(Controller(Gains(0.0, ki=1.0), None, LIMIT, T))
    while drive(0.0, 100.0, 0.0) < LIMIT:
        pass
    assert drive(0.0, 100.0, 0.0) == LIMIT
    drive(0.0, -100.0, 0.0)
    assert drive(0.0, -100.0, 0.0) < LIMIT


# ---- taking over ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "gains", [PID, place("PD", 3.86e-4, 36.0, 1.0), Gains(0.0)], ids=["PID", "PD", "none"]
)
@pytest.mark.parametrize("held", [-0.3, 0.0, 0.7])
def test_it_takes_over_from_the_torque_that_acts(gains, held):
    drive = Sampled(Controller(gains, Feedback(example(plugins.law("gms")), 0.8), LIMIT, T))
    own = Sampled(Controller(gains, Feedback(example(plugins.law("gms")), 0.8), LIMIT, T))
    torques = []
    for k in range(400):
        motion = (2.0 * T * k, 2.0 * T * k + 2e-3, 2.0)
        followed = drive(*motion, held, name="follow") if k < 200 else drive(*motion)
        torques.append(followed)
        alone = own(*motion)
    assert torques[:200] == [held] * 200
    step = PID.ki * 2e-3 * T + abs(alone - held) * T / 0.1 if gains.ki else abs(alone - held) * T / 0.1
    assert np.abs(np.diff(torques)).max() <= step + 5e-3 * abs(alone)
    if not gains.ki:
        assert torques[-1] == pytest.approx(alone, rel=1e-6)


# ---- C as Python, and single precision far out -----------------------------------------------------------------------

RUN = """#include "x.h"
#include <math.h>
#define TURN 6.283185307179586
void run(long n, const double *position, const double *wanted, const double *wanted_velocity, double *out)
{{
    x_state z;
    x_settings s;
    x_parameters p;
    x_memory m;
    x_surroundings u = {{ {around} }};
    x_init(&s, &p);
    x_reset(&m, &z);
    for (long i = 0; i < n; i++) {{
        const double x = position[i], w = wanted[i];
        const {real} v = ({real})wanted_velocity[i], a = 0;
        out[i] = (double)(CALL v, a, &s, &m, &z, &p, &u));
    }}
}}
"""
WHOLE = "x_sample(x, w,"
FOLLOWING = f"i < 50 ? x_follow(x, w, v, a, 0.3, &s, &m, &z, &p, &u) : {WHOLE}"
TURNS = ", ".join(f"({{real}})(long)({a} / TURN), ({{real}})fmod({a}, TURN)" for a in "xw")


def answers_of(controller, single, signals, folder, call):
    program = RUN.replace("CALL", call)
    return answers(built_controller(controller, program, folder, COMPILERS[-1], single), *signals)


def tracking(count, offset):
    t = T * np.arange(count)
    wanted = offset + 0.3 * np.sin(2.0 * np.pi * t)
    position = wanted - 2e-3 * np.cos(7.0 * t)
    position[count // 2] = math.nan
    return position, wanted, 0.6 * np.pi * np.cos(2.0 * np.pi * t)


@needs_compiler
@every_controller
def test_faults_and_taking_over_give_the_bits_of_python(controller, tmp_path):
    signals, drive = tracking(500, 0.0), Sampled(controller)
    got = answers_of(controller, False, signals, tmp_path, FOLLOWING)
    rows = [list(map(float, row)) for row in zip(*signals)]
    expected = [drive(*row, 0.3, name="follow") if k < 50 else drive(*row) for k, row in enumerate(rows)]
    np.testing.assert_array_equal(got, expected)


@needs_compiler
@every_controller
@pytest.mark.parametrize("call", [WHOLE, f"x_sample_turns({TURNS},"], ids=["double", "turns"])
def test_single_precision_loses_nothing_at_a_thousand_radians(controller, call, tmp_path):
    errors = []
    for offset in (0.0, 1000.0):
        signals, drive = tracking(1000, offset), Sampled(controller)
        expected = [drive(*map(float, row)) for row in zip(*signals)]
        errors.append(np.abs(answers_of(controller, True, signals, tmp_path, call) - expected).max())
    # The rest of a turn has steps of 2.4e-7 rad, and the contact of this law is as stiff as 6e3 N·m/rad.
    assert max(errors) < (1e-4 if call == WHOLE else 3e-3), errors


# ---- substeps ----------------------------------------------------------------------------------------------------


def along_a_reversal(substeps):
    """Torques of a feedforward in 2 ms samples about the reversal of a sine, in plain Python."""
    lugre = example(plugins.law("lugre"))
    drive = Sampled(Controller(Gains(0.0), Feedforward(lugre, substeps=substeps), sample_time=2e-3))
    speeds = [2.0 * math.sin(2.0 * math.pi * (2e-3 * k - 0.25)) for k in range(140)]
    return np.array([drive(0.0, 0.0, v) for v in speeds]), speeds


def test_substeps_divide_the_step_of_the_law_and_its_error():
    fine, one = along_a_reversal(400)[0], along_a_reversal(1)[0]
    four, speeds = along_a_reversal(4)
    model = example(plugins.law("lugre"))
    z, u, found = model.law.state(model.parameters), Surroundings(), [0.0]
    for v0, v1 in pairwise(speeds):
        ways = [v0 + (v1 - v0) * (i / 4.0) for i in range(4)] + [v1]
        found.append([model.law.step(a, b, 5e-4, z, model.parameters, u) for a, b in pairwise(ways)][-1])
    assert four[1:].tolist() == found[1:]
    assert abs(one - fine).max() > 5e-3
    assert abs(four - fine).max() < 0.2 * abs(one - fine).max()


def test_the_simulation_divides_the_sample_too():
    dahl = example(plugins.law("dahl"))
    drive = Sampled(Controller(Gains(0.0), Feedforward(dahl, substeps=3), sample_time=1e-3))
    reference = Reference("plain_sine", amplitude=0.5, frequency=2.0)
    controller = Controller(PID, Feedforward(dahl, substeps=3), sample_time=1e-3)
    record = simulate(RigidAxis(3.86e-4, dahl), controller, reference, 0.3, output=1e-3)
    rows = [np.flatnonzero(record.time == 1e-3 * k)[-1] for k in range(300)]
    speeds = reference.sample(1e-3 * np.arange(300) + 1e-11)[:, 1]
    told = [drive(0.0, 0.0, float(v)) for v in speeds]
    np.testing.assert_allclose(record["compensation_torque"][rows], told, rtol=0, atol=1e-9)
    assert record.meta["compensator"]["substeps"] == 3


@pytest.mark.parametrize("wrong", [0, 2.5, 1001, math.nan])
def test_substeps_are_a_whole_number(wrong):
    with pytest.raises(ParameterError, match=r"substeps = \S+ must be a whole number"):
        Feedforward(example(plugins.law("gms")), substeps=wrong)


def test_substeps_belong_to_samples():
    with pytest.raises(ParameterError, match="substeps needs a sampled controller"):
        Controller(PID, Feedforward(example(plugins.law("gms")), substeps=2))


def test_the_command_line_divides_and_states_the_error(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    lugre = example(plugins.law("lugre"))
    lines = [f"{k} = {v!r}" for k, v in lugre.parameters._asdict().items()]
    (tmp_path / "m.toml").write_text("\n".join(['law = "lugre"', "[parameters]", *lines]))
    call = ["export", "m.toml", "--to", "c99", "--out", "c", "--substeps"]
    assert main([*call, "8", "--compensator", "ff"]) == 0
    assert "8.0, /* feedforward_substeps:" in (tmp_path / "c/m.c").read_text()
    readme = (tmp_path / "c/README.md").read_text()
    assert f"| 1 | {step_errors(lugre)[1].whole:.2g} | {step_errors(lugre, parts=8)[1].parts:.2g} |" in readme
    assert "in 8 substeps" in readme
    assert "`p.feedforward_substeps` = 8" in readme
    for more, said in ((["8"], "--substeps belongs to"), (["0", "--compensator", "fb"], "--substeps 0 must")):
        assert main([*call, *more]) == 2
        assert said in capsys.readouterr().err


# ---- what the check of an export runs ------------------------------------------------------------------------------


@pytest.mark.skipif("gcc" not in COMPILERS, reason="needs gcc")
@pytest.mark.parametrize("name", ["c99", "arduino"])
def test_the_check_runs_the_controller(name):
    target = controller_target(name)
    export = target.write(ALL["FB"], "x", name == "arduino")
    assert target.check(export, "x").passed
    for wrong in ("-7", "m->applied + m->applied / 50"):
        files = {
            n: text.replace("return m->applied;", f"return {wrong};") for n, text in export.files.items()
        }
        assert files != export.files
        result = target.check(type(export)(files), "x")
        assert result.passed is False
        assert "N·m off the definition" in result.text


# ---- what a controller may be ------------------------------------------------------------------------------------


def test_a_position_that_was_counted_is_not_rounded_again():
    drive = Sampled(Controller(Gains(1.0), None, math.inf, T, encoder_counts=100.0))
    assert drive(0.0123, 0.0, 0.0) == -0.0123
    on_rig = control_of(Controller(Gains(1.0), None, math.inf, T, 100.0), Limits(1.0, 10.0, (-1.0, 1.0)), T)
    np.testing.assert_array_equal(on_rig.settings, drive.n)


def test_a_filter_above_half_the_sample_rate_is_refused():
    helper = Feedback(example(plugins.law("coulomb")), filter_hz=496.0)
    with pytest.raises(ParameterError, match=r"496 Hz .* at most 495 Hz"):
        Controller(PID, helper, sample_time=T)
    with pytest.raises(ParameterError, match=r"at most 495 Hz"):
        control_of(Controller(PID, helper), Limits(1.0, 10.0, (-1.0, 1.0)), T)
    assert Controller(PID, helper, sample_time=0.5 * T).compensator is helper
