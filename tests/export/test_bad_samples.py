"""One bad sample does not stay in an exported law: it gives no torque, and the law goes on as if it had not been."""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.spec import Surroundings
from stickslip.exports import linuxcnc
from stickslip.exports.job import Job
from stickslip.models.plugins import law
from support.hal_component import Component
from support.modelica_text import Package
from support.structured_text import Program

DT = 1e-3
BAD = (math.nan, math.inf, -math.inf, 1e200)
MODELS = {
    "lugre": ss.Model("lugre", sigma0=1e3, sigma1=1.0, fc=0.3, fs=0.4, vs=0.1, sigma2=0.01),
    "position": ss.Model(
        law("dahl").having(position_dependence="spectrum"),
        sigma0=1e3,
        fc=0.3,
        order=(2.0,),
        ripple=(0.3,),
        ripple_phase=(0.1,),
    ),
    "coulomb": ss.Model("coulomb", fc=0.3, sigma2=0.01),
}
needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
every_model = pytest.mark.parametrize("name", MODELS)


@dataclass
class Law:
    """The law itself: what an export must answer."""

    model: ss.Model
    z: Any = field(init=False)

    def __post_init__(self):
        self.z = self.model.law.state(self.model.parameters)

    def step(self, v0, v1, position=0.0):
        return self.model.law.step(v0, v1, DT, self.z, self.model.parameters, Surroundings(position=position))


def insist(step, own):
    """Good steps, bad ones of every kind among them, and the torque of the law without these."""
    draw = np.random.default_rng(1)
    for k, bad in enumerate((None, *BAD, None)):
        for v0, v1, x in draw.uniform(-0.3, 0.3, (5, 3)).tolist():
            assert step(v0, v1, x) == pytest.approx(own.step(v0, v1, x), rel=1e-9, abs=1e-12)
        if bad is not None:
            assert step(0.1, bad, 0.0) == 0.0, k
            assert step(bad, 0.1, 0.0) == 0.0, k
            assert step(bad, bad, 0.0) == 0.0, k
            if own.model.law.chosen.get("position_dependence") == "spectrum":
                assert step(0.1, 0.1, bad) == 0.0, k


@every_model
def test_a_contact_in_python(name):
    scope = {"__name__": "axis"}
    exec(str(ss.export(MODELS[name], to="python", name="axis").files["axis.py"]), scope)
    contact = scope["Contact"]()
    insist(lambda v0, v1, x: contact.step(v0, v1, DT, position=x), Law(MODELS[name]))
    time = contact.u.time
    assert contact.step(0.1, 0.1, math.nan) == 0.0
    assert contact.u.time == time


@needs_gcc
@every_model
@pytest.mark.parametrize("single", [False, True])
def test_a_contact_in_c(name, single, tmp_path):
    for file, text in ss.export(MODELS[name], to="c99", name="axis", single=single).files.items():
        (tmp_path / file).write_text(text)
    real = "float" if single else "double"
    (tmp_path / "run.c").write_text(f"""#include "axis.h"
static axis_parameters p; static axis_state z; static axis_surroundings u = {{0, 1, 20, 0, 0}};
void start(void) {{ axis_init(&p); axis_reset(&z); }}
double run(double v0, double v1, double dt, double x)
{{
    u.position = ({real})x;
    return (double)axis_substeps(({real})v0, ({real})v1, ({real})dt, 1, &z, &p, &u);
}}
""")
    command = ["gcc", "-std=c99", "-O2", "-shared", "-fPIC", "axis.c", "run.c", "-lm", "-o", "run.so"]
    subprocess.run(command, cwd=tmp_path, check=True)
    built = ctypes.CDLL(str(tmp_path / "run.so"))
    built.run.restype, built.run.argtypes = ctypes.c_double, [ctypes.c_double] * 4
    built.start()
    if not single:
        insist(lambda v0, v1, x: built.run(v0, v1, DT, x), Law(MODELS[name]))
    before = built.run(0.1, 0.1, 0.0, 0.0)
    for bad in BAD:
        assert built.run(0.1, bad, DT, 0.0) == built.run(0.1, 0.1, bad, 0.0) == 0.0
        assert built.run(0.1, 0.1, 0.0, 0.0) == before


@every_model
def test_a_block_in_structured_text(name):
    program = Program(ss.export(MODELS[name], to="st", name="axis").files["axis.st"])
    block, law, last = program.instance("axis"), Law(MODELS[name]), 0.0
    block |= {"velocity": 0.0, "sample_time": DT}
    program.run("axis", block)
    draw = np.random.default_rng(1)
    for bad in (None, *BAD):
        if bad is not None:
            for given in ({"velocity": bad}, {"sample_time": bad}, {"velocity": bad, "sample_time": bad}):
                block |= {"velocity": 0.1, "sample_time": DT, **given}
                program.run("axis", block)
                assert block["torque"] == 0.0
        for v in draw.uniform(-0.3, 0.3, 4).tolist():
            block |= {"velocity": v, "sample_time": DT, "position": 0.2}
            program.run("axis", block)
            assert block["torque"] == pytest.approx(law.step(last, v, 0.2), rel=1e-9, abs=1e-12)
            last = v
    block |= {"velocity": math.nan, "restart": True}
    program.run("axis", block)
    block |= {"velocity": 0.2, "restart": False}
    program.run("axis", block)  # the restart was not lost
    assert block["torque"] == pytest.approx(Law(MODELS[name]).model.law.step(
        0.2, 0.2, 0.0, Law(MODELS[name]).z, MODELS[name].parameters, Surroundings(position=0.2)
    ), abs=1e-12)  # fmt: skip


@needs_gcc
@every_model
def test_a_component_of_linuxcnc(name, tmp_path):
    for file, text in linuxcnc.write(Job(MODELS[name], "axis")).files.items():
        (tmp_path / file).write_text(text)
    made, law, last = Component((tmp_path / "axis.comp").read_text(), tmp_path), Law(MODELS[name]), 0.0
    made.place("velocity").value = 0.0
    made.run(1_000_000)
    for bad in BAD:
        made.place("velocity").value = bad
        made.run(1_000_000)
        assert made.place("torque").value == 0.0
        for v in (0.1, -0.2):
            made.place("velocity").value = v
            made.run(1_000_000)
            assert made.place("torque").value == pytest.approx(law.step(last, v), rel=1e-9, abs=1e-12)
            last = v


@every_model
def test_a_step_in_modelica(name):
    package = Package(ss.export(MODELS[name], to="modelica", name="axis").files["axis.mo"])
    names = package.functions["step"][0]
    v = {"p": package.record("Parameters"), "u": package.record("Surroundings")}
    v["z"] = v["z_in"] = package.record("State") if "State" in package.records else {}

    def step(v0, v1, x):
        v.update({"v0": v0, "v1": v1, "dt": DT, "dt_": DT})
        v["u"]["position"] = x
        got, *after = package.call("step", [v[n] for n in names])
        if after:
            v["z"] = v["z_in"] = after[0]
        return got

    insist(step, Law(MODELS[name]))


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="needs Octave")
@every_model
def test_a_step_in_octave(name, tmp_path):
    for file, text in ss.export(MODELS[name], to="matlab", name="axis").files.items():
        (tmp_path / file).write_text(text)
    (tmp_path / "run.m").write_text("""p = axis_parameters(); z = axis_reset(); u = axis_surroundings();
[before, z] = axis_step(0.1, 0.2, 1e-3, z, p, u);
for bad = [NaN, Inf, -Inf, 1e200]
    [torque, z] = axis_step(0.1, bad, 1e-3, z, p, u); assert(torque == 0.0);
    [torque, z] = axis_step(0.1, 0.1, bad, z, p, u); assert(torque == 0.0);
    [torque, z] = axis_step(0.2, 0.2, 0.0, z, p, u); assert(abs(torque - before) < 1e-12);
end
""")
    done = subprocess.run(
        ["octave-cli", "--norc", "--quiet", "run.m"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_every_readme_says_what_a_bad_sample_does():
    for to in ("c99", "arduino", "python", "matlab", "st", "linuxcnc", "modelica"):
        assert "no finite number" in ss.export(MODELS["lugre"], to=to, name="axis").files["README.md"], to
