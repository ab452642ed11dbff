"""Controllers made of control laws in every language that carries them, against plain Python sample by sample."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from stickslip.contract.control_laws import Plain, specimen
from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.control.registry import control_law, control_law_names
from stickslip.core.errors import UnknownName
from stickslip.exports import CONTROLLER_TARGETS, controller_target
from stickslip.exports._fmu_run import played
from stickslip.exports.controllers import golden_samples
from stickslip.exports.st_controller import GIVEN
from stickslip.models import plugins
from stickslip.models.model import Model
from support.structured_text import Program

OWN = Path(__file__).parents[1] / "support" / "sliding_mode.py"
T = 1e-3
PD = ControlBlock("pd", kp=6.099, kd=0.097067)
PID = ControlBlock(
    "pid", None, {"anti_windup": "back_calculation", "at_rest": "reset"}, kp=18.297, ki=766.4, kd=0.1456,
    tracking_time=0.02,
)  # fmt: skip
OBSERVER = ControlBlock("disturbance_observer", None, {"order": "second"}, inertia=3.8623e-4, corner=300.0)
GMS = Model("gms", **plugins.law("gms").example)
LUGRE = Model("lugre", **plugins.law("lugre").example)
CONTROLLERS = {
    "PD": Controller(loop=PD, sample_time=T),
    "PID and observer": Controller(
        loop=PID, sample_time=T, feedforward=ControlBlock("inertia_feedforward", inertia=3.8e-4), observer=OBSERVER,
        estimator=ControlBlock("butterworth_difference", corner=900.0), torque_limit=1.0,
    ),
    "two held laws": Controller(
        loop=PD, sample_time=T,
        feedforward=[ControlBlock("friction_feedforward", LUGRE), ControlBlock("inertia_feedforward", inertia=3.8e-4)],
        observer=ControlBlock("friction_feedback", GMS), torque_limit=0.8,
    ),
    "own law": Controller(
        loop=ControlBlock(str(OWN), inertia=3.8e-4, slope=60.0, torque=0.4, layer=0.5), sample_time=T, torque_limit=1.0
    ),
}  # fmt: skip


@pytest.mark.parametrize("controller", CONTROLLERS.values(), ids=CONTROLLERS)
@pytest.mark.parametrize("name", [n for n in CONTROLLER_TARGETS if n != "st"])
def test_it_gives_the_torque_of_plain_python(name, controller):
    target = controller_target(name)
    export = target.write(controller, "axis", False)
    result = target.check(export, "axis")
    if result.passed is None:
        pytest.skip(result.text)
    assert result.passed, result.text
    assert "README.md" in export.files


@pytest.mark.parametrize("controller", CONTROLLERS.values(), ids=CONTROLLERS)
@pytest.mark.parametrize("name", ["axis", "reference"])  # the second is a word of the language
def test_the_function_block_gives_the_torque_of_plain_python(name, controller):
    export = controller_target("st").write(controller, name, False)
    program = Program(export.files[f"{name}.st"])
    block = next(pou for pou in program.pous if "elsewhere" in program.instance(pou))
    v, samples = program.instance(block), golden_samples(controller)
    for row in zip(*(column.tolist() for column in samples)):
        *given, torque, v["load"], v["temperature"] = row
        v.update(zip(GIVEN, given))
        program.run(block, v)
        assert v["torque"] == pytest.approx(torque, abs=1e-11 * max(abs(samples.torque)))
        assert (v["fault"] > 0.0) == any(math.isnan(x) for x in given)


@pytest.mark.parametrize("name", control_law_names())
def test_every_control_law_goes_to_the_languages_without_a_c_compiler(name):
    controller = specimen(control_law(name))
    for language in ("python", "matlab"):
        target = controller_target(language)
        result = target.check(target.write(controller, "axis", False), "axis")
        assert result.passed is not False, f"{language}: {result.text}"
    program = Program(controller_target("st").write(controller, "axis", False).files["axis.st"])
    v, samples = program.instance("axis"), golden_samples(controller, count=150)
    for row in zip(*(column.tolist() for column in samples)):
        *given, torque, v["load"], v["temperature"] = row
        v.update(zip(GIVEN, given))
        program.run("axis", v)
        assert v["torque"] == pytest.approx(torque, abs=1e-10 * max(abs(samples.torque)))


def test_the_function_block_takes_over_and_restarts():
    controller = CONTROLLERS["PID and observer"]
    program = Program(controller_target("st").write(controller, "axis", False).files["axis.st"])
    v = program.instance("axis")
    v.update(position=0.0, reference_position=0.02, reference_velocity=0.0, reference_acceleration=0.0)
    first = [program.run("axis", v) or v["torque"] for _ in range(3)]
    v.update(elsewhere=True, held=0.3)
    for _ in range(20):
        program.run("axis", v)
    v["elsewhere"] = False
    program.run("axis", v)
    assert v["torque"] == pytest.approx(0.3, abs=1e-12)
    v["restart"] = True
    program.run("axis", v)
    assert v["torque"] == first[0] != 0.3


def test_what_carries_no_controller_is_told():
    with pytest.raises(UnknownName, match="urdf"):
        controller_target("urdf")


@pytest.mark.parametrize("steps", [5, 1, 0.25], ids=["five steps a sample", "one", "four samples a step"])
def test_the_unit_samples_by_itself_whatever_the_communication_step(steps):
    """With inputs that stand still over a sample (or over a step, where that is longer) the torque is Python's."""
    pytest.importorskip("fmpy")
    controller = CONTROLLERS["PID and observer"]
    unit = controller_target("fmu").write(controller, "axis", False).files["axis.fmu"]
    count, h = 40 * max(1, round(steps)), T / steps
    time = 0.5 + h * np.arange(count)
    sample = np.maximum(np.floor((time - 0.5) / T + 1e-6), np.arange(count) if steps < 1 else 0)
    given = {"position": 1e-3 * np.sin(0.3 * sample), "reference": 2e-3 * np.cos(0.3 * sample)}
    answer = played(unit, time, np.full(count, h), given, ("torque",))
    if not isinstance(answer, np.ndarray):
        pytest.skip(answer.text)
    plain, expected = Plain(controller), []
    for k in range(count):
        due = 1 if steps == 1 else (4 if steps < 1 else int(k % steps == 0))
        row = (float(given["position"][k]), float(given["reference"][k]), 0.0, 0.0)
        expected.append([plain(row) for _ in range(due)][-1] if due else expected[-1])
    assert answer[:, 0] == pytest.approx(expected, abs=0.0)


SIDES = """
import math
from typing import Annotated, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    torque: Annotated[float, Par("N·m", "K", "torque", positive=True)]


class State(NamedTuple):
    last: Annotated[float, Par("rad/s", "s", "surface a sample ago")]


def sample(y, z, p, u):
    s = y.reference_velocity - y.velocity + 60.0 * y.error
    sign = math.copysign(1.0, s) if s != 0.0 else 0.0
    z.last += 0.5 * (abs(s) if s > 1.0 else 1.0 / (2.0 + s if s > -1.0 else 3.0)) - 0.5 * z.last
    if (1.0 / s if s != 0.0 else 0.0) > z.last:
        sign = sign + 0.1
    elif s < -3.0:
        sign = -2.0
    return p.torque * sign + (0.1 / s if abs(s) > 1.0 else 0.1 * s) + 0.01 * z.last


CONTROL_LAW = ControlLaw("sides", Params, sample, "loop", State=State, title="Sides", equation="T", source=("own",),
                         example={"torque": 0.4})
"""


def test_conditional_expressions_are_if_statements_in_structured_text(tmp_path):
    """A law that held every check of its contract was refused there, without the place in its file."""
    (tmp_path / "sides.py").write_text(SIDES)
    loop = ControlBlock(str(tmp_path / "sides.py"), torque=0.4)
    controller = Controller(loop=loop, sample_time=T, torque_limit=1.0)
    program = Program(controller_target("st").write(controller, "axis", False).files["axis.st"])
    block = next(pou for pou in program.pous if "elsewhere" in program.instance(pou))
    v, samples = program.instance(block), golden_samples(controller)
    for row in zip(*(column.tolist() for column in samples)):
        *given, torque, v["load"], v["temperature"] = row
        v.update(zip(GIVEN, given))
        program.run(block, v)
        assert v["torque"] == pytest.approx(torque, abs=1e-11)
