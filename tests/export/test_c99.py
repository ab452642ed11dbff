"""The C of every registered law and of the sampled controller against compiled and plain Python."""

import ctypes
import re
import shutil
import subprocess
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import Gains, place
from stickslip.core.errors import InputError
from stickslip.core.spec import Surroundings
from stickslip.exports import c99, c99_controller
from stickslip.exports.golden import Golden, golden, random_steps, room_beside_jumps
from stickslip.exports.job import Job
from stickslip.jit import call_sample, call_step, compiled_step, flat, kernel, pointer
from stickslip.laws import LAWS as BUILT_IN
from stickslip.models import plugins
from stickslip.models.model import Model
from stickslip.simulation.compiled_controller import compiled
from support.laws import label, registered, variants
from support.sampled_text import Memory, sampled_by, settings

COMPILERS = [c for c in ("gcc", "clang") if shutil.which(c)]
pytestmark = pytest.mark.skipif(not COMPILERS, reason="needs a C compiler")
STEPS = 250_000
LAWS = registered()
every_law = pytest.mark.parametrize("law", LAWS, ids=label)
every_compiler = pytest.mark.parametrize("compiler", COMPILERS)

LOOP = """#include "x.h"
void run(long n, const double *v0, const double *v1, const double *dt, const double *x, double *out)
{{
    x_parameters p;
    x_state z;
    x_surroundings u = {{ {around} }};
    x_init(&p);
    x_reset(&z);
    for (long i = 0; i < n; i++) {{
        u.position = ({real})x[i];
        out[i] = (double)x_step(({real})v0[i], ({real})v1[i], ({real})dt[i], &z, &p, &u);
    }}
}}
"""
CONTROL = """#include "x.h"
void run(long n, const double *position, const double *wanted, const double *wanted_velocity,
         const double *wanted_acceleration, double *out)
{{
    x_parameters p;
    x_state z;
    x_settings s;
    x_memory m;
    x_surroundings u = {{ {around} }};
    x_init(&s, &p);
    x_reset(&m, &z);
    for (long i = 0; i < n; i++) {{
        out[i] = x_sample(position[i], wanted[i], wanted_velocity[i], wanted_acceleration[i], &s, &m, &z, &p, &u);
    }}
}}
"""


def built(job, program, folder, compiler, *more):
    """The exported C with a loop around it, as a function on arrays; one source file where it is baked in."""
    return looped(c99.write(job).files, job.single, program, folder, compiler, *more)


def built_controller(controller, program, folder, compiler, single=False):
    """The same of a controller."""
    files = c99_controller.write(controller, "x", single).files
    return looped(files, single, program, folder, compiler)


def looped(files, single, program, folder, compiler, *more):
    for name, text in files.items():
        (folder / name).write_text(text)
    around = ", ".join(repr(x) + ("f" if single else "") for x in Surroundings())
    (folder / "run.c").write_text(program.format(around=around, real="float" if single else "double"))
    command = [compiler, *c99.FLAGS, "-shared", "-fPIC", *more, "x.c", "run.c", "-lm", "-o", f"{compiler}.so"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return ctypes.CDLL(str(folder / f"{compiler}.so")).run


def answers(run, *inputs):
    out = np.empty(inputs[0].size)
    array = ctypes.POINTER(ctypes.c_double)
    run(ctypes.c_long(out.size), *(np.ascontiguousarray(a).ctypes.data_as(array) for a in (*inputs, out)))
    return out


def example(law):
    return Model(law, **dict(law.example))


@kernel()
def run_law(step, v0, v1, dt, position, z, p, u, out):
    for i in range(v0.size):
        u[0] = position[i]
        out[i] = call_step(step, v0[i], v1[i], dt[i], pointer(z, 0), pointer(p, 0), pointer(u, 0))


def by_compiled_python(model, v0, v1, dt, position):
    law, p, out = model.law, model.parameters, np.empty(v0.size)
    z = flat(law.pack_state(law.state(p)))
    run_law(compiled_step(law), v0, v1, dt, position, z, flat(law.pack(p)), np.array(Surroundings()), out)
    return out


@every_compiler
@every_law
def test_double_gives_the_bits_of_python(law, compiler, tmp_path):
    steps = random_steps(STEPS, seed=7)
    out = answers(built(Job(example(law), "x"), LOOP, tmp_path, compiler), *steps)
    expected = by_compiled_python(example(law), *steps)
    assert np.all(np.isfinite(expected))
    np.testing.assert_array_equal(out, expected)


@pytest.mark.slow
@pytest.mark.parametrize("law", variants(), ids=label)
def test_every_choice_gives_the_bits_of_python(law, tmp_path):
    steps = random_steps(50_000, seed=8)
    out = answers(built(Job(example(law), "x"), LOOP, tmp_path, COMPILERS[0]), *steps)
    np.testing.assert_array_equal(out, by_compiled_python(example(law), *steps))


@every_law
def test_golden_vectors_are_plain_python_and_equal_the_compiled_form(law):
    vectors = golden(example(law), count=3000, seed=5)
    np.testing.assert_array_equal(by_compiled_python(example(law), *vectors[:4]), vectors.torque)


@every_law
def test_single_precision_stays_within_its_bound(law, tmp_path):
    steps = random_steps(20_000, seed=11)
    out = answers(built(Job(example(law), "x", single=True), LOOP, tmp_path, COMPILERS[0]), *steps)
    expected = by_compiled_python(example(law), *steps)
    room = bound = c99.SINGLE_BOUND * np.abs(expected).max()
    if law.name not in BUILT_IN:  # one from outside may jump
        answer = partial(by_compiled_python, example(law))
        room = np.maximum(bound, room_beside_jumps(answer, Golden(*steps, expected), bound))
    assert np.all(np.abs(out - expected) <= room)


TEETH = '''"""Torque that jumps with the way: teeth."""

from typing import Annotated, NamedTuple

from stickslip.core.spec import Law, Par


class Params(NamedTuple):
    low: Annotated[float, Par("N·m", "T_1", "torque on one half of a tooth", positive=True)]
    high: Annotated[float, Par("N·m", "T_2", "torque on the other half", positive=True)]
    pitch: Annotated[float, Par("rad", "d", "angle of a tooth", positive=True)]


class State(NamedTuple):
    way: Annotated[float, Par("rad", "x", "way")]


def step(v0, v1, dt, z, p, u):
    """Torque of the half of a tooth at the end of the step, N·m."""
    z.way += 0.5 * (v0 + v1) * dt
    share = z.way / p.pitch - math.floor(z.way / p.pitch)
    if v1 == 0.0:
        return 0.0
    torque = p.low
    if share > 0.5:
        torque = p.high
    return math.copysign(torque, v1)


LAW = Law(
    "teeth", Params, step, title="Teeth", equation="F = T_1, T_2", source=("a drawing",),
    example={"low": 0.2, "high": 0.3, "pitch": 3e-8}, State=State, odd=False, continuous=False,
)
'''.replace("from typing", "import math\nfrom typing", 1)


def test_a_torque_that_jumps_is_held_to_its_bound_beside_the_jumps_alone(tmp_path):
    """Rounding passes a jump a step sooner or later: that is no error of the export; anything else is."""
    (tmp_path / "teeth.py").write_text(TEETH)
    order = Job(example(plugins.law(str(tmp_path / "teeth.py"))), "x", single=True)
    export = c99.write(order)
    result = c99.check(order, export)
    assert result.passed, result.text
    everywhere = str(export.files["x_check.c"]).replace("error <= g[5]", "error < 0.0")
    assert c99.check(order, type(export)({**export.files, "x_check.c": everywhere})).passed is False
    assert "Beside a jump of the torque" in export.files["README.md"]
    wrong = {**export.files, "x.c": export.files["x.c"].replace("0.5f * ", "0.49f * ")}
    assert wrong != export.files
    assert c99.check(order, type(export)(wrong)).passed is False


@kernel()
def run_sample(address, position, wanted, wanted_velocity, wanted_acceleration, n, m, z, p, u, out):
    for i in range(position.size):
        out[i] = call_sample(
            address, position[i], wanted[i], wanted_velocity[i], wanted_acceleration[i], pointer(n, 0),
            pointer(m, 0), pointer(z, 0), pointer(p, 0), pointer(u, 0),
        )  # fmt: skip


CONTROLLERS = {
    "FF": lambda m: Controller(
        place("PD", 3.86e-4, 36.0, 1.0), Feedforward(m, lead=7e-4, offset=-0.03, inertia_feedforward=4e-4), 0.5,
        1e-3, 1e6,
    ),
    "FB-filtered": lambda m: Controller(
        place("PID", 3.86e-4, 25.0, 1.0), Feedback(m, 0.8, 10.0, deadband=0.01, offset=0.05), sample_time=1e-3
    ),
    "none": lambda m: Controller(place("PD", 3.86e-4, 36.0, 1.0), None, 0.2, 1e-3, 4096.0),
}  # fmt: skip


def motion(count):
    draw = np.random.default_rng(3)
    t = 1e-3 * np.arange(count)
    wanted = 0.1 * np.sin(2.0 * t) + 0.01 * np.sin(31.0 * t)
    position = wanted + 1e-3 * np.convolve(draw.standard_normal(count), np.ones(20) / 20.0, "same")
    position[count // 3 : count // 2] = position[count // 3]  # a standstill
    velocity = 0.2 * np.cos(2.0 * t) + 0.31 * np.cos(31.0 * t)
    return position, wanted, velocity, -0.4 * np.sin(2.0 * t) - 9.61 * np.sin(31.0 * t)


@pytest.mark.parametrize("kind", CONTROLLERS)
@every_law
def test_the_controller_gives_the_bits_of_python(law, kind, tmp_path):
    model, signals = example(law), motion(100_000)
    controller = CONTROLLERS[kind](model)
    run = built_controller(controller, CONTROL, tmp_path, COMPILERS[-1])
    np.testing.assert_array_equal(answers(run, *signals), by_compiled_controller(controller, *signals))


def by_compiled_controller(controller, *signals):
    made, out = compiled(controller), np.empty(signals[0].size)
    arrays = (made.settings, made.memory, made.state, made.parameters, np.array(Surroundings()))
    run_sample(made.address, *signals, *arrays, out)
    return out


@pytest.mark.parametrize("kind", CONTROLLERS)
def test_the_compiled_controller_gives_the_bits_of_a_text_of_its_own(kind):
    model, signals = example(plugins.law("gms")), motion(2000)
    controller = CONTROLLERS[kind](model)
    law, n, p = model.law if controller.compensator else None, settings(controller), model.parameters
    m, z = SimpleNamespace(**dict.fromkeys(Memory._fields, 0.0)), model.law.state(p)
    u = SimpleNamespace(**Surroundings()._asdict())
    plain = [sampled_by(law)(*map(float, row), n, m, z, p, u) for row in zip(*signals)]
    np.testing.assert_array_equal(by_compiled_controller(controller, *signals), plain)


def test_a_controller_in_continuous_time_is_refused():
    with pytest.raises(InputError, match="sample_time"):
        c99_controller.write(Controller(place("PD", 1e-3, 10.0, 1.0)), "x")


def test_a_name_that_is_no_identifier_is_refused():
    with pytest.raises(InputError, match=r"\(name\)"):
        Job(example(LAWS[0]), "my law")


@pytest.mark.parametrize(
    ("single", "said"), [(False, "every bit is the same"), (True, f"at most {c99.SINGLE_BOUND} of")]
)
def test_the_readme_says_what_the_check_allows(single, said):
    readme = c99.write(Job(Model("coulomb", fc=0.3), "axis", single=single)).files["README.md"]
    assert said in readme
    assert "within 0.0" not in readme


MODEL = Model("stribeck", k=50.0, fs=0.33, fc=0.28, vs=0.1, sigma2=0.02)


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize(
    ("controller", "said"),
    [
        (
            Controller(Gains(kp=0.0), Feedforward(MODEL), sample_time=1e-3),
            "0.001 s: measured",
        ),
        (
            Controller(Gains(kp=0.0), Feedback(MODEL, filter_hz=10.0), sample_time=2e-3),
            "add it to the torque of your own controller",
        ),
        (
            Controller(place("PD", 1e-3, 10.0, 1.0), Feedforward(MODEL), sample_time=1e-3),
            "the torque of `loop` (Four gains)",
        ),
    ],
    ids=["ff", "fb", "PD and ff"],
)
def test_what_the_readme_shows_compiles_and_gives_the_torque(controller, said, single, tmp_path):
    files = c99_controller.write(controller, "axis", single).files
    readme = files["README.md"]
    assert said in readme
    assert ("add it to the torque" in readme) is (not any(controller.gains))
    for name, content in files.items():
        (tmp_path / name).write_text(str(content))
    (shown,) = re.findall(r"```c\n(.*?)```", readme, re.DOTALL)
    real = "float" if single else "double"
    given = "position = 0, reference = 0, velocity = 2, acceleration = 10"
    head, _, body = shown.partition("\n")
    (tmp_path / "shown.c").write_text(
        f"#include <stdio.h>\n{head}\nint main(void) {{\n{real} {given};\n"
        f'{body}printf("%.9g", (double)torque);\nreturn 0; }}\n'
    )
    built = [
        COMPILERS[0],
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-pedantic",
        "shown.c",
        "axis.c",
        "-lm",
        "-o",
        "shown",
    ]
    subprocess.run(built, cwd=tmp_path, check=True)
    ran = subprocess.run(["./shown"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    friction = MODEL.law.steady(2.0, MODEL.parameters)
    wanted = {"ff": friction, "fb": 0.0}["fb" if controller.compensator.__class__ is Feedback else "ff"]
    assert float(ran) == pytest.approx(wanted + 2.0 * controller.gains.kr, rel=1e-5)
