"""Exported C tells how far what it has learned may be off, as the law in Python does."""

import subprocess

import pytest
from test_c99 import COMPILERS

from stickslip.control.learned import WIDTH, learned_values
from stickslip.core.spec import Learned
from stickslip.exports.c99_controller import write
from support.golden_rows import ROWS

SCALE, LEAST_SQUARES, MAKKAR = (
    "PD + FF LuGre .9 scale adapted + DOB 200 residual", "PD + FF LuGre .9 RLS + DOB 200 residual",
    "PD + Makkar adaptive",
)  # fmt: skip
VALUES = {"feedforward_scale": 0.9, "feedforward_coulomb": 0.25, "feedforward_viscous": 1e-3}
MAIN = """
#include "x.h"
#include <stdio.h>
int main(void)
{{
    x_settings n;
    x_parameters p;
    x_memory m;
    x_state z;
    x_init(&n, &p);
    x_reset(&m, &z);
    {given}
    {print}
    return 0;
}}
"""


def learned_state(controller):
    """A state within all bounds, with 0.01 in what the law keeps besides."""
    own = {f.name: 0.01 for f in controller.state_fields if isinstance(f.par, Learned)}
    return controller.state(own | {n: x for n, x in VALUES.items() if n in own})


@pytest.mark.skipif("gcc" not in COMPILERS, reason="needs gcc")
@pytest.mark.parametrize("row", [SCALE, LEAST_SQUARES])
def test_c_tells_the_deviation_that_python_tells(row, tmp_path):
    controller = ROWS[row]
    z = learned_state(controller)
    export = write(controller, "x")
    for name, text in export.files.items():
        (tmp_path / name).write_text(str(text))
    kept = [f.name for f in controller.state_fields if isinstance(f.par, Learned)]
    values = controller.learned(z)
    own = controller.deviations
    (tmp_path / "main.c").write_text(
        MAIN.format(
            given=" ".join(f"z.{name} = {values[name]!r};" for name in kept),
            print=" ".join(f'printf("%.17g ", x_{name}_deviation(&n, &z, &p));' for name in own),
        )
    )
    build = ["gcc", "-std=c99", "-O2", "-ffp-contract=off", "x.c", "main.c", "-lm", "-o", "run"]
    subprocess.run(build, cwd=tmp_path, check=True)
    done = subprocess.run(["./run"], cwd=tmp_path, capture_output=True, text=True, check=True)
    told = dict(zip(own, map(float, done.stdout.split())))
    for value in learned_values(controller, z):
        assert value.uncertainty == WIDTH * told[value.name] > 0.0
        assert f"`x_{value.name}_deviation(&n, &z, &p)`" in export.files["README.md"]
    assert own


def test_a_law_that_tells_none_says_so():
    export = write(ROWS[MAKKAR], "x")
    assert "_deviation" not in export.files["x.h"]
    assert "no uncertainty given" in export.files["README.md"]
