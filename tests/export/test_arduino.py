"""The Arduino library with a whole controller, and its example for a board's own compiler."""

import shutil
import subprocess

import pytest

from stickslip import plugins
from stickslip.control.compensators.feedback import Feedback
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.export import arduino
from stickslip.export.job import Job
from stickslip.model import Model


def jobs():
    model = Model("gms", **plugins.law("gms").example)
    control = Controller(place("PID", 1e-3, 10.0, 1.0), Feedback(model, filter_hz=10.0), sample_time=2e-3)
    return Job(model, "joint"), Job(model, "joint", control)


@pytest.mark.parametrize("job", jobs(), ids=["law", "controller"])
def test_library_and_example_compile_and_run(job):
    export = arduino.write(job)
    result = arduino.check(job, export)
    if result.passed is None:
        pytest.skip(result.text)
    assert result.passed, result.text
    broken = {**export.files, "examples/Step/Step.ino": "void setup() { joint_missing(); }"}
    assert arduino.check(job, type(export)(broken)).passed is False


@pytest.mark.skipif(shutil.which("arm-none-eabi-g++") is None, reason="needs arm-none-eabi-g++")
def test_the_library_compiles_for_a_microcontroller_without_double_precision(tmp_path):
    for name, text in arduino.write(jobs()[1]).files.items():
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
