"""The HAL component: its declarations are those of halcompile, and its function gives the torque of the law."""

import shutil

import numpy as np
import pytest

from stickslip.core.spec import Surroundings
from stickslip.exports import linuxcnc
from stickslip.exports.job import Job
from stickslip.models import plugins
from stickslip.models.model import Model
from support.hal_component import Component
from support.laws import farthest, label, registered

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
LAWS = [*registered(), farthest(registered()[-1])]


def component(model, folder):
    for name, text in linuxcnc.write(Job(model, "axis")).files.items():
        (folder / name).write_text(text)
    return Component((folder / "axis.comp").read_text(), folder)


@pytest.mark.parametrize("law", LAWS, ids=label)
def test_the_function_gives_the_torque_of_the_law(law, tmp_path):
    model = Model(law, **dict(law.example))
    made, p, z = component(model, tmp_path), model.parameters, law.state(model.parameters)
    draw = np.random.default_rng(2)
    velocity = np.cumsum(draw.normal(0.0, 0.01, 300)) * (draw.random(300) > 0.05)
    position, last = 0.0, float(velocity[0])
    made.place("load").value, made.place("temperature").value = 1.5, 35.0
    time = 0.0
    for v in velocity:
        made.place("velocity").value, made.place("position").value = v, position
        made.run(1_000_000)
        time += 1_000_000 * 1e-9
        around = Surroundings(position=position, load=1.5, temperature=35.0, time=time)
        expected = law.step(last, float(v), 1_000_000 * 1e-9, z, p, around)
        assert made.place("torque").value == expected
        position, last = position + 1e-3 * float(v), float(v)


def test_scales_turn_the_machines_units_into_ours_and_back(tmp_path):
    made = component(Model("coulomb", fc=0.25, sigma2=0.5), tmp_path)
    made.place("velocity_scale").value, made.place("torque_scale").value = 0.5, 100.0
    made.place("velocity").value = 4.0
    made.run(1_000_000)
    assert made.place("torque").value == 100.0 * (0.25 + 0.5 * 2.0)


def test_it_rests_while_it_is_not_enabled_and_starts_afresh(tmp_path):
    model = Model("dahl", sigma0=1e3, fc=1.0)
    made = component(model, tmp_path)
    made.place("velocity").value = 0.1
    for _ in range(3):
        made.run(1_000_000)
    bent = made.place("torque").value
    assert bent > 0.1
    made.place("enable").value = 0
    made.run(1_000_000)
    assert made.place("torque").value == 0.0
    made.place("enable").value = 1
    for _ in range(3):
        made.run(1_000_000)
    assert made.place("torque").value == bent


def test_it_declares_what_halcompile_asks_for(tmp_path):
    made = component(Model("coulomb", fc=0.25), tmp_path)
    assert {"velocity", "position", "load", "temperature", "enable", "torque"} == set(made.pins)
    assert made.includes == ["axis_law.c"]
    assert made.texts.count("text") == 3  # description, license, author
    assert "function" in made.texts


def test_substeps_divide_the_step_of_a_period(tmp_path):
    law = plugins.law("lugre")
    model = Model(law, **law.example)
    made, z = component(model, tmp_path), law.state(model.parameters)
    made.place("substeps").value = 2
    for last, v in ((0.1, 0.1), (0.1, -0.3), (-0.3, 0.2)):
        made.place("velocity").value = v
        made.run(1_000_000)
        slope, dt = (v - last) / 2, 1_000_000 * 1e-9
        law.step(last, last + slope, dt / 2, z, model.parameters, Surroundings())
        torque = law.step(last + slope, v, dt / 2, z, model.parameters, Surroundings())
        assert made.place("torque").value == torque
