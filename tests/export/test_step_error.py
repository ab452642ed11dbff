"""What an export says of the error of a step, and the substeps that make it smaller."""

import importlib.util
import math
import re
import shutil
import subprocess

import numpy as np
import pytest

from stickslip.core.spec import Surroundings
from stickslip.exports import _fmu, arduino, c99, fmu, fmu_axis, linuxcnc, matlab, modelica, python, st
from stickslip.exports._step_error import PARTS, step_errors
from stickslip.exports.job import Job
from stickslip.models import plugins
from stickslip.models.model import Model
from support.structured_text import Program

LUGRE = Model("lugre", **plugins.law("lugre").example)
TARGETS = (arduino, c99, fmu, linuxcnc, matlab, modelica, python, st)


def torques(times, parts=1):
    """Plain Python on a sine of 2 rad/s and 1 Hz, from rest at its peak."""
    z, last, v0, out = LUGRE.law.state(LUGRE.parameters), -0.25, -2.0, []
    for time in times:
        v1 = 2.0 * math.sin(2.0 * math.pi * time)
        for i in range(parts):
            a, b = (v0 + (v1 - v0) * (i + k) / parts for k in (0, 1))
            torque = LUGRE.law.step(a, b, (time - last) / parts, z, LUGRE.parameters, Surroundings())
        out.append(torque)
        v0, last = v1, time
    return out


@pytest.mark.parametrize(("sample_time", "row"), [(2e-3, 0), (1e-3, 1), (5e-4, 2)])
def test_the_stated_error_is_that_against_steps_of_two_microseconds(sample_time, row):
    begin, worst = [-0.25 + 1e-3 * i for i in range(240)], [0.0, 0.0]
    for phase in (0.0, 0.25, 0.5, 0.75):
        coarse = [(i + phase) * sample_time for i in range(-4, 5)]
        stride = round(sample_time / 2e-6)
        fine = [(i / stride + phase) * sample_time for i in range(-4 * stride, 4 * stride + 1)]
        exact = torques([*begin, *fine])[-len(fine) :: stride]
        for i, parts in enumerate((1, PARTS)):
            found = torques([*begin, *coarse], parts)[-len(coarse) :]
            worst[i] = max(worst[i], *(abs(a - b) for a, b in zip(found, exact)))
    said = step_errors(LUGRE)[row]
    assert said.sample_time == sample_time
    assert (said.whole, said.parts) == pytest.approx(worst, rel=0.1)
    assert said.parts < 0.4 * said.whole


@pytest.mark.parametrize("target", TARGETS, ids=lambda m: m.TARGET.name)
def test_every_readme_states_it(target, monkeypatch):
    monkeypatch.setattr(_fmu, "_compiled", lambda *_: None)
    assert stated(target.write(Job(LUGRE, "x"))) == in_rows(step_errors(LUGRE))


def test_an_axis_states_the_error_of_its_own_stages(monkeypatch):
    monkeypatch.setattr(_fmu, "_compiled", lambda *_: None)
    monkeypatch.setattr(fmu_axis, "driven", lambda _: fmu_axis.Driven(*np.zeros((4, 1))))
    job = Job(LUGRE, "x", settings={"inertia": 1e-3})
    found = step_errors(LUGRE, held=True)
    assert stated(fmu_axis.write(job)) == in_rows(found)
    # A slope taken as two velocities that are held: far worse than one that is linear, and less the shorter.
    assert all(e.whole > 2.0 * other.whole for e, other in zip(found, step_errors(LUGRE)))
    assert all(e.parts < 0.5 * e.whole for e in found)


def stated(export):
    """The numbers of the table in a README, which ends with how a step is divided."""
    readme = export.files["README.md"]
    rows = re.findall(r"\| (\S+) \| (\S+) \| (\S+) \|\n", readme.partition("## How exact")[2])
    assert re.search(
        r"substeps|samplePeriod|several times|communication step|max_step", readme.rstrip().splitlines()[-1]
    )
    return [
        tuple(map(float, row)) for row in rows[2 if rows[0][0] == "---" else 0 :] if row[0] != "---|---|---"
    ]


def in_rows(errors):
    """Of a table: ms, N·m, N·m."""
    return [(1e3 * e.sample_time, float(f"{e.whole:.2g}"), float(f"{e.parts:.2g}")) for e in errors]


def divided(motion, parts):
    """Torques of plain Python, every step divided."""
    z, out = LUGRE.law.state(LUGRE.parameters), []
    for v0, v1, dt in motion:
        slope = (v1 - v0) / parts
        for i in range(1, parts):
            a, b = v0 + slope * (i - 1), v0 + slope * i
            LUGRE.law.step(a, b, dt / parts, z, LUGRE.parameters, Surroundings())
        v = v0 + slope * (parts - 1)
        out.append(LUGRE.law.step(v, v1, dt / parts, z, LUGRE.parameters, Surroundings()))
    return out


MOTION = [(math.sin(0.9 * k), math.sin(0.9 * k + 0.9), 1e-3) for k in range(40)]


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
def test_substeps_in_c(tmp_path):
    for name, text in c99.write(Job(LUGRE, "x")).files.items():
        (tmp_path / name).write_text(str(text))
    rows = ", ".join("{" + ", ".join(map(repr, row)) + "}" for row in MOTION)
    (tmp_path / "main.c").write_text(f"""#include "x.h"
#include <stdio.h>
int main(void) {{
    static const double motion[][3] = {{ {rows} }};
    for (int count = 0; count < 5; count++) {{
        x_state z; x_surroundings u = {{ 0.0, 1.0, 20.0, 0.0, 0.0 }};
        x_reset(&z);
        for (int i = 0; i < {len(MOTION)}; i++)
            printf("%.17g\\n", x_substeps(motion[i][0], motion[i][1], motion[i][2], count, &z, &x_identified, &u));
    }}
    return 0;
}}
""")
    subprocess.run(
        ["gcc", "-std=c99", *c99.FLAGS[1:4], "main.c", "x.c", "-lm", "-o", "main"], cwd=tmp_path, check=True
    )
    printed = subprocess.run(["./main"], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    found = [float(line) for line in printed.split()]
    assert found == [torque for parts in (1, 1, 2, 3, 4) for torque in divided(MOTION, parts)]


def test_substeps_in_python(tmp_path):
    (tmp_path / "alone.py").write_text(python.write(Job(LUGRE, "alone")).files["alone.py"])
    spec = importlib.util.spec_from_file_location("alone", tmp_path / "alone.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for parts in (1, 4):
        contact = module.Contact()
        assert [contact.step(*row, substeps=parts) for row in MOTION] == divided(MOTION, parts)


def as_python(text):
    """A function of MATLAB, of assignments and loops, in Python: the same lines in the same order."""
    changes = (
        (r"^function \[(.*?)\] = (\w+)\((.*)\)$", r"def \2(\3):"), (r"^(\s*)%.*", r"\1pass"),
        (r"for (\w+) = 1:\((.*)\)$", r"for \1 in range(1, (\2) + 1):"), (r"\[(~|\w+), z\] =", r"\1, z ="),
        ("~", "_"), (r"\bfix\(", "int("), (r"^(\s*)end;?$", r"\1pass"), (";$", ""),
    )  # fmt: skip
    lines = text.splitlines()
    assert lines[-1] == "end"
    outputs = re.match(r"function \[(.*?)\]", lines[0])[1]
    for i, line in enumerate(lines):
        for pattern, by in changes:
            line = re.sub(pattern, by, line)
        lines[i] = line
    lines[-1] = f"    return {outputs}"
    return "\n".join(lines)


@pytest.mark.parametrize("parts", [0, 1, 4])
def test_substeps_in_matlab_by_their_lines(parts):
    def step(v0, v1, dt, z, p, u):
        return LUGRE.law.step(v0, v1, dt, z, p, u), z

    scope = {"x_step": step}
    exec(as_python(matlab.write(Job(LUGRE, "x")).files["x_substeps.m"]), scope)
    z, found = LUGRE.law.state(LUGRE.parameters), []
    for row in MOTION:
        torque, z = scope["x_substeps"](*row, parts, z, LUGRE.parameters, Surroundings())
        found.append(torque)
    assert found == divided(MOTION, max(parts, 1))


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="needs Octave")
def test_substeps_in_octave(tmp_path):
    for name, text in matlab.write(Job(LUGRE, "x")).files.items():
        (tmp_path / name).write_text(str(text))
    rows = "; ".join(" ".join(map(repr, row)) for row in MOTION)
    (tmp_path / "main.m").write_text(f"""rows = [{rows}];
p = x_parameters(); u = x_surroundings();
for count = [1 4]
    z = x_reset();
    for i = 1:size(rows, 1)
        [torque, z] = x_substeps(rows(i, 1), rows(i, 2), rows(i, 3), count, z, p, u);
        disp(num2str(torque, 17));
    end
end
""")
    command = ["octave-cli", "--norc", "--quiet", "--eval", "main"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    expected = [torque for parts in (1, 4) for torque in divided(MOTION, parts)]
    assert [float(line) for line in done.stdout.split()] == pytest.approx(expected, rel=matlab.BOUND)


@pytest.mark.parametrize("parts", [0, 1, 4])
def test_substeps_in_structured_text(parts):
    program = Program(st.write(Job(LUGRE, "friction")).files["friction.st"])
    block = program.instance("friction")
    block["substeps"] = parts
    motion = [(MOTION[0][0], MOTION[0][0], 0.0), *MOTION]
    found = []
    for _, velocity, _ in motion:
        block.update(velocity=velocity, sample_time=1e-3)
        program.run("friction", block)
        found.append(block["torque"])
    assert found == pytest.approx(divided(motion, max(parts, 1)), abs=1e-12)
