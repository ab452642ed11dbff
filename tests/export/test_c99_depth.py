"""The exported C beyond its bits: static analysis, constants folded in, a microcontroller."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest
from test_c99 import COMPILERS, answers, example

from stickslip.control.compensator import Feedback
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core.spec import Surroundings
from stickslip.exports import c99, c99_controller
from stickslip.exports.golden import random_steps
from stickslip.exports.job import Job
from stickslip.models import plugins
from support.cortex_m4f import emulated, missing
from support.laws import farthest, label, registered

every_law = pytest.mark.parametrize("law", registered(), ids=label)


# ---- static analysis -------------------------------------------------------------------------------------------


def analysed(folder, *files):
    checks = "--enable=warning,style,performance,portability"
    command = ["cppcheck", checks, "--std=c99", "--quiet", "--error-exitcode=1", *files]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    return done.stderr if done.returncode else ""


@pytest.mark.skipif(shutil.which("cppcheck") is None, reason="needs cppcheck")
@pytest.mark.parametrize("law", [*registered(), farthest(plugins.law("gms"))], ids=label)
def test_cppcheck_finds_nothing(law, tmp_path):
    model = example(law)
    controller = Controller(place("PID", 1e-3, 10.0, 1.0), Feedback(model, filter_hz=10.0), sample_time=1e-3)
    law, whole = c99.write(Job(model, "x")), c99_controller.write(controller, "y")
    for name, text in {**law.files, **whole.files}.items():
        (tmp_path / name).write_text(text)
    assert analysed(tmp_path, "x.c", "x_check.c") == ""
    assert analysed(tmp_path, "y.c", "y_check.c") == ""


@pytest.mark.skipif(shutil.which("cppcheck") is None, reason="needs cppcheck")
def test_cppcheck_finds_a_mistake(tmp_path):
    source = c99.write(Job(example(plugins.law("dahl")), "x")).files["x.c"]
    (tmp_path / "x.c").write_text(source + "\nint f(void) { int a[2]; return a[2]; }\n")
    assert "a[2]" in analysed(tmp_path, "x.c")


# ---- constants folded in, without contraction: a fused multiply-add rounds once where the definition rounds twice ----

# Every step starts from the state that the runtime parameters led to, so that no difference grows.
SIDE_BY_SIDE = """#include "x.c"
double exact_step(double v0, double v1, double dt, void *z, const void *p, const void *u);
void run(long n, const double *v0, const double *v1, const double *dt, const double *x, double *out)
{{
    x_parameters p;
    x_state z;
    x_init(&p);
    x_reset(&z);
    for (long i = 0; i < n; i++) {{
        x_surroundings u = {{ {around} }};
        x_state same = z;
        u.position = x[i];
        double expected = exact_step(v0[i], v1[i], dt[i], &z, &p, &u);
        double got = x_step(v0[i], v1[i], dt[i], &same, &x_identified, &u);
        out[i] = fabs(got - expected) / (nextafter(fabs(expected), INFINITY) - fabs(expected));
    }}
}}
"""


@pytest.mark.skipif(not COMPILERS, reason="needs a C compiler")
@every_law
def test_constants_folded_in_stay_within_four_units_in_the_last_place(law, tmp_path):
    # The same law twice: "exact" is compiled by itself, to the bits of Python, and its structures are those of "x".
    for prefix in ("x", "exact"):
        for name, text in c99.write(Job(example(law), prefix)).files.items():
            (tmp_path / name).write_text(text)
    around = ", ".join(repr(x) for x in Surroundings())
    (tmp_path / "run.c").write_text(SIDE_BY_SIDE.format(around=around))
    strict = [COMPILERS[0], "-std=c99", "-O2", "-ffp-contract=off", "-fno-builtin", "-fPIC", "-c", "exact.c"]
    folded = [COMPILERS[0], "-std=c99", "-O2", "-shared", "-fPIC", "run.c", "exact.o", "-lm", "-o", "run.so"]
    for command in (strict, folded):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    units = answers(ctypes.CDLL(str(tmp_path / "run.so")).run, *random_steps(100_000, seed=12))
    assert units.max() <= 4.0


# ---- a microcontroller -----------------------------------------------------------------------------------------


@pytest.mark.cortex
@pytest.mark.skipif(bool(missing()), reason=f"needs {', '.join(missing())}")
@every_law
def test_an_emulated_cortex_m4f_stays_within_the_bound_of_single_precision(law):
    torque, expected, size, instructions = emulated(law)
    assert np.abs(torque - expected).max() <= c99.SINGLE_BOUND * np.abs(expected).max()
    assert size > 0
    assert instructions > 1.0
