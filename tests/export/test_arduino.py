"""The Arduino library with a whole controller, and its example for a board's own compiler."""

import shutil
import subprocess

import pytest

from stickslip.control.compensator import Feedback
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.exports import arduino, arduino_controller, c99
from stickslip.exports.job import Job
from stickslip.models import plugins
from stickslip.models.model import Model


def controller_with(model):
    helper = Feedback(model, filter_hz=10.0)
    return Controller(place("PID", 1e-3, 10.0, 1.0), helper, sample_time=2e-3)


def exported(model, kind):
    """The export of the law, or of a controller that holds it."""
    if kind == "law":
        return arduino.write(Job(model, "joint"))
    return arduino_controller.write(controller_with(model), "joint")


GMS = Model("gms", **plugins.law("gms").example)


@pytest.mark.parametrize("kind", ["law", "controller"])
def test_library_and_example_compile_and_run(kind):
    export = exported(GMS, kind)
    result = arduino.tried(export, "joint")
    if result.passed is None:
        pytest.skip(result.text)
    assert result.passed, result.text
    broken = {**export.files, "examples/Step/Step.ino": "void setup() { joint_missing(); }"}
    assert arduino.tried(type(export)(broken), "joint").passed is False


@pytest.mark.skipif(shutil.which("avr-g++") is None, reason="needs avr-g++")
@pytest.mark.parametrize("law", ["dahl", "gms", "lugre"])
def test_library_and_example_link_for_an_avr_whose_library_has_less(law):
    for kind in ("law", "controller"):
        export = exported(Model(law, **plugins.law(law).example), kind)
        assert "avr-g++" in arduino.tried(export, "joint").text
        without = {n: str(text).replace("#ifdef __AVR__", "#if 0") for n, text in export.files.items()}
        found = arduino.tried(type(export)(without), "joint")
        assert found.passed is False
        assert found.text.startswith("avr-g++: ")


@pytest.mark.parametrize("law", ["dahl", "gms", "lugre"])
def test_what_the_avr_lacks_is_as_good_as_the_librarys(law, tmp_path):
    compiler = shutil.which("gcc")
    if compiler is None:
        pytest.skip("needs gcc")
    delta = {"delta_d": 1.4} if law == "dahl" else {}
    export = c99.write(Job(Model(law, **{**plugins.law(law).example, **delta}), "x", single=True))
    for name, text in export.files.items():
        (tmp_path / name).write_text(str(text))
    errors = []
    for board in ([], ["-D__AVR__"]):
        subprocess.run(
            [compiler, "-O2", *board, "x.c", "x_check.c", "-lm", "-o", "check"], cwd=tmp_path, check=True
        )
        errors.append(
            float(subprocess.run(["./check"], cwd=tmp_path, capture_output=True, check=True).stdout)
        )
    assert errors[1] <= 2.0 * errors[0] + 1e-7


@pytest.mark.skipif(shutil.which("arm-none-eabi-g++") is None, reason="needs arm-none-eabi-g++")
def test_the_library_compiles_for_a_microcontroller_without_double_precision(tmp_path):
    for name, text in exported(GMS, "controller").files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    core = ["-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"]
    command = [
        "arm-none-eabi-g++",
        *core,
        "-Wdouble-promotion",
        "-Werror",
        "-c",
        "src/joint.cpp",
        "-o",
        "joint.o",
    ]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
