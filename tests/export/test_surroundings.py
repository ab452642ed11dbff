"""A law that depends on load, temperature, position and time goes on doing so where it is exported."""

import importlib.util
import re
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from test_c99 import COMPILERS, CONTROL, answers, built_controller

from stickslip.cli import main
from stickslip.control import composition
from stickslip.control.compensator import Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import Gains
from stickslip.core.spec import Surroundings
from stickslip.exports import (
    TARGETS,
    arduino,
    c99,
    c99_controller,
    matlab,
    modelica,
    python,
    st,
    target_named,
)
from stickslip.exports.golden import answered
from stickslip.exports.job import Export, Job
from stickslip.models import plugins
from stickslip.models.model import Model
from support.laws import farthest
from support.structured_text import Program

T = 1e-3
TOOLS = {c99: bool(COMPILERS), python: True, matlab: bool(shutil.which("octave-cli"))}
DRIFT = Model("coulomb", {"time_dependence": "settling"}, fc=1.0, drift=-0.5, drift_time=0.2)


def modulated():
    """LuGre that depends on everything."""
    law = farthest(plugins.law("lugre"))
    return Model(law, **dict(law.example))


def around(**values):
    return SimpleNamespace(**{**Surroundings()._asdict(), **values})


def test_the_structured_text_block_follows_load_temperature_and_time():
    model = modulated()
    law, p, z = model.law, model.parameters, model.law.state(model.parameters)
    program = Program(st.write(Job(model, "friction")).files["friction.st"])
    block, u, last = program.instance("friction"), around(), 0.01
    for k in range(60):
        v, u.load, u.temperature, u.position = 0.01 + 1e-3 * k, 1.0 + 0.01 * k, 20.0 + k, 0.1 * k
        u.time += T if k else 0.0
        block.update(velocity=v, sample_time=T, position=u.position, restart=False, load=u.load,
                     temperature=u.temperature)  # fmt: skip
        program.run("friction", block)
        expected = law.step(last if k else v, v, T if k else 0.0, z, p, u)
        assert block["torque"] == pytest.approx(expected, rel=1e-9)
        last = v
    block["restart"] = True
    program.run("friction", block)
    (name,) = (n for n in block["u"] if n.strip("_").startswith("time"))
    assert block["u"][name] == 0.0


@pytest.mark.skipif(not COMPILERS, reason="needs a C compiler")
@pytest.mark.parametrize("single", [False, True])
def test_the_exported_controller_keeps_the_time(single, tmp_path):
    controller = Controller(Gains(0.0), Feedforward(DRIFT), sample_time=T)
    count = 2000
    signals = [np.zeros(count), np.zeros(count), np.ones(count), np.zeros(count)]
    program = CONTROL.replace("out[i] = ", "out[i] = (double)").replace(
        "wanted_velocity[i], wanted_acceleration[i]",
        "({real})wanted_velocity[i], ({real})wanted_acceleration[i]",
    )
    got = answers(built_controller(controller, program, tmp_path, COMPILERS[0], single), *signals)
    time = T * np.arange(count)
    np.testing.assert_allclose(got, 1.0 + 0.5 * np.expm1(-time / 0.2), rtol=1e-5 if single else 1e-12)


def test_the_time_of_the_samples_loses_nothing_in_single_precision_over_days():
    n = Controller(Gains(0.0), sample_time=T).settings
    m, u = SimpleNamespace(**{f.name: np.float32(0.0) for f in composition.MEMORY}), around()
    n = SimpleNamespace(**{k: np.float32(v) for k, v in n._replace(clock=1.0)._asdict().items()})
    m.seconds = np.float32(2e5)  # where a float has steps of 16 ms
    for _ in range(5001):
        composition.keep_time(n, m, u)
    assert float(u.time) == pytest.approx(200_005.0, abs=0.02)


def test_the_python_contact_has_load_and_temperature_and_its_time_runs(tmp_path):
    model = modulated()
    path = tmp_path / "x.py"
    path.write_text(python.write(Job(model, "x")).files["x.py"])
    spec = importlib.util.spec_from_file_location("x", path)
    spec.loader.exec_module(module := importlib.util.module_from_spec(spec))
    contact, u = module.Contact(), around(load=2.0, temperature=50.0, position=0.3)
    z, p = model.law.state(model.parameters), model.parameters
    for _ in range(2):
        for _ in range(20):
            u.time += T
            expected = model.law.step(0.1, 0.1, T, z, p, u)
            assert contact.step(0.1, 0.1, T, 0.3, load=2.0, temperature=50.0) == expected
        contact.reset()
        z, u.time = model.law.state(p), 0.0


def test_the_arduino_example_lets_the_time_run():
    assert "u.time += SAMPLE_TIME;" in arduino.write(Job(DRIFT, "x")).files["examples/Step/Step.ino"]


@pytest.mark.parametrize("name", TARGETS)
def test_a_target_that_carries_any_law_says_where_its_surroundings_come_from(name):
    target = target_named(name)
    assert target.forms or target.around in target.carries
    assert bool(target.forms) != bool(target.around)


@pytest.mark.parametrize("target", ["c99", "st", "linuxcnc", "python"])
def test_the_export_of_a_modulated_law_says_what_it_depends_on(target, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = 'law = "coulomb"\nchoices = {time_dependence = "settling", load_dependence = "load_power"}\n'
    (tmp_path / "m.toml").write_text(text + "[parameters]\nfc = 1.0\ndrift = -0.5\ndrift_time = 0.2\n")
    assert main(["export", "m.toml", "--to", target]) == 0
    said = capsys.readouterr().out
    assert f"friction depends on normal load and time: {target_named(target).around}" in said
    if target == "c99":
        assert "u.time += dt;" in (tmp_path / "m-c99" / "README.md").read_text()


RUN = """[axis]
inertia = 1e-3
load = 2.5
temperature = 55.0
[friction]
law = "coulomb"
fc = 1.0
[reference]
kind = "sine"
amplitude = 0.01
frequency = 4.0
duration = 0.1
[controller]
gains = {kp = 1.0}
compensator = "feedforward"
law = "mine"
sample_time = 1e-3
[laws.mine]
law = "coulomb"
load_dependence = "load_power"
fc = 1.0
"""


@pytest.mark.parametrize("target", ["c99", "arduino"])
def test_an_exported_controller_starts_where_the_run_is(target, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run.toml").write_text(RUN)
    check = ["--check"] if COMPILERS else []
    assert main(["export", "run.toml", "--to", target, "--controller", "--out", "x", *check]) == 0
    texts = [p.read_text() for p in (tmp_path / "x").rglob("*") if p.suffix in (".md", ".ino", ".c")]
    wanted = ("{ 0.0, 2.5, 55.0, 0.0, 0.0 }", "{ 0.0f, 2.5f, 55.0f, 0.0f, 0.0f }")
    assert (
        sum(any(text.count(w) for w in wanted) for text in texts) == 2
    )  # the README or example, and the check


@pytest.mark.parametrize("name", ["load", "temperature", "time"])
@pytest.mark.parametrize(("target", "single"), [(c99, False), (c99, True), (python, False), (matlab, False)])
def test_the_check_sees_a_modulation_that_stands_still(target, single, name):
    job, suffix = Job(modulated(), "x", single=single), "f" if single else ""
    export, read = target.write(job), rf"(?<!self\.)\bu(->|\.){name}\b(?! =)"
    still = rf"(0.0{suffix} * \g<0> + {getattr(Surroundings(), name)}{suffix})"
    here = TOOLS[target]
    assert target.check(job, export).passed is (True if here else None)
    code = ("x.c", "x.py", "x_step.m")
    files = {n: re.sub(read, still, str(t)) if n in code else t for n, t in export.files.items()}
    assert files != export.files
    if here:
        found = target.check(job, Export(files))
        assert found.passed is False
        assert "off the definition" in found.text


@pytest.mark.parametrize("name", ["position", "load", "temperature", "time"])
@pytest.mark.parametrize("target", [c99, python, st, modelica, matlab])
def test_golden_steps_tell_an_export_that_lost_a_modulation(target, name):
    """The torque that the law has with it at rest is another one, by more than a hundredth of the largest."""
    model = modulated()
    rows = np.loadtxt(target.write(Job(model, "x")).files["golden.csv"].splitlines()[1:], delimiter=",")
    v0, v1, dt, position, torque, *around = rows.T
    columns = dict(zip(("position", "load", "temperature", "time"), (position, *around)))
    assert np.array_equal(answered(model, v0, v1, dt, position, around=tuple(around)), torque)
    columns[name] = np.full(torque.size, getattr(Surroundings(), name))
    position, *around = columns.values()
    lost = answered(model, v0, v1, dt, position, around=tuple(around))
    assert np.abs(lost - torque).max() > 1e-2 * np.abs(torque).max()


@pytest.mark.parametrize("name", ["load", "temperature", "time"])
@pytest.mark.skipif(not COMPILERS, reason="needs a C compiler")
def test_golden_samples_tell_a_controller_that_lost_a_modulation(name):
    controller = Controller(Gains(0.0), Feedforward(modulated()), sample_time=T)
    export = c99_controller.write(controller, "x")
    assert c99_controller.check(export, "x").passed
    head, name_of, body = export.files["x.c"].partition("double x_feedforward_over_sample(")
    body, brace, rest = body.partition("\n}\n")
    still = f"{{\n    x_surroundings here = *u;\n    here.{name} = {getattr(Surroundings(), name)};"
    body = body.replace("{", still, 1).replace("p, u);", "p, &here);")
    assert "&here" in body
    source = "".join([head, name_of, body, brace, rest])
    found = c99_controller.check(Export({**export.files, "x.c": source}), "x")
    assert found.passed is False
    assert "off the definition" in found.text
